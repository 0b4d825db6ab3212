"""The rims of faces: sides of surfaces and pieces of trimming loops, as curves in space."""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, eps
from .._errors import InputError
from .._prepared import prepare
from ..curve import AbstractCurve, BSplineCurve
from ..differential import Partials2, jet, second_partials_at
from ..differential._normal import quick_partials_at
from ..surface import AbstractSurface, TrimmedSurface, breaks

SIDES = ("u0", "u1", "v0", "v1")
"""Sides u = first, u = last, v = first, v = last."""

_CORNER = 0.3  # radians that a loop of degree 1 must turn to have a corner
_PER_SPAN, _LEAST = 8, 64


class Place(NamedTuple):
    """Parameters on a rim, their first and second derivatives by the share, and a way into the face; each (2,)."""

    parameters: Float[Array, "2"]
    along: Float[Array, "2"]
    turn: Float[Array, "2"]
    inward: Float[Array, "2"]


class AbstractPath(eqx.Module):
    """A way in the parameter plane of a surface, a function of the share from 0 to 1."""

    @abc.abstractmethod
    def at(self, share: Float[Array, ""]) -> Place:
        """Where the path is, inside traced code."""


class StraightPath(AbstractPath):
    """A side, from one corner of the parameter rectangle to the next; its ends are met bit by bit."""

    start: Float[Array, "2"]
    end: Float[Array, "2"]
    inward: Float[Array, "2"]

    def at(self, share: Float[Array, ""]) -> Place:
        way = self.end - self.start
        parameters = jnp.where(share < 0.5, self.start + share * way, self.end - (1 - share) * way)
        return Place(parameters, way, jnp.zeros_like(way), self.inward)


class LoopPath(AbstractPath):
    """The part of a trimming loop between two of its parameters; the face lies on its left."""

    loop: BSplineCurve
    start: Float[Array, ""]
    end: Float[Array, ""]

    def at(self, share: Float[Array, ""]) -> Place:
        way = self.end - self.start
        parameter = jnp.where(share < 0.5, self.start + share * way, self.end - (1 - share) * way)
        first = lambda t: jax.jvp(self.loop.point, (t,), (way,))
        (place, slope), (_, turn) = jax.jvp(first, (parameter,), (way,))
        return Place(place, slope, turn, jnp.stack([-slope[1], slope[0]]))


class RimCurve(AbstractCurve):
    """A rim as a curve in space, over [0, 1]."""

    surface: AbstractSurface
    path: AbstractPath

    @property
    def domain(self) -> tuple[Any, Any]:
        return 0.0, 1.0

    @property
    def dtype(self) -> Any:
        return self.surface.dtype

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        parameters = self.path.at(u).parameters
        return self.surface.point(parameters[0], parameters[1])


def partials_on(surface: AbstractSurface, place: Place) -> Partials2:
    """All derivatives up to the second at a place of a rim, inside traced code.

    By the rule of the class for all of them together, if it has one: that compiles several times faster.
    """
    has_rule = jet.dispatch(type(surface)) is not jet.dispatch(AbstractSurface)
    differentiate = quick_partials_at if has_rule else second_partials_at
    return differentiate(surface, place.parameters[0], place.parameters[1])


def side_path(surface: AbstractSurface, side: str) -> StraightPath:
    """The side of a surface that is called so."""
    along_u, along_v = surface.domain
    number = lambda x: jnp.asarray(x, surface.dtype)
    fixed, running = (along_u, along_v) if side[0] == "u" else (along_v, along_u)
    last = int(side[1])
    at, across = number(fixed[last]), number(fixed[0]) - number(fixed[1]) if last else number(fixed[1]) - number(fixed[0])
    pair = lambda x, y: jnp.stack([x, y] if side[0] == "u" else [y, x])
    return StraightPath(pair(at, number(running[0])), pair(at, number(running[1])), pair(across, jnp.zeros_like(across)))


def rims(surface: AbstractSurface) -> dict[str, AbstractPath]:
    """All that bounds a face, by name: its four sides, or of a trimmed one the pieces of its loops between corners.

    Pieces are called "loop 0 edge 2", counted from where the loop starts. The loops must be concrete.
    """
    if not isinstance(surface, TrimmedSurface):
        return {side: side_path(surface, side) for side in SIDES}
    found: dict[str, AbstractPath] = {}
    for number, loop in enumerate(surface.loops):
        corners = _corners(loop)
        for edge, (start, end) in enumerate(zip(corners[:-1], corners[1:], strict=True)):
            # below the corner by a few roundings: derivatives there are from the right
            roundings = 4 * eps(loop.dtype) * max(abs(start), abs(end), end - start)
            ends = (jnp.asarray(x, loop.dtype) for x in (start, end - roundings))
            found[f"loop {number} edge {edge}"] = LoopPath(loop, *ends)
    return found


def named_rims(surface: AbstractSurface, side: str | None, argument: str) -> dict[str, AbstractPath]:
    """The rim that was asked for, or all of them."""
    if side in SIDES:
        return {side: side_path(surface, side)}
    if side is None or isinstance(surface, TrimmedSurface):
        known = rims(surface)
        if side is None:
            return known
        if side in known:
            return {side: known[side]}
        raise InputError(f"`{argument}` must be one of {', '.join((*SIDES, *known))}, got {side!r}.")
    raise InputError(f"`{argument}` must be one of {', '.join(SIDES)}, got {side!r}.")


class Rim(NamedTuple):
    """A rim with samples at even shares: their points (n, 3), the length of their polygon, how far the rim leaves it, and
    below what a length is rounding noise."""

    name: str
    path: AbstractPath
    points: np.ndarray
    length: float
    sagitta: float
    noise: float

    def at(self, shares: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the polygon, close to those of the rim."""
        known = np.linspace(0, 1, len(self.points))
        return np.stack([np.interp(shares, known, column) for column in self.points.T], axis=1)

    @property
    def closed(self) -> bool:
        """Whether the rim ends where it starts."""
        return bool(np.linalg.norm(self.points[-1] - self.points[0]) <= self.noise)

    @property
    def box(self) -> np.ndarray:
        """The corners of the bounding box of the samples, (2, 3)."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])


def sampled(surface: AbstractSurface, paths: dict[str, AbstractPath]) -> list[Rim]:
    """Rims of a concrete surface with their samples, eight or more in each span; rims shrunk to a point have length 0."""
    count = _LEAST
    for spans in (*map(len, breaks(surface)), *(len(breaks(p.loop)) for p in paths.values() if isinstance(p, LoopPath))):
        while count < _PER_SPAN * (spans - 1):
            count *= 2  # so that surfaces of similar structure are compiled together
    shares = jnp.linspace(0, 1, count + 1, dtype=surface.dtype)
    found = []
    for name, path in paths.items():
        points = concrete(rim_points(surface, path, shares)).astype(float)
        found.append(Rim(name, path, points, *_length(points), 0.0))
    corners = np.concatenate([rim.points for rim in found])
    size = max(float(np.ptp(corners, axis=0).max()), 1e-3 * float(np.abs(corners).max()))
    noise = max(1e-9, 64 * eps(surface.dtype)) * size
    return [rim._replace(noise=noise, length=rim.length if rim.length > noise else 0.0) for rim in found]


@eqx.filter_jit
def rim_points(surface: AbstractSurface, path: AbstractPath, shares: Float[Array, "n"]) -> Float[Array, "n 3"]:
    """Points of a rim."""
    return jax.vmap(RimCurve(prepare(surface), path).point)(shares)


def _length(points: np.ndarray) -> tuple[float, float]:
    chords = np.diff(points, axis=0)
    bend = np.linalg.norm(np.diff(chords, axis=0), axis=1)
    return float(np.linalg.norm(chords, axis=1).sum()), float(bend.max(initial=0)) / 8


def _corners(loop: BSplineCurve) -> list[float]:
    """Parameters of a loop where it has corners, first and last included."""
    knots = concrete(breaks(loop)).astype(float)
    inside = knots[1:-1]
    if loop.degree == 1:
        legs = np.diff(concrete(loop(knots)).astype(float), axis=0)
        turn = (
            np.cross(legs[:-1], legs[1:]) if legs.shape[1] == 3 else legs[:-1, 0] * legs[1:, 1] - legs[:-1, 1] * legs[1:, 0]
        )
        sharp = np.abs(np.arctan2(turn, np.sum(legs[:-1] * legs[1:], axis=1))) > _CORNER
    else:
        counts = np.array([np.sum(concrete(loop.knots) == knot) for knot in inside], int)
        sharp = counts >= loop.degree
    return [float(knots[0]), *inside[sharp].tolist(), float(knots[-1])]
