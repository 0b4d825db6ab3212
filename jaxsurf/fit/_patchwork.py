"""A grid of B-spline patches as one surface: bridges between them, fitted to points."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from .._array import Numbers, as_float, concrete
from .._errors import InputError
from .._progress import Event, Progress, silent
from ..build._join_axes import chained
from ..build._same_knots import same_knots
from ..edit._spline_axis import SplineAxis, spline_axis, with_axis
from ..query import closest_point
from ..surface import BSplineSurface
from ._arrangement import side_points
from ._bending import bending_terms
from ._pose import faint_bending, side_lengths

_ATTENUATION = 0.1  # share of the shortest ripple of the net that the background bending takes away, as in `fit_cloud`
_SLIDING = 0.1  # keeps the isolines of the bridges even
_STEPS = 8
_STILL = 1e-6  # of the size: vertices that move less have arrived

Grid = list[list[BSplineSurface]]
"""Patches by column, along u, and row, along v."""

Bands = tuple[list[tuple[float, float]], list[tuple[float, float]]]
"""First and last parameters of the patches, by column and by row; the bridges lie between."""


class JoinedPatches(NamedTuple):
    """The surface, and the first and last parameters that patches have in it: in u by column, in v by row."""

    shape: BSplineSurface
    columns: list[tuple[float, float]]
    rows: list[tuple[float, float]]


def join_patches(
    patches: Sequence[Sequence[Any]], points: Numbers | None = None, *, progress: Progress = silent
) -> JoinedPatches:
    """A grid of B-spline surfaces with gaps between as one surface, C^(degree − 1) throughout, all of them kept in it.

    patches: by column, along u, and row, along v: u1 of `patches[0][0]` faces u0 of `patches[1][0]`, and its v1 faces v0 of
    `patches[0][1]`. The bridges between, and the corners where four patches meet, bend least; with points (N, 3) they are
    fitted to those that lie on them. Patches are of one degree, at least 3; those of a column get one domain in u and common
    knots, those of a row in v. Raises `InputError` with the place where sides face the wrong way, touch or overlap. Source:
    paper 003, with bridges for vertices that do not coincide.
    """
    grid = [list(column) for column in patches]
    _check_grid(grid)
    gaps = [[0.0] * (n - 1) for n in (len(grid), len(grid[0]))]
    for axis, name in ((0, "column"), (1, "row")):
        for k in range(len(gaps[axis])):
            lines = zip(grid[k], grid[k + 1], strict=True) if axis == 0 else ((column[k], column[k + 1]) for column in grid)
            gaps[axis][k] = float(np.mean([_gap(*pair, axis, f"{name} {k + 1}") for pair in lines]))
    surface, free, bands = patchwork(grid, (gaps[0], gaps[1]))
    known = np.zeros((0, 3)) if points is None else np.asarray(concrete(as_float(points)), np.float64)
    return JoinedPatches(fitted_bridges(surface, free, known, progress), *bands)


def _check_grid(grid: list[list[Any]]) -> None:
    if not grid or not grid[0] or any(len(column) != len(grid[0]) for column in grid) or len(grid) * len(grid[0]) < 2:
        sizes = [len(column) for column in grid]
        raise InputError(f"`patches` must be columns of equally many surfaces, two in all or more, got columns of {sizes}.")
    degrees = set()
    for c, column in enumerate(grid):
        for r, patch in enumerate(column):
            if not isinstance(patch, BSplineSurface) or patch.periodic_u or patch.periodic_v:
                raise InputError(
                    f"`patches[{c}][{r}]` must be a B-spline surface that is not periodic, got {type(patch).__name__}; "
                    "js.to_bspline converts."
                )
            degrees |= {patch.degree_u, patch.degree_v}
    if len(degrees) > 1 or min(degrees) < 3:
        raise InputError(f"`patches` must be of one degree of at least 3, got {sorted(degrees)}; see js.elevate_degree.")


def _gap(one: BSplineSurface, other: BSplineSurface, axis: int, where: str) -> float:
    """The mean distance of facing sides."""
    ends = side_points(one, f"{'uv'[axis]}1"), side_points(other, f"{'uv'[axis]}0")
    distances = [float(np.linalg.norm(a - b, axis=1).mean()) for a, b in (ends, (ends[0], ends[1][::-1]))]
    behind = side_points(one, f"{'uv'[axis]}0")
    if distances[1] < distances[0]:
        raise InputError(f"The sides after {where} of `patches` run against each other; turn one of them by js.reverse.")
    apart = np.mean(np.sum((ends[1] - ends[0]) * (ends[0] - behind), axis=1))
    if distances[0] <= 1e-6 * float(np.linalg.norm(np.ptp(np.concatenate(ends), axis=0))) or apart <= 0:
        raise InputError(
            f"The sides after {where} of `patches` touch or overlap: bridges need a gap; cut a strip off by js.split, or "
            "use js.join where control points coincide."
        )
    return distances[0]


def patchwork(patches: Grid, gaps: tuple[list[float], list[float]]) -> tuple[BSplineSurface, Bool[np.ndarray, "n m"], Bands]:
    """One surface C^(degree − 1) throughout that has all patches in it as they are, and which of its control points no patch
    determines.

    gaps: lengths of the bridges between columns and between rows. Patches of a column get one domain in u, as long as they
    are on average, and all knots of all of them; those of a row likewise in v.
    """
    columns, rows = len(patches), len(patches[0])
    sides = np.array([[[float(x) for x in side_lengths(patch)] for patch in column] for column in patches])
    patches = [_alike(column, "u", float(sides[c, :, 0].mean())) for c, column in enumerate(patches)]
    lines = [_alike([column[r] for column in patches], "v", float(sides[:, r, 1].mean())) for r in range(rows)]
    degree = max(lines[0][0].degree_u, lines[0][0].degree_v)
    sizes_u = [_sizes(gap, [lines[0][c], lines[0][c + 1]], "u", degree) for c, gap in enumerate(gaps[0])]
    sizes_v = [_sizes(gap, [lines[r][0], lines[r + 1][0]], "v", degree) for r, gap in enumerate(gaps[1])]
    across = [chained([spline_axis(patch, "u") for patch in line], sizes_u) for line in lines]
    knots_u, _, firsts_u = across[0]
    along = []
    for c in range(columns):
        swapped = [jnp.swapaxes(across[r][1][c], 0, 1) for r in range(rows)]
        axes = [SplineAxis(net, lines[r][c].knots_v, degree) for r, net in enumerate(swapped)]
        along.append(chained(axes, sizes_v))
    knots_v, _, firsts_v = along[0]
    net = np.zeros((len(knots_u) - degree - 1, len(knots_v) - degree - 1, 3))
    free = np.ones(net.shape[:2], bool)
    for c, u in enumerate(firsts_u):
        for r, v in enumerate(firsts_v):
            own = np.swapaxes(np.asarray(along[c][1][r]), 0, 1)
            net[u : u + own.shape[0], v : v + own.shape[1]] = own
            free[u : u + own.shape[0], v : v + own.shape[1]] = False
    counts_u = [across[0][1][c].shape[0] for c in range(columns)]
    counts_v = [along[0][1][r].shape[0] for r in range(rows)]
    bands = (_bands(knots_u, firsts_u, counts_u, degree), _bands(knots_v, firsts_v, counts_v, degree))
    dtype = patches[0][0].dtype
    made = [jnp.asarray(x, dtype) for x in (net, knots_u, knots_v)]
    surface = BSplineSurface(made[0], made[1], made[2], degree, degree)
    return surface, free, bands


def fitted_bridges(
    surface: BSplineSurface, free: Bool[np.ndarray, "n m"], points: Float[np.ndarray, "N 3"], progress: Progress
) -> BSplineSurface:
    """The free control points such that the bridges bend least, and then follow the points; all others stay bit for bit.

    Gauss-Newton on signed distances, the feet found anew in each step, with the background bending of `fit_cloud` counted
    from the bridges that bend least.
    """
    if not free.any():
        return surface
    own = np.flatnonzero(free.reshape(-1))
    sides = [float(x) for x in side_lengths(surface)]
    bending = _bending(surface, (sides[0], sides[1]))
    net = np.asarray(surface.control_points, np.float64).reshape(-1, 3).copy()
    at_rest = np.delete(np.arange(len(net)), own)
    within = bending[own][:, own]
    net[own] = _solve(within, -(bending[own][:, at_rest] @ net[at_rest]))
    surface, rest, feet = _with_net(surface, net), net.copy(), None
    if not len(points):
        return surface
    weight = faint_bending(max(surface.control_points.shape[:2]), _ATTENUATION)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    for step in range(_STEPS):
        found = closest_point(surface, points, start=feet)
        feet = np.asarray(found.parameters)
        rows = _design(surface, feet)[:, own]
        seen = np.flatnonzero(np.diff(rows.indptr))
        if progress(Event("bridge", step, _STEPS, float(np.sqrt(np.mean(np.square(found.distance)))))) or not len(seen):
            break
        offsets = points[seen] - np.asarray(found.points)[seen]
        change = _step(rows[seen], offsets, _unit_normals(surface, feet[seen]), weight * within, net[own] - rest[own])
        net[own] += change
        surface = _with_net(surface, net)
        if np.abs(change).max() < _STILL * size:
            break
    return surface


def _step(rows: Any, offsets: np.ndarray, normals: np.ndarray, bending: Any, bent: np.ndarray) -> np.ndarray:
    """The change of the free control points, (free, 3), that takes up the heights of points over their feet."""
    from scipy.sparse import diags, hstack, kron

    across = hstack([diags(normals[:, k]) @ rows for k in range(3)]).tocsr()
    stiff = bending * len(offsets)
    system = across.T @ across + kron(np.eye(3), stiff + _SLIDING * (rows.T @ rows))
    right = across.T @ np.sum(offsets * normals, axis=1) - (stiff @ bent).T.reshape(-1)
    return _solve(system, right).reshape(3, -1).T


def _solve(matrix: Any, right: np.ndarray) -> np.ndarray:
    """A sparse positive (semi)definite system; what nothing determines stays small."""
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    scale = matrix.diagonal().mean()
    return splu((matrix + 1e-12 * scale * identity(matrix.shape[0])).tocsc()).solve(right)


def _bending(surface: BSplineSurface, sides: tuple[float, float]) -> Any:
    """The matrix of `bending_matrix`, sparse."""
    from scipy.sparse import csr_matrix, kron

    sparse = lambda matrix: csr_matrix(np.asarray(matrix))
    total: Any = sum(float(w) * kron(sparse(u), sparse(v)) for u, v, w in bending_terms(surface, sides))
    return total.tocsr()


def _design(surface: BSplineSurface, feet: Float[np.ndarray, "N 2"]) -> Any:
    from scipy.interpolate import BSpline

    knots = [np.asarray(k, np.float64) for k in (surface.knots_u, surface.knots_v)]
    degrees = surface.degree_u, surface.degree_v
    inside = [np.clip(feet[:, i], k[p], k[-p - 1]) for i, (k, p) in enumerate(zip(knots, degrees, strict=True))]
    along_u, along_v = (BSpline.design_matrix(t, k, p) for t, k, p in zip(inside, knots, degrees, strict=True))
    return _row_products(along_u, along_v)


def _unit_normals(surface: BSplineSurface, feet: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 3"]:
    u, v = (jnp.asarray(feet[:, i]) for i in (0, 1))
    cross = np.cross(surface.derivative(u, v, (1, 0)), surface.derivative(u, v, (0, 1)))
    return cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), np.finfo(float).tiny)


def _with_net(surface: BSplineSurface, net: np.ndarray) -> BSplineSurface:
    points = jnp.asarray(net.reshape(surface.control_points.shape), surface.dtype)
    return BSplineSurface(points, surface.knots_u, surface.knots_v, surface.degree_u, surface.degree_v)


def _alike(line: list[BSplineSurface], direction: str, length: float) -> list[BSplineSurface]:
    """Patches side by side on common knots over [0, length] in one direction."""
    axes = same_knots([spline_axis(patch, direction) for patch in line], (0.0, length))
    return [with_axis(patch, axis, direction) for patch, axis in zip(line, axes, strict=True)]


def _sizes(gap: float, pair: list[BSplineSurface], direction: str, degree: int) -> np.ndarray:
    """Spans of a bridge: as long as those of its neighbours, but more than the degree, so that there are free vertices."""
    spans = np.concatenate([np.diff(np.unique(np.asarray(spline_axis(patch, direction).knots))) for patch in pair])
    count = degree + max(1, round(gap / float(np.median(spans))))
    return np.full(count, gap / count)


def _bands(knots: np.ndarray, firsts: list[int], counts: list[int], degree: int) -> list[tuple[float, float]]:
    return [(float(knots[k + degree]), float(knots[k + n])) for k, n in zip(firsts, counts, strict=True)]


def jumps(surface: BSplineSurface, at: float, direction: str, count: int = 65) -> tuple[float, float, float]:
    """Largest jumps of the point, and of first and second derivatives by arc length, across a knot, against the size.

    By the polynomials of the spans on both sides of it, each from its own control points.
    """
    axis = spline_axis(surface, direction)
    knots, p, along = np.asarray(axis.knots), axis.degree, "uv".index(direction)
    after = int(np.searchsorted(knots, at, side="right")) - 1
    before = int(np.searchsorted(knots, at, side="left")) - 1
    first, last = (float(x) for x in surface.domain[1 - along])
    other, fixed = np.linspace(first, last, count), np.full(count, at)
    place = (fixed, other) if along == 0 else (other, fixed)
    sides = []
    for span in (before, after):
        own = SplineAxis(axis.net[span - p : span + 1], axis.knots[span - p : span + p + 2], p)
        part = with_axis(surface, own, direction)
        sides.append([np.asarray(part.derivative(*place, ((k, 0), (0, k))[along])) for k in range(3)])
    size = float(np.linalg.norm(np.ptp(np.asarray(surface.control_points).reshape(-1, 3), axis=0)))
    speed = np.linalg.norm(sides[0][1], axis=1).mean()
    scales = (1 / size, 1 / speed, size / speed**2)
    found = [np.linalg.norm(a - b, axis=1).max() * scale for a, b, scale in zip(*sides, scales, strict=True)]
    return float(found[0]), float(found[1]), float(found[2])


def _row_products(a: Any, b: Any) -> Any:
    """The sparse matrix whose rows are the Kronecker products of the rows of two with equally many entries in each."""
    from scipy.sparse import csr_matrix

    rows, n, m = a.shape[0], a.shape[1], b.shape[1]
    index_a, index_b = a.indices.reshape(rows, -1), b.indices.reshape(rows, -1)
    values = a.data.reshape(rows, -1)[:, :, None] * b.data.reshape(rows, -1)[:, None, :]
    indices = index_a[:, :, None] * m + index_b[:, None, :]
    starts = np.arange(rows + 1) * values[0].size
    return csr_matrix((values.ravel(), indices.ravel(), starts), shape=(rows, n * m))
