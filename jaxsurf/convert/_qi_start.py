"""A first curve through points, or near them: a cubic spline, whose tangents an integral curve then takes up."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ._qi_equations import State
from ._qi_spans import Layout

_SMOOTHER = 4.0  # by which smoothing is lessened until all points are near enough


def start_state(
    points: Float[np.ndarray, "m 3"], plan: Layout, ends: tuple[Any, Any], tolerance: float, power: float
) -> State:
    """Tangents and lengths of the cubic spline through points, or smoothed ones if they may be moved.

    ends: unit tangents or None; power: of the chords that the parameters are in proportion to.
    """
    from scipy.interpolate import CubicSpline

    places = _smoothed(points, plan.closed, tolerance) if tolerance else points
    loop = np.concatenate([places, places[:1]]) if plan.closed else places
    chords = np.linalg.norm(np.diff(loop, axis=0), axis=1)
    sites = np.concatenate([[0], np.cumsum(chords**power)])
    conditions: Any = "periodic" if plan.closed else _conditions(ends, chords, sites)
    slope = CubicSpline(sites, loop, bc_type=conditions).derivative()
    abscissae, weights = np.polynomial.legendre.leggauss(16)
    steps = np.diff(sites)
    speeds = np.linalg.norm(slope(sites[:-1, None] + steps[:, None] * (1 + abscissae) / 2), axis=-1)
    lengths = speeds @ weights * steps / 2
    gaps, degree = len(chords), plan.degree
    knots = np.arange(-degree, gaps * plan.parts + degree + 1) / plan.parts
    knots = knots if plan.closed else np.clip(knots, 0, gaps)
    greville = np.mean([knots[1 + i : 1 + i + plan.count] for i in range(degree)], axis=0)
    greville = greville % gaps if plan.closed else greville
    tangents = slope(np.interp(greville, np.arange(gaps + 1), sites))
    # at a cusp of the spline, the chord
    speed = np.linalg.norm(tangents, axis=1, keepdims=True)
    gap = np.minimum(greville.astype(int), gaps - 1)
    still = speed < 1e-3 * (chords / steps)[gap, None]
    tangents = np.where(still, np.diff(loop, axis=0)[gap] / chords[gap, None], tangents / np.where(still, 1, speed))
    for place, end in ((0, ends[0]), (-1, ends[1])):
        if end is not None:
            tangents[place] = end
    return State(tangents, lengths / np.sum(lengths), float(np.sum(lengths)), places - points)


def _conditions(ends: tuple[Any, Any], chords: np.ndarray, sites: np.ndarray) -> Any:
    speeds = chords[[0, -1]] / np.diff(sites)[[0, -1]]
    return tuple("not-a-knot" if end is None else (1, end * speed) for end, speed in zip(ends, speeds, strict=True))


def _smoothed(points: Float[np.ndarray, "m 3"], closed: bool, tolerance: float) -> Float[np.ndarray, "m 3"]:
    """Points moved by at most 0.9 of the tolerance, as far as that goes towards second differences of 0."""
    from scipy.sparse import csc_matrix, eye
    from scipy.sparse.linalg import splu

    count = len(points)
    loop = np.concatenate([points, points[:2]]) if closed else points
    chords = np.linalg.norm(np.diff(loop, axis=0), axis=1)
    before, after = chords[:-1], chords[1:]
    rows = np.arange(len(before))
    scale = np.mean(chords) ** 2
    values = scale * np.stack([1 / before, -1 / before - 1 / after, 1 / after]) * 2 / (before + after)
    columns = np.stack([rows, rows + 1, rows + 2]) % count
    bends = csc_matrix((values.reshape(-1), (np.tile(rows, 3), columns.reshape(-1))), shape=(len(rows), count))
    weight = 1e12
    while weight > 1e-6:
        smooth = splu((eye(count) + weight * (bends.T @ bends)).tocsc()).solve(points)
        gaps = np.linalg.norm(np.diff(np.concatenate([smooth, smooth[:1]]) if closed else smooth, axis=0), axis=1)
        near = np.max(np.sum((smooth - points) ** 2, axis=1)) <= (0.9 * tolerance) ** 2
        if near and np.min(gaps) > 1e-3 * np.mean(chords):  # and not shrunk to a point
            return smooth
        weight /= _SMOOTHER
    return points
