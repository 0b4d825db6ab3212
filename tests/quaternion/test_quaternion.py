"""Quaternion algebra, exponential, rotations and splines: named for their laws, with mpmath and scipy as oracles."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jaxsurf as js
from jaxsurf import _safe
from jaxsurf.quaternion import (
    QuaternionSpline,
    conjugate,
    exp,
    from_matrix,
    half_rotation,
    inverse,
    log,
    minimal_rotation,
    multiply,
    norm,
    normalize,
    rotate,
    slerp,
    to_matrix,
    turn,
)

RNG = np.random.default_rng(4)
P, Q, R = jnp.asarray(RNG.normal(size=(3, 20, 4)))
UNIT, OTHER = normalize(P), normalize(Q)
VECTORS = jnp.asarray(RNG.normal(size=(20, 3)))
IDENTITY = np.array([1.0, 0, 0, 0])


def close(found, wanted, atol=1e-14):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=atol)


# --- algebra


def test_products_associate_and_norms_multiply():
    close(multiply(multiply(P, Q), R), multiply(P, multiply(Q, R)), 1e-13)
    close(norm(multiply(P, Q)), norm(P) * norm(Q), 1e-13)
    close(conjugate(multiply(P, Q)), multiply(conjugate(Q), conjugate(P)))


def test_inverses_undo():
    close(multiply(P, inverse(P)), np.tile(IDENTITY, (20, 1)))
    close(multiply(inverse(P), P), np.tile(IDENTITY, (20, 1)))
    close(inverse(jnp.zeros(4)), 0)


def test_units_i_j_k():
    one, i, j, k = jnp.eye(4)
    close(multiply(i, j), k, 0)
    close(multiply(j, k), i, 0)
    close(multiply(k, i), j, 0)
    close(multiply(i, i), -one, 0)


def test_everything_broadcasts():
    assert multiply(P[:, None], Q[None]).shape == (20, 20, 4)
    assert rotate(UNIT[:, None], VECTORS[None]).shape == (20, 20, 3)
    assert half_rotation(VECTORS[0], VECTORS).shape == (20, 3)


# --- rotations


def scipy_of(q):
    return Rotation.from_quat(np.array(q)[..., [1, 2, 3, 0]])


def test_rotations_are_those_of_scipy_and_of_the_sandwich():
    close(rotate(UNIT, VECTORS), scipy_of(UNIT).apply(np.array(VECTORS)), 1e-14)
    pure = jnp.concatenate([jnp.zeros((20, 1)), VECTORS], axis=1)
    close(rotate(UNIT, VECTORS), multiply(multiply(UNIT, pure), conjugate(UNIT))[:, 1:], 1e-14)
    close(rotate(-UNIT, VECTORS), rotate(UNIT, VECTORS), 0)
    close(rotate(multiply(UNIT, OTHER), VECTORS), rotate(UNIT, rotate(OTHER, VECTORS)), 1e-14)


def test_matrices_are_those_of_scipy_and_return():
    close(to_matrix(UNIT), scipy_of(UNIT).as_matrix(), 1e-15)
    side = np.where(np.asarray(UNIT[:, :1]) < 0, -1.0, 1.0)
    close(from_matrix(to_matrix(UNIT)), UNIT * side, 1e-15)


@pytest.mark.parametrize("diagonal", [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
def test_half_turns_have_quaternions_and_gradients(diagonal):
    matrix = jnp.diag(jnp.asarray(diagonal, float))
    q = from_matrix(matrix)
    close(to_matrix(q), matrix, 1e-15)
    assert np.all(np.isfinite(jax.jacobian(from_matrix)(matrix)))


def test_turning_by_a_half_rotation_vector_is_rotating_by_its_exponential():
    half = VECTORS[::-1]
    close(turn(half, VECTORS), rotate(exp(half), VECTORS), 1e-14)
    close(turn(half, VECTORS), Rotation.from_rotvec(2 * np.array(half)).apply(np.array(VECTORS)), 1e-14)
    close(turn(jnp.zeros(3), VECTORS[0]), VECTORS[0], 0)


def test_the_minimal_rotation_turns_one_direction_to_the_other_on_the_great_circle():
    a, b = VECTORS, VECTORS[::-1] * 3.0
    unit = lambda x: np.asarray(x) / np.linalg.norm(x, axis=1, keepdims=True)
    close(rotate(minimal_rotation(a, b), jnp.asarray(unit(a))), unit(b), 1e-14)
    half = half_rotation(a, b)
    close(np.sum(half * a, axis=1), 0, 1e-14)
    angle = np.arccos(np.clip(np.sum(unit(a) * unit(b), axis=1), -1, 1))
    close(2 * np.linalg.norm(half, axis=1), angle, 1e-7)
    close(half_rotation(a, 2.0 * a), 0, 1e-16)


def test_nearly_opposite_directions_keep_all_digits():
    angle = np.pi - np.array([1e-1, 1e-4, 1e-7])
    ends = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    half = half_rotation(jnp.array([1.0, 0, 0]), jnp.asarray(ends))
    close(half[:, 2], angle / 2, 1e-14)


def test_opposite_directions_give_finite_nonsense():
    f = lambda b: half_rotation(jnp.array([1.0, 0, 0]), b)
    for value in (f(jnp.array([-1.0, 0, 0])), jax.jacobian(f)(jnp.array([-1.0, 0, 0]))):
        assert np.all(np.isfinite(value))


def test_great_arcs_go_the_shorter_way():
    t = jnp.linspace(0, 1, 20)
    way = slerp(UNIT, OTHER, t)
    from scipy.spatial.transform import Slerp

    wanted = [Slerp([0, 1], scipy_of(np.stack([a, b])))(s) for a, b, s in zip(UNIT, OTHER, np.asarray(t), strict=True)]
    for q, other in zip(way, wanted, strict=True):
        close(to_matrix(q), other.as_matrix(), 1e-14)
    close(to_matrix(slerp(UNIT, -OTHER, t)), to_matrix(way), 1e-14)


# --- exponential and logarithm


def test_logarithm_undoes_the_exponential_and_both_signs_agree():
    half = VECTORS / jnp.linalg.norm(VECTORS, axis=1, keepdims=True) * jnp.linspace(0, 1.55, 20)[:, None]
    close(log(exp(half)), half, 1e-14)
    close(log(-exp(half)), log(exp(half)), 0)
    close(log(7.0 * exp(half)), half, 1e-14)
    close(to_matrix(exp(log(UNIT))), to_matrix(UNIT), 1e-14)
    close(log(jnp.zeros(4)), 0, 0)


def _derivatives(f, x, order=4):
    found, x = [], jnp.asarray(x)
    for _ in range(order + 1):
        found.append(float(f(x)))
        f = jax.grad(f)
    return found


X = [0.0, 1e-12, 1e-6, 1e-3, 0.3, 0.999999, 1.000001, 2.0, 7.0]


@pytest.mark.parametrize("x", X)
def test_series_are_right_to_the_fourth_derivative(x):
    mpmath.mp.dps = 40
    for k in range(4):
        oracle = lambda s, k=k: mpmath.hyp1f2(1, mpmath.mpf(k + 1) / 2, mpmath.mpf(k + 2) / 2, -s / 4) / math.factorial(k)
        wanted = [float(mpmath.diff(oracle, mpmath.mpf(x), n)) for n in range(5)]
        close(_derivatives(partial(_safe.stumpff, k), x), wanted, 2e-13)


@pytest.mark.parametrize("x", [0.0, 1e-10, 1e-3, 0.0159, 0.0161, 0.0999, 0.1001, 0.3, 2.0])
@pytest.mark.parametrize("cosine", [1.0, 0.4])
def test_arc_over_sine_is_right_to_the_fourth_derivative(x, cosine):
    mpmath.mp.dps = 40
    # atan(√z)/√z = 2F1(1/2, 1; 3/2; −z)
    oracle = lambda s: mpmath.hyp2f1(0.5, 1, 1.5, -s / mpmath.mpf(cosine) ** 2) / mpmath.mpf(cosine)
    wanted = np.array([float(mpmath.diff(oracle, mpmath.mpf(x), n)) for n in range(5)])
    found = _derivatives(lambda s: _safe.arc_over_sine(s, jnp.asarray(cosine)), x)
    np.testing.assert_allclose(found, wanted, rtol=2e-11)


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.1])
def test_derivatives_of_the_exponential_along_a_line(size):
    """d⁴/dt⁴ exp(t ω) = (ω·)⁴ exp, also at and near t = 0."""
    omega = np.array([0.3, -0.4, 1.2])
    f = lambda t: exp(t * jnp.asarray(omega))
    for _ in range(4):
        f = lambda t, g=f: jax.jvp(g, (t,), (1.0,))[1]
    close(f(size), np.linalg.norm(omega) ** 4 * exp(size * jnp.asarray(omega)), 1e-13)


# --- splines of orientations

KNOTS = [2.0] * 4 + [2.7, 3.1] + [5.0] * 4


def test_a_clamped_spline_begins_and_ends_at_its_orientations():
    spline = QuaternionSpline(UNIT[:6], KNOTS)
    q = spline(jnp.array([2.0, 3.3, 5.0]))
    close(norm(q), 1)
    close(to_matrix(q[0]), to_matrix(UNIT[0]), 1e-13)
    close(to_matrix(q[2]), to_matrix(UNIT[5]), 1e-13)
    flipped = QuaternionSpline(UNIT[:6] * jnp.array([1.0, -1, 1, 1, -1, -1])[:, None], KNOTS)
    close(to_matrix(flipped(3.3)), to_matrix(q[1]), 1e-13)


def test_degree_one_is_great_arcs():
    spline = QuaternionSpline(UNIT[:3], [0.0, 0.0, 1.0, 3.0, 3.0], 1)
    close(to_matrix(spline(2.0)), to_matrix(slerp(UNIT[1], UNIT[2], jnp.asarray(0.5))), 1e-14)


def test_splines_are_smooth_across_knots_and_differentiable():
    spline = QuaternionSpline(UNIT[:6], KNOTS)
    twice = jax.jacfwd(jax.jacfwd(lambda t: to_matrix(spline(t))))
    close(twice(2.7 - 1e-9), twice(2.7 + 1e-9), 1e-5)
    gradient = jax.grad(lambda o: jnp.sum(jnp.sin(QuaternionSpline(o, KNOTS)(3.3))))(UNIT[:6])
    assert np.all(np.isfinite(gradient)) and np.any(gradient != 0)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((np.zeros((6, 3)), KNOTS), r"`orientations` must have shape \(n, 4\), got \(6, 3\)"),
        ((np.ones((5, 4)), KNOTS), "`knots` must have 9 knots"),
    ],
)
def test_bad_input_is_refused(arguments, message):
    with pytest.raises(js.InputError, match=message):
        QuaternionSpline(*arguments)


def test_single_precision_stays():
    for function, argument in ((exp, VECTORS), (log, UNIT), (from_matrix, to_matrix(UNIT)), (to_matrix, UNIT)):
        found = function(argument.astype(jnp.float32))
        assert found.dtype == jnp.float32
        close(found, function(argument), 2e-6)
