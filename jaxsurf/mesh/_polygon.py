"""Closed polygons in the parameter plane."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float


def inside(points: Float[np.ndarray, "n 2"], polygons: Sequence[np.ndarray]) -> Bool[np.ndarray, "n"]:
    """Whether each point lies inside an odd number of the polygons (the last corner joins the first)."""
    odd = np.zeros(len(points), dtype=bool)
    for start, end in segments(polygons):
        # The half-open comparison counts a corner on the ray once.
        crosses = (start[1] > points[:, 1]) != (end[1] > points[:, 1])
        rise = end[1] - start[1]
        at = start[0] + (points[:, 1] - start[1]) * (end[0] - start[0]) / (rise if rise else 1.0)
        odd ^= crosses & (points[:, 0] < at)
    return odd


def segments(polygons: Sequence[np.ndarray]) -> Float[np.ndarray, "s 2 2"]:
    """All sides of all polygons, first to last corner of each."""
    return np.concatenate([np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in polygons])
