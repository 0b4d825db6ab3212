"""Quantiles of many numbers, wherever they lie, in memory that does not grow with them."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int


def quantile(magnitudes: Float[Array, "N"], counted: Bool[Array, "N"], q: Float[Array, ""]) -> Float[Array, ""]:
    """The value that a share `q` of the counted magnitudes, all ≥ 0, does not exceed, between two of them linearly.

    As `numpy.quantile`, to the last bit of the two neighbours, without sorting: numbers ≥ 0 are ordered as their bits are,
    so that the k-th is found by halving the range of bits and counting. Counts over devices do not depend on their order.
    """
    count = jnp.sum(counted, dtype=jnp.int32)
    place = q * jnp.maximum(count - 1, 0).astype(magnitudes.dtype)
    below = jnp.floor(place)
    first = below.astype(jnp.int32)
    lower = _ranked(magnitudes, counted, first)
    upper = _ranked(magnitudes, counted, jnp.minimum(first + 1, jnp.maximum(count - 1, 0)))
    return lower + (place - below) * (upper - lower)


@eqx.filter_jit
def compiled_quantile(magnitudes: Float[Array, "N"], counted: Bool[Array, "N"], q: Float[Array, ""]) -> Float[Array, ""]:
    return quantile(magnitudes, counted, q)


def _ranked(magnitudes: Float[Array, "N"], counted: Bool[Array, "N"], rank: Int[Array, ""]) -> Float[Array, ""]:
    """The magnitude that exceeds `rank` others."""
    whole = jnp.int64 if magnitudes.dtype == jnp.float64 else jnp.int32
    bits = jax.lax.bitcast_convert_type(jnp.abs(magnitudes), whole)

    def halve(_: Array, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = low + (high - low) // 2
        enough = jnp.sum((bits <= middle) & counted, dtype=jnp.int32) > rank
        return jnp.where(enough, low, middle + 1), jnp.where(enough, middle, high)

    top = jax.lax.bitcast_convert_type(jnp.asarray(jnp.inf, magnitudes.dtype), whole)
    steps = 64 if whole == jnp.int64 else 32
    found = jax.lax.fori_loop(0, steps, halve, (jnp.zeros((), whole), top))[1]
    return jax.lax.bitcast_convert_type(found, magnitudes.dtype)
