"""First parameters for an unordered sheet-like cloud: unroll it into a plane.

Host code on concrete points; the parameters are only where the fit starts, they are improved by the foot points.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from .._errors import InputError

_NEIGHBOURS = 10
_LANDMARKS = 120
_WIDE = 1.5  # pieces are bridged wherever their gap is at most so many times the shortest one
_MOST_POINTS = 3000  # the neighbour graph is built on a thinned cloud of at most so many


class Parametrisation(NamedTuple):
    """Parameters (k, 2) in the unit square of the points `index` (k,), and the two side lengths of the unrolled sheet."""

    parameters: Float[np.ndarray, "k 2"]
    index: np.ndarray
    sides: tuple[float, float]


def parametrise(points: Any, *, margin: float = 0.01) -> list[Parametrisation]:
    """Candidate parametrisations of a cloud (N, 3): its unrolling by geodesic distances, and its projection to a plane.

    The unrolling (landmark Isomap: shortest paths in the graph of nearest neighbours, embedded by classical scaling) also
    opens half cylinders and strips that are no height fields; the projection to the plane of least squares is better on
    flat clouds with holes. Both are turned so that their bounding rectangle is smallest, the longer side along u, and
    leave `margin` of each side free around the points. Which one serves better only a fit can tell.
    Raises `InputError` if the points do not span a sheet (too few, all equal, or on a line).
    Source: de Silva, Tenenbaum, Sparse multidimensional scaling using landmark points, 2004.
    """
    points = np.asarray(points, np.float64)
    check_sheet(points)
    index = thin(points, _MOST_POINTS)
    sample = points[index]
    flat = _project(sample)
    candidates = [_in_rectangle(flat, margin)]
    if len(sample) > _NEIGHBOURS:
        unrolled = _unroll(sample)
        candidates.insert(0, _in_rectangle(unrolled, margin))
    return [Parametrisation(parameters, index, sides) for parameters, sides in candidates]


def check_sheet(points: Float[np.ndarray, "..."]) -> None:
    """Refuse clouds that cannot carry a surface."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"`points` must have shape (N, 3), got {points.shape}.")
    if not np.all(np.isfinite(points)):
        row = int(np.argmin(np.all(np.isfinite(points), axis=1)))
        raise InputError(f"`points` must be finite, but point {row + 1} is {points[row]}; remove it.")
    distinct = np.unique(points, axis=0)
    if len(distinct) < 4:
        raise InputError(
            f"`points` must hold at least 4 distinct points, got {len(distinct)} distinct ones among {len(points)}."
        )
    extent = np.linalg.svd(distinct - distinct.mean(axis=0), compute_uv=False)
    if extent[1] < 1e-6 * extent[0]:
        raise InputError(
            f"`points` must span a sheet, but all {len(points)} lie on one line (to 1e-6 of its length); "
            "fit a curve to them or add measurements beside the line."
        )


def thin(points: Float[np.ndarray, "N 3"], most: int) -> np.ndarray:
    """Indices of at most `most` points, one from each cell of a cubic grid, evenly spread; ascending."""
    if len(points) <= most:
        return np.arange(len(points))
    low, size = points.min(axis=0), np.ptp(points, axis=0).max()
    coarse, fine = 1.0, 4096.0
    chosen = np.arange(len(points))
    for _ in range(24):
        cells = np.sqrt(coarse * fine)
        keys = np.floor((points - low) * (cells / size)).astype(np.int64)
        _, first = np.unique(keys, axis=0, return_index=True)
        if len(first) > most:
            fine = cells
        else:
            coarse, chosen = cells, first
    return np.sort(chosen) if len(chosen) <= most else np.arange(0, len(points), -(-len(points) // most))


def _project(points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 2"]:
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    return centred @ axes[:2].T


def _unroll(points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 2"]:
    """Classical scaling of geodesic distances to landmarks, each chosen farthest from those before."""
    from scipy.sparse.csgraph import dijkstra

    graph = _neighbour_graph(points)
    reached = np.full(len(points), np.inf)
    rows, landmarks = [], []
    here = 0
    for _ in range(min(_LANDMARKS, len(points))):
        distance = dijkstra(graph, directed=False, indices=here)
        landmarks.append(here)
        rows.append(distance)
        reached = np.minimum(reached, distance)
        here = int(np.argmax(reached))
    squared = np.asarray(rows) ** 2
    among = squared[:, landmarks]
    means = among.mean(axis=0)
    centred = -0.5 * (among - means[None, :] - means[:, None] + means.mean())
    values, vectors = np.linalg.eigh(centred)
    top = vectors[:, -2:] / np.sqrt(np.maximum(values[-2:], np.finfo(float).tiny))
    return -0.5 * (squared - means[:, None]).T @ top


def _neighbour_graph(points: Float[np.ndarray, "k 3"]):
    """Edges to the nearest neighbours, and bridges between pieces that these leave apart.

    A gap is bridged along all of its width: over a single bridge all ways would lead, and be too long.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    count = len(points)
    distance, neighbour = map(np.asarray, KDTree(points).query(points, k=min(_NEIGHBOURS + 1, count)))
    start = np.repeat(np.arange(count), neighbour.shape[1] - 1)
    end, length = neighbour[:, 1:].ravel(), distance[:, 1:].ravel()
    # a sparse matrix forgets entries that are 0, so coincident points get a tiny distance
    length = np.maximum(length, 1e-12 * np.ptp(points, axis=0).max())
    while True:
        graph = coo_matrix((length, (start, end)), shape=(count, count)).tocsr()
        pieces, label = connected_components(graph, directed=False)
        if pieces == 1:
            return graph
        inside = label == label[0]
        gap, nearest = map(np.asarray, KDTree(points[inside]).query(points[~inside]))
        bridges = gap <= _WIDE * gap.min()
        start = np.append(start, np.flatnonzero(~inside)[bridges])
        end = np.append(end, np.flatnonzero(inside)[nearest[bridges]])
        length = np.append(length, gap[bridges])


def _in_rectangle(flat: Float[np.ndarray, "k 2"], margin: float) -> tuple[Float[np.ndarray, "k 2"], tuple[float, float]]:
    """Turn a plane cloud so that its bounding rectangle has the least area, and scale that to the unit square."""
    from scipy.spatial import ConvexHull

    hull = flat[ConvexHull(flat).vertices]
    edges = np.roll(hull, -1, axis=0) - hull
    angles = np.unique(np.round(np.mod(np.arctan2(edges[:, 1], edges[:, 0]), np.pi / 2), 12))
    turns = np.stack([np.stack([np.cos(angles), np.sin(angles)], -1), np.stack([-np.sin(angles), np.cos(angles)], -1)], 1)
    areas = np.prod(np.ptp(hull @ np.swapaxes(turns, 1, 2), axis=1), axis=1)
    turned = flat @ turns[int(np.argmin(areas))].T
    if np.ptp(turned[:, 0]) < np.ptp(turned[:, 1]):
        turned = np.stack([turned[:, 1], -turned[:, 0]], axis=1)
    low, sides = turned.min(axis=0), np.ptp(turned, axis=0)
    parameters = margin + (1 - 2 * margin) * (turned - low) / sides
    return parameters, (float(sides[0]) / (1 - 2 * margin), float(sides[1]) / (1 - 2 * margin))
