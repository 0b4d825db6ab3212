"""Guards at singular places; no other file writes them.

Each docstring states the value and the gradient at the singular place.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float


def safe_sqrt(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Square root of x ≥ 0; at x ≤ 0 the value is 0 and the gradient 0."""
    # `lax.select`, here and below: `jnp.where` on the way to every normal is a third of a program
    positive = x > 0
    return lax.select(positive, jnp.sqrt(lax.select(positive, x, jnp.ones_like(x))), jnp.zeros_like(x))


def norm(vector: Float[Array, "... d"], *, keepdims: bool = False) -> Float[Array, "..."]:
    """Euclidean length along the last axis; at the zero vector the value is 0 and the gradient 0."""
    return safe_sqrt(jnp.sum(vector * vector, axis=-1, keepdims=keepdims))


def divide(numerator: Float[Array, "..."], denominator: Float[Array, "..."]) -> Float[Array, "..."]:
    """Quotient; where the denominator is 0 the value is 0 and so are the gradients."""
    good = denominator != 0
    return jnp.where(good, numerator / jnp.where(good, denominator, 1), 0)


@jax.custom_jvp
def unit(vector: Float[Array, "... d"]) -> Float[Array, "... d"]:
    """Unit vector along the last axis; the zero vector stays zero, with gradient 0."""
    return _unit(vector)[0]


@unit.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    # (d − u ⟨u, d⟩) / |v|, half of what comes of deriving the guards one after another
    (vector,), (along,) = primals, tangents
    direction, length, good = _unit(vector)
    turned = along - direction * jnp.sum(direction * along, axis=-1, keepdims=True)
    return direction, turned / length * good


def _unit(vector: Float[Array, "... d"]) -> tuple[Array, Array, Array]:
    """The unit vector, the length or 1, and 1 or 0."""
    square = jnp.sum(vector * vector, axis=-1, keepdims=True)
    positive = square > 0
    length, good = jnp.sqrt(lax.select(positive, square, jnp.ones_like(square))), positive.astype(vector.dtype)
    return vector / length * good, length, good


def arctan2(y: Float[Array, "..."], x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Angle of the point (x, y) in (-π, π]; at the origin the value is 0 and the gradient 0."""
    good = (x != 0) | (y != 0)
    return jnp.where(good, jnp.arctan2(jnp.where(good, y, 0), jnp.where(good, x, 1)), 0)


def angle(a: Float[Array, "... 3"], b: Float[Array, "... 3"]) -> Float[Array, "..."]:
    """Angle between vectors in [0, π], exact for small and large angles; gradient 0 where they are parallel."""
    return arctan2(norm(jnp.cross(a, b)), jnp.sum(a * b, axis=-1))


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def stumpff(k: int, x: Float[Array, "..."]) -> Float[Array, "..."]:
    """c_k(x) = Σ_j (−x)ʲ / (2j + k)! for x ≥ 0, entire functions; every derivative at 0 is right.

    c₀ = cos √x, c₁ = sin(√x) / √x, c₂ = (1 − cos √x) / x and so on, by the series for x < 1. Source: Stumpff,
    Himmelsmechanik I, 1959; c_k' = (k c_{k+2} − c_{k+1}) / 2.
    """
    small = x < 1
    series, root = jnp.where(small, x, 0), jnp.sqrt(jnp.where(small, 1, x))
    near = _horner(series, [(-1) ** j / math.factorial(2 * j + k) for j in range(11)])
    far = jnp.sin(root) / root if k % 2 else jnp.cos(root)
    for lower in range(k % 2, k, 2):
        far = (1 / math.factorial(lower) - far) / jnp.where(small, 1, x)
    return jnp.where(small, near, far)


@stumpff.defjvp
def _(k: int, primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (x,), (along,) = primals, tangents
    slope = -0.5 * stumpff(k + 1, x)
    if k:
        slope = slope + 0.5 * k * stumpff(k + 2, x)
    return stumpff(k, x), along * slope


def arc_over_sine(square: Float[Array, "..."], cosine: Float[Array, "..."]) -> Float[Array, "..."]:
    """θ / s of the angle θ = atan2(s, c) in [0, π], from s² and c; 1 / c at s = 0 with every derivative right.

    By the series of atan(√z)/√z for z = s²/c² < 0.1; a smaller limit costs digits of the 4th derivative beyond it.

    Where s = 0 and c ≤ 0 (a half turn has no axis) the value is finite and means nothing, the gradient 0.
    """
    ratio = divide(square, cosine * cosine)
    near = (cosine > 0) & (ratio < 0.1)
    tangent = jnp.where(near, ratio, 0)
    series = _horner(tangent, [(-1) ** k / (2 * k + 1) for k in range(22)])
    beyond = ~near & (square > 0)
    root = jnp.sqrt(jnp.where(beyond, square, 1))
    arc = jnp.arctan2(root, jnp.where(beyond, cosine, 1)) / root
    return jnp.where(near, series / jnp.where(near, cosine, 1), arc)


def _horner(x: Float[Array, "..."], coefficients: list[float]) -> Float[Array, "..."]:
    total = jnp.full_like(x, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total
