"""Splines through points, against scipy's on the same knots."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from jaxsurf._errors import InputError
from jaxsurf.convert import interpolate
from jaxsurf.curve import BSplineCurve
from jaxsurf.surface import BSplineSurface

RANDOM = np.random.default_rng(0)
POINTS = RANDOM.normal(size=(9, 3)) + 4
NET = RANDOM.normal(size=(6, 7, 3)) + 4
S = np.linspace(0, 1, 41)


def spaced(points, power=1.0):
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) ** power
    return np.concatenate([[0], np.cumsum(steps)]) / steps.sum()


def close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(a, b, rtol=0, atol=tolerance)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_open_curves_are_those_of_scipy(degree):
    curve = interpolate(POINTS, degree)
    u = spaced(POINTS)
    close(curve(u), POINTS)
    oracle = make_interp_spline(u, POINTS, degree, t=np.asarray(curve.knots))
    close(curve(S), oracle(S))


def test_spacings():
    for name, power in (("centripetal", 0.5), ("uniform", 0.0)):
        close(interpolate(POINTS, parameters=name)(spaced(POINTS, power)), POINTS)
    given = np.array([2, 2.1, 2.5, 3, 3.3, 4, 4.1, 4.8, 5])
    curve = interpolate(POINTS, parameters=given)
    close(curve(given), POINTS)
    assert [float(end) for end in curve.domain] == [2, 5]


@pytest.mark.parametrize("degree", [2, 3])
def test_closed_curves_are_smooth_where_they_close(degree):
    ring = np.concatenate([POINTS, POINTS[:1]])
    curve = interpolate(ring, degree, closed=True)
    assert curve.periodic
    assert curve.control_points.shape == (9, 3)
    u = spaced(ring)
    close(curve(u), ring)
    close(curve.control_points, interpolate(POINTS, degree, closed=True).control_points)
    if degree == 3:
        close(curve(S), CubicSpline(u, ring, bc_type="periodic")(S))
    a, b = curve.domain
    before, after = curve.derivative(b - 1e-13, degree - 1), curve.derivative(a, degree - 1)
    np.testing.assert_allclose(before, after, rtol=1e-6)


def test_end_tangents():
    directions = ([1.0, 0, 0], [0.0, 3, 0])
    curve = interpolate(POINTS, parameters="uniform", end_tangents=directions)
    steps = np.linalg.norm(np.diff(POINTS, axis=0), axis=1) * 8
    slopes = [[steps[0], 0, 0], [0, steps[-1], 0]]
    close(curve.derivative([0.0, 1.0]), slopes, 1e-11)
    ends: Any = ((1, slopes[0]), (1, slopes[1]))
    oracle = CubicSpline(np.linspace(0, 1, 9), POINTS, bc_type=ends)
    close(curve(S), oracle(S))
    two = interpolate(POINTS[:2, :2], end_tangents=([1.0, 0], [0.0, 1]))
    close(two([0.0, 1.0]), POINTS[:2, :2])


def test_a_spline_is_found_again():
    curve = BSplineCurve(POINTS, [2, 2, 2, 2, 2.4, 3, 3.2, 3.9, 4.4, 5, 5, 5, 5], 3)
    sites = np.mean([np.asarray(curve.knots)[1 + i : 10 + i] for i in range(3)], axis=0)
    again = interpolate(curve(sites), parameters=sites)
    assert again.knots.shape == curve.knots.shape
    close(again(sites), curve(sites))


@pytest.mark.parametrize("closed", [(True, False), (False, True)])
def test_grids_of_points(closed):
    at_u, at_v = closed
    u, v = np.linspace(2, 3, 6 + at_u), np.linspace(0, 2, 7 + at_v)
    surface = interpolate(NET, (3, 2), closed=closed, parameters=(u, v))
    assert (surface.periodic_u, surface.periodic_v) == (at_u, at_v)
    assert (surface.degree_u, surface.degree_v) == (3, 2)
    close(surface.grid(u[:6], v[:7]), NET)


def test_a_grid_takes_the_mean_spacing_of_its_rows():
    u = np.mean([spaced(NET[:, j]) for j in range(7)], axis=0)
    v = np.mean([spaced(NET[i]) for i in range(6)], axis=0)
    close(interpolate(NET).grid(u, v), NET)
    shrunk = NET.copy()
    shrunk[:, 0] = NET[0, 0]  # one row is a point
    assert isinstance(interpolate(shrunk), BSplineSurface)
    repeated = np.concatenate([NET, NET[:1]])
    close(interpolate(repeated, closed=(True, False)).control_points, interpolate(NET, closed=(True, False)).control_points)


def test_gradients_are_differences():
    place = lambda points: jnp.sum(interpolate(points)(0.37) ** 2)
    gradient = jax.jit(jax.grad(place))(jnp.asarray(POINTS))
    step = np.zeros_like(POINTS)
    step[3, 1] = 1e-6
    close(gradient[3, 1], (place(POINTS + step) - place(POINTS - step)) / 2e-6, 1e-7)
    ring = lambda points: jnp.sum(interpolate(points, closed=True)(0.37) ** 2)
    slope = (ring(POINTS + step) - ring(POINTS - step)) / 2e-6
    close(jax.jit(jax.grad(ring))(jnp.asarray(POINTS))[3, 1], slope, 1e-7)


def test_single_precision_and_many_points():
    curve = interpolate(POINTS.astype(np.float32))
    assert curve.dtype == np.float32
    close(curve(spaced(POINTS)), POINTS, 1e-5)
    walk = np.cumsum(RANDOM.normal(size=(3000, 3)), axis=0)
    close(interpolate(walk)(spaced(walk)), walk, 1e-9)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: interpolate(POINTS[:3]), "`points` must be at least 4 for degree 3, got 3"),
        (lambda: interpolate(NET[:, :2]), "`points` must be at least 4 in v for degree 3, got 2"),
        (lambda: interpolate(POINTS[:2], closed=True), "of a closed spline must be at least 3, got 2"),
        (lambda: interpolate(POINTS[[0, 1, 2, 2, 3]]), "`points` 2 and 3 coincide"),
        (lambda: interpolate(POINTS[[0, 1, 2, 2, 0, 0]], closed=True), "`points` 2 and 3 coincide"),
        (lambda: interpolate(POINTS[0]), r"`points` must have shape \(n, 3\)"),
        (
            lambda: interpolate([[0.0, 0], [1, np.nan], [2, 3], [4, 4]]),
            r"`points` must be finite, got nan at index \[1, 1\]",
        ),
        (lambda: interpolate(POINTS, 0), "`degree` must be at least 1, got 0"),
        (lambda: interpolate(POINTS, (3, 3)), "`degree` and `closed` of a curve must be single"),
        (lambda: interpolate(POINTS, parameters="chords"), 'must be one of "chord", "centripetal", "uniform"'),
        (lambda: interpolate(POINTS, parameters=[0.0, 1]), r"`parameters` must have shape \(9,\), got \(2,\)"),
        (lambda: interpolate(POINTS, parameters=np.zeros(9)), "`parameters` must ascend, but number 1"),
        (lambda: interpolate(POINTS, closed=True, parameters=S[:9]), r"shape \(10,\), the last for the return"),
        (lambda: interpolate(NET, parameters=("chord",)), r"must be one or a pair \(u, v\), got 1"),
        (lambda: interpolate(NET, end_tangents=([1.0, 0, 0], [1.0, 0, 0])), "`end_tangents` are for curves"),
        (lambda: interpolate(POINTS, closed=True, end_tangents=([1.0, 0, 0], [1.0, 0, 0])), "are for open curves"),
        (lambda: interpolate(POINTS, end_tangents=([1.0, 0], [1.0, 0])), r"must be two directions \(3,\)"),
        (lambda: interpolate(POINTS, end_tangents=([1.0, 0, 0], [0.0, 0, 0])), "got a zero vector"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
