"""The outline of a cloud in the parameter plane, and the surface trimmed to it."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._errors import InputError
from ..basis import clamped_knots, collocation_matrix, periodic_knots
from ..curve import BSplineCurve
from ..surface import BSplineSurface, TrimmedSurface

_LONG = 4.0  # triangles with an edge longer than so many median edges are empty space
_POINTS_PER_KNOT = 4  # of the ragged border that one control point of the outline smooths
_KEEPING = 50.0  # how much more a border point outside the outline counts than one inside it
_ROUNDS = 8


def trim_to_cloud(surface: BSplineSurface, parameters: Float[Array, "N 2"], sides: tuple[Any, ...]) -> TrimmedSurface:
    """The part of a fitted surface that was measured: trimmed along a smooth closed curve around the feet of the points.

    parameters: the feet; sides: lengths of the sheet along u and v, so that distances in the parameter plane mean something.
    The border is that of the Delaunay triangles of the feet without those longer than 4 median edges (an alpha shape),
    its largest loop, fitted by a closed cubic that keeps nearly all points inside. Holes inside are kept closed.
    Raises `InputError` if the feet have no such border.
    """
    box = np.array([[float(end) for end in pair] for pair in surface.domain])
    scale = np.asarray([float(side) for side in sides]) / (box[:, 1] - box[:, 0])
    plane = (np.asarray(parameters) - box[:, 0]) * scale
    border = _largest_loop(plane)
    if border is None:
        raise InputError("`parameters` have no outline: the points do not cover an area; do not trim.")
    corners = np.clip(plane[border] / scale + box[:, 0], box[:, 0], box[:, 1])
    return TrimmedSurface(surface, (_smooth_loop(corners, plane[border], box),))


def _largest_loop(plane: Float[np.ndarray, "N 2"]) -> np.ndarray | None:
    """Indices of points around the largest piece of the alpha shape, in order."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(plane).simplices
    except (QhullError, ValueError):  # too few points, or all on one line
        return None
    corners = plane[triangles]
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    triangles = triangles[lengths.max(axis=1) <= _LONG * np.median(lengths)]
    if not len(triangles):
        return None
    # triangles that share an edge hang together; the piece with most of them counts
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(triangles)), 3)
    _, edge_number, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge_number.ravel(), kind="stable")
    shared = np.flatnonzero(np.diff(edge_number.ravel()[order]) == 0)
    links = coo_matrix((np.ones(len(shared)), (owner[order[shared]], owner[order[shared + 1]])), shape=(len(triangles),) * 2)
    _, piece = connected_components(links, directed=False)
    kept = piece == np.bincount(piece).argmax()
    rim = edges[(count[edge_number.ravel()] == 1) & kept[owner]]
    loops = _chain(rim)
    return max(loops, key=lambda loop: _area(plane[loop]), default=None)


def _chain(edges: np.ndarray) -> list[np.ndarray]:
    """Join edges into closed loops; where a corner has four edges, the loop takes any that is left."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    loops = []
    while neighbours:
        start = here = next(iter(neighbours))
        loop = []
        while True:
            loop.append(here)
            following = neighbours[here].pop()
            neighbours[following].remove(here)
            for corner in (here, following):
                if not neighbours[corner]:
                    del neighbours[corner]
            here = following
            if here == start:
                break
        loops.append(np.asarray(loop))
    return loops


def _area(loop: Float[np.ndarray, "k 2"]) -> float:
    return abs(_signed_area(loop))


def _signed_area(loop: Float[np.ndarray, "k 2"]) -> float:
    x, y = loop.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _smooth_loop(
    corners: Float[np.ndarray, "k 2"], plane: Float[np.ndarray, "k 2"], box: Float[np.ndarray, "2 2"]
) -> BSplineCurve:
    """A closed cubic near the corners, inside the domain; few corners are kept as a polygon.

    Least squares, in which corners outside count more (expectile regression): half of them would lie outside else.
    """
    count = len(corners) // _POINTS_PER_KNOT
    if count < 6:
        closed = np.concatenate([corners, corners[:1]])
        return BSplineCurve(closed, clamped_knots(len(closed), 1), 1)
    steps = np.linalg.norm(np.roll(plane, -1, axis=0) - plane, axis=1)
    parameters = jnp.asarray(np.concatenate([[0], np.cumsum(steps)[:-1]]) / steps.sum())
    knots = periodic_knots(count, 3)
    matrix = np.asarray(collocation_matrix(knots.astype(parameters.dtype), 3, parameters, periodic=True))
    weights, turn = np.ones(len(corners)), _signed_area(corners)
    for _ in range(_ROUNDS):
        control = np.linalg.lstsq(weights[:, None] * matrix, weights[:, None] * corners, rcond=None)[0]
        loop = matrix @ control
        ahead = np.roll(loop, -1, axis=0) - np.roll(loop, 1, axis=0)
        left = ahead[:, 0] * (corners - loop)[:, 1] - ahead[:, 1] * (corners - loop)[:, 0]
        weights = np.where(left * turn < 0, np.sqrt(_KEEPING), 1.0)
    return BSplineCurve(np.clip(control, box[:, 0], box[:, 1]), knots, 3, periodic=True)
