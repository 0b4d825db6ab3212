"""Derivatives through a fit, by the implicit function theorem."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._constrained import restored
from ._objective import evaluate, objective
from ._problem import Problem

_DIRECTIONS = 40  # of the Krylov space; the Gauss-Newton matrix is near the Hessian, and a few usually do


@eqx.filter_jit
def with_derivatives(problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]) -> Float[Array, "P"]:
    """The minimiser θ as a function of all numbers that the problem holds: points, weights, size, what is fixed.

    The gradient of the objective and the multipliers of the conditions vanish at θ; their derivatives give those of θ. The
    Hessian is exact, feet moving and residuals counted, and applied as a product, with the Gauss-Newton matrix to solve
    with. What the objective does not determine (gliding without a weight against it) moves as little as may be.
    """
    frozen, theta, feet = jax.lax.stop_gradient((problem, theta, feet))
    count = theta.size
    normals = restored(frozen, theta, rounds=0)[1]
    matrix = evaluate(frozen, theta, feet)[0].matrix
    solve = _saddle_solver(matrix, normals)
    multipliers = -solve(jnp.concatenate([evaluate(frozen, theta, feet)[0].gradient, jnp.zeros_like(normals[:, 0])]))[count:]

    def stationary(x: Float[Array, "Pc"]) -> Float[Array, "Pc"]:
        along, forces = x[:count], x[count:]

        def energy(y: Float[Array, "P"]) -> Float[Array, ""]:
            held = forces @ problem.violation(y) if problem.fixed else 0
            return objective(problem, y, feet) + held

        conditions = problem.violation(along) if problem.fixed else forces
        return jnp.concatenate([jax.grad(energy)(along), conditions])

    def krylov(product: Any, right: Float[Array, "Pc"]) -> Float[Array, "Pc"]:
        return jax.scipy.sparse.linalg.gmres(product, right, M=solve, restart=_DIRECTIONS, maxiter=4, tol=1e-11)[0]

    def tangent_solve(product: Any, right: Float[Array, "Pc"]) -> Float[Array, "Pc"]:
        return jax.lax.custom_linear_solve(product, right, krylov, symmetric=True)

    start = jnp.concatenate([theta, multipliers])
    return jax.lax.custom_root(stationary, start, lambda _, x: x, tangent_solve)[:count]


def _saddle_solver(matrix: Float[Array, "P P"], normals: Float[Array, "c P"]) -> Any:
    """A function that solves [[H, Cᵀ], [C, 0]] x = b by the Gauss-Newton matrix."""
    count, held = matrix.shape[0], normals.shape[0]
    ridge = 1e-13 * jnp.trace(matrix) / count
    scale = jnp.sqrt(jnp.trace(matrix) / count)  # so that both parts are of one size
    corner = -ridge * jnp.eye(held, dtype=matrix.dtype)
    upper = jnp.concatenate([matrix + ridge * jnp.eye(count, dtype=matrix.dtype), scale * normals.T], axis=1)
    lower = jnp.concatenate([scale * normals, corner], axis=1)
    factored = jax.scipy.linalg.lu_factor(jnp.concatenate([upper, lower], axis=0))
    unit = jnp.concatenate([jnp.ones(count, matrix.dtype), jnp.full(held, scale, matrix.dtype)])
    return lambda right: unit * jax.scipy.linalg.lu_solve(factored, unit * right)
