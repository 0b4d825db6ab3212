"""All edges that the faces of a model share."""

from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from .._array import concrete, is_concrete
from .._errors import InputError
from ..surface import AbstractSurface
from ._continuity import Continuity, measure, untrimmed
from ._matching import feet_on, match
from ._sides import Rim, rims, sampled

_TOLERANCE = 1e-3  # of the size
_SAME = 1e-6  # of the size: edges closer than this are not doubted


class SharedEdge(NamedTuple):
    """An edge that two faces share, by their numbers, and how closely they meet along it."""

    first: int
    second: int
    continuity: Continuity


def shared_edges(surfaces: Sequence[Any], *, count: int = 65, tolerance: float | None = None) -> tuple[SharedEdge, ...]:
    """Every edge that two of the surfaces share, also the seam of one with itself, measured as by `js.continuity`.

    Sides of surfaces, and pieces of the loops of trimmed ones, are compared where their bounding boxes come within
    `tolerance`, default 1e-3 of the size of all. Where a narrow face brings other sides within it, the side that is ten
    times as near wins. Of two sides that meet along several parts the longest is taken. `count`: samples on each edge.
    Raises `InputError` unless all are concrete surfaces.
    """
    surfaces = list(surfaces)
    for number, surface in enumerate(surfaces):
        if not isinstance(surface, AbstractSurface):
            raise InputError(f"`surfaces[{number}]` must be a surface, got a {type(surface).__name__}.")
        if not is_concrete(surface):
            raise InputError(
                "`shared_edges` searches concrete surfaces; under `jit` and `grad` call `js.continuity` with sides."
            )
    whole = [untrimmed(surface) for surface in surfaces]
    known = [[rim for rim in sampled(w, rims(s)) if rim.length > 0] for s, w in zip(surfaces, whole, strict=True)]
    if not any(known):
        return ()
    boxes = [[rim.box for rim in face] for face in known]
    every = np.concatenate([np.concatenate(face) for face in boxes if face])
    size = float(np.linalg.norm(np.ptp(every, axis=0)))
    reach = _TOLERANCE * size if tolerance is None else float(tolerance)
    found = []
    for i, j in combinations_with_replacement(range(len(surfaces)), 2):
        if not known[i] or not known[j] or not _near(_around(boxes[i]), _around(boxes[j]), reach):
            continue
        for p, q in _pairs(known[i], known[j], same=i == j):
            if not _near(p.box, q.box, reach + p.sagitta + q.sagitta):
                continue
            held = match(p, q, reach)
            if held is not None:
                try:
                    found.append(SharedEdge(i, j, measure(whole[i], whole[j], p, q, held, count)))
                except InputError as error:
                    raise InputError(f"`surfaces[{i}]` (a) and `surfaces[{j}]` (b): {error}") from error
    close = [edge for edge in found if float(edge.continuity.max_g0) <= reach]
    return tuple(edge for edge in close if not _is_doubtful(edge, close, _SAME * size))


def _pairs(first: list[Rim], second: list[Rim], same: bool) -> list[tuple[Rim, Rim]]:
    if same:
        return [(p, q) for k, p in enumerate(first) for q in first[k + 1 :]]
    return [(p, q) for p in first for q in second]


def _around(boxes: list[np.ndarray]) -> np.ndarray:
    stacked = np.stack(boxes)
    return np.stack([stacked[:, 0].min(axis=0), stacked[:, 1].max(axis=0)])


def _near(first: np.ndarray, second: np.ndarray, reach: float) -> bool:
    return bool(np.all(first[0] <= second[1] + reach) and np.all(second[0] <= first[1] + reach))


def _is_doubtful(edge: SharedEdge, others: Sequence[SharedEdge], noise: float) -> bool:
    """Whether one of the two sides has a partner that is ten times as near along most of this part."""
    gap = float(edge.continuity.max_g0)
    if gap <= noise:
        return False
    for mine in _ends(edge):
        for other in others:
            for its in _ends(other):
                nearer = other is not edge and mine[:2] == its[:2] and float(other.continuity.max_g0) < 0.1 * gap
                if (
                    nearer
                    and np.mean(feet_on(its[2], mine[2].points).distance < 2 * its[2].length / len(its[2].points)) > 0.5
                ):
                    return True
    return False


def _ends(edge: SharedEdge) -> list[tuple[int, str, Any]]:
    """Face, side and the part of it that both sides of an edge have."""
    held = edge.continuity
    length = float(held.length)
    part = lambda side, points: Rim(side, None, concrete(points).astype(float), length, 0.0, 0.0)  # type: ignore[arg-type]
    return [
        (edge.first, held.side_a, part(held.side_a, held.points_a)),
        (edge.second, held.side_b, part(held.side_b, held.points_b)),
    ]
