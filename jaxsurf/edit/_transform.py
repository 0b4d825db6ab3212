"""Moving shapes in space: every curve and every surface."""

import functools
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._arguments import as_direction, as_number, as_vector
from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._safe import unit
from ..curve import AbstractCurve, BSplineCurve, CompositeCurve, Line, NURBSCurve
from ..surface import AbstractSurface, BSplineSurface, NURBSSurface, TrimmedSurface
from ._mapped import MappedCurve, MappedSurface, apply_affine, as_affine


def translate(shape: Any, offset: Numbers) -> Any:
    """The shape moved by `offset`, (3,), or (2,) for a curve in a parameter plane."""
    offset = _vector(shape, offset, "offset")
    return transform(shape, jnp.eye(offset.shape[0], dtype=offset.dtype), offset)


def rotate(shape: Any, axis: Numbers, angle: Numbers, center: Numbers = (0.0, 0.0, 0.0)) -> Any:
    """The shape turned by `angle` radians, right-handed about the line through `center` along `axis`.

    center, axis: (3,). R = I + sin(angle) K + (1 - cos(angle)) K², K p = n × p, n the unit vector of `axis`
    (Rodrigues).
    """
    _check_in_space(shape, "rotate")
    dtype = shape.dtype
    n = unit(as_direction(axis, "axis", dtype))
    turned = as_number(angle, "angle", dtype)
    one = jnp.eye(3, dtype=dtype)
    once = jnp.cross(n[None, :], one).T
    twice = n[:, None] * n[None, :] - one
    matrix = one + jnp.sin(turned) * once + 2 * jnp.sin(turned / 2) ** 2 * twice
    return _about(shape, matrix, as_vector(center, "center", dtype))


def scale(shape: Any, factor: Numbers, center: Numbers | None = None) -> Any:
    """The shape enlarged from `center` (default: the origin) by `factor`, one number or one per coordinate.

    None may be 0. A negative product of the three factors, as in a reflection, reverses the side of the
    normal.
    """
    size, dtype = _dimension(shape), shape.dtype
    factors = as_float(factor, dtype)
    factors = jnp.full(size, factors) if factors.ndim == 0 else as_vector(factors, "factor", sizes=(size,))
    if is_concrete(factors) and not concrete(factors).all():
        raise InputError(f"`factor` must not be 0, got {concrete(factors).tolist()}.")
    center = jnp.zeros(size, dtype) if center is None else _vector(shape, center, "center")
    return _about(shape, jnp.diag(factors), center)


def mirror(shape: Any, point: Numbers, normal: Numbers) -> Any:
    """The mirror image in the plane through `point` with `normal`, both (3,); p - 2 ⟨p - point, n⟩ n.

    Parameters stay, so that S_u × S_v of the image is the opposite of the image of S_u × S_v: a normal that
    pointed outward points inward. `js.reverse(image, "u")` turns it back.
    """
    _check_in_space(shape, "mirror")
    n = unit(as_direction(normal, "normal", shape.dtype))
    matrix = jnp.eye(3, dtype=shape.dtype) - 2 * n[:, None] * n[None, :]
    return _about(shape, matrix, as_vector(point, "point", shape.dtype))


@functools.singledispatch
def transform(shape: Any, matrix: Numbers, offset: Numbers) -> Any:
    """The shape under the affine map p → matrix · p + offset, with the same parameters.

    matrix: (3, 3), offset: (3,); for curves in a parameter plane (2, 2) and (2,). B-splines, NURBS and lines
    stay what they are, composite curves and trimmed surfaces in their parts; any other shape becomes a
    `MappedCurve` or a `MappedSurface` around itself. A matrix with a negative determinant reverses the side
    of the normal.
    """
    raise TypeError(f"transform is not defined for {type(shape).__name__}.")


@transform.register(AbstractCurve)
def _(shape: AbstractCurve, matrix: Numbers, offset: Numbers) -> AbstractCurve:
    return MappedCurve(shape, *_affine(shape, matrix, offset))


@transform.register(AbstractSurface)
def _(shape: AbstractSurface, matrix: Numbers, offset: Numbers) -> AbstractSurface:
    return MappedSurface(shape, *_affine(shape, matrix, offset))


@transform.register(MappedCurve)
def _(shape: MappedCurve, matrix: Numbers, offset: Numbers) -> MappedCurve:
    matrix, offset = _affine(shape, matrix, offset)
    return MappedCurve(shape.curve, _product(matrix, shape.matrix), apply_affine(matrix, offset, shape.offset))


@transform.register(MappedSurface)
def _(shape: MappedSurface, matrix: Numbers, offset: Numbers) -> MappedSurface:
    matrix, offset = _affine(shape, matrix, offset)
    return MappedSurface(shape.surface, _product(matrix, shape.matrix), apply_affine(matrix, offset, shape.offset))


@transform.register(BSplineCurve)
@transform.register(NURBSCurve)
@transform.register(BSplineSurface)
@transform.register(NURBSSurface)
def _(shape: Any, matrix: Numbers, offset: Numbers) -> Any:
    moved = apply_affine(*_affine(shape, matrix, offset), shape.control_points)
    return eqx.tree_at(lambda s: s.control_points, shape, moved)


@transform.register(Line)
def _(shape: Line, matrix: Numbers, offset: Numbers) -> Line:
    affine = _affine(shape, matrix, offset)
    return Line(apply_affine(*affine, shape.start), apply_affine(*affine, shape.end))


@transform.register(CompositeCurve)
def _(shape: CompositeCurve, matrix: Numbers, offset: Numbers) -> CompositeCurve:
    return with_pieces(shape, tuple(transform(piece, matrix, offset) for piece in shape.pieces))


@transform.register(TrimmedSurface)
def _(shape: TrimmedSurface, matrix: Numbers, offset: Numbers) -> TrimmedSurface:
    return eqx.tree_at(lambda s: s.surface, shape, transform(shape.surface, matrix, offset))


def with_pieces(shape: CompositeCurve, pieces: tuple[AbstractCurve, ...]) -> CompositeCurve:
    """A composite curve of other pieces that meet as well as the old ones did, within whatever tolerance."""
    return eqx.tree_at(lambda s: s.pieces, shape, pieces)


def _affine(shape: Any, matrix: Numbers, offset: Numbers) -> tuple[Float[Array, "d d"], Float[Array, "d"]]:
    matrix, offset = as_affine(matrix, offset, shape.dtype)
    if offset.shape[0] != _dimension(shape):
        raise InputError(
            f"`matrix` and `offset` must have dimension {_dimension(shape)}, that of the shape, got {offset.shape[0]}."
        )
    return matrix, offset


def _about(shape: Any, matrix: Float[Array, "d d"], center: Float[Array, "d"]) -> Any:
    """The linear map about a point that stays."""
    return transform(shape, matrix, center - _product(matrix, center))


def _product(a: Float[Array, "d d"], b: Float[Array, "d *e"]) -> Float[Array, "d *e"]:
    return jnp.matmul(a, b, precision="highest")


def _dimension(shape: Any) -> int:
    if isinstance(shape, AbstractSurface):
        return 3
    if isinstance(shape, AbstractCurve):
        return eqx.filter_eval_shape(shape.point, jnp.zeros((), shape.dtype)).shape[0]
    raise TypeError(f"transform is not defined for {type(shape).__name__}.")


def _check_in_space(shape: Any, function: str) -> None:
    if _dimension(shape) != 3:
        raise InputError(f"`{function}` works in space; for a curve in a parameter plane use `transform`.")


def _vector(shape: Any, values: Numbers, name: str) -> Float[Array, "d"]:
    sizes = (_dimension(shape),)
    return as_vector(values, name, shape.dtype, sizes=sizes)
