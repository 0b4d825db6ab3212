"""Measuring ranges, each fitted alone, joined to one surface."""

import warnings
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._array import Numbers, as_float, concrete
from .._errors import GeometryWarning, InputError
from .._progress import Event, Progress, silent
from ..query import Foot, closest_point
from ..surface import BSplineSurface
from ._align import Alignment, align as fitted_to
from ._arrangement import Meeting, arranged, cut_apart
from ._checkpoint import Watched
from ._cloud import CloudFit, fit_cloud
from ._deviation import Deviation
from ._patchwork import Bands, fitted_bridges, jumps, patchwork
from ._pose import side_lengths

_SPACINGS = 3.0  # reach, in spacings of the points
_ALIGN = 0.02  # of the size: how far apart ranges may be before they are aligned


class Range(eqx.Module):
    """One measuring range in a join.

    fit: the range fitted alone; place: column and row in the grid; pose: how it was moved, `None` if it was not; deviation:
    of its points, moved, from the joined surface; cell: first and last parameters, in u and in v, of the part of the joined
    surface that is its own.
    """

    fit: CloudFit
    place: tuple[int, int] = eqx.field(static=True)
    pose: Alignment | None
    deviation: Deviation
    cell: tuple[tuple[float, float], tuple[float, float]] = eqx.field(static=True)

    def moved(self, points: Numbers) -> Float[np.ndarray, "*n 3"]:
        """Points of the range where the join has them."""
        return np.asarray(points if self.pose is None else self.pose(points))

    @property
    def shift(self) -> Float[np.ndarray, "3"]:
        """How far the middle of the range was moved."""
        middle = np.asarray(self.fit.foot.points).mean(axis=0)
        return self.moved(middle) - middle


class Seam(eqx.Module):
    """Where two ranges meet: their numbers and sides, the share of the first that the second overlaps, the parameters of the
    joined surface between which the bridge lies, and the largest jumps of value, first and second derivative at its ends.

    Jumps are against the size of the surface, derivatives by arc length.
    """

    ranges: tuple[int, int] = eqx.field(static=True)
    sides: tuple[str, str] = eqx.field(static=True)
    overlap: float = eqx.field(static=True)
    direction: str = eqx.field(static=True)
    bridge: tuple[float, float] = eqx.field(static=True)
    jumps: tuple[float, float, float] = eqx.field(static=True)


class JoinedRanges(eqx.Module):
    """What `join_ranges` found: the surface, the feet and deviation of all points in the order of the ranges, and reports by
    range and by seam."""

    shape: BSplineSurface
    foot: Foot
    deviation: Deviation
    ranges: tuple[Range, ...]
    seams: tuple[Seam, ...]
    stopped: bool = False


def join_ranges(
    clouds: Sequence[Numbers],
    *,
    spans: tuple[int, int] | None = None,
    tolerance: float | None = None,
    degree: int = 3,
    loss: str = "squared",
    fairness: float = 0.0,
    align: bool = False,
    reach: float | None = None,
    progress: Progress = silent,
) -> JoinedRanges:
    """Fit clouds (N, 3) that overlap or abut, each alone, and join them to one surface, C² throughout if cubic.

    Which sides meet is found; the ranges must fill a grid, such as 1 × n or 2 × 2. Each fitted surface is cut at isolines
    where its neighbours begin, and stays as it is between them; the bridges in the overlaps, and the corners where four
    ranges meet, are fitted to the points of all ranges there. spans, tolerance, degree (at least 3), loss, fairness: of each
    fit, as in `fit_cloud`. align: correct poses first: each range is turned and shifted so that its points fit the surfaces
    of those before it. reach: how far a side may be from the neighbour that it meets (default three spacings of the points;
    with `align` at least 2 % of the size). Raises `InputError` with the distance where a range touches no other; warns where
    a bridge folds. Source: paper 003, sections 1 and 3, with bridges for vertices that do not coincide.
    """
    points = [np.asarray(concrete(as_float(cloud)), np.float64) for cloud in clouds]
    if len(points) < 2:
        raise InputError(f"`clouds` must be two ranges or more, got {len(points)}.")
    if degree < 3:
        raise InputError(f"`degree` must be at least 3 for seams with continuous curvature, got {degree}.")
    if reach is not None and not reach > 0:
        raise InputError(f"`reach` must be a length > 0, got {reach}.")
    watched = Watched(progress)
    fits = []
    for number, cloud in enumerate(points):
        named = _Named(watched, f"range {number + 1}: ")
        fits.append(
            fit_cloud(cloud, spans=spans, tolerance=tolerance, degree=degree, loss=loss, fairness=fairness, progress=named)
        )
        if fits[-1].stopped:
            raise InputError("`join_ranges` was stopped before every range was fitted; nothing is joined.")
    surfaces = [fit.shape for fit in fits]
    near = max(_spacing(surfaces, points) * _SPACINGS, 3 * max(float(fit.deviation.rms) for fit in fits))
    poses: list[Alignment | None] = [None] * len(points)
    if align:
        wide = max(near, _ALIGN * _size(points)) if reach is None else reach
        poses = _aligned(surfaces, points, wide)
        moves = [pose if pose is not None else (lambda x: x) for pose in poses]
        surfaces = [move(surface) for move, surface in zip(moves, surfaces, strict=True)]
        points = [np.asarray(move(cloud)) for move, cloud in zip(moves, points, strict=True)]
    reach = near if reach is None else reach
    found = arranged(surfaces, reach)
    surface, free, bands = patchwork(*cut_apart(found, reach))
    surface = fitted_bridges(surface, free, np.concatenate(points), watched)
    _warn_of_folds(surface)
    foot = closest_point(surface, np.concatenate(points))
    ends = np.cumsum([len(cloud) for cloud in points])[:-1]
    parts = jnp.split(foot.distance, ends)
    places = {number: place for place, number in found.numbers.items()}
    ranges = [
        Range(fit, places[k], poses[k], Deviation(parts[k]), (bands[0][places[k][0]], bands[1][places[k][1]]))
        for k, fit in enumerate(fits)
    ]
    seams = _seams(surface, found.meetings, places, bands)
    return JoinedRanges(surface, foot, Deviation(foot.distance), tuple(ranges), seams, watched.stop)


class _Named:
    """Progress of one range of several."""

    def __init__(self, progress: Progress, name: str):
        self.progress, self.name = progress, name

    def __call__(self, event: Event) -> object:
        return self.progress(event._replace(phase=self.name + event.phase))


def _aligned(surfaces: list[BSplineSurface], points: list[Float[np.ndarray, "n 3"]], reach: float) -> list[Alignment | None]:
    """Each range on that one, of those already placed, with which it shares most points; the first stays."""
    poses: list[Alignment | None] = [None] * len(points)
    placed, left = {0: surfaces[0]}, set(range(1, len(points)))
    while left:
        shared = {(k, j): _shared(points[k], placed[j], reach) for k in left for j in placed}
        k, j = max(shared, key=lambda pair: shared[pair].sum())
        chosen = shared[k, j]
        if chosen.sum() < 6:
            raise InputError(
                f"Range {k + 1} shares no points with another one within {reach:.4g}, and `align` needs an overlap; "
                "measure one, take a larger `reach`, or leave `align` out."
            )
        pose = fitted_to(points[k][chosen], placed[j])
        poses[k], placed[k] = pose, pose(surfaces[k])
        left.remove(k)
    return poses


def _shared(points: Float[np.ndarray, "n 3"], surface: BSplineSurface, reach: float) -> np.ndarray:
    """Which points have a foot inside a surface, within reach."""
    found = closest_point(surface, points)
    lower, upper = (np.array([float(along[k]) for along in surface.domain]) for k in (0, 1))
    share = (np.asarray(found.parameters) - lower) / (upper - lower)
    inside = np.all((share > 0.01) & (share < 0.99), axis=1)
    return inside & (np.abs(np.asarray(found.distance)) <= reach)


def _seams(surface: BSplineSurface, meetings: list[Meeting], places: Any, bands: Bands) -> tuple[Seam, ...]:
    measured, seams = {}, []
    for meeting in meetings:
        one, other = places[meeting.first], places[meeting.second]
        axis = int(one[1] != other[1])
        bridge = (bands[axis][one[axis]][1], bands[axis][other[axis]][0])
        direction = "uv"[axis]
        for at in bridge:
            if (direction, at) not in measured:
                measured[direction, at] = jumps(surface, at, direction)
        both = [measured[direction, at] for at in bridge]
        largest = (max(b[0] for b in both), max(b[1] for b in both), max(b[2] for b in both))
        seams.append(Seam((meeting.first, meeting.second), meeting.sides, meeting.overlap, direction, bridge, largest))
    return tuple(seams)


def _warn_of_folds(surface: BSplineSurface) -> None:
    """Say where neighbouring normals are opposite."""
    knots = [np.unique(np.asarray(k)) for k in (surface.knots_u, surface.knots_v)]
    u, v = (np.concatenate([k[:-1] + share * np.diff(k) for share in (0.25, 0.75)]) for k in knots)
    u, v = np.sort(u), np.sort(v)
    at = np.meshgrid(u, v, indexing="ij")
    cross = np.cross(surface.derivative(*at, (1, 0)), surface.derivative(*at, (0, 1)))
    turned = [np.sum(a * b, axis=-1) < 0 for a, b in ((cross[1:], cross[:-1]), (cross[:, 1:], cross[:, :-1]))]
    for axis, bad in enumerate(turned):
        if bad.any():
            i, j = np.argwhere(bad)[0]
            warnings.warn(
                f"The joined surface folds near u = {u[i]:.4g}, v = {v[j]:.4g} along {'uv'[axis]}: the ranges overlap "
                "by too little there for their outlines; overlap them by more, or fit them with fewer spans.",
                GeometryWarning,
                stacklevel=3,
            )
            return


def _spacing(surfaces: list[BSplineSurface], points: list[np.ndarray]) -> float:
    """The largest mean spacing of points in a range: the root of area by point."""
    areas = [float(np.prod([float(x) for x in side_lengths(surface)])) for surface in surfaces]
    return max((area / len(cloud)) ** 0.5 for area, cloud in zip(areas, points, strict=True))


def _size(points: list[np.ndarray]) -> float:
    return float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))
