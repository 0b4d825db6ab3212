"""Which sides of surfaces that were measured apart meet, their places in a grid, and where they are cut."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from .._errors import InputError
from ..build._edge_fields import points_on
from ..build._ribbons import SIDES
from ..edit import reparametrise, reverse, split, transpose
from ..query import closest_point
from ..surface import BSplineSurface

_COUNT = 33  # places along a side
_MOST = 0.25  # widest bridge, as a share of its surface
_LEAST = 0.08  # narrowest one: what is cut off where surfaces overlap by less
_LEFT = 0.1  # share of a surface that cuts must leave

Place = tuple[int, int]
"""Column, along u, and row, along v."""


class Meeting(NamedTuple):
    """Two surfaces that meet: their numbers, their sides there as they were given, and the share of the first one's
    length by which they overlap."""

    first: int
    second: int
    sides: tuple[str, str]
    overlap: float


class Arrangement(NamedTuple):
    """Surfaces turned so that u runs from column to column of a grid and v from row to row, by place; their numbers, by
    place; and which of them meet."""

    surfaces: dict[Place, BSplineSurface]
    numbers: dict[Place, int]
    meetings: list[Meeting]

    @property
    def size(self) -> tuple[int, int]:
        """Numbers of columns and rows."""
        return max(c for c, _ in self.surfaces) + 1, max(r for _, r in self.surfaces) + 1


def arranged(surfaces: list[BSplineSurface], reach: float) -> Arrangement:
    """Find the sides that lie within `reach` of another surface along half of their length, and the grid that they make."""
    turned, places, names = {0: surfaces[0]}, {0: (0, 0)}, {0: {side: side for side in SIDES}}
    queue, meetings = [0], []
    while queue:
        one = queue.pop(0)
        for other in range(len(surfaces)):
            if other in turned:
                continue
            sides = _meeting(turned[one], surfaces[other], reach)
            if sides is None:
                continue
            turned[other], names[other] = _turned_to(turned[one], surfaces[other], sides)
            axis, end = "uv".index(sides[0][0]), int(sides[0][1])
            step = (2 * end - 1) * np.eye(2, dtype=int)[axis]
            places[other] = (places[one][0] + int(step[0]), places[one][1] + int(step[1]))
            queue.append(other)
    _refuse_apart(surfaces, set(turned), reach)
    origin = [min(place[k] for place in places.values()) for k in (0, 1)]
    at: dict[Place, int] = {}
    for number, place in places.items():
        own = (place[0] - origin[0], place[1] - origin[1])
        if own in at:
            raise InputError(
                f"Ranges {at[own] + 1} and {number + 1} lie in the same place of the grid, column {own[0] + 1} of row "
                f"{own[1] + 1}; leave one of them out, or join their points first."
            )
        at[own] = number
    found = Arrangement({place: turned[number] for place, number in at.items()}, at, meetings)
    columns, rows = found.size
    for place in np.ndindex(columns, rows):
        if place not in at:
            raise InputError(
                f"Ranges must fill a grid of {columns} columns and {rows} rows, but there is none in column {place[0] + 1}, "
                f"row {place[1] + 1}; add it, or join fewer ranges at a time."
            )
    for (c, r), number in at.items():
        for axis, next_place in ((0, (c + 1, r)), (1, (c, r + 1))):
            if next_place in at:
                second = at[next_place]
                own, other = f"{'uv'[axis]}1", f"{'uv'[axis]}0"
                overlap = _overlap(found.surfaces[c, r], found.surfaces[next_place], axis, reach)
                meetings.append(Meeting(number, second, (names[number][own], names[second][other]), overlap))
    return found


def cut_apart(found: Arrangement, reach: float) -> tuple[list[list[BSplineSurface]], tuple[list[float], list[float]]]:
    """The surfaces, by column and row, cut at isolines so that they leave room for bridges, and the lengths of these."""
    columns, rows = found.size
    ends = {place: [[0.0, 1.0], [0.0, 1.0]] for place in found.surfaces}
    for c, r in found.surfaces:
        for axis, other in ((0, (c + 1, r)), (1, (c, r + 1))):
            if other in found.surfaces:
                last, first = _cuts(found.surfaces[c, r], found.surfaces[other], axis, reach)
                ends[c, r][axis][1], ends[other][axis][0] = last, first
    for place, both in ends.items():
        if min(last - first for first, last in both) < _LEFT:
            raise InputError(
                f"Range {found.numbers[place] + 1} lies almost wholly within its neighbours: cuts at isolines would leave "
                f"less than {_LEFT:.0%} of it; leave it out."
            )
    cut = [[_part(found.surfaces[c, r], ends[c, r]) for r in range(rows)] for c in range(columns)]
    gaps_u = [float(np.mean([_gap(cut[c][r], cut[c + 1][r], 0) for r in range(rows)])) for c in range(columns - 1)]
    gaps_v = [float(np.mean([_gap(cut[c][r], cut[c][r + 1], 1) for c in range(columns)])) for r in range(rows - 1)]
    return cut, (gaps_u, gaps_v)


def side_points(surface: BSplineSurface, side: str) -> Float[np.ndarray, "n 3"]:
    """Points along a side."""
    return np.asarray(points_on(surface, side, np.linspace(0, 1, _COUNT)))


def _meeting(one: BSplineSurface, other: BSplineSurface, reach: float) -> tuple[str, str] | None:
    """The sides where two surfaces meet: half of each lies within reach of the other one, and less of the opposite sides."""
    sides = (_side_towards(one, other, reach), _side_towards(other, one, reach))
    return None if sides[0] is None or sides[1] is None else (sides[0], sides[1])


def _side_towards(one: BSplineSurface, other: BSplineSurface, reach: float) -> str | None:
    """The side of `one` that lies within reach of `other`."""
    points = np.concatenate([side_points(one, side) for side in SIDES])
    near = np.abs(np.asarray(closest_point(other, points).distance)) <= reach
    shares: dict[str, float] = dict(zip(SIDES, near.reshape(len(SIDES), -1).mean(axis=1), strict=True))
    able = [side for side in SIDES if shares[side] >= 0.5 > shares[_opposite(side)]]
    return max(able, key=shares.__getitem__, default=None)


def _opposite(side: str) -> str:
    return side[0] + "10"[int(side[1])]


def _turned_to(one: BSplineSurface, other: BSplineSurface, sides: tuple[str, str]) -> tuple[BSplineSurface, dict[str, str]]:
    """`other` with its side opposite to that of `one`, running alike; and what its sides were called before."""
    names = {side: side for side in SIDES}
    side, wanted = sides[1], _opposite(sides[0])
    if side[0] != wanted[0]:
        other, names = transpose(other), {"vu"["uv".index(s[0])] + s[1]: name for s, name in names.items()}
        side = wanted[0] + side[1]
    if side != wanted:
        other, names = _reversed(other, names, wanted[0])
    own, there = side_points(one, sides[0]), side_points(other, wanted)
    if np.sum((own - there[::-1]) ** 2) < np.sum((own - there) ** 2):
        other, names = _reversed(other, names, "vu"["uv".index(wanted[0])])
    return other, names


def _reversed(surface: BSplineSurface, names: dict[str, str], direction: str) -> tuple[BSplineSurface, dict[str, str]]:
    turned = {(_opposite(side) if side[0] == direction else side): name for side, name in names.items()}
    return reverse(surface, direction), turned


def _refuse_apart(surfaces: list[BSplineSurface], placed: set[int], reach: float) -> None:
    for number, surface in enumerate(surfaces):
        if number not in placed:
            points = np.concatenate([side_points(surface, side) for side in SIDES])
            distances = [
                float(np.abs(np.asarray(closest_point(other, points).distance)).min())
                for k, other in enumerate(surfaces)
                if k != number
            ]
            raise InputError(
                f"Range {number + 1} touches no other: no side of it lies within {reach:.4g} of another range along half of "
                f"its length, and its nearest point is {min(distances):.4g} away; measure the part between, or take a "
                "larger `reach`."
            )


def _overlap(one: BSplineSurface, other: BSplineSurface, axis: int, reach: float) -> float:
    """The share of `one`, along an axis, that the first side of `other` reaches into it by, at its deepest."""
    shares = _shares_on(one, side_points(other, f"{'uv'[axis]}0"), axis, reach)
    return 0.0 if not len(shares) else 1 - float(shares.min())


def _shares_on(surface: BSplineSurface, points: np.ndarray, axis: int, reach: float) -> Float[np.ndarray, "n"]:
    """Shares of the domain along an axis of the feet of points within reach, without those on the sides along it."""
    found = closest_point(surface, points)
    lower, upper = (np.array([float(along[k]) for along in surface.domain]) for k in (0, 1))
    shares = (np.asarray(found.parameters) - lower) / (upper - lower)
    aside = shares[:, 1 - axis]
    near = (np.abs(np.asarray(found.distance)) <= reach) & (aside > 1e-6) & (aside < 1 - 1e-6)
    return shares[near, axis]


def _cuts(one: BSplineSurface, other: BSplineSurface, axis: int, reach: float) -> tuple[float, float]:
    """Where `one` ends and `other` begins, as shares: what is kept of both does not overlap."""
    overlap = _overlap(one, other, axis, reach)
    width = float(np.clip(overlap, _LEAST, _MOST))
    last = 1 - width if overlap <= _MOST else 1 - overlap / 2 - width / 2
    line = _isoline(one, axis, last + width)
    there = _shares_on(other, line, axis, reach)
    first = float(there.max()) if len(there) else 0.0
    return last, max(first, _LEAST if overlap < _LEAST else 0.0)


def _isoline(surface: BSplineSurface, axis: int, share: float) -> Float[np.ndarray, "n 3"]:
    ends = [np.array([float(x) for x in along]) for along in surface.domain]
    at = [e[0] + (e[1] - e[0]) * np.linspace(0, 1, _COUNT) for e in ends]
    at[axis] = ends[axis][:1] + (ends[axis][1] - ends[axis][0]) * share
    return np.asarray(surface.grid(*at)).reshape(-1, 3)


def _part(surface: BSplineSurface, ends: list[list[float]]) -> BSplineSurface:
    """The part between shares of both directions, each over [0, 1]."""
    surface = reparametrise(surface, ((0.0, 1.0), (0.0, 1.0)))
    for direction, (first, last) in zip("uv", ends, strict=True):
        if last < 1:
            surface = split(surface, last, direction)[0]
        if first > 0:
            surface = split(surface, first, direction)[1]
    return reparametrise(surface, ((0.0, 1.0), (0.0, 1.0)))


def _gap(one: Any, other: Any, axis: int) -> float:
    ends = side_points(one, f"{'uv'[axis]}1"), side_points(other, f"{'uv'[axis]}0")
    return float(np.linalg.norm(ends[1] - ends[0], axis=1).mean())
