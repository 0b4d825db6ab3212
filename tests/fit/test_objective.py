"""The objective of a fit: its derivatives, its Gauss-Newton matrix, and its two ways over the points."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import dented, points_on, sheet
from scipy.interpolate import BSpline

import jaxsurf as js
from jaxsurf.basis import clamped_knots
from jaxsurf.fit._bending import bending_of
from jaxsurf.fit._fairness import _variation, fairness_terms
from jaxsurf.fit._normal_equations import accumulate
from jaxsurf.fit._objective import evaluate
from jaxsurf.fit._problem import Problem, free_leaves, linearise
from jaxsurf.fit._solve import solve
from jaxsurf.surface import AbstractSurface

SIDES = (10.0, 6.0)


def problem_of(shape, points, *, free=None, loss="squared", fair=False, sliding=0.0):
    number = jnp.asarray
    return Problem(
        shape,
        number(points),
        number(np.random.default_rng(5).uniform(0.5, 2, len(points))),
        number(12.0),
        number(0.1),
        number(1e-4),
        number(1e-2 if fair else 0.0),
        number(sliding),
        free_leaves(shape, free),
        loss,
        fair,
    )


def beside(shape, count=120):
    """Points around a shape, some of them beyond its border."""
    points = points_on(shape, count, seed=1)
    return points + 0.1 * np.random.default_rng(2).normal(size=points.shape)


def sphere():
    return js.Sphere([7.0, -3.0, 4.0], 2.5)


CASES = {
    "net": (sheet(), "squared", True),
    "net, far points forgotten": (sheet(), "tukey", False),
    "sphere": (sphere(), "squared", False),
}


@pytest.mark.parametrize("shape, loss, bent", CASES.values(), ids=CASES)
def test_the_gradient_is_the_slope_of_the_value(shape, loss, bent):
    """The feet are found anew at every trial: their motion must not matter (envelope theorem)."""
    problem = problem_of(shape, beside(shape), loss=loss)
    penalty = bending_of(shape, SIDES) if bent else None
    feet = js.closest_point(shape, problem.points).parameters
    theta = problem.unknowns()
    steps = np.random.default_rng(3).normal(size=(3, theta.size))
    h = 1e-4
    trials = jnp.asarray(np.concatenate([theta + h * steps, theta - h * steps]))
    values = eqx.filter_jit(lambda p: jax.lax.map(lambda x: evaluate(p, x, feet, penalty)[:2], trials))
    value, gradients = values(problem)
    np.testing.assert_allclose(
        (value[:3] - value[3:]) / (2 * h),
        np.sum(0.5 * (gradients[:3] + gradients[3:]) * steps, axis=1),
        rtol=1e-5,
        atol=1e-9,
    )


@pytest.mark.parametrize("shape", [sheet(), sphere()], ids=["net", "sphere"])
def test_the_gauss_newton_matrix_is_the_hessian_at_exact_points(shape):
    points = points_on(shape, 120, seed=1, margin=0.1)
    problem = problem_of(shape, points)
    feet = js.closest_point(shape, points).parameters
    theta = problem.unknowns()
    steps = np.random.default_rng(3).normal(size=(3, theta.size))
    h = 1e-5
    trials = jnp.asarray(np.concatenate([theta + h * steps, theta - h * steps, theta[None]]))
    found = eqx.filter_jit(lambda p: jax.lax.map(lambda x: evaluate(p, x, feet, None)[1:3], trials))
    gradients, matrices = found(problem)
    scale = float(jnp.max(jnp.abs(matrices[-1])))
    np.testing.assert_allclose((gradients[:3] - gradients[3:6]) / (2 * h), steps @ matrices[-1], rtol=0, atol=1e-4 * scale)
    assert np.linalg.eigvalsh(matrices[-1])[0] > -1e-12 * scale


@pytest.mark.parametrize("count", [1, 120, 700])
def test_both_ways_over_the_points_give_the_same_sums(count):
    shape = sheet()
    problem = problem_of(shape, beside(shape, count), sliding=0.1)
    feet = js.closest_point(shape, problem.points).parameters

    @eqx.filter_jit
    def both(problem, feet):
        lines = linearise(shape, feet, problem.points, problem.sliding)
        arguments = (shape, problem, feet, lines, problem.weights)
        return accumulate(*arguments), accumulate.dispatch(object)(*arguments)

    for by_cell, by_point in zip(*both(problem, feet), strict=True):
        np.testing.assert_allclose(by_cell, by_point, rtol=1e-10, atol=1e-12 * count)


def test_sliding_weighs_the_tangents_only():
    shape = sheet()
    points = points_on(shape, 50, seed=1, margin=0.1) + 0.05
    feet = js.closest_point(shape, points).parameters
    root = linearise(shape, feet, jnp.asarray(points), jnp.asarray(0.01)).root
    tangents = js.partials(shape, feet[:, 0], feet[:, 1])
    normal = np.cross(*tangents)
    np.testing.assert_allclose(np.einsum("nab,nb->na", root, normal), normal, atol=1e-11)
    for tangent in tangents:
        np.testing.assert_allclose(np.einsum("nab,nb->na", root, tangent), 0.1 * tangent, atol=1e-11)


def test_feet_on_the_border_pull_sideways_too():
    plane = js.Plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 2.0)
    points = jnp.asarray([[0.2, 0.3, 1.0], [3.0, 0.3, 1.0], [3.0, 3.0, 1.0]])
    feet = js.closest_point(plane, points).parameters
    root = linearise(plane, feet, points, jnp.asarray(0.0)).root
    expected = [np.diag([0, 0, 1]), np.diag([1, 0, 1]), np.eye(3)]
    np.testing.assert_allclose(root, expected, atol=1e-12)


# --- bending


@pytest.mark.parametrize("periodic", [False, True], ids=["sheet", "tube"])
def test_the_bending_matrix_is_the_energy_of_the_unrolled_sheet(periodic):
    knots_u, knots_v = np.array([2.0, 2.6, 3.1, 4.4, 4.7, 5.0]), np.array([0.0] * 3 + [0.4] + [1.0] * 3)
    if not periodic:
        knots_u = np.array([2.0] * 4 + [3.1] + [5.0] * 4)
    net = np.random.default_rng(1).normal(size=(5, 4, 3))
    shape = js.BSplineSurface(net, knots_u, knots_v, 3, 2, periodic_u=periodic)
    energy = np.einsum("ix,ij,jx", net.reshape(-1, 3), bending_of(shape, SIDES), net.reshape(-1, 3))
    if periodic:  # the same curve with its ends wrapped round
        net = np.concatenate([net, net[:3]])
        knots_u = np.concatenate([knots_u[-4:-1] - 3, knots_u, knots_u[1:4] + 3])
    along_u, along_v = BSpline(knots_u, net, 3), BSpline(knots_v, np.eye(4), 2)
    (u, weight_u), (v, weight_v) = _midpoints(2, 5), _midpoints(0, 1)
    part = lambda i, j: np.einsum("anx,bn->abx", along_u(u, nu=i), along_v(v, nu=j))
    scale_u, scale_v = SIDES[0] / 3, SIDES[1] / 1
    integrand = (part(2, 0) / scale_u**2) ** 2 + 2 * (part(1, 1) / (scale_u * scale_v)) ** 2 + (part(0, 2) / scale_v**2) ** 2
    expected = (SIDES[0] * SIDES[1]) * scale_u * scale_v * np.sum(integrand) * weight_u * weight_v
    np.testing.assert_allclose(energy, expected, rtol=1e-4)


def _midpoints(a, b, count=500):
    step = (b - a) / count
    return a + step * (0.5 + np.arange(count)), step


def test_planes_do_not_bend():
    shape = sheet()
    flat = np.asarray(shape.control_points) * [1, 1, 0]
    # control points at the Greville abscissae, where the net of a linear map lies
    greville = lambda knots: np.mean([knots[i + 1 : i + 1 + 6] for i in range(3)], axis=0)
    u, v = greville(np.asarray(shape.knots_u)), greville(np.asarray(shape.knots_v))
    flat = np.stack(np.meshgrid(2 * u - 1, v + 4, indexing="ij"), -1).reshape(-1, 2)
    matrix = np.asarray(bending_of(shape, SIDES))
    np.testing.assert_allclose(matrix @ flat, 0, atol=1e-10 * np.abs(matrix).max())
    assert np.linalg.eigvalsh(matrix)[0] > -1e-12 * np.abs(matrix).max()
    assert np.linalg.matrix_rank(matrix, tol=1e-9 * np.abs(matrix).max()) == 36 - 3  # 1, u and v do not bend


def test_shapes_without_a_net_have_no_bending_matrix():
    assert bending_of(sphere(), SIDES) is None


# --- fairness in the objective

NET = js.BSplineSurface(
    np.stack(
        [
            *np.meshgrid(np.arange(11.0), np.arange(11.0), indexing="ij"),
            np.random.default_rng(4).normal(size=(11, 11)),
        ],
        -1,
    ),
    clamped_knots(11, 3, (2.0, 5.0)),
    clamped_knots(11, 3),
    3,
    3,
)
CURVE = js.BSplineCurve(np.random.default_rng(6).normal(size=(8, 3)), [2.0, 2.3, 2.8, 3.0, 3.5, 3.9, 4.2, 4.7, 5.0], 3, True)
FAIR = {"net": NET, "curve": CURVE, "torus": js.Torus([1.0, 2.0, 3.0], [0.0, 1.0, 1.0], 3.0, 1.0)}


@pytest.fixture(scope="module", params=FAIR)
def fair(request):
    shape = FAIR[request.param]
    problem = problem_of(shape, np.ones((4, 3)), fair=True)
    theta = problem.unknowns()
    steps = np.random.default_rng(3).normal(size=(3, theta.size))
    trials = jnp.asarray(np.concatenate([theta[None], theta + 1e-5 * steps, theta - 1e-5 * steps]))
    terms = lambda p: jax.lax.map(lambda x: fairness_terms(p.member(x), p), trials)
    return problem, steps, eqx.filter_jit(terms)(problem)


def test_the_gradient_of_fairness_is_the_slope_of_its_value(fair):
    _, steps, (value, gradient, matrix) = fair
    slope = (value[1:4] - value[4:]) / 2e-5
    np.testing.assert_allclose(slope, steps @ gradient[0], rtol=1e-5)
    assert np.linalg.eigvalsh(matrix[0])[0] > -1e-12 * np.max(matrix[0])


def test_fairness_has_no_unit(fair):
    """Scaling about the origin changes nothing, so that a shape gains nothing by growing or shrinking."""
    problem, _, (value, gradient, _) = fair
    if not isinstance(problem.shape, js.Torus):
        theta = problem.unknowns()
        grown = eqx.filter_jit(fairness_terms)(problem.member(3 * theta), problem)
        np.testing.assert_allclose(grown[0], value[0], rtol=1e-10)
        assert abs(theta @ gradient[0]) < 1e-10 * np.linalg.norm(theta) * np.linalg.norm(gradient[0])


def test_both_ways_to_the_fairness_of_a_net_agree():
    """A net of 8 × 8 even spans has the nodes of a shape without structure."""
    both = eqx.filter_jit(lambda p: (_variation(NET, p), _variation.dispatch(AbstractSurface)(NET, p)))
    for by_cell, by_point in zip(*both(problem_of(NET, np.ones((4, 3)), fair=True)), strict=True):
        np.testing.assert_allclose(by_cell, by_point, rtol=0, atol=1e-10 * np.max(np.abs(by_point)))


def test_fairness_of_something_else_is_refused():
    problem = problem_of(sphere(), np.ones((4, 3)), fair=True)
    with pytest.raises(TypeError, match="`fairness` expects a curve or a surface, got Problem"):
        fairness_terms(problem, problem)


def test_the_solver_ends_at_a_stationary_value():
    shape = dented(sheet(), 1)
    points = jnp.asarray(beside(sheet(), 300))
    problem = problem_of(shape, points, sliding=0.1)
    penalty = bending_of(shape, SIDES)
    feet = js.closest_point(shape, points).parameters
    first = eqx.filter_jit(evaluate)(problem, problem.unknowns(), feet, penalty)
    found = solve(problem, feet, penalty, rtol=1e-10, max_steps=200, progress=lambda event: False)
    last = eqx.filter_jit(evaluate)(problem, found.theta, found.feet, penalty)
    assert last[0] < first[0] and np.linalg.norm(last[1]) < 1e-4 * np.linalg.norm(first[1])
