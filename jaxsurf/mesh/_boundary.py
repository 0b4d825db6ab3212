"""Polygons on the loops of a trimmed surface."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from ..curve import BSplineCurve
from ..surface import AbstractSurface
from ._chords import chord_indices
from ._distance import to_segment
from ._evaluate import between_breaks, breaks_within, curve_at, domain_corners, points_at

SAMPLES = 1024  # per loop, shared by its knot spans
FEWEST = 8


@dataclass(frozen=True)
class Boundary:
    """Parameters on each loop, ascending, first and last included, of the polygons' corners."""

    surface: AbstractSurface
    loops: tuple[BSplineCurve, ...]
    parameters: tuple[Float[np.ndarray, "_"], ...]

    @classmethod
    def through(
        cls,
        surface: AbstractSurface,
        loops: Sequence[BSplineCurve],
        stretch: np.ndarray,
        spacing: float,
        wanted: float,
    ) -> "Boundary":
        """Corners so that chords stay within half of `wanted` in space, pieces below `spacing` in the plane.

        Knots of the loops are corners always: a loop may have a kink there.
        """
        return cls(surface, tuple(loops), tuple(_corners(surface, c, stretch, spacing, wanted / 2) for c in loops))

    def polygons(self) -> list[Float[np.ndarray, "_ 2"]]:
        """The corners in the parameter plane, the last not repeating the first."""
        pairs = zip(self.loops, self.parameters, strict=True)
        return [loop_points(self.surface, loop, p[:-1]) for loop, p in pairs]

    def halved(self, which: Bool[np.ndarray, "s"]) -> "Boundary":
        """A further corner in the middle of the pieces marked in `which`, numbered loop by loop."""
        first, finer = 0, []
        for p in self.parameters:
            split = which[first : first + len(p) - 1]
            finer.append(np.sort(np.concatenate([p, ((p[1:] + p[:-1]) / 2)[split]])))
            first += len(p) - 1
        return replace(self, parameters=tuple(finer))

    @property
    def max_error(self) -> float:
        """Largest distance of the loops' middles between corners from the pieces' chords, in space."""
        errors = [0.0]
        for loop, p in zip(self.loops, self.parameters, strict=True):
            corners, middle = (
                points_at(self.surface, loop_points(self.surface, loop, q)) for q in (p, (p[1:] + p[:-1]) / 2)
            )
            errors.append(float(to_segment(middle, corners[:-1], corners[1:]).max()))
        return max(errors)


def loop_points(surface: AbstractSurface, loop: BSplineCurve, parameters: np.ndarray) -> Float[np.ndarray, "k 2"]:
    """Points of a loop, put back into the surface's domain where round-off left it."""
    low, high = domain_corners(surface)
    return np.clip(curve_at(loop, parameters), low, high)


def _corners(
    surface: AbstractSurface, loop: BSplineCurve, stretch: np.ndarray, spacing: float, tolerance: float
) -> np.ndarray:
    first, last = (float(end) for end in loop.domain)
    places = breaks_within(loop, None, first, last)
    dense, steps = between_breaks(places, max(SAMPLES, 16 * (len(places) - 1)))
    plane = loop_points(surface, loop, dense)
    points = points_at(surface, plane)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(plane * stretch, axis=0), axis=-1))])
    longest = min(spacing, travelled[-1] / FEWEST)
    chosen = [0]
    for start in range(0, len(dense) - 1, steps):
        here, _ = chord_indices(points[start : start + steps + 1, None, :], tolerance)
        for index in here[1:] + start:
            count = int(np.ceil((travelled[index] - travelled[chosen[-1]]) / longest))
            even = np.linspace(travelled[chosen[-1]], travelled[index], max(count, 1) + 1)[1:-1]
            between = np.searchsorted(travelled, even)
            chosen += [i for i in np.unique(between).tolist() if chosen[-1] < i < index]
            chosen.append(int(index))
    return dense[chosen]
