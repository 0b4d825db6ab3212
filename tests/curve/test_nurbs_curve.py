"""Rational curves: conics are exact, weights that are equal change nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import splinepy
from jax.test_util import check_grads

from jaxsurf._errors import InputError
from jaxsurf.curve import BSplineCurve, NURBSCurve, homogeneous, project

CLOSE = {"rtol": 0, "atol": 1e-12}
KNOTS = {
    2: [2, 2, 2, 2.7, 2.7, 4.1, 5, 5, 5],
    3: [2, 2, 2, 2, 3.1, 3.1, 3.1, 4.4, 5, 5, 5, 5],
    5: [2, 2, 2, 2, 2, 2, 4.9, 5, 5, 5, 5, 5, 5],
}


def curve(degree):
    rng = np.random.default_rng(degree)
    count = len(KNOTS[degree]) - degree - 1
    return NURBSCurve(3 + rng.normal(size=(count, 3)), rng.uniform(0.3, 3, count), KNOTS[degree], degree)


def quarter_circles(radius):
    """The full circle of nine points, The NURBS Book, example 7.2."""
    corners = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]
    weights = [1, np.sqrt(0.5)] * 4 + [1]
    knots = [2, 2, 2, 2.5, 2.5, 3, 3, 4.5, 4.5, 5, 5, 5]
    return NURBSCurve(radius * np.array(corners, float), weights, knots, 2)


@pytest.mark.parametrize("degree", [3, 5])
def test_points_are_those_of_another_library(degree):
    shape, u = curve(degree), np.linspace(2, 5, 9)
    other = splinepy.NURBS(
        degrees=[degree],
        knot_vectors=[KNOTS[degree]],
        control_points=np.asarray(shape.control_points),
        weights=np.asarray(shape.weights)[:, None],
    )
    np.testing.assert_allclose(shape(u), other.evaluate(u[:, None]), **CLOSE)
    if degree == 3:
        slope = other.derivative(u[1:-1, None], [1])
        np.testing.assert_allclose(shape.derivative(u[1:-1]), slope, rtol=1e-11)


def test_a_circle_has_its_radius():
    shape = quarter_circles(3.0)
    assert [float(end) for end in shape.domain] == [2, 5]
    np.testing.assert_allclose(jnp.linalg.norm(shape(np.linspace(2, 5, 50)), axis=1), 3, **CLOSE)


def test_equal_weights_are_no_weights():
    points, u = np.asarray(curve(3).control_points), np.linspace(2, 5, 9)
    rational = NURBSCurve(points, np.full(len(points), 2.5), KNOTS[3], 3)
    np.testing.assert_allclose(rational(u), BSplineCurve(points, KNOTS[3], 3)(u), **CLOSE)


def test_moving_the_control_points_moves_the_curve():
    shape, u = curve(3), np.linspace(2, 5, 9)
    matrix = np.array([[1, 2, 0], [0, 1, -1], [0.5, 0, 1]])
    moved = NURBSCurve(np.asarray(shape.control_points) @ matrix.T - 4, shape.weights, KNOTS[3], 3)
    np.testing.assert_allclose(moved(u), np.asarray(shape(u)) @ matrix.T - 4, **CLOSE)


def test_gradients_are_those_of_finite_differences():
    shape = curve(2)

    @jax.jit
    def value(weights, knots):
        return NURBSCurve(shape.control_points, weights, knots, 2).point(jnp.asarray(4.4)) @ jnp.arange(1.0, 4.0)

    check_grads(value, (shape.weights, shape.knots), order=1, rtol=1e-6)


def test_projection_undoes_homogeneous_coordinates():
    shape = curve(5)
    flat = homogeneous(shape.control_points, shape.weights)
    np.testing.assert_allclose(project(flat), shape.control_points, **CLOSE)


def test_single_precision_stays():
    shape = NURBSCurve(np.ones((3, 3), np.float32), [1, 2, 1], KNOTS[2][:3] + [5.0] * 3, 2)
    assert shape.weights.dtype == shape.knots.dtype == shape(3).dtype == np.float32


@pytest.mark.parametrize(
    ("points", "weights", "message"),
    [
        (np.zeros((4, 3)), [1, 1, -2, 1], "`weights` must be positive and finite, got -2 at index 2"),
        (np.zeros((4, 3)), [1, 1, 1, np.nan], "`weights` must be positive and finite, got nan at index 3"),
        (np.zeros((4, 3)), [1, 1, 1], r"`weights` must have shape \(4,\), one for each"),
        (np.zeros((4, 4)), [1, 1, 1, 1], r"`control_points` must have shape \(n, 3\), got \(4, 4\)"),
        (np.zeros((3, 3)), [1, 1, 1], "`knots` must have 6 knots"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(points, weights, message):
    with pytest.raises(InputError, match=message):
        NURBSCurve(points, weights, [0, 0, 0, 1, 2, 2, 2], 2)
