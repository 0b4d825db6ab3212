"""Which of many parameters a polyline needs to stay within a chordal tolerance."""

import numpy as np
from jaxtyping import Float, Int

from ._distance import to_segment


def chord_indices(points: Float[np.ndarray, "n k d"], tolerance: float) -> tuple[Int[np.ndarray, "m"], bool]:
    """Indices, first and last included, whose chords keep all k polylines within `tolerance` of all n points.

    Intervals are halved while any point in them is further than `tolerance` from its chord. The second result is whether every
    chord was seen to be good: one between neighbours has no point to measure, so the points are then too few.
    """
    chosen, proved = [0], True
    open_intervals = [(0, len(points) - 1)]
    while open_intervals:
        first, last = open_intervals.pop()
        if last - first <= 1:
            proved = False
            chosen.append(last)
            continue
        inner = to_segment(points[first + 1 : last], points[first], points[last])
        middle = (first + last) // 2
        if inner.max() <= tolerance:
            chosen.append(last)
        else:
            open_intervals += [(middle, last), (first, middle)]
    return np.array(chosen), proved
