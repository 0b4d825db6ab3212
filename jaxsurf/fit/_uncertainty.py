"""How well a fit knows what it found: covariances of control data and of places."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float
from .._errors import InputError
from ..curve import AbstractCurve
from ..query import foot_at, value_and_tangents
from ._constrained import onto, restored
from ._losses import LOSSES
from ._normal_equations import derivatives_by_unknowns
from ._objective import data_terms, penalty_terms
from ._problem import Problem, across

_GAUGE = 1e-6  # least weight of gliding along the shape, which points do not see, in the matrix that is inverted
_EFFICIENCY = 0.95  # of the robust losses on Gaussian noise
_CHUNK = 256


class Uncertainty(eqx.Module):
    """Covariances of what a fit found, to first order in the noise.

    covariance: (P, P) of the free numbers, in the order of the leaves of the shape, of rational weights the logarithms, as
    far as the points see them: gliding along the shape has none. noise: standard deviation of a measurement of weight 1;
    numbers: how many free numbers the points really determine, less than P where fairness and bending hold some; problem:
    what was fitted.
    The points' errors are taken as independent, along the normal, with variances noise² / weight, the loss and what holds
    the shape (bending, fairness, what is fixed, and how far the net was free to glide until the last step, which lets it fit
    noise) as part of the estimate: cov = noise² A⁻¹ M A⁻¹ with the Gauss-Newton
    matrices M of the points and A of the whole objective; the bias that fairness brings is not in it. Source: Huber, Robust
    statistics, 1981, §7.6, for robust losses.
    """

    covariance: Float[Array, "P P"]
    noise: Float[Array, ""]
    numbers: Float[Array, ""]
    problem: Problem

    def deviation(self, *parameters: Numbers) -> Float[Array, "..."]:
        """Standard deviation of the place at u, or (u, v), across the curve or surface: of a surface along its normal."""
        spread = self._spread(*parameters, across_only=True)
        return jnp.sqrt(jnp.maximum(jnp.trace(spread, axis1=-2, axis2=-1), 0))

    def covariance_at(self, *parameters: Numbers) -> Float[Array, "... d d"]:
        """Covariance of the place at u, or (u, v), along the shape too, as far as points see that."""
        return self._spread(*parameters, across_only=False)

    def _spread(self, *parameters: Numbers, across_only: bool) -> Float[Array, "... d d"]:
        wanted = 1 if isinstance(self.problem.shape, AbstractCurve) else 2
        if len(parameters) != wanted:
            raise InputError(f"Expected {wanted} `parameters`, u{', v' if wanted == 2 else ''}, got {len(parameters)}.")
        arrays = jnp.broadcast_arrays(*(as_float(p, self.problem.points.dtype) for p in parameters))
        rows = jnp.stack([a.reshape(-1) for a in arrays], axis=-1)
        found = _spreads(self.problem, self.covariance, rows, across_only)
        return found.reshape(*arrays[0].shape, *found.shape[1:])


@eqx.filter_jit
def _spreads(problem: Problem, covariance: Array, rows: Float[Array, "N k"], across_only: bool) -> Float[Array, "N d d"]:
    at = derivatives_by_unknowns(problem, problem.unknowns(), lambda member, *t: member.point(*t))

    def one(t: Float[Array, "k"]) -> Float[Array, "d d"]:
        jacobian = at(*t)[1]
        if across_only:
            jacobian = across(value_and_tangents(problem.shape, t)[1]) @ jacobian
        return jacobian @ covariance @ jacobian.T

    return jax.lax.map(one, rows, batch_size=_CHUNK)


@eqx.filter_jit
def uncertainty_of(problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"], noise: Any = None) -> Uncertainty:
    """Covariances at a solution θ with converged feet; noise: see `Uncertainty`, `None` to find it from the distances."""
    with_sliding = lambda s: eqx.tree_at(lambda p: p.sliding, _squared(problem), jnp.asarray(s, theta.dtype))
    gauge = jnp.maximum(problem.sliding, _GAUGE)
    slope, square = _influence(problem, theta, feet)
    seen = data_terms(with_sliding(0.0), theta, feet)[0].matrix
    matrix = data_terms(with_sliding(gauge), theta, feet)[0].matrix + penalty_terms(problem, theta).matrix / slope
    matrix = matrix + (1e-14 * jnp.trace(matrix) / theta.size) * jnp.eye(theta.size, dtype=theta.dtype)
    factored = jax.scipy.linalg.cho_factor(matrix)
    inverse = lambda x: jax.scipy.linalg.cho_solve(factored, x)
    normals = restored(problem, theta, rounds=0)[1]
    free = jax.vmap(lambda e: onto(normals, inverse, inverse(e)))(jnp.eye(theta.size, dtype=theta.dtype))
    numbers = jnp.sum(free * seen)
    counted = jnp.sum(problem.weights > 0).astype(theta.dtype)
    if noise is None:
        variance = square / jnp.maximum(counted - numbers, 1) / slope**2
    else:
        variance = jnp.asarray(noise, theta.dtype) ** 2 / (1 if problem.loss == "squared" else _EFFICIENCY)
    unit = problem.size**2 * jnp.sum(problem.weights)
    fitted = eqx.tree_at(lambda p: p.shape, problem, problem.member(theta))
    return Uncertainty(variance / unit * (free @ seen @ free.T), jnp.sqrt(variance), numbers, fitted)


def _squared(problem: Problem) -> Problem:
    return Problem(**{**vars(problem), "loss": "squared"})


def _influence(problem: Problem, theta: Array, feet: Array) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Mean slope of ψ(r) = r ρ'(r²/s²), and Σ w ψ²."""
    loss, s = LOSSES[problem.loss], problem.scale
    distance = foot_at(problem.member(theta), problem.points, feet).distance
    psi = lambda r: r * loss.weight((r / s) ** 2)
    slope = jnp.sum(problem.weights * jax.vmap(jax.grad(psi))(distance)) / jnp.sum(problem.weights)
    return slope, jnp.sum(problem.weights * psi(distance) ** 2)
