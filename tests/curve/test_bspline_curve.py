"""B-spline curves on awkward knots, against scipy and splinepy."""

import numpy as np
import pytest
from knot_cases import CASES, ORDER, PERIODIC, A, B, expected, make, places

import jaxsurf as js

every_case = pytest.mark.parametrize("name, degree", CASES)


def curve_of(name: str, degree: int) -> tuple[js.BSplineCurve, np.ndarray]:
    basis = make(name, degree)
    points = np.random.default_rng(degree).normal(size=(basis.size, 3)) + [4.0, -7.0, 2.0]
    return js.BSplineCurve(points, basis.knots, degree, basis.periodic), points


@every_case
def test_points_and_derivatives_are_those_of_scipy(name, degree):
    curve, points = curve_of(name, degree)
    u = places(name, degree)
    rows = expected(np.asarray(curve.knots), degree, curve.periodic, u)
    for order in range(ORDER + 1):
        wanted = rows[:, order] @ points
        found = curve(u) if order == 0 else curve.derivative(u, order)
        # what cancels in it: the sum of the terms' sizes
        terms = np.max(np.abs(rows[:, order]) @ np.abs(points))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * max(1, terms))


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
@pytest.mark.parametrize("name", ["one span", "uneven", "inner knots of every multiplicity"])
def test_points_and_slopes_are_those_of_splinepy(name, degree):
    import splinepy

    curve, points = curve_of(name, degree)
    knots = np.asarray(curve.knots)
    other = splinepy.BSpline(degrees=[degree], knot_vectors=[knots.tolist()], control_points=points)
    u = np.random.default_rng(3).uniform(A, B, 50)
    np.testing.assert_allclose(curve(u), other.evaluate(u[:, None]), rtol=0, atol=1e-12)
    slopes = other.derivative(u[:, None], [1])
    np.testing.assert_allclose(curve.derivative(u), slopes, rtol=0, atol=1e-12 * np.max(np.abs(slopes)))


@pytest.mark.parametrize("name", PERIODIC)
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_closed_curves_close(name, degree):
    """C^(degree − 1) across the seam, which is a simple knot."""
    curve, _ = curve_of(name, degree)
    for order in range(degree):
        start, end = (np.asarray(curve.derivative(u, order)) for u in (A, np.nextafter(B, 0)))
        np.testing.assert_allclose(start, end, rtol=0, atol=1e-9 * (1 + np.max(np.abs(start))))


REFUSED = {
    "a row": (([1.0, 2.0], [0.0, 0.0, 1.0, 1.0], 1), r"`control_points` must have shape \(n, 3\)"),
    "knots": ((np.zeros((4, 3)), [0.0, 0.0, 1.0, 1.0], 3), r"`knots` must have 8 knots \(n \+ degree \+ 1\)"),
    "falling": ((np.zeros((2, 3)), [0.0, 1.0, 0.5, 1.0], 1), "`knots` must ascend, but knot 2 .0.5. is below knot 1 .1."),
    "few": ((np.zeros((2, 3)), [0.0, 0.0, 0.5, 1.0, 1.0], 2), "needs at least 3 control points, got 2"),
}


@pytest.mark.parametrize("arguments, message", REFUSED.values(), ids=REFUSED)
def test_bad_input_is_refused_in_one_sentence(arguments, message):
    with pytest.raises(js.InputError, match=message):
        js.BSplineCurve(*arguments)
