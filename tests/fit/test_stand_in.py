"""Polynomials between breaks stand in for derivatives: the gradient stays exact, and the matrix is near."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import points_on, sheet
from truths import NOISE, TRUTHS

import jaxsurf as js
from jaxsurf.fit import _chunks
from jaxsurf.fit._normal_equations import _point_by_point, accumulate
from jaxsurf.fit._objective import evaluate
from jaxsurf.fit._pose import posed
from jaxsurf.fit._problem import linearise
from jaxsurf.fit._stand_in import NodeCells, stand_in_for

COUNT = 700


def problem_of(shape, points, free=None, **options):
    options = {"fairness": 0.0, "bending": None, "rest": None, "fixed": (), "sliding": 0.1, "held": False, **options}
    return posed(shape, jnp.asarray(points), jnp.ones(len(points)), free=free, **options)


# off by a share of the largest entry: polynomials of degree 4 on spans in which tangents turn by up to 145°
NEAR = {
    "QI surface": 1e-3,
    "QI curve": 1e-3,
    "sweep along two guides": 1e-3,
    "B-spline curve": 1e-13,
    "closed B-spline curve": 1e-13,
}


@pytest.mark.parametrize("name", NEAR)
def test_gradients_are_exact_and_matrices_near(name):
    truth, rng = TRUTHS[name](), np.random.default_rng(1)
    parameters = jnp.stack([jnp.asarray(t) for t in truth.parameters(rng, count=COUNT)], axis=-1)
    points = np.asarray(truth.member(*parameters.T)) + NOISE * rng.normal(size=(COUNT, 3))
    problem = problem_of(truth.member, points, truth.free)
    weights = jnp.asarray(rng.uniform(0.5, 2, COUNT))
    assert stand_in_for(truth.member, problem.unknowns().size, COUNT) is not None
    lines = linearise(truth.member, parameters, problem.points, problem.sliding)
    both = [eqx.filter_jit(f)(truth.member, problem, parameters, lines, weights) for f in (accumulate, _point_by_point)]
    (gradient, matrix), (wanted, near) = both
    np.testing.assert_allclose(gradient, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    np.testing.assert_allclose(matrix, near, rtol=0, atol=NEAR[name] * np.abs(near).max())


def test_few_points_and_many_numbers_have_no_stand_in():
    sphere = js.Sphere([7.0, -3, 4], 5.0)
    nodes = NodeCells(sphere).count * NodeCells(sphere).terms
    assert stand_in_for(sphere, 4, nodes) is None and stand_in_for(sphere, 4, nodes + 1) is not None
    assert stand_in_for(sphere, 10**5, 10**6) is None


def test_chunks_add_up_to_the_whole(monkeypatch):
    """Also where the last one overlaps the one before it."""
    truth = sheet()
    points = points_on(truth, 230, seed=1) + NOISE * np.random.default_rng(2).normal(size=(230, 3))
    problem = problem_of(truth, points)
    feet = js.closest_point(truth, points).parameters + 1e-3
    whole, moved = eqx.filter_jit(evaluate)(problem, problem.unknowns(), feet)
    monkeypatch.setattr(_chunks, "CHUNK", 100)
    parts, again = eqx.filter_jit(lambda problem, theta, feet: evaluate(problem, theta, feet))(
        problem, problem.unknowns(), feet
    )
    for a, b in zip(whole, parts, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * np.abs(a).max())
    np.testing.assert_allclose(moved, again, rtol=0, atol=1e-9)
