"""How the section of a sweep turns on its way: the kinds R(v), in one table."""

import abc
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_direction, early
from .._array import Numbers, concrete, is_concrete
from .._errors import InputError
from .._registry import register
from .._safe import norm, unit
from ..quaternion import to_matrix
from ._guides import Guides, Station
from ._half_way import half_way, smallest_rotation

SAMPLES = 64
"""Places per smooth span where known guides are looked at."""


class AbstractRotation(eqx.Module):
    """A kind of R(v): how a section turns between a station of the guides and another one.

    `table` and `known` compute, once, what does not depend on v: of the guides and of a start. `matrix` gives R(v), (3, 3),
    orthonormal with det +1, the identity at the station where the section starts. `settled` looks at known guides: it
    refuses those for which the kind is not defined, and chooses static numbers.
    """

    def settled(self, guides: Guides) -> "AbstractRotation":
        """The same kind, made ready for these guides."""
        return self

    def renewed(self, guides: Guides) -> "AbstractRotation":
        """The same kind, made ready for these guides where it was not."""
        return self

    def table(self, guides: Guides) -> Any:
        """What `known` and `matrix` need of the whole guides."""
        return None

    @abc.abstractmethod
    def known(self, table: Any, start: Station) -> Any:
        """What `matrix` needs of the start."""

    @abc.abstractmethod
    def matrix(self, table: Any, known: Any, here: Station) -> Float[Array, "3 3"]:
        """R(v) at a station."""


@register
class Fixed(AbstractRotation):
    """R = I: sections are moved, not turned. Source: paper 000, identity."""

    def known(self, table: Any, start: Station) -> Any:
        return None

    def matrix(self, table: Any, known: Any, here: Station) -> Float[Array, "3 3"]:
        return jnp.eye(3, dtype=here.guides.dtype)


class _SmallestRotation(AbstractRotation):
    """The smallest rotation from a direction at the start to that at v."""

    opposite: bool = eqx.field(static=True, default=True)

    @abc.abstractmethod
    def direction(self, here: Station) -> Float[Array, "3"]:
        """The unit direction that is followed."""

    def settled(self, guides: Guides) -> AbstractRotation:
        if not is_concrete(guides):
            return self
        directions = sampled(guides, self.direction)[1]
        nearest = min(float(np.linalg.norm(directions + directions[end], axis=1).min()) for end in (0, -1))
        return type(self)(opposite=nearest < 0.3)

    def renewed(self, guides: Guides) -> AbstractRotation:
        return self if self.opposite else self.settled(guides)

    def known(self, table: Any, start: Station) -> Any:
        return self.direction(start)

    def matrix(self, table: Any, known: Any, here: Station) -> Float[Array, "3 3"]:
        if not self.opposite:
            return smallest_rotation(known, unit(known + self.direction(here)))
        still = jax.tree.map(lambda leaf: jax.lax.stop_gradient(leaf) if eqx.is_array(leaf) else leaf, here.guides)
        along, frozen = (lambda v, g=g: self.direction(g.at(v)) for g in (here.guides, still))
        return smallest_rotation(known, half_way(known, along, frozen, here.v))


@register
class GuideRotation(_SmallestRotation):
    """The smallest rotation between tangents of one guide. Source: paper 000, Rotation-2."""

    def direction(self, here: Station) -> Float[Array, "3"]:
        return here.tangent


@register
class ChordRotation(_SmallestRotation):
    """The smallest rotation between chords of two guides. Source: paper 000, Rotation-1."""

    def direction(self, here: Station) -> Float[Array, "3"]:
        return here.chord_direction


class FrameRotation(AbstractRotation):
    """F(v) F(start)ᵀ of orthonormal frames along the guides."""

    @abc.abstractmethod
    def frame(self, table: Any, here: Station) -> Float[Array, "3 3"]:
        """The frame at a station, unit vectors in columns."""

    def known(self, table: Any, start: Station) -> Any:
        return self.frame(table, start).T

    def matrix(self, table: Any, known: Any, here: Station) -> Float[Array, "3 3"]:
        return self.frame(table, here) @ known


@register
class ChordGuideRotation(FrameRotation):
    """The frame of chord e and f = unit(T − ⟨T, e⟩e), T = C₁' + C₂', of two guides. Source: paper 000, Rotation-1 and -2."""

    def settled(self, guides: Guides) -> AbstractRotation:
        if is_concrete(guides):
            refuse(guides, lambda s: norm(_across_chord(s)), lambda x: x < 1e-8, "the guides run along their chord", "chord")
        return self

    def frame(self, table: Any, here: Station) -> Float[Array, "3 3"]:
        return _chord_frame(here)


def _across_chord(here: Station) -> Float[Array, "3"]:
    """The part of T = C₁' + C₂' across the chord, in units of T."""
    along = unit(here.velocities[0] + here.velocities[1])
    return along - (along @ here.chord_direction) * here.chord_direction


def _chord_frame(here: Station) -> Float[Array, "3 3"]:
    e, f = here.chord_direction, unit(_across_chord(here))
    return jnp.stack([e, f, jnp.cross(e, f)], axis=1)


@register
class FrenetRotation(FrameRotation):
    """The frame of tangent, principal normal and binormal; not defined at inflections and on straight parts."""

    def settled(self, guides: Guides) -> AbstractRotation:
        if is_concrete(guides):
            refuse(guides, _turning, lambda x: x < 1e-6, "the guide has an inflection or a straight part", "minimal")
            places, binormals = sampled(guides, lambda s: jnp.cross(s.velocities[0], s.acceleration))
            flips = np.flatnonzero(np.sum(binormals[1:] * binormals[:-1], axis=1) < 0)
            if len(flips):
                # C' × C'' is nearly linear between two places, and zero between them
                before, after = np.linalg.norm(binormals[flips[0] : flips[0] + 2], axis=1)
                v = np.interp(before, [0, before + after], places[flips[0] : flips[0] + 2])
                _refuse_at(float(v), "the guide has an inflection", "minimal")
        return self

    def frame(self, table: Any, here: Station) -> Float[Array, "3 3"]:
        t, b = here.tangent, unit(jnp.cross(here.velocities[0], here.acceleration))
        return jnp.stack([t, jnp.cross(b, t), b], axis=1)


def _turning(here: Station) -> Float[Array, ""]:
    """How far the tangent would turn over the whole guide at the present rate, radians."""
    velocity = here.velocities[0]
    a, b = here.guides.domain
    return norm(jnp.cross(velocity, here.acceleration)) / (velocity @ velocity) * (b - a)


@register
class UpRotation(FrameRotation):
    """The frame of the tangent and the direction across it that is level; `up` is upright, (3,), as on a road."""

    up: Float[Array, "3"]

    def __init__(self, up: Numbers = (0.0, 0.0, 1.0)):
        self.up = as_direction(up, "up")

    def settled(self, guides: Guides) -> AbstractRotation:
        if is_concrete(guides, self.up):
            steep = lambda s: norm(jnp.cross(s.tangent, unit(self.up.astype(guides.dtype))))
            refuse(guides, steep, lambda x: x < 1e-4, "the guide runs along `up`", "minimal")
        return self

    def frame(self, table: Any, here: Station) -> Float[Array, "3 3"]:
        t = here.tangent
        side = unit(jnp.cross(t, self.up.astype(t.dtype)))
        return jnp.stack([t, side, jnp.cross(t, side)], axis=1)


@register
class GivenRotation(FrameRotation):
    """Rotations by the caller: `function(v)` gives a rotation matrix (3, 3) or a unit quaternion (4,).

    A function with parameters of its own is best an `equinox.Module`: its arrays are then fitted and derived like others.
    """

    function: Callable[[Any], Any]

    def settled(self, guides: Guides) -> AbstractRotation:
        if not is_concrete(guides, self.function):
            return self
        shape = np.shape(self.function(jnp.asarray(guides.domain[0], guides.dtype)))
        if shape not in ((3, 3), (4,)):
            raise InputError(f"`rotation` must give a matrix (3, 3) or a unit quaternion (4,), got shape {shape}.")
        places, found = sampled(guides, lambda s: self.frame(None, s))
        off = np.abs(np.swapaxes(found, 1, 2) @ found - np.eye(3)).max(axis=(1, 2))
        off = np.maximum(off, np.where(np.linalg.det(found) > 0, 0, 2))
        if off.max() > 1e-6:
            v = places[np.argmax(off > 1e-6)]
            raise InputError(
                f"`rotation` must give rotations, orthonormal with determinant +1, but at v = {v:g} it is off by "
                f"{off.max():.2g}."
            )
        return self

    def frame(self, table: Any, here: Station) -> Float[Array, "3 3"]:
        given = jnp.asarray(self.function(here.v), here.guides.dtype)
        return to_matrix(given) if given.shape == (4,) else given


def places_between(guides: Guides, per_span: int) -> Float[np.ndarray, "n"]:
    """Places inside the smooth spans of known guides, nearly at their ends too."""
    edges = concrete(guides.breaks()).astype(np.float64)
    share = 0.5 - 0.5 * np.cos(math.pi * np.linspace(0, 1, per_span))
    return (edges[:-1, None] + np.diff(edges)[:, None] * (1e-9 + (1 - 2e-9) * share)).ravel()


def sampled(guides: Guides, f: Callable[[Station], Array]) -> tuple[Float[np.ndarray, "n"], np.ndarray]:
    """Places of known guides and values there."""
    places = places_between(guides, SAMPLES)
    return places, _values(guides, f, places)


def _values(guides: Guides, f: Callable[[Station], Array], places: Float[np.ndarray, "n"]) -> np.ndarray:
    found = early(_values_at, guides, f, jnp.asarray(places, guides.dtype))
    return concrete(found).astype(np.float64)


@eqx.filter_jit
def _values_at(guides: Guides, f: Callable[[Station], Array], v: Float[Array, "n"]) -> Array:
    ready = guides.prepared()
    return jax.vmap(lambda t: f(ready.at(t)))(v)


def opposite_places(rotation: AbstractRotation, guides: Guides, ends: tuple[str, ...]) -> tuple[float, float] | None:
    """Of a smallest rotation along known guides: where, and how nearly, it comes to the opposite of a start; radians."""
    if not (isinstance(rotation, _SmallestRotation) and rotation.opposite):
        return None
    places, directions = sampled(guides, rotation.direction)
    found = []
    for end in ends:
        first = directions[0 if end == "first" else -1]
        low, high = places[0], places[-1]
        for _ in range(6):  # nearer and nearer about the nearest place
            inside = np.linspace(low, high, 129)
            missed = np.linalg.norm(_values(guides, rotation.direction, inside) + first, axis=1)
            nearest = int(np.argmin(missed))
            low, high = inside[max(nearest - 1, 0)], inside[min(nearest + 1, 128)]
        found.append((float(inside[nearest]), float(missed[nearest])))
    return min(found, key=lambda pair: pair[1])


def refuse(
    guides: Guides, f: Callable[[Station], Array], bad: Callable[[np.ndarray], np.ndarray], what: str, instead: str
) -> None:
    """Refuse guides where a value is bad, with the parameter and what to take instead."""
    places, values = sampled(guides, f)
    wrong = bad(values) | ~np.isfinite(values)
    if wrong.any():
        _refuse_at(float(places[np.argmax(wrong)]), what, instead)


def _refuse_at(v: float, what: str, instead: str) -> None:
    raise InputError(f'`rotation` is not defined at v = {v:.6g}, where {what}; take rotation="{instead}".')
