"""Rotations: between directions, between orientations, as matrices."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from .. import _safe
from ._algebra import conjugate, multiply, normalize
from ._exponential import exp, log


def half_rotation(start: Float[Array, "*#batch 3"], end: Float[Array, "*#batch 3"]) -> Float[Array, "*batch 3"]:
    """ω = ½ atan2(|a × b|, ⟨a, b⟩) unit(a × b): exp(ω) turns direction a to direction b on the great circle.

    start, end: of any length > 0. Opposite directions have no such rotation: there ω is finite and means nothing. Source:
    paper 004, (5), with atan2 for the arcsin, which holds to 90° only.
    """
    a, b = jnp.broadcast_arrays(start, end)
    across = jnp.cross(a, b)
    square, cosine = jnp.sum(across * across, axis=-1, keepdims=True), jnp.sum(a * b, axis=-1, keepdims=True)
    return 0.5 * across * _safe.arc_over_sine(square, cosine)


def minimal_rotation(start: Float[Array, "*#batch 3"], end: Float[Array, "*#batch 3"]) -> Float[Array, "*batch 4"]:
    """The unit quaternion of the smallest rotation that turns direction `start` to direction `end`."""
    return exp(half_rotation(start, end))


@jax.custom_jvp
def turn(half: Float[Array, "*#batch 3"], vector: Float[Array, "*#batch 3"]) -> Float[Array, "*batch 3"]:
    """exp(ω) v exp(ω)⁻¹ by Rodrigues' formula, of the half rotation vector ω.

    With φ = 2ω: v cos φ + (φ × v) sin φ / φ + φ ⟨φ, v⟩ (1 − cos φ) / φ².
    """
    full = 2 * half
    return _mixed(full, vector, 0)


@partial(turn.defjvp, symbolic_zeros=True)
def _(primals: tuple[Array, Array], tangents: tuple[Any, Any]) -> tuple[Array, Array]:
    """The turned vector moves with its own change, turned, and about J dφ, J the left Jacobian of the rotations."""
    half, vector = primals
    by_half, by_vector = tangents
    turned = turn(half, vector)
    moved = jnp.zeros_like(turned) if isinstance(by_vector, SymbolicZero) else turn(half, by_vector)
    if not isinstance(by_half, SymbolicZero):
        moved = moved + jnp.cross(_mixed(2 * half, 2 * by_half, 1), turned)
    return turned, moved


def _mixed(full: Float[Array, "*#batch 3"], vector: Float[Array, "*#batch 3"], k: int) -> Float[Array, "*batch 3"]:
    """c_k v + c_{k+1} φ × v + c_{k+2} φ ⟨φ, v⟩, Stumpff's functions of |φ|²: for k = 0 v turned, for k = 1 J v."""
    square = jnp.sum(full * full, axis=-1, keepdims=True)
    along = jnp.sum(full * vector, axis=-1, keepdims=True)
    c = [_safe.stumpff(k + i, square) for i in range(3)]
    return c[0] * vector + c[1] * jnp.cross(full, vector) + c[2] * along * full


def slerp(
    start: Float[Array, "*#batch 4"], end: Float[Array, "*#batch 4"], t: Float[Array, "*#batch"]
) -> Float[Array, "*batch 4"]:
    """The orientation at share t of the great arc from one unit quaternion to another, the shorter way round."""
    step = log(multiply(end, conjugate(start)))
    return multiply(exp(t[..., None] * step), start)


def to_matrix(q: Float[Array, "*batch 4"]) -> Float[Array, "*batch 3 3"]:
    """The rotation matrix of a unit quaternion."""
    w, x, y, z = (q[..., i] for i in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def from_matrix(matrix: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 4"]:
    """The unit quaternion of a rotation matrix, w ≥ 0; of four formulas the best conditioned one.

    Source: Shepperd, Quaternion from rotation matrix, 1978.
    """
    m = [[matrix[..., i, j] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    skew = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1])
    candidates = [jnp.stack([1 + trace, *skew], axis=-1)]
    for i in range(3):
        row = [m[i][j] + m[j][i] if i != j else 1 + 2 * m[i][i] - trace for j in range(3)]
        candidates.append(jnp.stack([skew[i], *row], axis=-1))
    sizes = jnp.stack([trace, m[0][0], m[1][1], m[2][2]], axis=-1)
    best = jnp.argmax(sizes, axis=-1)[..., None, None]
    chosen = jnp.take_along_axis(jnp.stack(candidates, axis=-2), best, axis=-2)[..., 0, :]
    q = normalize(chosen)
    return jnp.where(q[..., :1] < 0, -q, q)
