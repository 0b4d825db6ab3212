"""Knot insertion, degree elevation and interpolation."""

import jax.numpy as jnp
import numpy as np
import pytest
from knot_cases import ORDINARY, A, B, make, places

from jaxsurf.basis import (
    averaged_knots,
    collocation_matrix,
    elevated_knots,
    elevation_matrix,
    extend_periodic,
    greville,
    inserted_knots,
    periodic_knots,
    refinement_matrix,
)

CASES = [(name, degree) for name in ORDINARY for degree in (1, 2, 3, 5)]


def _points(count: int) -> np.ndarray:
    return np.random.default_rng(count).normal(size=(count, 3))


@pytest.mark.parametrize("name, degree", CASES)
def test_insertion_leaves_the_shape_and_removal_returns_it(name, degree):
    """New knots in empty places, on simple inner knots (if the degree allows) and several at one place."""
    basis = make(name, degree)
    new = [2.2, 4.75] + [3.5] * degree
    simple = [t for t in np.asarray(basis.knots) if A < t < B and np.sum(basis.knots == t) == 1]
    refined = inserted_knots(basis.knots, jnp.asarray(new + simple[:1] * (degree > 1)))
    assert np.all(np.diff(refined) >= 0)
    matrix = refinement_matrix(basis.knots, refined, degree)
    points = _points(basis.size)
    u = jnp.asarray(places(name, degree))
    before = collocation_matrix(basis.knots, degree, u) @ points
    after = collocation_matrix(refined, degree, u) @ (matrix @ points)
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-12 * np.max(np.abs(before)))
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=0, atol=1e-13)
    removed = np.linalg.lstsq(np.asarray(matrix), np.asarray(matrix @ points), rcond=None)[0]
    np.testing.assert_allclose(removed, points, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name, degree", CASES)
def test_elevation_leaves_the_shape(name, degree):
    basis = make(name, degree)
    elevated = elevated_knots(basis.knots, degree)
    matrix = elevation_matrix(basis.knots, elevated, degree)
    assert (elevated[degree + 1], elevated[-degree - 2]) == (A, B)
    points = _points(basis.size)
    u = jnp.asarray(places(name, degree))
    before = collocation_matrix(basis.knots, degree, u) @ points
    after = collocation_matrix(elevated, degree + 1, u) @ (matrix @ points)
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-12 * np.max(np.abs(before)))


@pytest.mark.parametrize("name, degree", CASES)
def test_elevation_keeps_the_smoothness(name, degree):
    """Every inner knot comes once more, so that the spline is as smooth as before."""
    knots = np.asarray(make(name, degree).knots)
    elevated = np.asarray(elevated_knots(make(name, degree).knots, degree))
    for t in np.unique(knots[(knots > A) & (knots < B)]):
        assert np.sum(elevated == t) == np.sum(knots == t) + 1


@pytest.mark.parametrize("name, degree", CASES)
def test_greville_points_reproduce_the_parameter(name, degree):
    basis, u = make(name, degree), places(name, degree)
    values = collocation_matrix(basis.knots, degree, jnp.asarray(u))
    reproduced = np.asarray(values @ greville(basis.knots, degree))
    np.testing.assert_allclose(reproduced, u, rtol=0, atol=1e-12 * np.max(np.abs(values)))


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
def test_interpolation_on_averaged_knots_meets_the_data_and_repeats_polynomials(degree):
    parameters = np.array([2.0, 2.05, 2.7, 2.9, 3.6, 4.5, 4.7, 5.0])
    knots = averaged_knots(jnp.asarray(parameters), degree)
    matrix = np.asarray(collocation_matrix(knots, degree, jnp.asarray(parameters)))
    data = np.stack([_points(8)[:, 0], (parameters - 3) ** degree], axis=1)
    control = np.linalg.solve(matrix, data)
    np.testing.assert_allclose(matrix @ control, data, rtol=0, atol=1e-12 * np.max(np.abs(data)))
    u = np.linspace(A, B, 40)
    curve = collocation_matrix(knots, degree, jnp.asarray(u)) @ control[:, 1]
    np.testing.assert_allclose(curve, (u - 3) ** degree, rtol=0, atol=1e-10)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("degree", [1, 3, 5])
def test_continued_knots_repeat_after_a_period(count, degree):
    knots = np.sort(np.concatenate([[A, B], np.random.default_rng(count).uniform(A, B, count - 1)]))
    longer = extend_periodic(jnp.asarray(knots), degree)
    assert longer.shape == (count + 2 * degree + 1,)
    np.testing.assert_array_equal(longer[degree : degree + count], knots[:-1])
    np.testing.assert_allclose(longer[count:] - longer[:-count], B - A, rtol=0, atol=1e-14)


def test_even_periodic_knots_stay_even():
    longer = extend_periodic(periodic_knots(4, 3, (A, B)), 3)
    np.testing.assert_allclose(np.diff(longer), 0.75, rtol=0, atol=1e-14)
