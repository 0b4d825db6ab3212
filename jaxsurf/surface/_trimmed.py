"""Surfaces of which only a part counts."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._arguments import as_type, early
from .._array import Numbers, as_float, concrete, eps, is_concrete, map_points
from .._errors import InputError
from .._registry import register
from ..curve import BSplineCurve
from ..curve._breaks import breaks
from ..curve._reversed import reversed_spline
from ._abstract import AbstractSurface

_SIDES = 32  # of the polygon that stands for one knot span of a curved loop


@register
class TrimmedSurface(AbstractSurface):
    """A surface and closed loops in its parameter plane: what counts lies in the first, outside the others.

    Domain, points and grids are those of the whole `surface`; `contains` tells which parameters count. loops:
    closed 2-D B-spline curves (degree 1 for polygons), one at least. The first runs counter-clockwise, holes
    clockwise; on concrete data a loop that runs the other way is turned round. Raises `InputError` for loops
    that are not closed 2-D B-splines and, on concrete data, for ends further apart than 1e-9 of the loop's
    size and for loops without area.
    """

    surface: AbstractSurface
    loops: tuple[BSplineCurve, ...]

    def __init__(self, surface: AbstractSurface, loops: Sequence[Any]):
        loops = tuple(loops)
        if not loops:
            raise InputError("`loops` must hold at least the outer loop, got none.")
        self.surface = surface
        self.loops = tuple(_oriented(as_type(loop, surface.dtype), i) for i, loop in enumerate(loops))

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.surface.domain

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.surface.point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.surface.grid_points(u, v)

    def contains(self, u: Numbers, v: Numbers) -> Bool[Array, "*batch"]:
        """Whether parameters, broadcast against each other, count: their winding number is positive.

        Each knot span of a curved loop counts as 32 chords; polygons are exact. Points on an edge count for
        one side.
        """
        edges = _edges(self.loops)
        return map_points(_inside, edges, as_float(u, self.dtype), as_float(v, self.dtype))


@breaks.register(TrimmedSurface)
def _(shape: TrimmedSurface) -> tuple[Any, Any]:
    return breaks(shape.surface)


@eqx.filter_jit
def loop_polygon(loop: BSplineCurve) -> Float[Array, "n 2"]:
    """Points along a loop, both ends included; 32 a knot span, or exactly the corners of degree 1."""
    sides = 1 if loop.degree == 1 else _SIDES
    knots = loop.knots if loop.periodic else loop.knots[loop.degree : loop.control_points.shape[0] + 1]
    fractions = jnp.arange(sides, dtype=loop.dtype) / sides
    parameters = knots[:-1, None] + jnp.diff(knots)[:, None] * fractions[None, :]
    return jax.vmap(loop.point)(jnp.append(parameters.reshape(-1), knots[-1]))


def _edges(loops: tuple[BSplineCurve, ...]) -> tuple[Float[Array, "n 2"], Float[Array, "n 2"]]:
    """Where the sides of all polygons start and end; the last of each ends exactly where the first starts."""
    starts = [loop_polygon(loop)[:-1] for loop in loops]
    ends = [jnp.roll(start, -1, axis=0) for start in starts]
    return jnp.concatenate(starts), jnp.concatenate(ends)


def _inside(edges: tuple[Array, Array], u: Float[Array, ""], v: Float[Array, ""]) -> Bool[Array, ""]:
    """Crossings of the ray to +u, upwards minus downwards (Sunday, Practical Geometry Algorithms, ch. 3)."""
    (x, y), (end_x, end_y) = edges[0].T, edges[1].T
    side = (end_x - x) * (v - y) - (u - x) * (end_y - y)
    up = (y <= v) & (end_y > v) & (side > 0)
    down = (end_y <= v) & (y > v) & (side < 0)
    return jnp.sum(up, dtype=jnp.int32) > jnp.sum(down, dtype=jnp.int32)


def _oriented(loop: Any, index: int) -> BSplineCurve:
    """The loop, turned the right way round; refused if it is none."""
    if not isinstance(loop, BSplineCurve):
        raise InputError(
            f"`loops[{index}]` must be a closed 2-D BSplineCurve, got a {type(loop).__name__}; "
            f"`js.to_bspline` converts curves."
        )
    if loop.control_points.shape[1] != 2:
        raise InputError(f"`loops[{index}]` must have 2-D control points, got shape {loop.control_points.shape}.")
    if not is_concrete(loop):
        return loop
    corners = concrete(early(loop_polygon, loop))
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    gap = float(np.linalg.norm(corners[-1] - corners[0]))
    if gap > max(1e-9, 32 * eps(loop.dtype)) * size:
        raise InputError(f"`loops[{index}]` must be closed, but its ends are {gap:.3g} apart.")
    area = _signed_area(corners)
    if abs(area) <= 32 * eps(loop.dtype) * size**2:
        raise InputError(f"`loops[{index}]` encloses no area; remove it.")
    if (area > 0) == (index == 0):
        return loop
    turned, knots = reversed_spline(loop.control_points, loop.knots, loop.degree, loop.periodic)
    return BSplineCurve(turned, knots, loop.degree, loop.periodic)


def _signed_area(corners: np.ndarray) -> float:
    x, y = (corners - corners[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
