"""Cumulative basis: B̃_i = Σ_{j ≥ i} B_j."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ._bspline import BSplineBasis


def cumulative_local(basis: BSplineBasis, u: Float[Array, ""]) -> tuple[Int[Array, ""], list[Float[Array, ""]]]:
    """Index of the first cumulative function that is neither 0 nor 1 around `u`, and the `degree` values of those.

    All functions before it are 1, all after them 0 (paper 004 below (3), with the sum from j = i).
    """
    first, values = basis.local(u)
    sums, total = [], jnp.zeros_like(u)
    for value in reversed(values[1:]):
        total = total + value
        sums.append(total)
    return first + 1, sums[::-1]


def cumulative_row(basis: BSplineBasis, u: Float[Array, ""]) -> Float[Array, "n"]:
    """All `n` cumulative values at one parameter; the first is 1. Not for periodic bases: they have no first function."""
    return jnp.cumsum(basis.row(u)[::-1])[::-1]
