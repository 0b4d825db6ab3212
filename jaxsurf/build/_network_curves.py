"""Curves of a network: pieces of them between nodes, and curves of one structure stacked."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._prepared import prepare
from .._registry import register
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._alike import kinds_of, row_of, stack
from ._blend import Smoothstep

_FADE = Smoothstep(2)  # flat to second order at nodes: tangents and curvatures of the curves stay there


@register
class NetworkEdge(AbstractCurve):
    """A part of a curve, moved so that it passes through nodes; on [0, 1].

    X(w) = curve(t) + δ(t), t = (1 − w) ends[0] + w ends[1]. δ takes `offsets` (n, 3) at the parameters `places` (n,),
    ascending, and goes from one to the next by the quintic smoothstep, so that the tangent and the curvature at nodes are
    those of the curve. ends: (2,), descending ones reverse. closed: t may run beyond the curve's end, on to its start.
    """

    curve: AbstractCurve
    places: Float[Array, "n"]
    offsets: Float[Array, "n 3"]
    ends: Float[Array, "2"]
    closed: bool = eqx.field(static=True, default=False)

    @property
    def domain(self) -> tuple[Any, Any]:
        return 0.0, 1.0

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        t = (1 - u) * self.ends[0] + u * self.ends[1]
        shares = jnp.clip((t - self.places[:-1]) / jnp.diff(self.places), 0, 1)
        steps = jnp.diff(self.offsets, axis=0)
        return self.curve.point(wrapped(self.curve, t, self.closed)) + self.offsets[0] + _FADE(shares) @ steps


def wrapped(curve: AbstractCurve, t: Float[Array, ""], closed: bool) -> Float[Array, ""]:
    """A parameter brought back into the domain of a closed curve."""
    if not closed:
        return t
    a, b = (jnp.asarray(end, t.dtype) for end in curve.domain)
    return jnp.where(t > b, t - (b - a), jnp.where(t < a, t + (b - a), t))


@breaks.register(NetworkEdge)
def _(shape: NetworkEdge) -> Any:
    inside = jnp.asarray(breaks(shape.curve), shape.dtype)
    if shape.closed:
        inside = jnp.concatenate([inside, inside[1:] + (inside[-1] - inside[0])])
    places = (jnp.concatenate([inside, shape.places]) - shape.ends[0]) / (shape.ends[1] - shape.ends[0])
    places = jnp.sort(jnp.clip(places, 0, 1)).at[0].set(0).at[-1].set(1)
    if not is_concrete(places):
        return places
    known = np.unique(concrete(places))
    # a cut near a knot leaves no span of the size of a rounding; the last place is the end itself
    apart = np.append(np.diff(known) > 1e-12, True)
    apart[0] = True
    return known[apart]


class Group(NamedTuple):
    """Curves of one structure: all their arrays stacked in front, and their numbers."""

    stacked: Any
    members: tuple[int, ...]


class Stacks(NamedTuple):
    """Curves sorted by structure: groups, and for each curve its group and its row there."""

    groups: tuple[Group, ...]
    group_of: tuple[int, ...]
    row_of: tuple[int, ...]

    def curve(self, group: int, row: Any) -> Any:
        """One curve; the row may be traced."""
        return row_of(self.groups[group].stacked, row)


def structures(curves: Sequence[AbstractCurve], flags: Sequence[Any]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """For each curve the number of its structure (shapes of arrays, all that is static, its flag), and its row in it."""
    return _places(kinds_of(curves, flags))


def stacked(curves: Sequence[AbstractCurve], flags: Sequence[Any], *, ready: bool = True) -> Stacks:
    """Curves stacked by structure, each one prepared if it is to be `ready`."""
    groups, kinds = [], kinds_of(curves, flags)
    for members in kinds:
        together = stack([curves[i] for i in members])
        groups.append(Group(eqx.filter_vmap(prepare)(together) if ready else together, tuple(members)))
    return Stacks(tuple(groups), *_places(kinds))


def _places(kinds: list[list[int]]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """For each curve the number of its kind, and its row in it."""
    places = {i: (number, row) for number, members in enumerate(kinds) for row, i in enumerate(members)}
    group_of, row_of = zip(*(places[i] for i in range(len(places))), strict=True)
    return group_of, row_of
