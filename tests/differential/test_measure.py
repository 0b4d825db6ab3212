"""Length, area, volume and the parameter at a length, against closed forms and quadrature."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differential_cases import assert_close, bicubic, cubic, difference
from mpmath import ellipe
from scipy.integrate import quad

from jaxsurf._errors import InputError
from jaxsurf.curve import BSplineCurve, Circle, CompositeCurve, Line, NURBSCurve
from jaxsurf.differential import arc_length, area, equally_spaced, parameter_at_length, volume
from jaxsurf.surface import BSplineSurface, Cylinder, Plane, Sphere, Torus

CORNER = CompositeCurve([Line([1.0, 0, 0], [2.0, 0, 0]), Line([2.0, 0, 0], [2.0, 3, 0])])


def with_points(curve, points):
    return BSplineCurve(points, curve.knots, curve.degree)


def test_length_is_that_of_quadrature():
    curve = cubic()
    knots = [2, 2.7, 4.1, 5]
    speed = lambda t: float(np.linalg.norm(curve.derivative(t)))
    expected = sum(quad(speed, a, b, epsabs=1e-11)[0] for a, b in zip(knots[:-1], knots[1:], strict=True))
    assert_close(arc_length(curve), expected, 1e-9)
    assert_close(jax.jit(arc_length)(curve), expected, 1e-8)
    assert_close(arc_length(curve, 2.2, 4.5) + arc_length(curve, 4.5, 5.0), arc_length(curve, 2.2), 1e-9)
    assert_close(arc_length(curve, 4.5, 2.2), -arc_length(curve, 2.2, 4.5))


def test_lengths_of_known_curves():
    assert_close(arc_length(Circle([1.0, 2, 3], [0.0, 1, 1], 5.0)), 10 * math.pi, 1e-12)
    assert_close(arc_length(CORNER), 4)
    parabola = BSplineCurve([[0, 0], [0.5, 0], [1, 1.0]], [0, 0, 0, 1, 1, 1], 2)
    assert_close(arc_length(parabola), (2 * math.sqrt(5) + math.asinh(2)) / 4)


def test_spans_are_halved_where_it_is_needed():
    # a quarter of an ellipse 50 times as long as wide: the speed falls steeply near one end
    flat = NURBSCurve([[5.0, 0], [5, 0.1], [0, 0.1]], [1, math.sqrt(0.5), 1], [0, 0, 0, 1, 1, 1], 2)
    assert_close(arc_length(flat), 5 * float(ellipe(1 - 0.02**2)), 1e-10)
    assert_close(arc_length(flat, tolerance=1e-4), arc_length(flat), 1e-3)


def test_gradients_of_the_length():
    curve = cubic()
    length = lambda points: arc_length(with_points(curve, points))
    gradient = jax.jit(jax.grad(length))(curve.control_points)
    moved = lambda x: length(curve.control_points.at[3, 1].set(x))
    assert_close(gradient[3, 1], difference(moved, float(curve.control_points[3, 1])), 1e-7)
    by_end = jax.grad(lambda b: arc_length(curve, 2.2, b))(4.0)
    assert_close(by_end, jnp.linalg.norm(curve.derivative(4.0)), 1e-6)
    point = BSplineCurve(np.ones((3, 3)), [0, 0, 0, 1, 1, 1], 2)
    assert np.isfinite(jax.grad(lambda p: arc_length(with_points(point, p)))(point.control_points)).all()


def test_areas_and_volumes_of_known_solids():
    ball, ring = Sphere([1.0, 2, 3], 2.0), Torus([1.0, 2, 3], [1.0, 1, 0], 3.0, 0.7)
    assert_close(area(ball), 16 * math.pi, 1e-10)
    assert_close(volume(ball), 32 * math.pi / 3, 1e-10)
    assert_close(area(ring), 4 * math.pi**2 * 2.1, 1e-10)
    assert_close(volume([ring]), 2 * math.pi**2 * 3 * 0.49, 1e-10)
    assert_close(area(Plane([1.0, 2, 3], [1.0, 1, 1], size=3.0)), 9, 1e-12)


def test_volume_of_several_faces():
    corner = np.array([4.0, 5, 6])
    directions = np.eye(3)
    cube = []
    for axis in range(3):
        a, b, c = directions[(axis + 1) % 3], directions[(axis + 2) % 3], directions[axis]
        for start, (p, q) in ((corner, (b, a)), (corner + c, (a, b))):
            net = np.array([[start, start + q], [start + p, start + p + q]])
            cube.append(BSplineSurface(net, [2, 2, 3, 3], [2, 2, 3, 3], 1, 1))
    assert_close(volume(cube), 1)
    with pytest.raises(InputError, match="`surfaces` must hold at least one surface"):
        volume([])


def test_volume_is_differentiable():
    assert_close(jax.jit(jax.grad(lambda r: volume(Sphere([1.0, 2, 3], r))))(2.0), 16 * math.pi, 1e-9)
    surface = bicubic()
    net = lambda z: surface.control_points.at[3, 3, 2].set(z)
    size = lambda z: area(BSplineSurface(net(z), surface.knots_u, surface.knots_v, 3, 3))
    assert_close(jax.jit(jax.grad(size))(0.4), difference(size, 0.4, 1e-4), 1e-6)


def test_parameters_at_lengths():
    curve = cubic()
    whole = float(arc_length(curve))
    lengths = np.array([[0, 0.1, 0.5], [0.77, 0.9, 1]]) * whole
    found = parameter_at_length(curve, lengths)
    assert found.shape == (2, 3)
    assert_close([arc_length(curve, 2.0, u) for u in found.reshape(-1)], lengths.reshape(-1), 1e-9)
    assert_close(parameter_at_length(CORNER, [0.5, 1, 2.5]), [0.5, 1, 1.5])
    with pytest.raises(InputError, match="`length` must lie between 0 and the curve's length 4, got 4.5"):
        parameter_at_length(CORNER, [1.0, 4.5])


def test_derivatives_of_the_parameter_at_a_length():
    circle = lambda r: Circle([1.0, 2, 3], [0.0, 1, 1], r)
    assert_close(jax.jit(jax.grad(lambda s: parameter_at_length(circle(2.0), s)))(5.0), 0.5)
    assert_close(jax.jit(jax.jacfwd(jax.value_and_grad(lambda r: parameter_at_length(circle(r), 5.0))))(2.0), [-1.25, 1.25])
    curve = cubic()
    place = lambda points: parameter_at_length(with_points(curve, points), 1.7)
    gradient = jax.jit(jax.grad(place))(curve.control_points)
    moved = lambda x: place(curve.control_points.at[2, 0].set(x))
    assert_close(gradient[2, 0], difference(moved, float(curve.control_points[2, 0]), 1e-4), 1e-5)


def test_equal_spacing():
    curve = cubic()
    u = equally_spaced(curve, 6)
    parts = [float(arc_length(curve, a, b)) for a, b in zip(u[:-1], u[1:], strict=True)]
    np.testing.assert_allclose(parts, float(arc_length(curve)) / 5, rtol=1e-8)
    assert (float(u[0]), float(u[-1])) == (2, 5)
    assert_close(equally_spaced(CORNER, 5), [0, 1, 4 / 3, 5 / 3, 2])
    with pytest.raises(InputError, match="`n` must be at least 2, got 1"):
        equally_spaced(curve, 1)


def test_single_precision_and_shapes():
    curve = cubic(np.float32)
    assert arc_length(curve).dtype == parameter_at_length(curve, 1.0).dtype == np.float32
    assert_close(arc_length(curve), np.float32(arc_length(cubic())), 1e-5)
    assert area(Cylinder(np.zeros(3, np.float32), [0, 0, 1], 1, 2)).dtype == np.float32
    with pytest.raises(InputError, match=r"`a` and `b` must be numbers, got shapes \(2,\), \(\)"):
        arc_length(curve, [2.1, 2.2])
