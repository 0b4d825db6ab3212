"""Rational surfaces."""

import jax.numpy as jnp
import numpy as np
import pytest
import splinepy

from jaxsurf._errors import InputError
from jaxsurf.surface import BSplineSurface, NURBSSurface

CLOSE = {"rtol": 0, "atol": 1e-12}
U, V = [2, 2, 2, 2.4, 2.4, 5, 5, 5], [-1, -1, -1, -1, 0.5, 2, 2, 2, 2]


def surface():
    rng = np.random.default_rng(0)
    return NURBSSurface(3 + rng.normal(size=(5, 5, 3)), rng.uniform(0.3, 3, (5, 5)), U, V, 2, 3)


def test_points_and_grids_are_those_of_another_library():
    shape = surface()
    other = splinepy.NURBS(
        degrees=[2, 3],
        knot_vectors=[U, V],
        control_points=np.asarray(shape.control_points).swapaxes(0, 1).reshape(-1, 3),
        weights=np.asarray(shape.weights).T.reshape(-1, 1),
    )
    u, v = np.linspace(2, 5, 7), np.linspace(-1, 2, 5)
    queries = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
    expected = other.evaluate(queries.reshape(-1, 2)).reshape(7, 5, 3)
    np.testing.assert_allclose(shape.grid(u, v), expected, **CLOSE)
    np.testing.assert_allclose(shape(u[:, None], v[None, :]), expected, **CLOSE)


def test_equal_weights_are_no_weights():
    shape, u, v = surface(), np.linspace(2, 5, 7), np.linspace(-1, 2, 5)
    rational = NURBSSurface(shape.control_points, np.full((5, 5), 0.2), U, V, 2, 3)
    plain = BSplineSurface(shape.control_points, U, V, 2, 3)
    np.testing.assert_allclose(rational.grid(u, v), plain.grid(u, v), **CLOSE)


def test_a_quarter_of_a_cylinder_has_its_radius():
    corners = np.array([[1, 0], [1, 1], [0, 1]])
    net = np.array([[[*corner, height] for height in (0, 2)] for corner in corners], float)
    weights = np.array([[1, 1], [0.5**0.5, 0.5**0.5], [1, 1]])
    shape = NURBSSurface(net, weights, [0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1)
    place = shape.grid(np.linspace(0, 1, 9), [0, 0.3])
    np.testing.assert_allclose(jnp.linalg.norm(place[..., :2], axis=-1), 1, **CLOSE)
    np.testing.assert_allclose(place[:, 1, 2], 0.6, **CLOSE)


@pytest.mark.parametrize(
    ("points", "weights", "message"),
    [
        ((5, 5, 3), -np.eye(5), r"`weights` must be positive and finite, got -1 at index \(0, 0\)"),
        ((5, 5, 3), np.ones(5), r"`weights` must have shape \(5, 5\)"),
        ((5, 5, 2), np.ones((5, 5)), r"`control_points` must have shape \(n, m, 3\), got \(5, 5, 2\)"),
        ((5, 4, 3), np.ones((5, 4)), "`knots_v` must have 8 knots"),
        ((4, 5, 3), np.ones((4, 5)), "`knots_u` must have 7 knots"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(points, weights, message):
    with pytest.raises((InputError, TypeError), match=message):
        NURBSSurface(np.zeros(points), weights, U, V, 2, 3)
