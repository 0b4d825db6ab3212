"""The transform grid: what holds for every shape under eager, jit, vmap, jvp, grad, in both types.

`test_transforms_of_curves.py` and `test_transforms_of_surfaces.py` run it: two files, so that two workers share it.
"""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cases import corners, parameters

import jaxsurf as js
from jaxsurf.curve import AbstractCurve
from jaxsurf.surface import AbstractSurface


@pytest.fixture(scope="module")
def shape(case):
    return case.shape


def test_eager_jit_and_vmap_agree(shape):
    places, other = parameters(shape), _disturbed(shape)
    points = shape(*places)
    assert points.shape == (*places[0].shape, points.shape[-1])

    @eqx.filter_jit
    def under(shape, pair, places):
        each = jax.vmap(lambda *p: shape(*p))(*places)
        both = eqx.filter_vmap(lambda s, p: s(*p), in_axes=(eqx.if_array(0), None))(pair, places)
        return shape(*places), each, both

    pair = jax.tree.map(lambda a, b: np.stack([a, b]) if eqx.is_inexact_array(a) else a, shape, other)
    jitted, each, both = under(shape, pair, places)
    for found, wanted in ((jitted, points), (each, points), (both[0], points), (both[1], other(*places))):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 * float(np.max(np.abs(wanted))))


def test_forward_reverse_and_difference_agree(shape):
    """Derivatives by each array of control data, along a random direction."""
    places = parameters(shape)
    data, static = eqx.partition(shape, eqx.is_inexact_array)

    def value(data):
        points = eqx.combine(data, static)(*places)
        return jnp.mean(jnp.sin(points)) + jnp.mean(points**2) / 8

    @jax.jit
    def slopes(data, along):
        pulled = jax.tree.map(lambda g, a: jnp.sum(g * a), jax.grad(value)(data), along)
        return jax.jvp(value, (data,), (along,))[1], sum(jax.tree.leaves(pulled))

    at = jax.jit(value)
    leaves, tree = jax.tree.flatten(jax.tree.map(np.asarray, data))
    rng = np.random.default_rng(3)
    for i, leaf in enumerate(leaves):
        along = [np.zeros_like(other) for other in leaves]
        along[i] = rng.normal(size=leaf.shape)
        moved = lambda h, along=along: tree.unflatten([x + h * a for x, a in zip(leaves, along, strict=True)])
        pushed, pulled = slopes(data, tree.unflatten(along))
        np.testing.assert_allclose(pushed, pulled, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(pulled, _slope(lambda h, m=moved: at(m(h)), 1e-4), rtol=1e-6, atol=1e-8)


def test_vmap_and_jvp_commute(shape):
    places = parameters(shape)
    data, static = eqx.partition(shape, eqx.is_inexact_array)
    rng = np.random.default_rng(5)
    along = jax.tree.map(lambda leaf: rng.normal(size=leaf.shape), data)
    point = lambda data, *p: type(shape).point(eqx.combine(data, static), *p)
    axes = (None, *(0 for _ in places))

    @jax.jit
    def both(data, along, *places):
        inner = lambda *p: jax.jvp(point, (data, *p), (along, *map(jnp.ones_like, p)))[1]
        outside = jax.jvp(jax.vmap(point, axes), (data, *places), (along, *map(jnp.ones_like, places)))[1]
        return outside, jax.vmap(inner)(*places)

    np.testing.assert_allclose(*both(data, along, *places), rtol=1e-12, atol=1e-12)


def test_types_follow_the_control_data(shape):
    places = parameters(shape)
    exact = shape(*places)
    assert exact.dtype == shape.dtype == jnp.float64
    single = jax.tree.map(lambda a: a.astype(jnp.float32) if eqx.is_inexact_array(a) else a, shape)
    points = single(*places)
    assert points.dtype == single.dtype == jnp.float32
    np.testing.assert_allclose(points, exact, rtol=0, atol=2e-5 * float(np.max(np.abs(exact))))
    verbs = [single.derivative] + ([single.grid] if isinstance(shape, AbstractSurface) else [])
    assert {jax.eval_shape(verb, *places).dtype for verb in verbs} == {np.dtype(np.float32)}


def test_new_values_are_not_traced_again(shape):
    traces = []

    @eqx.filter_jit
    def first(shape):
        traces.append(None)
        return jax.tree.leaves(shape)[0]

    first(shape)
    first(_disturbed(shape))
    assert len(traces) == 1


def test_derivatives_are_slopes_of_lower_ones(shape):
    curve = isinstance(shape, AbstractCurve)
    chain = [(0,), (1,), (2,), (3,), (4,)] if curve else [(0, 0), (1, 0), (1, 1), (1, 2), (2, 2)]
    axes = [0, 0, 0, 0] if curve else [0, 1, 1, 0]

    @eqx.filter_jit
    def derivatives(shape, places):
        return [shape.derivative(*places, order[0] if curve else order) for order in chain]

    places = parameters(shape)
    along = lambda axis, h: derivatives(shape, tuple(p + h * (i == axis) for i, p in enumerate(places)))
    slopes = {axis: _slopes(lambda h, axis=axis: along(axis, h), 1e-3) for axis in set(axes)}
    exact = derivatives(shape, places)
    np.testing.assert_allclose(exact[0], shape(*places), rtol=1e-13, atol=1e-13)
    for k, axis in enumerate(axes):
        scale = 1 + float(np.max(np.abs(exact[k + 1])))
        np.testing.assert_allclose(exact[k + 1], slopes[axis][k], rtol=0, atol=1e-6 * scale)


def test_gradients_are_finite_at_ends_and_breaks_and_on_degenerate_data(case):
    for kind, shape in {"": case.shape, **case.degenerate}.items():
        value, gradient = _value_and_gradient((shape, corners(shape)))
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


def _slope(f, h):
    """Central difference of the fourth order."""
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


def _slopes(f, h):
    """`_slope` of a function with several results."""
    values = [[np.asarray(x) for x in f(step)] for step in (h, -h, 2 * h, -2 * h)]
    return [(8 * (a - b) - (c - d)) / (12 * h) for a, b, c, d in zip(*values, strict=True)]
