"""Which part of a surface was measured, and its outline."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from ..surface import AbstractSurface
from ..surface._breaks import breaks


class Coverage(eqx.Module):
    """Which knot cells of a surface hold feet of measured points.

    covered: (spans_u, spans_v). What lies in other cells was not measured: it continues its surroundings as gently as the
    net can.
    """

    covered: Bool[np.ndarray, "m n"]

    @property
    def uncovered(self) -> list[tuple[int, int]]:
        """(u, v) numbers of the knot cells without points."""
        return [(int(i), int(j)) for i, j in np.argwhere(~self.covered)]

    @property
    def share(self) -> float:
        """Share of the knot cells that hold points."""
        return float(self.covered.mean())


def coverage(surface: AbstractSurface, parameters: Float[Array | np.ndarray, "N 2"]) -> Coverage:
    """Count the feet in every cell between breaks, the knot cells of a spline."""
    feet = np.asarray(parameters)
    edges = [np.asarray(places) for places in breaks(surface)]
    cells = [np.clip(np.searchsorted(e, feet[:, i], side="right") - 1, 0, len(e) - 2) for i, e in enumerate(edges)]
    covered = np.zeros([len(e) - 1 for e in edges], bool)
    covered[cells[0], cells[1]] = True
    return Coverage(covered)
