"""Quaternion integral shapes moved, run backwards, split and put on other domains, where they stay what they are."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, concrete, eps, is_concrete
from ..curve import AbstractCurve, QICurve
from ..surface import AbstractSurface, QISurface
from ._mapped import apply_affine, as_affine
from ._parameters import _reparametrise, _reverse, _split
from ._reparametrised import affine
from ._transform import transform


@transform.register
def _(shape: QICurve, matrix: Numbers, offset: Numbers) -> AbstractCurve:
    """A similarity keeps great arcs: the control tangents turn, the length is scaled. Other maps are wrapped around."""
    similar = _similarity(matrix, offset, shape.dtype)
    if similar is None:
        return transform.dispatch(AbstractCurve)(shape, matrix, offset)
    return _moved_curve(shape, *similar)


@transform.register
def _(shape: QISurface, matrix: Numbers, offset: Numbers) -> AbstractSurface:
    similar = _similarity(matrix, offset, shape.dtype)
    if similar is None:
        return transform.dispatch(AbstractSurface)(shape, matrix, offset)
    matrix, _, factor = similar
    tangents = jnp.matmul(shape.tangents, matrix.T, precision="highest")
    return shape.replace(spine=_moved_curve(shape.spine, *similar), tangents=tangents, lengths=factor * shape.lengths)


@_reparametrise.register
def _(shape: QICurve, intervals: list[Array]) -> QICurve:
    return shape.replace(knots=affine(shape.knots, _ends(shape.domain), intervals[0]))


@_reparametrise.register
def _(shape: QISurface, intervals: list[Array]) -> QISurface:
    u, v = (_ends(pair) for pair in shape.domain)
    knots_v = affine(shape.knots_v, v, intervals[1])
    spine = shape.spine.replace(knots=affine(shape.spine.knots, v, intervals[1]))
    return shape.replace(knots_u=affine(shape.knots_u, u, intervals[0]), knots_v=knots_v, spine=spine)


@_reverse.register
def _(shape: QICurve, direction: None) -> AbstractCurve:
    """Of degree 1 the turns are made one at a time, in either order; of higher degrees the reverse is no QI curve."""
    if shape.degree > 1:
        return _reverse.dispatch(AbstractCurve)(shape, direction)
    a, b = shape.domain
    knots = ((a + b) - shape.knots)[::-1]
    return shape.replace(start=shape(b), tangents=-shape.tangents[::-1], knots=knots)


@_split.register
def _(shape: QICurve, at: Float[Array, ""], direction: None) -> tuple[Any, Any]:
    if shape.degree > 1 or not is_concrete(shape.knots, at):
        return _split.dispatch(AbstractCurve)(shape, at, direction)
    knots, cut = concrete(shape.knots), float(at)
    before, after = int(np.sum(knots[1:-1] < cut)), int(np.sum(knots[1:-1] <= cut))
    tangent = shape.tangent(at)[None]
    doubled = np.full(2, cut, knots.dtype)
    (a, _), length = shape.domain, shape.speed
    left = shape.replace(
        length=length * (at - a),
        tangents=jnp.concatenate([shape.tangents[:before], tangent]),
        knots=np.concatenate([knots[: before + 1], doubled]),
    )
    right = shape.replace(
        start=shape(at),
        length=shape.length - left.length,
        tangents=jnp.concatenate([tangent, shape.tangents[after:]]),
        knots=np.concatenate([doubled, knots[after + 1 :]]),
    )
    return left, right


def _moved_curve(shape: QICurve, matrix: Array, offset: Array, factor: Array) -> QICurve:
    tangents = jnp.matmul(shape.tangents, matrix.T, precision="highest")
    start = apply_affine(matrix, offset, shape.start)
    return shape.replace(start=start, length=factor * shape.length, tangents=tangents)


def _similarity(matrix: Numbers, offset: Numbers, dtype: Any) -> tuple[Array, Array, Array] | None:
    """Matrix, offset and factor of a map known to keep all angles, else None."""
    matrix, offset = as_affine(matrix, offset, dtype)
    if matrix.shape != (3, 3) or not is_concrete(matrix):
        return None
    values = concrete(matrix).astype(np.float64)
    square = values.T @ values
    factor = np.sqrt(np.trace(square) / 3)
    if not factor > 0 or np.max(np.abs(square - factor**2 * np.eye(3))) > 64 * eps(dtype) * factor**2:
        return None
    return matrix, offset, jnp.asarray(factor, dtype)


def _ends(domain: tuple[Any, Any]) -> Float[Array, "2"]:
    return jnp.stack([jnp.asarray(end) for end in domain])
