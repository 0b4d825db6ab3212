"""Parameter lines and outlines of a surface."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..mesh import breaks_within, curve_at, domain_corners, inside, points_at
from ..surface import AbstractSurface, TrimmedSurface

EVEN_LINES = 9
MOST_KNOT_LINES = 33
SAMPLES = 257
LOOP_SAMPLES = 1025


@dataclass(frozen=True)
class Isolines:
    """Polylines in space: the outline of a surface, and lines of equal parameter inside."""

    outline: list[Float[np.ndarray, "_ 3"]]
    inner: list[Float[np.ndarray, "_ 3"]]


def isolines(surface: AbstractSurface) -> Isolines:
    """Lines at the knots of a B-spline, if not too many, else nine even ones; seams count as inner lines."""
    if isinstance(surface, TrimmedSurface):
        return _trimmed(surface)
    low, high = domain_corners(surface)
    outline, inner = [], []
    for axis in (0, 1):
        places = _places(surface, axis, low[axis], high[axis])
        along = np.linspace(low[1 - axis], high[1 - axis], SAMPLES)
        lines = [_line(surface, axis, place, along) for place in places]
        size = max(np.ptp(line, axis=0).max() for line in lines) or 1.0
        closed = np.abs(lines[0] - lines[-1]).max() < 1e-6 * size
        ends, between = [lines[0], lines[-1]], lines[1:-1]
        inner += [*between, lines[0]] if closed else between
        outline += [] if closed else [end for end in ends if np.ptp(end, axis=0).max() > 1e-6 * size]
    return Isolines(outline, inner)


def _places(surface: AbstractSurface, axis: int, first: float, last: float) -> Float[np.ndarray, "n"]:
    distinct = breaks_within(surface, axis, first, last)
    if 5 <= len(distinct) <= MOST_KNOT_LINES:
        return distinct
    return np.linspace(first, last, EVEN_LINES)


def _line(surface: AbstractSurface, axis: int, place: float, along: np.ndarray) -> Float[np.ndarray, "n 3"]:
    pair = [np.full_like(along, place), along]
    return points_at(surface, np.stack(pair if axis == 0 else pair[::-1], axis=-1))


def _trimmed(surface: TrimmedSurface) -> Isolines:
    base = surface.surface
    low, high = domain_corners(base)
    plane = []
    for loop in surface.loops:
        first, last = (float(end) for end in loop.domain)
        plane.append(np.clip(curve_at(loop, np.linspace(first, last, LOOP_SAMPLES)), low, high))
    outline = [points_at(base, loop) for loop in plane]
    first, last = np.concatenate(plane).min(axis=0), np.concatenate(plane).max(axis=0)
    inner = []
    for axis in (0, 1):
        along = np.linspace(first[1 - axis], last[1 - axis], SAMPLES)
        places = _places(base, axis, low[axis], high[axis])
        for place in places[(places > first[axis]) & (places < last[axis])]:
            pair = [np.full_like(along, place), along]
            kept = inside(np.stack(pair if axis == 0 else pair[::-1], axis=-1), [loop[:-1] for loop in plane])
            line = _line(base, axis, place, along)
            breaks = np.flatnonzero(np.diff(kept.astype(int))) + 1
            inner += [
                piece
                for piece, start in zip(np.split(line, breaks), [0, *breaks], strict=True)
                if kept[start] and len(piece) > 1
            ]
    return Isolines(outline, inner)
