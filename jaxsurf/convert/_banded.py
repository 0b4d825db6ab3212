"""Linear equations with a band matrix, solved without exchanging rows."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

Pair = tuple[Array, Array]


def band(first: Int[Array, "n"], values: Float[Array, "n w"], reach: int) -> Float[Array, "n b"]:
    """Rows of `values` that start at column `first`, with the diagonal in column `reach`; b = 2 reach + 1."""
    count, width = values.shape
    shift = first - jnp.arange(count, dtype=first.dtype) + reach
    columns = shift[:, None] + jnp.arange(width, dtype=first.dtype)[None]
    rows = jnp.arange(count, dtype=first.dtype)[:, None]
    return jnp.zeros((count, 2 * reach + 1), values.dtype).at[rows, columns].set(values, mode="drop")


def solve_banded(matrix: Float[Array, "n b"], right: Float[Array, "n d"]) -> Float[Array, "n d"]:
    """x with A x = right, A given by its band with the diagonal in the middle column; cost n b².

    Gaussian elimination without pivoting, stable for B-spline collocation, whose matrices are totally
    positive (de Boor and Pinkus 1977). Differentiable.
    """
    reach = matrix.shape[1] // 2
    # rows above the first one: those of the identity, with nothing to eliminate
    above = jnp.zeros((reach, reach + 1), matrix.dtype).at[:, 0].set(1)

    def eliminate(carry: Pair, row: Pair) -> tuple[Pair, Pair]:
        upper, done = carry
        left, value = row
        for k in range(reach):  # by the row that is reach − k above
            share = left[k] / upper[k, 0]
            left = left.at[k : k + reach + 1].add(-share * upper[k])
            value = value - share * done[k]
        upper = jnp.concatenate([upper[1:], left[None, reach:]])
        done = jnp.concatenate([done[1:], value[None]])
        return (upper, done), (left[reach:], value)

    def substitute(below: Array, row: Pair) -> Pair:
        upper, value = row
        solved = (value - upper[1:] @ below) / upper[0]
        return jnp.concatenate([solved[None], below[:-1]]), solved

    blank = jnp.zeros((reach, right.shape[1]), right.dtype)
    _, triangle = jax.lax.scan(eliminate, (above, blank), (matrix, right))
    return jax.lax.scan(substitute, blank, triangle, reverse=True)[1]
