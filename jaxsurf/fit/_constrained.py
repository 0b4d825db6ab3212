"""Steps of a fit that keep what is fixed."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import eps
from ._problem import Problem

_ROUNDS = 6


def restored(
    problem: Problem, theta: Float[Array, "P"], rounds: int = _ROUNDS
) -> tuple[Float[Array, "P"], Float[Array, "c P"]]:
    """The nearest unknowns that keep what is fixed, by Newton's steps, and the derivatives of the conditions there."""
    if not problem.fixed:
        return theta, jnp.zeros((0, theta.size), theta.dtype)

    def once(_: Any, x: Float[Array, "P"]) -> Float[Array, "P"]:
        value, push = jax.vjp(problem.violation, x)
        rows = jax.vmap(lambda e: push(e)[0])(jnp.eye(value.size, dtype=value.dtype))
        return x - rows.T @ _solved(rows @ rows.T, value)

    found = jax.lax.fori_loop(0, rounds, once, theta)
    return found, jax.jacrev(problem.violation)(found)


def onto(normals: Float[Array, "c P"], inverse: Callable[[Array], Array], step: Float[Array, "P"]) -> Float[Array, "P"]:
    """The step H⁻¹g without its part across the normals, in the metric H: with a multiplier for each of them."""
    if normals.shape[0] == 0:
        return step
    across = jax.vmap(inverse)(normals)
    return step - _solved(across @ normals.T, normals @ step) @ across


def _solved(matrix: Float[Array, "k k"], right: Float[Array, "k"]) -> Float[Array, "k"]:
    """Least solution of semidefinite equations; conditions may be there twice."""
    values, vectors = jnp.linalg.eigh(matrix)
    good = values > 1e3 * eps(matrix.dtype) * matrix.shape[0] * jnp.max(jnp.abs(values))
    scaled = jnp.where(good, (vectors.T @ right) / jnp.where(good, values, 1), 0)
    return vectors @ scaled
