"""Which parts of two rims lie along each other, from their samples."""

from typing import NamedTuple

import numpy as np

from ._sides import Rim


class Match(NamedTuple):
    """A part of a first rim, from share `start` to `end`, that lies along a second one.

    On a closed rim the part may go on over its end, beyond 1. apart: the largest distance of samples, good to `slack`;
    length: of the part. lowest, highest: the second rim's samples that end it; -1 where the first rim itself does.
    """

    start: float
    end: float
    apart: float
    slack: float
    length: float
    lowest: int
    highest: int


def match(first: Rim, second: Rim, tolerance: float) -> Match | None:
    """The longest part of the first rim along which the second runs within the tolerance; None if there is none.

    The ends of the part are feet of the second rim's samples: of its ends, or ends of the first rim. Rims that only meet at
    a corner share no part.
    """
    slack = first.sagitta + second.sagitta
    feet = feet_on(first, second.points)
    last = len(first.points) - 1
    good = (feet.distance <= tolerance + slack) & ~feet.beyond
    if not good.any():
        return _within(first, second, tolerance, slack)
    run = _longest_run(good, second.closed)
    where = feet.place[run] / last
    if first.closed:
        where = np.unwrap(where, period=1)
    ends = [int(np.argmin(where)), int(np.argmax(where))]
    numbers = [int(run[k]) for k in ends]
    start, end = (float(where[k]) for k in ends)
    if not first.closed:
        for neighbour in _neighbours(run, len(good), second.closed):
            if feet.beyond[neighbour]:
                if feet.place[neighbour] == 0:
                    start, numbers[0] = 0.0, -1
                else:
                    end, numbers[1] = 1.0, -1
    elif end - start >= 1 - 1.5 / last:
        start, end, numbers = 0.0, 1.0, [-1, -1]
    elif start < 0:
        start, end = start + 1, end + 1
    length = (end - start) * first.length
    if length < min(3 * tolerance, 0.5 * min(first.length, second.length)) or not length > 0:
        return None
    return Match(start, end, float(feet.distance[run].max()), slack, length, *numbers)


def nearest_distance(first: Rim, second: Rim) -> float:
    """How far the first rim is from the second: the largest distance where it runs beside it, else the least."""
    feet = feet_on(first, second.points)
    beside = feet.distance[~feet.beyond]
    return float(beside.max() if len(beside) else feet.distance.min())


class Feet(NamedTuple):
    """Of points on a rim's polygon: distances, places counted in samples, and whether the point lies beyond an end."""

    distance: np.ndarray
    place: np.ndarray
    beyond: np.ndarray


def feet_on(rim: Rim, points: np.ndarray) -> Feet:
    """Nearest places of points (n, 3) on the polygon of a rim's samples."""
    starts, legs = rim.points[:-1], np.diff(rim.points, axis=0)
    squared = np.maximum(np.sum(legs * legs, axis=1), np.finfo(float).tiny)
    along = (points @ legs.T - np.sum(starts * legs, axis=1)) / squared
    inside = np.clip(along, 0, 1)
    offset = points[:, None] - (starts + inside[..., None] * legs)
    distances = np.sum(offset * offset, axis=-1)
    leg = np.argmin(distances, axis=1)
    row = np.arange(len(points))
    place = leg + inside[row, leg]
    over = np.maximum(-along[row, leg], along[row, leg] - 1)
    at_end = (place == 0) | (place == len(legs))
    return Feet(np.sqrt(distances[row, leg]), place, at_end & (over > 0.1) & (not rim.closed))


def _within(first: Rim, second: Rim, tolerance: float, slack: float) -> Match | None:
    """The whole first rim, where it is so short that it lies between two samples of the second."""
    feet = feet_on(second, first.points)
    if np.any(feet.beyond) or np.any(feet.distance > tolerance + slack) or np.ptp(feet.place) == 0:
        return None
    return Match(0.0, 1.0, float(feet.distance.max()), slack, first.length, -1, -1)


def _longest_run(good: np.ndarray, cyclic: bool) -> np.ndarray:
    """Numbers of the longest run of True, in order; of a closed rim it may go on over the end."""
    count = len(good)
    if good.all():
        return np.arange(count)
    shift = int(np.argmin(good)) if cyclic else 0
    order = (np.arange(count) + shift) % count
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good[order], [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2]
    best = int(np.argmax(ends - starts))
    return order[starts[best] : ends[best]]


def _neighbours(run: np.ndarray, count: int, cyclic: bool) -> list[int]:
    before, after = int(run[0]) - 1, int(run[-1]) + 1
    if cyclic:
        return [before % count, after % count]
    return [k for k in (before, after) if 0 <= k < count]
