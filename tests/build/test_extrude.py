"""Extrusions."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

VECTOR = np.array([0.3, -0.5, 2.0])
KNOTS = np.array([2.0] * 4 + [2.7, 3.1, 3.1] + [5.0] * 4)
NET = np.random.default_rng(1).normal(size=(7, 3))
CURVES = {
    "B-spline": (js.BSplineCurve(NET, KNOTS, 3), js.BSplineSurface),
    "periodic": (js.BSplineCurve(NET[:5], [2.0, 2.3, 3.0, 3.1, 4.2, 5.0], 3, periodic=True), js.BSplineSurface),
    "NURBS": (js.NURBSCurve(NET, [1, 2, 0.5, 1, 0.7, 1, 3], KNOTS, 3), js.NURBSSurface),
    "helix": (js.Helix((1, 0, 0), (0, 0, 1), 1.0, 0.3, 1.2), js.Extrusion),
}


@pytest.mark.parametrize("name", CURVES)
def test_every_row_is_the_moved_curve(name):
    curve, kind = CURVES[name]
    surface = js.extrude(curve, VECTOR)
    assert type(surface) is kind
    a, b = (float(end) for end in curve.domain)
    u, v = np.linspace(a, b, 17), np.array([0.0, 0.3, 1.0])
    wanted = np.asarray(curve(u))[:, None] + v[:, None] * VECTOR
    np.testing.assert_allclose(surface.grid(u, v), wanted, atol=1e-14 * 10)
    np.testing.assert_allclose(surface(u, 0.3), wanted[:, 1], atol=1e-14 * 10)
    assert surface.domain[1] == (0, 1)


def test_an_extrusion_converts_exactly_or_as_its_curve():
    line = js.extrude(js.Line(NET[0], NET[1]), VECTOR)
    found = js.to_bspline(line, 1e-9)
    assert float(found.max_error) == 0 and found.shape.control_points.shape == (2, 2, 3)
    np.testing.assert_allclose(found.shape.grid([0, 0.3, 1], [0, 0.6]), line.grid([0, 0.3, 1], [0, 0.6]), atol=1e-15)
    helix = js.to_bspline(js.extrude(CURVES["helix"][0], VECTOR), 1e-5)
    assert 0 < float(helix.max_error) <= 1e-5 and helix.shape.degree_v == 1


def test_bad_arguments_are_refused():
    with pytest.raises(js.InputError, match="`vector` must be a direction, got the zero vector"):
        js.extrude(CURVES["B-spline"][0], (0, 0, 0))
    with pytest.raises(js.InputError, match="`curve` must be a curve, got ndarray"):
        js.extrude(NET, VECTOR)
    with pytest.raises(js.InputError, match="`curve` must be a curve in space"):
        js.extrude(js.Line([0, 0], [1, 1]), VECTOR)


@pytest.mark.parametrize("name", ["NURBS", "helix"])
def test_derivatives_types_and_files(name, tmp_path):
    curve = CURVES[name][0]
    data, static = eqx.partition((curve, jnp.asarray(VECTOR)), eqx.is_inexact_array)
    u, v = np.array([2.0, 2.9, 4.0]), np.array([0.0, 0.4])
    value = lambda data: jnp.sum(jnp.sin(js.extrude(*eqx.combine(data, static)).grid(u, v)))
    along = jax.tree.map(lambda x: jnp.asarray(np.random.default_rng(2).normal(size=x.shape)), data)

    @jax.jit
    def slopes(data, along):
        gradient = jax.grad(value)(data)
        moved = jax.vmap(lambda h: value(jax.tree.map(lambda x, a: x + h * a, data, along)))(jnp.asarray([1e-6, -1e-6]))
        return gradient, jax.jvp(value, (data,), (along,))[1], (moved[0] - moved[1]) / 2e-6

    gradient, pushed, difference = slopes(data, along)
    pulled = sum(np.sum(g * a) for g, a in zip(jax.tree.leaves(gradient), jax.tree.leaves(along), strict=True))
    np.testing.assert_allclose(pushed, pulled, rtol=1e-10)
    np.testing.assert_allclose(pulled, difference, rtol=1e-6)

    surface = js.extrude(curve, VECTOR)
    js.save(tmp_path / "a.jxs", surface)
    assert eqx.tree_equal(js.load(tmp_path / "a.jxs"), surface)
    single = js.extrude(jax.tree.map(lambda x: x.astype(jnp.float32), curve), VECTOR)
    assert single.grid(u, v).dtype == jnp.float32
    np.testing.assert_allclose(single.grid(u, v), surface.grid(u, v), atol=1e-5)
