"""Which of many parameters a polyline needs to stay within a chordal tolerance."""

import numpy as np
from jaxtyping import Float, Int

from ._distance import to_segment


def chord_indices(points: Float[np.ndarray, "n k d"], tolerance: float, span: int = 1) -> tuple[Int[np.ndarray, "m"], bool]:
    """Indices, first and last included, whose chords keep all k polylines within `tolerance` of all n points.

    Intervals are halved while any point in them is further than `tolerance` from its chord, at a multiple of
    `span` as long as they hold one, so that chords end where spans do. The second result is whether every
    chord was seen to be good: one between neighbours has no point to measure, so the points are then too few.
    """
    chosen, proved = [0], True
    waiting = [(0, len(points) - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first <= 1:
            proved = False
            chosen.append(last)
            continue
        inner = to_segment(points[first + 1 : last], points[first], points[last])
        if inner.max() <= tolerance:
            chosen.append(last)
        else:
            middle = _middle(first, last, span)
            waiting += [(middle, last), (first, middle)]
    return np.array(chosen), proved


def _middle(first: int, last: int, span: int) -> int:
    half = (first + last) / 2
    at_break = round(half / span) * span
    return at_break if first < at_break < last else int(half)
