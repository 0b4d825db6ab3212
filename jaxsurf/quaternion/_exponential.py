"""Exponential and logarithm, right to high derivatives."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import _safe


def exp(half: Float[Array, "*batch 3"]) -> Float[Array, "*batch 4"]:
    """(cos |ω|, ω sin |ω| / |ω|), the unit quaternion of the rotation vector 2ω; `half` is ω in radians.

    Both parts are entire functions of |ω|²: every derivative at ω = 0 is right.
    """
    square = jnp.sum(half * half, axis=-1, keepdims=True)
    return jnp.concatenate([_safe.stumpff(0, square), half * _safe.stumpff(1, square)], axis=-1)


def log(q: Float[Array, "*batch 4"]) -> Float[Array, "*batch 3"]:
    """The half rotation vector ω with exp(ω) = ±q / |q|, |ω| ≤ π/2; q and −q give the same.

    At w = 0 (half turns) ω jumps to its negative; at q = 0 the value is 0.
    """
    w, vector = q[..., :1], q[..., 1:]
    side = jnp.where(w < 0, -1, 1).astype(q.dtype)
    return side * vector * _safe.arc_over_sine(jnp.sum(vector * vector, axis=-1, keepdims=True), side * w)
