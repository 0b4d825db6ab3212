"""Creases: rows of a surface across which its normal jumps."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, eps, is_concrete
from .._errors import InputError
from .._prepared import prepare
from .._safe import angle as angle_between
from ..differential import partials
from ..edit import ReparametrisedSurface, split
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._network import Network

_SAMPLES = 33  # places in each span along a row


class Creases(eqx.Module):
    """Where a surface is creased: parameters (k,), ascending, and the largest angles along these rows (k,), radians."""

    parameters: Float[Array, "k"]
    angles: Float[Array, "k"]


def creases(surface: Any, angle: float = 1e-3, *, direction: str = "v") -> Creases:
    """Rows v = constant (`direction` "u": u = constant) across which the normal jumps by more than `angle`, radians.

    Looked for at inner breaks, at 33 places in each span along them. A sweep is creased where its guides, made
    of lines and arcs, are C¹ and not C², and its rotation follows their tangents. Of a traced surface all breaks are given.
    Source: Jōnishi, Yajima (paper 000), section 3, figure 5.
    """
    if not isinstance(surface, AbstractSurface):
        raise InputError(f"`surface` must be a surface, got {type(surface).__name__}.")
    if direction not in ("u", "v"):
        raise InputError(f'`direction` must be "u" or "v", got {direction!r}.')
    if not (isinstance(angle, int | float) and angle >= 0):
        raise InputError(f"`angle` must be a number ≥ 0, radians, got {angle!r}.")
    edges = breaks(surface)
    across, along = edges if direction == "u" else edges[::-1]
    known = is_concrete(surface, edges)
    inner = jnp.asarray(concrete(across)[1:-1] if known else across[1:-1], surface.dtype)
    angles = _jumps(surface, inner, jnp.asarray(across, surface.dtype)[jnp.array([0, -1])], along, direction)
    if known:
        kept = np.flatnonzero(concrete(angles) > angle)
        inner, angles = inner[kept], angles[kept]
    return Creases(inner, angles)


def split_at_creases(
    surface: AbstractSurface | Network, angle: float = 1e-3, *, direction: str = "v"
) -> tuple[AbstractSurface, ...]:
    """The parts of a surface between its creases, each smooth up to its edges; together they are the surface.

    Each part has its own part of the domain. Splines are split exactly; of other surfaces a part stops 16 roundings before
    the crease, so that its normals there are its own. Of a network: the parts of all its patches, one after another. Needs
    known data.
    """
    if isinstance(surface, Network):
        return tuple(part for patch in surface.patches for part in split_at_creases(patch, angle, direction=direction))
    if isinstance(surface, AbstractSurface) and not is_concrete(surface):
        raise InputError("`split_at_creases` decides on known values: call it outside of `jit` and `grad`.")
    parts, rest = [], surface
    for place in concrete(creases(surface, angle, direction=direction).parameters):
        before, rest = split(rest, place, direction)
        parts.append(before)
    parts.append(rest)
    return tuple(
        _inside(part, direction, first=k > 0, last=k < len(parts) - 1) if isinstance(part, ReparametrisedSurface) else part
        for k, part in enumerate(parts)
    )


def _inside(part: ReparametrisedSurface, direction: str, *, first: bool, last: bool) -> ReparametrisedSurface:
    """A part whose upper end, if it is a cut, is below the crease: at a break the surface continues on its upper side."""
    name = f"ends_{direction}"
    ends = getattr(part, name)
    ascends = concrete(ends)[0] < concrete(ends)[1]
    if not (last if ascends else first):
        return part
    room = 16 * eps(part.dtype) * float(np.abs(concrete(ends)).max() + np.abs(np.ptp(concrete(ends))))
    return eqx.tree_at(lambda s: getattr(s, name), part, ends.at[int(ascends)].add(-room))


@eqx.filter_jit
def _jumps(
    surface: Any, places: Float[Array, "k"], ends: Float[Array, "2"], along: Any, direction: str
) -> Float[Array, "k"]:
    """The largest angle between normals on both sides of each row."""
    if not places.shape[0]:
        return jnp.zeros_like(places)
    edges = jnp.asarray(along, surface.dtype)
    share = jnp.linspace(0, 1, _SAMPLES, dtype=surface.dtype)
    inside = (edges[:-1, None] + jnp.diff(edges)[:, None] * share[None, :]).reshape(-1)
    room = (1e-9 if eps(surface.dtype) < 1e-10 else 1e-5) * (ends[1] - ends[0])
    ready = prepare(surface)

    def normals(place: Float[Array, ""]) -> Float[Array, "n 3"]:
        there = jnp.full_like(inside, place)
        found = partials(ready, *((there, inside) if direction == "u" else (inside, there)))
        return jnp.cross(found.u, found.v)

    turn = lambda place: jnp.max(angle_between(normals(place - room), normals(place + room)))
    return jax.vmap(turn)(places)
