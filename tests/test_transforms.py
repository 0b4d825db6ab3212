"""The transform grid: every shape under eager, jit, vmap, jvp, grad, in both types, at random and degenerate data."""

import importlib
import pkgutil
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cases import CASES, corners, make, parameters

import jaxsurf as js
from jaxsurf._registry import registered_class, registered_names
from jaxsurf.curve import AbstractCurve
from jaxsurf.surface import AbstractSurface


@pytest.fixture(params=CASES, scope="module")
def case(request):
    return make(request.param)


@pytest.fixture(scope="module")
def shape(case):
    return case.shape


def test_every_registered_shape_has_a_case():
    for module in pkgutil.walk_packages(js.__path__, "jaxsurf."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    classes = [registered_class(name) for name in registered_names()]
    own = {c for c in classes if c is not None and c.__module__.startswith("jaxsurf.")}
    shapes = {c.__name__ for c in own if issubclass(c, AbstractCurve | AbstractSurface)}
    assert shapes == {type(make(name).shape).__name__ for name in CASES}


def test_eager_jit_and_vmap_agree(shape):
    places = parameters(shape)
    points = shape(*places)
    assert points.shape == (*places[0].shape, points.shape[-1])
    size = float(jnp.ptp(points))
    close = lambda a, b: np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * size + 1e-13)
    with jax.disable_jit():
        close(type(shape).point(shape, *(p[0] for p in places)), points[0])
    close(eqx.filter_jit(lambda s, p: s(*p))(shape, places), points)
    close(jax.vmap(lambda *p: shape(*p))(*places), points)
    other = _disturbed(shape)
    pair = jax.tree.map(lambda a, b: jnp.stack([a, b]) if eqx.is_inexact_array(a) else a, shape, other)
    both = eqx.filter_vmap(lambda s, p: s(*p), in_axes=(eqx.if_array(0), None))(pair, places)
    close(both, jnp.stack([points, other(*places)]))


def test_forward_reverse_and_difference_agree(shape):
    """Derivatives by each array of control data, along a random direction."""
    places = parameters(shape)
    data, static = eqx.partition(shape, eqx.is_inexact_array)

    @jax.jit
    def value(data):
        points = eqx.combine(data, static)(*places)
        return jnp.mean(jnp.sin(points)) + jnp.mean(points**2) / 8

    forward = jax.jit(lambda data, along: jax.jvp(value, (data,), (along,))[1])
    leaves, tree = jax.tree.flatten(data)
    reverse = jax.tree.leaves(jax.jit(jax.grad(value))(data))
    rng = np.random.default_rng(3)
    for i, leaf in enumerate(leaves):
        along = [jnp.zeros_like(other) for other in leaves]
        along[i] = jnp.asarray(rng.normal(size=leaf.shape))
        pushed = forward(data, tree.unflatten(along))
        pulled = jnp.sum(reverse[i] * along[i])
        step = lambda h, i=i, along=along: value(tree.unflatten([*leaves[:i], leaves[i] + h * along[i], *leaves[i + 1 :]]))
        difference = _slope(step, 1e-4)
        np.testing.assert_allclose(pushed, pulled, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(pulled, difference, rtol=1e-6, atol=1e-8)


def test_vmap_and_jvp_commute(shape):
    places = parameters(shape)
    data, static = eqx.partition(shape, eqx.is_inexact_array)
    rng = np.random.default_rng(5)
    along = jax.tree.map(lambda leaf: jnp.asarray(rng.normal(size=leaf.shape)), data)
    point = lambda data, *p: type(shape).point(eqx.combine(data, static), *p)
    ones = tuple(jnp.ones_like(p) for p in places)
    axes = (None, *(0 for _ in places))
    outer_jvp = jax.jvp(jax.vmap(point, in_axes=axes), (data, *places), (along, *ones))[1]
    outer_vmap = jax.vmap(lambda *p: jax.jvp(point, (data, *p), (along, *(jnp.ones_like(q) for q in p)))[1])(*places)
    np.testing.assert_allclose(outer_jvp, outer_vmap, rtol=1e-12, atol=1e-12)


def test_types_follow_the_control_data(shape):
    places = parameters(shape)
    exact = shape(*places)
    assert exact.dtype == shape.dtype == jnp.float64
    single = jax.tree.map(lambda a: a.astype(jnp.float32) if eqx.is_inexact_array(a) else a, shape)
    points = single(*places)
    assert points.dtype == single.dtype == jnp.float32
    assert single.derivative(*places).dtype == jnp.float32
    np.testing.assert_allclose(points, exact, rtol=0, atol=2e-5 * float(jnp.max(jnp.abs(exact))))
    if isinstance(shape, AbstractSurface):
        assert single.grid(*places).dtype == jnp.float32


def test_new_values_are_not_traced_again(shape):
    traces = []

    @eqx.filter_jit
    def points(shape, places):
        traces.append(None)
        return shape(*places)

    places = parameters(shape)
    points(shape, places)
    points(_disturbed(shape), tuple(p + 0.01 for p in places))
    assert len(traces) == 1


def test_grid_is_the_points(shape):
    if isinstance(shape, AbstractCurve):
        pytest.skip("curves have no grid")
    u, v = parameters(shape)
    v = v[:-1]
    points = shape(u[:, None], v[None, :])
    np.testing.assert_allclose(shape.grid(u, v), points, rtol=1e-13, atol=1e-13)


def test_derivatives_are_slopes_of_lower_ones(shape):
    places = parameters(shape)
    if isinstance(shape, AbstractCurve):
        chain = [((k - 1,), (k,)) for k in (1, 2, 3, 4)]
    else:
        chain = [((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (1, 2)), ((1, 2), (2, 2))]
    for lower, higher in chain:
        axis = next(i for i, (a, b) in enumerate(zip(lower, higher, strict=True)) if a != b)
        at = lambda h, lower=lower, axis=axis: _derivative(
            shape, [p + h if i == axis else p for i, p in enumerate(places)], lower
        )
        slope, derived = _slope(at, 1e-3), _derivative(shape, places, higher)
        np.testing.assert_allclose(derived, slope, rtol=1e-6, atol=1e-6 * (1 + float(jnp.max(jnp.abs(derived)))))


def test_gradients_are_finite_at_ends_and_breaks_and_on_degenerate_data(case):
    for kind, shape in {"": case.shape, **case.degenerate}.items():
        places = corners(shape)
        value, gradient = _value_and_gradient((shape, places))
        finite = [np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves((value, gradient))]
        assert all(finite), (kind, value, gradient)


@eqx.filter_jit
@eqx.filter_value_and_grad
def _value_and_gradient(shape_and_places):
    shape, places = shape_and_places
    return jnp.sum(jnp.sin(shape(*places)))


def test_printing_is_short_and_clean(shape):
    for text in (repr(shape), eqx.tree_pformat(shape)):
        assert text.startswith(type(shape).__name__ + "(")
        assert len(text) < 1000
        assert not re.search(r"0x|<function|<class|jaxlib|Traced", text)


def test_saving_and_loading_keeps_every_bit(shape, tmp_path):
    js.save(tmp_path / "shape.jxs", shape)
    loaded = js.load(tmp_path / "shape.jxs")
    assert jax.tree.structure(loaded) == jax.tree.structure(shape)
    for before, after in zip(jax.tree.leaves(shape), jax.tree.leaves(loaded), strict=True):
        assert after.dtype == before.dtype
        assert np.asarray(after).tobytes() == np.asarray(before).tobytes()


def _disturbed(shape):
    """The same kind of shape with slightly larger numbers: as lawful, and knots ascend as before."""
    return jax.tree.map(lambda a: a * 1.001 if eqx.is_inexact_array(a) else a, shape)


def _derivative(shape, places, order):
    return shape.derivative(*places, order if len(order) > 1 else order[0])


def _slope(f, h):
    """Central difference of the fourth order."""
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)
