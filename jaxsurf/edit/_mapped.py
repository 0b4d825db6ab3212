"""Any shape under an affine map of space."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float
from .._errors import InputError
from .._registry import register
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ..surface import AbstractSurface


@register
class MappedCurve(AbstractCurve):
    """C(u) = matrix · curve(u) + offset, on the domain of `curve`; matrix: (d, d), offset: (d,)."""

    curve: AbstractCurve
    matrix: Float[Array, "d d"]
    offset: Float[Array, "d"]

    def __init__(self, curve: AbstractCurve, matrix: Numbers, offset: Numbers):
        self.curve = curve
        self.matrix, self.offset = as_affine(matrix, offset, curve.dtype)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.curve.domain

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return apply_affine(self.matrix, self.offset, self.curve.point(u))


@register
class MappedSurface(AbstractSurface):
    """S(u, v) = matrix · surface(u, v) + offset, on the domain of `surface`; matrix: (3, 3), offset: (3,)."""

    surface: AbstractSurface
    matrix: Float[Array, "3 3"]
    offset: Float[Array, "3"]

    def __init__(self, surface: AbstractSurface, matrix: Numbers, offset: Numbers):
        self.surface = surface
        self.matrix, self.offset = as_affine(matrix, offset, surface.dtype)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.surface.domain

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return apply_affine(self.matrix, self.offset, self.surface.point(u, v))

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return apply_affine(self.matrix, self.offset, self.surface.grid_points(u, v))


@breaks.register(MappedCurve)
def _(shape: MappedCurve) -> Any:
    return breaks(shape.curve)


@breaks.register(MappedSurface)
def _(shape: MappedSurface) -> tuple[Any, Any]:
    return breaks(shape.surface)


def apply_affine(
    matrix: Float[Array, "d d"], offset: Float[Array, "d"], points: Float[Array, "*n d"]
) -> Float[Array, "*n d"]:
    """matrix · p + offset for points of any batch shape."""
    turned = jnp.matmul(points, matrix.T, precision="highest")
    return turned + jnp.broadcast_to(offset, turned.shape)


def as_affine(matrix: Numbers, offset: Numbers, dtype: Any) -> tuple[Float[Array, "d d"], Float[Array, "d"]]:
    """Convert a matrix and an offset of one dimension, 2 or 3."""
    matrix, offset = as_float(matrix, dtype), as_float(offset, dtype)
    size = matrix.shape[0] if matrix.ndim else 0
    if size not in (2, 3) or matrix.shape != (size, size) or offset.shape != (size,):
        raise InputError(f"`matrix` and `offset` must have shapes (3, 3) and (3,), got {matrix.shape} and {offset.shape}.")
    return matrix, offset
