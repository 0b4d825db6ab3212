"""Unit normals; at poles, apexes and shrunk edges their limits, with finite and right gradients."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differential_cases import assert_close, bicubic, difference, squared, triangle

from jaxsurf.differential import normal, normal_at
from jaxsurf.surface import BSplineSurface, Cone, Sphere

POLE = math.pi / 2


def test_normals_are_unit_and_perpendicular():
    surface, u, v = bicubic(), np.linspace(2, 5, 6), np.linspace(5, 2, 6)
    n = normal(surface, u, v)
    assert_close(jnp.sum(n * n, axis=1), 1)
    for order in ((1, 0), (0, 1)):
        assert_close(jnp.sum(n * surface.derivative(u, v, order), axis=1), 0)


@pytest.mark.parametrize("dtype, close", [(np.float64, 1e-11), (np.float32, 2e-6)])
def test_a_sphere_has_its_normal_everywhere(dtype, close):
    ball = Sphere(np.array([1, -2, 3], dtype), dtype(2.5))
    v = np.array([-POLE, -POLE + 1e-9, -POLE + 1e-4, 0.3, POLE - 1e-6, POLE], dtype)
    found = normal(ball, np.linspace(0.2, 6, 6), v)
    assert found.dtype == dtype
    points = np.asarray(ball(np.linspace(0.2, 6, 6), v))
    assert_close(found, (points - np.asarray(ball.center)) / 2.5, close)


def test_gradients_at_a_pole_are_those_of_the_limit():
    ball = Sphere([1.0, -2, 3], 2.5)
    turn = jax.jit(jax.jacfwd(lambda v: normal(ball, 0.4, v)))
    assert_close(turn(POLE), [-math.cos(0.4), -math.sin(0.4), 0])
    assert_close(turn(-POLE), [math.cos(0.4), math.sin(0.4), 0])


def test_a_shrunk_edge_has_the_normal_of_its_surroundings():
    patch = triangle()
    u = np.linspace(1, 2, 5)
    assert_close(normal(patch, u, 1.0), normal(patch, u, 1 + 1e-5), 1e-4)
    flat = BSplineSurface(patch.control_points.at[..., 2].set(0), patch.knots_u, patch.knots_v, 2, 2)
    assert_close(normal(flat, u, 1.0), np.tile([0, 0, 1], (5, 1)))
    slope = lambda net: normal(BSplineSurface(net, patch.knots_u, patch.knots_v, 2, 2), 1.3, 1.0)[0]
    gradient = jax.jit(jax.grad(slope))(patch.control_points)
    at = lambda z: slope(patch.control_points.at[2, 1, 2].set(z))
    assert_close(gradient[2, 1, 2], difference(at, 0.3), 1e-8)


def test_where_both_partials_vanish():
    plane = squared()
    assert_close(normal(plane, [0, 0, 0.5, 1], [0, 0.5, 0, 1]), np.tile([0, 0, 1], (4, 1)), 1e-9)


def test_the_apex_of_a_cone_has_the_normal_of_its_ruling():
    cone = Cone([1.0, 2, 3], [0.0, 0, 1], 0.0, 0.4, 2.0)
    u = np.linspace(0, 6, 4)
    assert_close(normal(cone, u, 0.0), normal(cone, u, 1.3))


def test_a_thin_strip_is_not_degenerate():
    net = np.array([[[0, 0, 0], [0, 1e-9, 1e-9]], [[1, 0, 0], [1, 1e-9, 1e-9]]])
    strip = BSplineSurface(net, [0, 0, 1, 1], [0, 0, 1, 1], 1, 1)
    assert_close(normal(strip, 0.3, 0.3), np.array([0, -1, 1]) / math.sqrt(2))


def test_a_point_has_no_normal_but_finite_gradients():
    net = np.ones((2, 2, 3))
    dot = lambda net: normal(BSplineSurface(net, [0, 0, 1, 1], [0, 0, 1, 1], 1, 1), 0.3, 0.6)
    assert_close(dot(net), 0)
    assert np.isfinite(jax.jit(jax.jacfwd(dot))(jnp.asarray(net))).all()


def test_traced_and_single_calls_agree_with_eager_ones():
    ball = Sphere([1.0, -2, 3], 2.5)
    u, v = jnp.array([0.3, 2.0]), jnp.array([POLE, 0.4])
    assert_close(jax.jit(normal)(ball, u, v), normal(ball, u, v))
    assert_close(jax.vmap(lambda a, b: normal_at(ball, a, b))(u, v), normal(ball, u, v))
