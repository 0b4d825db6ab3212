"""A surface over the unit square, and what its sides know."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..surface import AbstractSurface
from ._guides import carried, value_and_slope

Point = Float[Array, "3"]
Share = Float[Array, ""]


class Square:
    """S over shares (s, t) in [0, 1]², inside traced code: points, and derivatives along and across sides."""

    def __init__(self, surface: AbstractSurface):
        self.surface = surface

    def __call__(self, s: Share, t: Share) -> Point:
        along_u, along_v = self.surface.domain
        return self.surface.point(carried(s, (0.0, 1.0), along_u), carried(t, (0.0, 1.0), along_v))

    def on_side(self, axis: int, end: int, share: Share) -> tuple[Point, Point, Point]:
        """The point on side s = end (axis 0) or t = end (axis 1) at a share along it, and the derivatives along and across
        it."""
        fixed = jnp.asarray(float(end), share.dtype)

        def both(x: Share, y: Share) -> Point:
            return self(x, y) if axis == 0 else self(y, x)

        point, across = value_and_slope(lambda x: both(x, share), fixed)
        along = value_and_slope(lambda y: both(fixed, y), share)[1]
        return point, along, across

    def corner(self, i: int, j: int, dtype: Any) -> tuple[Point, Point, Point]:
        """f_s, f_t and f_st at a corner."""
        s, t = (jnp.asarray(float(k), dtype) for k in (i, j))
        along_s: Callable[[Share], Point] = lambda y: value_and_slope(lambda x: self(x, y), s)[1]
        first, mixed = value_and_slope(along_s, t)
        return first, value_and_slope(lambda y: self(s, y), t)[1], mixed


def hermite_weight(end: int, x: Any) -> Any:
    """The cubic with slope 1 at this end, and with value 0 at both ends and slope 0 at the other one."""
    return x * (1 - x) ** 2 if end == 0 else x * x * (x - 1)
