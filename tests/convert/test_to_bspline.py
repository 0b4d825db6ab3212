"""Conversion to B-splines: the error is within the tolerance where nobody looked, and few control points do."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf.convert import to_bspline
from jaxsurf.curve import AbstractCurve, Arc, BSplineCurve, Circle, CompositeCurve, Line, NURBSCurve
from jaxsurf.surface import BSplineSurface, NURBSSurface, Plane, Sphere, TrimmedSurface

RANDOM = np.random.default_rng(0)


class Jump(AbstractCurve):
    """Two lines that do not meet, on [2, 5]; the break is one of the eight spans' ends."""

    height: jax.Array

    @property
    def domain(self):
        return 2.0, 5.0

    def point(self, u):
        return jnp.stack([u, jnp.where(u >= 3.5, self.height, 0), 0 * u])


class Crease(Jump):
    """A crease that no break tells of."""

    def point(self, u):
        return jnp.stack([u, jnp.abs(u - math.pi), 0 * u])


def largest_error(shape, spline, count=20_000):
    if isinstance(shape, AbstractCurve):
        a, b = map(float, shape.domain)
        u = RANDOM.uniform(a, b, count)
        return float(jnp.max(jnp.linalg.norm(shape(u) - spline(u), axis=-1)))
    (a, b), (c, d) = ((float(x), float(y)) for x, y in shape.domain)
    u, v = RANDOM.uniform(a, b, count), RANDOM.uniform(c, d, count)
    return float(jnp.max(jnp.linalg.norm(shape(u, v) - spline(u, v), axis=-1)))


@pytest.mark.parametrize("tol, degree, most", [(1e-9, 3, 600), (1e-9, 4, 200)])
def test_a_circle(tol, degree, most):
    circle = Circle([1.0, 2, 3], [0.0, 1, 1], 5.0)
    found = to_bspline(circle, tol, degree=degree)
    assert found.shape.degree == degree
    assert found.shape.control_points.shape[0] <= most
    assert float(found.max_error) <= tol
    assert largest_error(circle, found.shape) <= 1.05 * float(found.max_error) + 1e-15
    assert [float(end) for end in found.shape.domain] == [0, 2 * math.pi]


def test_the_error_falls_with_the_fourth_power():
    circle = Circle([1.0, 2, 3], [0.0, 1, 1], 5.0)
    coarse, fine = (to_bspline(circle, tol).shape.control_points.shape[0] for tol in (1e-5, 1e-9))
    assert fine / coarse < 13  # 10 for the tolerance by 10 to the 4th


def test_lines_and_planes_are_one_exact_piece():
    line = to_bspline(Line([1.0, 2, 3], [4.0, 0, 1]), 1e-12)
    assert line.shape.control_points.shape == (4, 3)
    plane = to_bspline(Plane([1.0, 2, 3], [1.0, 1, 2]), 1e-12)
    assert plane.shape.control_points.shape == (4, 4, 3)
    assert max(float(line.max_error), float(plane.max_error)) < 1e-14


def test_corners_stay_sharp_and_tangent_joints_smooth():
    lines = CompositeCurve([Line([0.0, 0, 0], [1.0, 0, 0]), Line([1.0, 0, 0], [1.0, 2, 0])])
    found = to_bspline(lines, 1e-6).shape
    assert list(np.asarray(found.knots)).count(1.0) == 3
    np.testing.assert_allclose(found.derivative([1 - 1e-9, 1.0]), [[1, 0, 0], [0, 2, 0]], atol=1e-6)
    # equal speed on both sides of the joint: C1, with a jump of the curvature
    arc = Arc([1.0, 1, 0], [1.0, 0, 0], [0.0, 0, 1], math.pi / 2)
    speed = math.pi / 2
    joined = CompositeCurve([Line([1 - speed, 0, 0], [1.0, 0, 0]), arc])
    found = to_bspline(joined, 1e-6).shape
    assert list(np.asarray(found.knots)).count(1.0) == 2
    slopes = found.derivative([1 - 1e-9, 1 + 1e-9])
    np.testing.assert_allclose(slopes[0], slopes[1], atol=1e-6)


def test_a_sphere_with_its_poles():
    ball = Sphere([1.0, 2, 3], 1.0)
    found = to_bspline(ball, 1e-6)
    assert float(found.max_error) <= 1e-6
    assert largest_error(ball, found.shape) <= 1.05e-6
    np.testing.assert_allclose(found.shape([0, 1.0, 5], math.pi / 2), [[1, 2, 4]] * 3, atol=1e-14)
    assert found.shape.control_points.shape[0] * found.shape.control_points.shape[1] < 3000


def test_rational_shapes():
    rng = np.random.default_rng(3)
    knots = [2, 2, 2, 2.5, 4, 4, 5, 5, 5]
    curve = NURBSCurve(rng.normal(size=(6, 2)), rng.uniform(0.5, 2, 6), knots, 2)
    found = to_bspline(curve, 1e-6)
    assert largest_error(curve, found.shape) <= 1.05e-6
    plain = NURBSCurve(curve.control_points, np.full(6, 2.0), knots, 2)
    found = to_bspline(plain, 1e-6)
    assert float(found.max_error) == 0
    np.testing.assert_array_equal(found.shape.control_points, plain.control_points)
    net = rng.normal(size=(3, 3, 3))
    square = [0, 0, 0, 1, 1, 1]
    found = to_bspline(NURBSSurface(net, np.ones((3, 3)), square, square, 2, 2), 1e-6)
    assert isinstance(found.shape, BSplineSurface)


def test_splines_stay_themselves_and_trimmed_surfaces_keep_their_loops():
    spline = BSplineCurve(RANDOM.normal(size=(5, 3)), [0, 0, 0, 1, 2, 3, 3, 3], 2)
    found = to_bspline(spline, 1e-9)
    assert found.shape is spline
    assert float(found.max_error) == 0
    loop = BSplineCurve([[-1.0, -1], [1, -1], [0, 1], [-1, -1]], [0, 0, 1, 2, 3, 3], 1)
    trimmed = to_bspline(TrimmedSurface(Plane([1.0, 2, 3], [1.0, 1, 2]), [loop]), 1e-9)
    assert isinstance(trimmed.shape, TrimmedSurface)
    assert isinstance(trimmed.shape.surface, BSplineSurface)


def test_a_crease_without_a_break_is_closed_in_on():
    crease = Crease(jnp.asarray(1.0))
    found = to_bspline(crease, 1e-4)
    assert largest_error(crease, found.shape) <= 1.2e-4
    assert found.shape.control_points.shape[0] < 80


def test_single_precision():
    circle = Circle(np.array([1, 2, 3], np.float32), [0, 1, 1], 5.0)
    found = to_bspline(circle, 1e-4)
    assert found.shape.dtype == found.max_error.dtype == np.float32
    assert largest_error(circle, found.shape) <= 1.1e-4
    with pytest.raises(InputError, match=r"`tol` = 1e-08 cannot be reached for this Circle in float32.*use double"):
        to_bspline(circle, 1e-8)


def test_what_cannot_be_converted_is_refused():
    circle = Circle([1.0, 2, 3], [0.0, 1, 1], 5.0)
    with pytest.raises(InputError, match=r"`tol` = 1e-17 cannot be reached for this Circle in float64.*allow more\."):
        to_bspline(circle, 1e-17, degree=5)
    with pytest.raises(InputError, match="`tol` must be a positive length, got 0"):
        to_bspline(circle, 0.0)
    with pytest.raises(InputError, match="`degree` must be at least 2, got 1"):
        to_bspline(circle, 1e-3, degree=1)
    with pytest.raises(InputError, match="call it outside `jit`"):
        jax.jit(lambda r: to_bspline(Circle([1.0, 2, 3], [0.0, 1, 1], r), 1e-3).max_error)(2.0)
    with pytest.raises(InputError, match="A Jump that jumps at u = 3.5 is no B-spline"):
        to_bspline(Jump(jnp.asarray(1.0)), 1e-3)
    with pytest.raises(TypeError, match="`to_bspline` expects a curve or a surface, got int"):
        to_bspline(3, 1e-3)
