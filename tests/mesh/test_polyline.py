"""Polylines of curves."""

import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf.basis import clamped_knots
from jaxsurf.curve import BSplineCurve, Circle
from jaxsurf.mesh import polyline


def test_chords_of_a_circle_stay_within_the_tolerance():
    points = polyline(Circle((1.0, 2.0, 3.0), (0.0, 0.0, 1.0), 5.0), tolerance=0.01)
    middle = (points[1:] + points[:-1]) / 2
    sagitta = 5.0 - np.linalg.norm(middle - [1.0, 2.0, 3.0], axis=1)
    assert 0.002 < sagitta.max() <= 0.01
    np.testing.assert_allclose(points[0], points[-1], atol=1e-12)


def test_kinks_are_kept():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [4, 2, 1]])
    points = polyline(BSplineCurve(corners, clamped_knots(4, 1, (2.0, 5.0)), 1))
    np.testing.assert_allclose(points, corners, atol=1e-12)


def test_resolution_is_a_number_of_points():
    curve = Circle((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0)
    assert polyline(curve, resolution=11).shape == (11, 3)
    with pytest.raises(InputError, match="`resolution` must be at least 2, got 1"):
        polyline(curve, resolution=1)
