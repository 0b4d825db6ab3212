"""Quaternion integral surfaces fitted to clouds, from the plane that a modeller begins with."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._array import Numbers, as_float, concrete
from .._errors import InputError
from .._progress import Event, Progress, silent
from ..surface import QISurface
from ._cloud import CloudFit, Stage, fit_cloud, left_out
from ._coverage import coverage
from ._deviation import Deviation
from ._fit import check_weights, fit
from ._losses import find_loss
from ._parametrise import check_sheet

_READY = math.pi / 2  # angles between tangents that the start is ready for, so that bending compiles nothing anew

_SLIDING = 0.1  # keeps the lines of the surface even
_RTOL = 1e-3  # relative gain of the objective below which the fit ends: the rest is turning that no point sees


def fit_qi(
    points: Numbers,
    *,
    tangents: tuple[int, int] = (3, 3),
    degree: int = 2,
    loss: str = "squared",
    fairness: float = 0.0,
    holdout: float = 0.0,
    seed: int = 0,
    progress: Progress = silent,
) -> CloudFit:
    """Fit a QI surface to an unordered sheet-like cloud (N, 3): control tangents, lengths, initial curve and its place.

    tangents: how many control tangents along u, the longer side, and along v, where the initial curve has as many. It begins
    with the plane (`qi_plane`) as a modeller does. degree: of both directions and the initial curve; loss, fairness: as in
    `fit`; holdout, seed: as in `fit_cloud`. A true return value of `progress` stops at the best surface so far.
    Raises `InputError` on clouds that carry no surface. Source: paper 004, figure 1, with a solver for the designer.
    """
    points = as_float(points)
    find_loss(loss)
    check_weights(fairness, None)
    if not 0 <= holdout < 1:
        raise InputError(f"`holdout` must be in [0, 1), got {holdout}.")
    start = qi_plane(points, tangents, degree)
    progress(Event("parametrise"))
    n, m = tangents
    options = {"loss": loss, "fairness": fairness, "sliding": _SLIDING, "release": 1.0, "rtol": _RTOL}
    options["progress"] = progress
    done = fit(start, points, phase=f"fit {n} × {m} tangents", **options)
    missed = None
    if holdout > 0 and not done.stopped:
        chosen = left_out(points.shape[0], holdout, seed)
        weights = jnp.asarray(~chosen, points.dtype)
        again = fit(done.shape, points, start=done.foot.parameters, weights=weights, phase="hold-out", **options)
        missed = Deviation(jnp.asarray(np.asarray(again.deviation)[chosen])) if chosen.any() else None
    covered = coverage(done.shape, done.foot.parameters)
    stage = Stage((n - degree, m - degree), n * m, float(done.deviation.rms), None)
    return CloudFit(done.shape, done.foot, done.deviation, done.result, done.stopped, missed, covered, (stage,), None)


def numbers_of(surface: QISurface) -> int:
    """How many numbers shape a QI surface: two for a direction, one for a length, three for the place."""
    spine = surface.spine.tangents.shape[0]
    n, m = surface.tangents.shape[:2]
    return 2 * (n * m + spine) + m + 1 + 3


def peer_spans(numbers: int, degree: int = 2) -> tuple[int, int]:
    """Spans of the smallest B-spline net of this degree with at least as many numbers; u the longer side."""
    count = -(-numbers // 3)
    sides = [(n, max(-(-count // n), degree + 1)) for n in range(degree + 1, count + degree + 1)]
    n, m = min((pair for pair in sides if pair[0] >= pair[1]), key=lambda pair: (pair[0] * pair[1], pair[0] - pair[1]))
    return n - degree, m - degree


def peer_fit(points: Numbers, surface: QISurface, **options: Any) -> CloudFit:
    """The B-spline fit of the same cloud with as many numbers, or the few more that a net needs, for comparison."""
    return fit_cloud(points, spans=peer_spans(numbers_of(surface)), degree=2, **options)


def qi_plane(points: Numbers, tangents: tuple[int, int] = (3, 3), degree: int = 2) -> QISurface:
    """The flat QI surface over the smallest rectangle, in the plane of inertia, about a sheet-like cloud (N, 3).

    tangents: how many control tangents along u, the longer side, and along v, where the initial curve has as many.
    Raises `InputError` on clouds that carry no surface and on fewer points than there are tangents.
    """
    points = as_float(points)
    host = np.asarray(concrete(points), np.float64)
    check_sheet(host)
    if len(tangents) != 2 or any(int(n) != n or n <= degree for n in tangents):
        raise InputError(f"`tangents` must be two whole numbers > `degree` = {degree} such as (3, 3), got {tangents!r}.")
    if len(host) < tangents[0] * tangents[1]:
        raise InputError(f"`points` must be at least as many as the {tangents[0] * tangents[1]} tangents, got {len(host)}.")
    centre = host.mean(axis=0)
    axes = np.linalg.svd(host - centre, full_matrices=False)[2]
    axes[2] = np.cross(axes[0], axes[1])
    flat = (host - centre) @ axes[:2].T
    turn = _best_turn(flat)
    low, high = (flat @ turn.T).min(axis=0), (flat @ turn.T).max(axis=0)
    if np.diff([high, low], axis=0)[0] @ [1, -1] > 0:  # v is longer: a quarter turn
        turn = np.array([[0.0, 1.0], [-1.0, 0.0]]) @ turn
        low, high = (flat @ turn.T).min(axis=0), (flat @ turn.T).max(axis=0)
    directions = turn @ axes[:2]
    corner = centre + low @ directions
    along_u, along_v = jnp.asarray((high - low)[:, None] * directions, points.dtype)
    plane = QISurface.plane(jnp.asarray(corner, points.dtype), along_u, along_v, tangents, degree)
    return plane.replace(spine=plane.spine.replace(angle=_READY), angles=(_READY, _READY))


def _best_turn(flat: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "2 2"]:
    """The rotation after which the bounding box is smallest."""
    angles = np.linspace(0, math.pi / 2, 46)[:-1]
    turns = np.stack([np.stack([np.cos(angles), np.sin(angles)], 1), np.stack([-np.sin(angles), np.cos(angles)], 1)], 1)
    extents = np.ptp(np.einsum("nk,ajk->anj", flat, turns), axis=1)
    return turns[int(np.argmin(extents[:, 0] * extents[:, 1]))]
