"""Where the net needs more knots."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Array, Float

from ..surface import BSplineSurface


def refined_knots(
    surface: BSplineSurface,
    parameters: Float[Array | np.ndarray, "N 2"],
    signed: Float[Array | np.ndarray, "N"],
    tolerance: float,
    max_spans: int,
    summed: Callable[[np.ndarray], np.ndarray] = lambda counts: counts,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Knots of a finer net: spans are halved where the points over or under them lie beyond the tolerance.

    A span is halved if more of its points are beyond the tolerance than a well fitted span would have (2.5 %), in each
    direction for itself, up to `max_spans`; the worst spans come first. `None` if no span can be halved.
    summed: adds up the counts of several processes, each with points of its own.
    """
    beyond = np.abs(np.asarray(signed)) > tolerance
    feet = np.asarray(parameters)
    finer, changed = [], False
    for axis, (knots, degree) in enumerate(((surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v))):
        knots = np.asarray(knots)
        breaks = knots[degree : len(knots) - degree]
        cell = np.clip(np.searchsorted(breaks, feet[:, axis], side="right") - 1, 0, len(breaks) - 2)
        count = summed(np.bincount(cell, minlength=len(breaks) - 1))
        bad = summed(np.bincount(cell, weights=beyond, minlength=len(breaks) - 1))
        share = bad / np.maximum(count, 1)
        # a lone point beyond is an outlier, not a shape; and a span needs points to carry two control points more
        wanted = (share > 0.025) & (bad >= 2) & (count >= 4)
        room = max_spans - (len(breaks) - 1)
        order = np.argsort(-share * wanted, kind="stable")[: max(room, 0)]
        halved = [i for i in order if wanted[i]]
        changed |= bool(halved)
        new = 0.5 * (breaks[halved] + breaks[np.asarray(halved, int) + 1])
        finer.append(np.sort(np.concatenate([knots, new])))
    return (finer[0], finer[1]) if changed else None
