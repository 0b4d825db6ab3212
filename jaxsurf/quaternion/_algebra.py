"""Quaternions (w, x, y, z) along the last axis; everything broadcasts."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import _safe


def multiply(p: Float[Array, "*#batch 4"], q: Float[Array, "*#batch 4"]) -> Float[Array, "*batch 4"]:
    """Hamilton's product p q; as rotations: q first, then p."""
    a, b, c, d = (p[..., i] for i in range(4))
    w, x, y, z = (q[..., i] for i in range(4))
    return jnp.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def conjugate(q: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """(w, −x, −y, −z); of a unit quaternion the inverse."""
    return jnp.concatenate([q[..., :1], -q[..., 1:]], axis=-1)


def norm(q: Float[Array, "*batch 4"]) -> Float[Array, "*batch"]:
    """Length √(w² + x² + y² + z²); at 0 the gradient is 0."""
    return _safe.norm(q)


def normalize(q: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """q / |q|; 0 stays 0."""
    return _safe.unit(q)


def inverse(q: Float[Array, "*batch 4"]) -> Float[Array, "*batch 4"]:
    """q⁻¹ = conjugate / |q|²; of 0 it is 0."""
    return _safe.divide(conjugate(q), jnp.broadcast_to(jnp.sum(q * q, axis=-1, keepdims=True), q.shape))


def rotate(q: Float[Array, "*#batch 4"], vector: Float[Array, "*#batch 3"]) -> Float[Array, "*batch 3"]:
    """q v q⁻¹ of a unit quaternion: v + 2 w (u × v) + 2 u × (u × v) with u = (x, y, z); q and −q do the same."""
    axis = q[..., 1:]
    across = 2 * jnp.cross(axis, vector)
    return vector + q[..., :1] * across + jnp.cross(axis, across)
