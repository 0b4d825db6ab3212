"""Guards at singular places; no other file writes them.

Each docstring states the value and the gradient at the singular place.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def safe_sqrt(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Square root of x ≥ 0; at x ≤ 0 the value is 0 and the gradient 0."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1)), 0)


def norm(vector: Float[Array, "... d"], *, keepdims: bool = False) -> Float[Array, "..."]:
    """Euclidean length along the last axis; at the zero vector the value is 0 and the gradient 0."""
    return safe_sqrt(jnp.sum(vector * vector, axis=-1, keepdims=keepdims))


def divide(numerator: Float[Array, "..."], denominator: Float[Array, "..."]) -> Float[Array, "..."]:
    """Quotient; where the denominator is 0 the value is 0 and so are the gradients."""
    good = denominator != 0
    return jnp.where(good, numerator / jnp.where(good, denominator, 1), 0)


def unit(vector: Float[Array, "... d"]) -> Float[Array, "... d"]:
    """Unit vector along the last axis; the zero vector stays zero, with gradient 0."""
    return divide(vector, norm(vector, keepdims=True))


def arctan2(y: Float[Array, "..."], x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Angle of the point (x, y) in (-π, π]; at the origin the value is 0 and the gradient 0."""
    good = (x != 0) | (y != 0)
    return jnp.where(good, jnp.arctan2(jnp.where(good, y, 0), jnp.where(good, x, 1)), 0)


def angle(a: Float[Array, "... 3"], b: Float[Array, "... 3"]) -> Float[Array, "..."]:
    """Angle between vectors in [0, π], exact for small and large angles; gradient 0 where they are parallel."""
    return arctan2(norm(jnp.cross(a, b)), jnp.sum(a * b, axis=-1))
