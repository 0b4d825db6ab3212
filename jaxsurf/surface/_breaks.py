"""Breaks of surfaces, a pair of arrays (u, v)."""

from typing import Any

from ..curve._breaks import breaks, even_breaks, knot_breaks
from ._abstract import AbstractSurface
from ._bspline import BSplineSurface


@breaks.register(AbstractSurface)
def _(shape: AbstractSurface) -> tuple[Any, Any]:
    along_u, along_v = shape.domain
    return even_breaks(along_u, shape.dtype), even_breaks(along_v, shape.dtype)


@breaks.register(BSplineSurface)
def _(shape: BSplineSurface) -> tuple[Any, Any]:
    return knot_breaks(shape.basis_u), knot_breaks(shape.basis_v)
