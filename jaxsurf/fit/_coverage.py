"""Which part of a surface was measured, and its outline."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from ..surface import BSplineSurface, QISurface


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


def coverage(surface: BSplineSurface | QISurface, parameters: Float[Array, "N 2"]) -> Coverage:
    """Count the feet in every knot cell."""
    feet = np.asarray(parameters)
    cells, shape = [], []
    for axis, basis in enumerate((surface.basis_u, surface.basis_v)):
        knots = np.asarray(basis.knots)
        breaks = np.unique(knots if basis.periodic else knots[basis.degree : basis.size + 1])
        cells.append(np.clip(np.searchsorted(breaks, feet[:, axis], side="right") - 1, 0, len(breaks) - 2))
        shape.append(len(breaks) - 1)
    covered = np.zeros(shape, bool)
    covered[cells[0], cells[1]] = True
    return Coverage(covered)
