"""The objective of a fit: its derivatives, its Gauss-Newton matrix, and its two ways over the points."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import sheet
from scipy.interpolate import BSpline

import jaxsurf as js
from jaxsurf.basis import clamped_knots
from jaxsurf.fit._bending import bending_of
from jaxsurf.fit._fairness import _variation, fairness_terms
from jaxsurf.fit._normal_equations import accumulate
from jaxsurf.fit._objective import evaluate
from jaxsurf.fit._problem import Linearised, Problem, free_leaves, linearise, unknowns_of
from jaxsurf.surface import AbstractSurface

SIDES = (10.0, 6.0)


def problem_of(shape, points, *, free=None, loss="squared", fair=False, sliding=0.0, penalty=None):
    number = jnp.asarray
    unknowns = unknowns_of(shape, free_leaves(shape, free)).size
    return Problem(
        shape,
        number(points),
        number(np.random.default_rng(5).uniform(0.5, 2, len(points))),
        number(12.0),
        number(0.1),
        number(1e-4),
        number(1e-2 if fair else 0.0),
        number(sliding),
        number(0.1 * np.random.default_rng(6).normal(size=unknowns)),
        penalty,
        (),
        free_leaves(shape, free),
        loss,
        fair,
    )


def beside(shape, noise=0.1):
    """Points around a shape, some of them beyond its border, and parameters near their feet."""
    (a, b), (c, d) = shape.domain
    margin = 0.15 if noise == 0 else 0.02
    rng = np.random.default_rng(1)
    u, v = rng.uniform(margin, 1 - margin, size=(2, 120))
    feet = np.stack([a + (b - a) * u, c + (d - c) * v], -1)
    points = np.asarray(shape(*feet.T)) + noise * rng.normal(size=(120, 3))
    return points, jnp.asarray(feet)


def sphere():
    return js.Sphere([7.0, -3.0, 4.0], 2.5)


@eqx.filter_jit
def evaluate_all(problem, trials, feet):
    return jax.lax.map(lambda theta: evaluate(problem, theta, feet)[0], trials)


def around(problem, feet, h):
    """Directions, and value, gradient and matrix at h and -h along each, and in their middle."""
    theta = np.asarray(problem.unknowns())
    steps = np.random.default_rng(3).normal(size=(3, theta.size))
    trials = jnp.asarray(np.concatenate([theta + h * steps, theta - h * steps, theta[None]]))
    return steps, evaluate_all(problem, trials, feet)


CASES = {
    "net": (sheet(), "squared"),
    "net, far points forgotten": (sheet(), "tukey"),
    "sphere": (sphere(), "squared"),
}


@pytest.mark.parametrize("shape, loss", CASES.values(), ids=CASES)
def test_the_gradient_is_the_slope_of_the_value(shape, loss):
    """The feet are found anew at every trial: their motion must not matter (envelope theorem)."""
    points, feet = beside(shape)
    problem = problem_of(shape, points, loss=loss, penalty=bending_of(shape, SIDES))
    steps, (value, gradient, _) = around(problem, feet, 1e-4)
    slope = (value[:3] - value[3:6]) / 2e-4
    np.testing.assert_allclose(slope, steps @ gradient[6], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("shape", [sheet(), sphere()], ids=["net", "sphere"])
def test_the_gauss_newton_matrix_is_the_hessian_at_exact_points(shape):
    points, feet = beside(shape, noise=0)
    problem = problem_of(shape, points, penalty=bending_of(shape, SIDES))
    steps, (_, gradient, matrix) = around(problem, feet, 1e-5)
    size = float(jnp.max(jnp.abs(matrix[6])))
    np.testing.assert_allclose((gradient[:3] - gradient[3:6]) / 2e-5, steps @ matrix[6], rtol=0, atol=1e-4 * size)
    assert np.linalg.eigvalsh(matrix[6])[0] > -1e-12 * size


@pytest.mark.parametrize("count", [1, 300])
def test_both_ways_over_the_points_give_the_same_sums(count):
    shape = sheet()
    rng = np.random.default_rng(1)
    feet = jnp.asarray(rng.uniform([2, 0], [5, 1], size=(count, 2)))
    offset, root = rng.normal(size=(count, 3)), rng.normal(size=(count, 3, 3))
    lines = Linearised(jnp.asarray(offset), jnp.asarray(root))
    problem = problem_of(shape, np.zeros((count, 3)))

    @eqx.filter_jit
    def both(problem, *sums):
        arguments = (shape, problem, *sums)
        return accumulate(*arguments), accumulate.dispatch(object)(*arguments)

    for by_cell, by_point in zip(*both(problem, feet, lines, problem.weights), strict=True):
        np.testing.assert_allclose(by_cell, by_point, rtol=0, atol=1e-12 * np.max(np.abs(by_point)))


def test_sliding_weighs_the_tangents_only():
    shape = sphere()
    points, feet = beside(shape, noise=0)
    root = linearise(shape, feet, jnp.asarray(points), jnp.asarray(0.01)).root
    normal = (points - [7, -3, 4]) / 2.5
    np.testing.assert_allclose(np.einsum("nab,nb->na", root, normal), normal, atol=1e-12)
    tangent = np.cross(normal, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(np.einsum("nab,nb->na", root, tangent), 0.1 * tangent, atol=1e-12)


def test_feet_on_the_border_pull_sideways_too():
    plane = js.Plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 2.0)
    points = jnp.asarray([[0.2, 0.3, 1.0], [3.0, 0.3, 1.0], [3.0, 3.0, 1.0]])
    feet = jnp.asarray([[0.2, 0.3], [1.0, 0.3], [1.0, 1.0]])
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
    energy = np.einsum("ix,ij,jx", net.reshape(-1, 3), np.asarray(bending_of(shape, SIDES)), net.reshape(-1, 3))
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
FAIR = {"net": NET, "curve": CURVE}


@pytest.fixture(scope="module", params=FAIR)
def fair(request):
    shape = FAIR[request.param]
    problem = problem_of(shape, np.ones((4, 3)), fair=True)
    theta = np.asarray(problem.unknowns())
    steps = np.random.default_rng(3).normal(size=(3, theta.size))
    trials = jnp.asarray(np.concatenate([theta[None], theta + 1e-5 * steps, theta - 1e-5 * steps, 3 * theta[None]]))
    terms = lambda p: jax.lax.map(lambda x: fairness_terms(p.member(x), p), trials)
    return problem, steps, eqx.filter_jit(terms)(problem)


def test_the_gradient_of_fairness_is_the_slope_of_its_value(fair):
    _, steps, (value, gradient, matrix) = fair
    slope = (value[1:4] - value[4:7]) / 2e-5
    np.testing.assert_allclose(slope, steps @ gradient[0], rtol=1e-5)
    assert np.linalg.eigvalsh(matrix[0])[0] > -1e-12 * np.max(matrix[0])


def test_fairness_has_no_unit(fair):
    """Scaling about the origin changes nothing, so that a shape gains nothing by growing or shrinking."""
    problem, _, (value, gradient, _) = fair
    theta = problem.unknowns()
    np.testing.assert_allclose(value[7], value[0], rtol=1e-10)
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
