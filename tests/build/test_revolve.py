"""Surfaces of revolution."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

POINT, AXIS = np.array([1.0, -2, 0.5]), np.array([0.3, -0.5, 1.0])
KNOTS = np.array([2.0] * 4 + [2.7, 3.1, 3.1] + [5.0] * 4)
NET = np.array([3.0, 1, 0]) + np.random.default_rng(1).normal(size=(7, 3))
SPLINE = js.BSplineCurve(NET, KNOTS, 3)
NURBS = js.NURBSCurve(NET, [1, 2, 0.5, 1, 0.7, 1, 3], KNOTS, 3)
U = np.linspace(2, 5, 14)


def test_rows_are_the_turned_curve():
    surface = js.revolve(SPLINE, POINT, AXIS, 2.3)
    np.testing.assert_array_equal(surface(U, 0.0), SPLINE(U))
    wanted = js.rotate(SPLINE, AXIS, 1.7, POINT)
    np.testing.assert_allclose(surface(U, 1.7), wanted(U), atol=1e-13)
    np.testing.assert_allclose(surface.grid(U, [0.0, 1.7]), np.stack([SPLINE(U), wanted(U)], axis=1), atol=1e-13)
    assert float(surface.domain[1][1]) == 2.3


def test_a_line_gives_a_cylinder_and_a_circle_a_torus():
    cylinder = js.Cylinder((0, 0, 1), (0, 0, 1), 2.0, 3.0)
    v = np.linspace(0, 2 * math.pi, 9)
    found = js.revolve(js.Line((2, 0, 1), (2, 0, 4)), (0, 0, 0), (0, 0, 5))
    np.testing.assert_allclose(found.grid([0, 0.4, 1], v), np.swapaxes(cylinder.grid(v, [0, 1.2, 3]), 0, 1), atol=1e-14)
    torus = js.Torus((0, 0, 0), (0, 0, 1), 3.0, 1.0)
    found = js.revolve(js.Circle((3, 0, 0), (0, -1, 0), 1.0, (1, 0, 0)), (0, 0, 7), (0, 0, 1))
    np.testing.assert_allclose(found.grid(v, v), np.swapaxes(torus.grid(v, v), 0, 1), atol=1e-14 * 10)


def test_a_whole_turn_closes():
    surface = js.revolve(SPLINE, POINT, AXIS)
    np.testing.assert_allclose(surface(U, 2 * math.pi), surface(U, 0.0), atol=1e-14 * 10)


@pytest.mark.parametrize("angle", [2 * math.pi, 2.3, math.pi / 2])
@pytest.mark.parametrize("curve", [SPLINE, NURBS], ids=["B-spline", "NURBS"])
def test_the_nurbs_surface_is_exact(curve, angle):
    """Rows at the ends of arcs are the same; between them every point keeps its distance and height."""
    surface = js.revolve(curve, POINT, AXIS, angle)
    exact = surface.as_nurbs()
    assert exact.domain[1][1] == angle and exact.degree_v == 2
    arcs = math.ceil(angle / (math.pi / 2) - 1e-6)
    ends = np.linspace(0, angle, arcs + 1)
    np.testing.assert_allclose(exact.grid(U, ends), surface.grid(U, ends), atol=1e-13)
    v = np.linspace(0, angle, 33)
    arm = np.asarray(exact.grid(U, v)) - POINT
    n = AXIS / np.linalg.norm(AXIS)
    own = np.asarray(curve(U)) - POINT
    height = arm @ n
    np.testing.assert_allclose(height, np.repeat((own @ n)[:, None], 33, axis=1), atol=1e-13)
    radius = np.linalg.norm(arm - height[..., None] * n, axis=-1)
    wanted = np.linalg.norm(own - (own @ n)[:, None] * n, axis=-1)
    np.testing.assert_allclose(radius, np.repeat(wanted[:, None], 33, axis=1), atol=1e-13)


def test_it_converts_within_the_tolerance():
    found = js.to_bspline(js.revolve(js.Line((2, 0, 1), (3, 0, 4)), (0, 0, 0), (0, 0, 1), 1.5), 1e-6)
    assert 0 < float(found.max_error) <= 1e-6


def test_other_curves_have_no_nurbs_surface():
    with pytest.raises(js.InputError, match="A revolved Helix is no NURBS surface: convert the curve"):
        js.revolve(js.Helix((0, 0, 0), (0, 0, 1), 1.0, 1.0, 1.0), POINT, AXIS).as_nurbs()
    with pytest.raises(js.InputError, match="needs a known `angle`"):
        jax.eval_shape(lambda a: js.revolve(SPLINE, POINT, AXIS, a).as_nurbs(), jnp.asarray(1.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SPLINE, POINT, (0, 0, 0)), "`axis` must be a direction"),
        ((SPLINE, POINT, AXIS, -1.0), "`angle` of a revolution must lie above 0 .* opposite `axis`"),
        ((SPLINE, POINT, AXIS, 7.0), "at most 2π radians, got 7"),
        ((SPLINE, (0, 0), AXIS), "`point` must have shape"),
        ((NET, POINT, AXIS), "`curve` must be a curve, got ndarray"),
        ((js.Line([0, 0], [1, 1]), POINT, AXIS), "`curve` must be a curve in space"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(js.InputError, match=message):
        js.revolve(*arguments)


def test_derivatives_agree_and_are_finite_at_poles(tmp_path):
    """Forward, reverse and differences by everything; the second curve starts on the axis, the third lies on it."""
    on_axis = js.Line(POINT, POINT + 2 * AXIS)
    shapes = [js.revolve(c, POINT, AXIS, 2.3) for c in (SPLINE, js.Line(POINT, NET[0]), on_axis)]
    u, v = np.array([0.0, 0.4, 1.0]), np.array([0.0, 1.1, 2.3])
    data, static = eqx.partition(shapes, eqx.is_inexact_array)

    def value(data):
        shapes = eqx.combine(data, static)
        return sum((jnp.sum(jnp.sin(s.grid(u if i else 2 + 3 * u, v))) for i, s in enumerate(shapes)), jnp.zeros(()))

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

    js.save(tmp_path / "a.jxs", shapes[0])
    assert eqx.tree_equal(js.load(tmp_path / "a.jxs"), shapes[0])
    single = jax.tree.map(lambda x: x.astype(jnp.float32), shapes[0])
    assert single.grid(U, v).dtype == jnp.float32
    np.testing.assert_allclose(single.grid(U, v), shapes[0].grid(U, v), atol=1e-5)
