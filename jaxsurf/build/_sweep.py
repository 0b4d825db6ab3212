"""Sweeps: characters carried along guides."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import is_concrete
from .._registry import register
from .._safe import divide
from ..curve import AbstractCurve
from ..curve._breaks import breaks as curve_breaks
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._blend import AbstractBlend
from ._family import Family, PreparedFamily
from ._guides import Guides, Station, carried, join_breaks, with_two_slopes
from ._ribbons import AbstractRibbons, Ends, Pair, ribbons_of
from ._rotation import AbstractRotation


@register
class Sweep(AbstractSurface):
    """S(u, v) = C₁(v) + M(v) (C(u) − anchor), blended for two characters: (1 − φ(v)) S₁ + φ(v) S₂.

    Made by `js.sweep`, which checks what it is given. characters: one or two curves of u, placed where the guides start and,
    the second, where they end, and swept from there; guides: one or two curves of v. u and v run over the domains of the
    first character and of the first guide; those of the second ones follow evenly. M = R, the `rotation`, times what `scale`
    says for two guides: "uniform", by the length of the chord C₂ − C₁; "chord", along the chord only; "none". The anchor is
    C₁ at the start. With two guides it is the character's own first point, and what lacks between its ends to the chord is
    added evenly along it: whatever the control data, both guides are met. ends: where each character is placed, "first" or
    "last". Source: Jōnishi, Yajima (paper 000), (2.1), (2.2).
    """

    characters: tuple[AbstractCurve, ...]
    guides: Guides
    rotation: AbstractRotation
    blend: AbstractBlend
    scale: str = eqx.field(static=True)
    ends: tuple[str, ...] = eqx.field(static=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.characters[0].domain, self.guides.domain

    def prepared(self) -> "PreparedSweep":
        """The sweep with all that does not depend on u and v computed."""
        guides = self.guides.prepared()
        characters = Family(self.characters, self.characters[0].domain).prepared()
        table = self.rotation.table(guides)
        places = jnp.stack([jnp.asarray(guides.domain[0 if end == "first" else 1], self.dtype) for end in self.ends])
        anchors, lasts = (characters.points(jnp.asarray(end, self.dtype)) for end in characters.domain)

        def start(v: Float[Array, ""], anchor: Float[Array, "3"], last: Float[Array, "3"]) -> _Start:
            station = guides.at(v)
            known = self.rotation.known(table, station)
            if len(guides.curves) == 1:
                return _Start(known, station.positions[0], None, jnp.ones((), self.dtype), jnp.zeros(3, self.dtype))
            return _Start(known, anchor, station.chord - (last - anchor), station.chord_length, station.chord_direction)

        return PreparedSweep(self, characters, guides, table, jax.vmap(start)(places, anchors, lasts))

    def renewed(self) -> "Sweep":
        if not is_concrete(self):
            return self
        curves = tuple(curve.renewed() for curve in self.guides.curves)
        characters = tuple(curve.renewed() for curve in self.characters)
        guides = Guides(curves, self.guides.meet)
        return Sweep(characters, guides, self.rotation.renewed(guides), self.blend, self.scale, self.ends)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)


class _Start(eqx.Module):
    """Where a character is placed: what the rotation knows, the anchor, what it lacks to the chord, and the chord there;
    those of all characters stacked."""

    known: Any
    anchor: Float[Array, "3"]
    lacks: Float[Array, "3"] | None
    chord_length: Float[Array, ""]
    chord_direction: Float[Array, "3"]


class _Row(eqx.Module):
    """All that a row of constant v needs: S = origin + Σ matrix (C(u) − anchor)."""

    origin: Float[Array, "3"]
    matrices: Float[Array, "k 3 3"]

    def __call__(self, offsets: Float[Array, "k 3"]) -> Float[Array, "3"]:
        """The point with these offsets of the characters."""
        return self.origin + self.turned(offsets)

    def turned(self, offsets: Float[Array, "k 3"]) -> Float[Array, "3"]:
        """Offsets turned alone."""
        return jnp.sum(self.matrices * offsets[:, None, :], axis=(0, 2))


class PreparedSweep(AbstractSurface):
    """A `Sweep` with its curves prepared and its starts computed."""

    sweep: Sweep
    characters: PreparedFamily
    guides: Guides
    table: Any
    starts: _Start

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.sweep.domain

    def prepared(self) -> "PreparedSweep":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.row(v)(self.offsets(u))

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        rows = jax.vmap(self.row)(v)
        total = jnp.broadcast_to(rows.origin[None], (u.shape[0], *rows.origin.shape))
        offsets = jax.vmap(self.offsets)(u)
        for k in range(offsets.shape[1]):
            # by coordinates: the compiler makes one loop over the points of it
            for i in range(3):
                total = total + offsets[:, k, i, None, None] * rows.matrices[None, :, k, :, i]
        return total

    def offsets(self, u: Float[Array, ""]) -> Float[Array, "k 3"]:
        """C(u) − anchor of each character, its ends on the guides."""
        offsets = self.characters.points(u) - self.starts.anchor
        if self.starts.lacks is None:
            return offsets
        a, b = self.domain[0]
        return offsets + (u - a) / (b - a) * self.starts.lacks

    def row(self, v: Float[Array, ""]) -> _Row:
        """What a row of constant v needs."""
        here = self.guides.at(v)
        origin = here.positions[0]
        matrices = jax.vmap(lambda start: self._matrix(start, here))(self.starts)
        if len(self.sweep.characters) == 2:
            share = self.sweep.blend(self.guides.share(v))
            matrices = jnp.stack([1 - share, share])[:, None, None] * matrices
        return _Row(origin, matrices)

    def _matrix(self, start: _Start, here: Station) -> Float[Array, "3 3"]:
        turn = self.sweep.rotation.matrix(self.table, start.known, here)
        if self.sweep.scale == "none":
            return turn
        ratio = divide(here.chord_length, start.chord_length)
        if self.sweep.scale == "uniform":
            return ratio * turn
        stretched = (ratio - 1) * (turn @ start.chord_direction)
        return turn + stretched[:, None] * start.chord_direction[None, :]


class _SweepRibbons(AbstractRibbons):
    """Rows at both ends of v with two derivatives, and offsets at both ends of u with theirs: known for all shares."""

    sweep: PreparedSweep
    rows: tuple[_Row, _Row, _Row]
    offsets: tuple[Float[Array, "2 k 3"], Float[Array, "2 k 3"], Float[Array, "2 k 3"]]

    def at(self, axis: int, share: Float[Array, ""]) -> Pair:
        if axis == 0:
            row = self.sweep.row(carried(share, (0.0, 1.0), self.sweep.domain[1]))
            return jax.vmap(row)(self.offsets[0]), jax.vmap(row.turned)(self.offsets[1])
        here = self.sweep.offsets(carried(share, (0.0, 1.0), self.sweep.domain[0]))
        points, across = (jax.vmap(lambda row: row(here))(rows) for rows in self.rows[:2])
        return points, across

    def bends(self, axis: int, share: Float[Array, ""]) -> Ends:
        if axis == 0:
            row = self.sweep.row(carried(share, (0.0, 1.0), self.sweep.domain[1]))
            return jax.vmap(row.turned)(self.offsets[2])
        here = self.sweep.offsets(carried(share, (0.0, 1.0), self.sweep.domain[0]))
        return jax.vmap(lambda row: row(here))(self.rows[2])


@ribbons_of.register
def _(surface: PreparedSweep) -> AbstractRibbons:
    ends = jnp.arange(2, dtype=surface.dtype)

    derived = lambda f, domain: jax.vmap(lambda t: with_two_slopes(lambda x: f(carried(x, (0.0, 1.0), domain)), t))(ends)
    return _SweepRibbons(surface, derived(surface.row, surface.domain[1]), derived(surface.offsets, surface.domain[0]))


@breaks.register(Sweep)
def _(shape: Sweep) -> tuple[Any, Any]:
    first, *others = shape.characters
    along_u = curve_breaks(first)
    for other in others:
        along_u = join_breaks(along_u, carried(jnp.asarray(curve_breaks(other)), other.domain, first.domain))
    return along_u, shape.guides.breaks()


@breaks.register(PreparedSweep)
def _(shape: PreparedSweep) -> tuple[Any, Any]:
    return breaks(shape.sweep)
