"""Points as they come out of a reader, and the checks that every format shares."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ._source import refusal


def point_label(index: int) -> str:
    """The name of a point for people: they count from 1."""
    return f"point {index + 1}"


class Part:
    """The `index`-th of `count` consecutive parts of something, as equal as can be; `of` says which rows it has."""

    def __init__(self, index: int = 0, count: int = 1):
        self.index, self.count, self.first, self.total = index, count, 0, 0

    def of(self, total: int) -> slice:
        """The rows of this part of `total`, remembered."""
        small, more = divmod(total, self.count)
        self.total, self.first = total, self.index * small + min(self.index, more)
        return slice(self.first, self.first + small + (self.index < more))


class Rows(NamedTuple):
    """Points (N, 3) and the name of the i-th one in messages ("line 17" in text, "point 17" elsewhere)."""

    points: np.ndarray
    label: Callable[[int], str] = point_label


def checked_points(path: Path, rows: Rows, part: Part | None = None) -> np.ndarray:
    """The points as a float64 array of their own, shape (N, 3); NaN, infinite or no points are refused.

    part: of which the rows are, where they are not all.
    """
    first = 0 if part is None else part.first
    with np.errstate(invalid="ignore"):  # widening a signalling NaN warns, and is refused just below
        points = np.array(rows.points, dtype=np.float64, order="C")
    if (points.shape[0] if part is None else part.total) == 0:
        raise refusal(path, "it holds no points; export it again")
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        worst = int(bad.argmax())
        x, y, z = points[worst].tolist()
        raise refusal(
            path,
            f"expected finite coordinates, got ({x}, {y}, {z}) in {rows.label(first + worst)} "
            f"({int(bad.sum())} of {len(points)} points are NaN or infinite); remove them first",
        )
    return points
