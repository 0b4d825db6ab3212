"""Frames that turn about the guide as little as can be."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._errors import InputError
from .._frame import perpendicular
from .._registry import register
from .._safe import arctan2, divide, norm, unit
from ._guides import Guides, Station
from ._rotation import AbstractRotation, FrameRotation

_TRACED_STEPS = 64
_MOST_STEPS = 2048


class _Table(NamedTuple):
    """Places, points, tangents and sides along a guide, and the angle that a closed guide gives back over its length."""

    places: Float[Array, "n"]
    points: Float[Array, "n 3"]
    tangents: Float[Array, "n 3"]
    sides: Float[Array, "n 3"]
    excess: Float[Array, ""]


@register
class RotationMinimising(FrameRotation):
    """The rotation-minimising frame of one guide: no turning about the tangent, and so no twist of the section.

    steps: per smooth span of the guide, or None for as many as it takes to have angles right to `tolerance`, radians, on
    known guides. The error falls with the fourth power of their number. On a closed guide (it ends where it starts, with the
    same tangent) the angle by which the frame misses itself is given back evenly, so that the sweep closes.
    Source: Wang, Jüttler, Zheng, Liu, Computation of rotation minimizing frames, 2008 (double reflection).
    """

    steps: int | None = eqx.field(static=True, default=None)
    tolerance: float = eqx.field(static=True, default=1e-9)
    ready_steps: int = eqx.field(static=True, default=_TRACED_STEPS)
    closed: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if self.steps is not None and (int(self.steps) != self.steps or self.steps < 1):
            raise InputError(f"`steps` must be a whole number ≥ 1, or None, got {self.steps!r}.")
        if not self.tolerance > 0:
            raise InputError(f"`tolerance` must be a number > 0, got {self.tolerance!r}.")

    def settled(self, guides: Guides) -> "RotationMinimising":
        if not is_concrete(guides):
            return self if self.steps is None else self._with(self.steps, self.closed)
        closed = _is_closed(guides)
        if self.steps is not None:
            return self._with(self.steps, closed)
        steps = 16
        before = concrete(_table(guides, steps, closed).sides)
        while steps < _MOST_STEPS:
            finer = concrete(_table(guides, 2 * steps, closed).sides)
            # the finer one is off by a fifteenth of the difference
            off = np.abs(finer[::2] - before).max() / 15
            steps, before = 2 * steps, finer
            if off < self.tolerance:
                break
        return self._with(steps, closed)

    def renewed(self, guides: Guides) -> AbstractRotation:
        found = self.settled(guides)
        enough = found.ready_steps <= self.ready_steps and found.closed == self.closed
        return self if enough else found

    def _with(self, steps: int, closed: bool) -> "RotationMinimising":
        return RotationMinimising(self.steps, self.tolerance, steps, closed)

    def table(self, guides: Guides) -> Any:
        return _table(guides, self.ready_steps, self.closed)

    def frame(self, table: Any, here: Station) -> Float[Array, "3 3"]:
        """One step from a place of the table: the farther one of the two about v, so that the step is never zero."""
        places = table.places
        index = jnp.clip(jnp.searchsorted(places, here.v, side="right") - 1, 0, places.shape[0] - 2)
        low, high = places[index], places[index + 1]
        index = jnp.where(here.v - low > high - here.v, index, index + 1)
        point, t = here.positions[0], here.tangent
        side = _reflected_twice(table.points[index], table.tangents[index], table.sides[index], point, t)
        angle = table.excess * here.guides.share(here.v)
        side = jnp.cos(angle) * side + jnp.sin(angle) * jnp.cross(t, side)
        return jnp.stack([t, side, jnp.cross(t, side)], axis=1)


@eqx.filter_jit
def _table(guides: Guides, steps: int, closed: bool) -> _Table:
    edges = jnp.asarray(guides.breaks(), guides.dtype)
    share = jnp.arange(steps, dtype=guides.dtype) / steps
    places = jnp.append((edges[:-1, None] + jnp.diff(edges)[:, None] * share[None, :]).reshape(-1), edges[-1])
    points, tangents = jax.vmap(lambda v: (guides.at(v).positions[0], guides.at(v).tangent))(places)

    def step(side: Array, rows: Any) -> tuple[Array, Array]:
        after = _reflected_twice(rows[0], rows[1], side, rows[2], rows[3])
        return after, after

    first = perpendicular(tangents[0])
    rest = jax.lax.scan(step, first, (points[:-1], tangents[:-1], points[1:], tangents[1:]))[1]
    sides = jnp.concatenate([first[None], rest])
    excess = jnp.zeros((), guides.dtype)
    if closed:
        excess = arctan2(jnp.cross(sides[-1], first) @ tangents[0], sides[-1] @ first)
    return _Table(places, points, tangents, sides, excess)


def _reflected_twice(
    point: Float[Array, "3"],
    tangent: Float[Array, "3"],
    side: Float[Array, "3"],
    to: Float[Array, "3"],
    onto: Float[Array, "3"],
) -> Float[Array, "3"]:
    """The side carried from one point with its tangent to another: reflected so that the points meet, then the tangents."""
    step = to - point
    reflected, carried = _reflected(side, step), _reflected(tangent, step)
    turned = _reflected(reflected, onto - carried)
    return unit(turned - (turned @ onto) * onto)


def _reflected(vector: Float[Array, "3"], normal: Float[Array, "3"]) -> Float[Array, "3"]:
    return vector - 2 * divide(vector @ normal, normal @ normal) * normal


def _is_closed(guides: Guides) -> bool:
    a, b = (jnp.asarray(end, guides.dtype) for end in guides.domain)
    first, middle, last = (guides.at(v) for v in (a, (a + b) / 2, b))
    size = norm(middle.positions[0] - first.positions[0])
    meets = norm(last.positions[0] - first.positions[0]) < 1e-7 * size
    return bool(meets & (norm(last.tangent - first.tangent) < 1e-6))
