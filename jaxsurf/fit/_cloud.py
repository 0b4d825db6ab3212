"""From an unordered cloud to a B-spline surface: the main job."""

import os
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array

from .._array import Numbers
from .._errors import InputError
from .._progress import Event, Progress, silent
from ..basis import refinement_matrix
from ..surface import BSplineSurface
from . import _processes as processes
from ._checkpoint import Checkpoint, Watched, cloud_mark
from ._coverage import Coverage, coverage
from ._deviation import Deviation
from ._first_net import ATTENUATION, SLIDING, best_start, linear_start
from ._fit import Fit, check_weights, fit, nearest_feet
from ._losses import find_loss
from ._parametrise import check_sheet, parametrise
from ._pose import faint_bending, side_lengths
from ._refine import refined_knots
from ._sharded_points import ShardedPoints, check_finite, whole_points

_COARSE = 4  # spans of the first net where a tolerance is to be met: enough to bend with the sheet
_RTOL = 0.005  # relative gain of the objective below which a stage ends: the rest is gliding along the sheet
SAMPLE = 200_000  # points of a large cloud, at most, from which the first net is taken, and which pictures show


class Stage(eqx.Module):
    """One round of a cloud fit: spans per direction, number of control points, rms, share of points within tolerance."""

    spans: tuple[int, int] = eqx.field(static=True)
    control_points: int = eqx.field(static=True)
    rms: float = eqx.field(static=True)
    within: float | None = eqx.field(static=True)


class CloudFit(eqx.Module):
    """What `fit_cloud` or `fit_qi` found.

    shape, foot, deviation, result, stopped: as in `Fit`, over all points; holdout: deviation of points left out of a
    refit, or `None`; coverage: the knot cells without points; stages: the history of refinement; met: whether the
    tolerance was reached, `None` without one.
    """

    shape: Any
    foot: Any
    deviation: Deviation
    result: Any
    stopped: bool
    holdout: Deviation | None
    coverage: Coverage
    stages: tuple[Stage, ...]
    met: bool | None


def fit_cloud(
    points: Numbers | ShardedPoints,
    *,
    spans: tuple[Any, ...] | None = None,
    tolerance: float | None = None,
    quantile: float = 0.95,
    degree: int = 3,
    loss: str = "squared",
    fairness: float = 0.0,
    holdout: float = 0.0,
    max_spans: int = 40,
    seed: int = 0,
    progress: Progress = silent,
    checkpoint: str | os.PathLike | None = None,
    resume: bool = False,
) -> CloudFit:
    """Fit a B-spline surface to an unordered sheet-like cloud (N, 3) of unknown parametrisation.

    spans: knot intervals per direction of the first net, u along the longer side; by default 8 × 8, or 4 × 4 where a
    tolerance is given. tolerance: knots are inserted where points lie farther than that, until a share `quantile` of them
    lies within, or `max_spans` are reached, or there would be fewer than two points for a control point. degree, loss,
    fairness: as in `fit`. holdout: share of the points that a second fit of the same net leaves out, to measure the
    deviation of points it has not seen (the surface that is returned has seen all).
    checkpoint: a file in which the fit keeps where it stands, at every stage and about once a second; it stays when the fit
    is done. resume: go on from there, with the same cloud and options; where that was compared, the surface came out as
    that of the fit that was not cut off to 1e-10 of the size.

    Points of `shard_points` are worked on by all of their devices. With several processes `foot` and `deviation` lie
    spread over them, and all must ask for figures together.

    The cloud is unrolled (`parametrise`; of more than 200 000 points every k-th), a first net fitted, and refined; a true
    return value of `progress` stops at the best surface so far. Raises `InputError` on clouds that carry no surface, and
    on a checkpoint of another cloud or of other options.
    """
    cloud = whole_points(points)
    check_finite(cloud)
    sample = cloud.picked(sample_index(cloud.count))
    check_sheet(sample)
    find_loss(loss)
    check_weights(fairness, None)
    _check_options(cloud.count, spans, tolerance, quantile, degree, holdout, max_spans)
    most = min(8 if tolerance is None else _COARSE, max_spans)
    first = (most, most) if spans is None else (int(spans[0]), int(spans[1]))
    _check_enough(cloud.count, first, degree)
    given = {"spans": list(first), "tolerance": tolerance, "quantile": quantile, "degree": degree, "loss": loss}
    given |= {"fairness": fairness, "holdout": holdout, "max_spans": max_spans, "seed": seed}
    mark = {} if checkpoint is None and not resume else cloud_mark(cloud, sample)
    kept = Checkpoint(checkpoint, {**mark, **given, "type of the numbers": str(cloud.points.dtype)})

    watched = Watched(progress)
    options = {"loss": loss, "fairness": fairness, "progress": watched}
    if resume:
        state, snapshot = kept.read()
        start, rest, stages = state["start"], state["rest"], [Stage(**stage) for stage in state["stages"]]
        feet, done = None, _measured(start, cloud) if state["held_out"] else None
    else:
        watched(Event("parametrise"))
        start, feet = _first_net(cloud, sample, first, degree, watched)
        rest, stages, done, snapshot = start, [], None, None
    watched.together, watched.keep = not cloud.alone, kept.keep

    def begin(start: BSplineSurface, held_out: bool) -> None:
        table = [{"spans": s.spans, "control_points": s.control_points, "rms": s.rms, "within": s.within} for s in stages]
        kept.begin({"start": start, "rest": rest, "stages": table, "held_out": held_out}, snapshot)

    while done is None:
        begin(start, held_out=False)
        done = _refit(start, cloud, feet, rest, {**options, "resume": snapshot})
        snapshot = None
        stages.append(_stage(done, cloud, tolerance))
        finer = _finer(done, cloud, stages[-1], tolerance, quantile, max_spans)
        if finer is not None:
            knots_u, knots_v = (jnp.asarray(k, cloud.points.dtype) for k in finer)
            feet = done.foot.parameters
            start = linear_start(cloud, feet, knots_u, knots_v, degree, side_lengths(done.shape))
            rest, done = _on_knots(done.shape, knots_u, knots_v), None
    missed = None
    if holdout > 0 and not done.stopped:
        begin(done.shape, held_out=True)
        missed = _hold_out(done, cloud, rest, holdout, seed, {**options, "resume": snapshot})
    met = None if tolerance is None else (stages[-1].within or 0) >= quantile
    cells = coverage(done.shape, cloud.rows(done.foot.parameters)).covered
    return CloudFit(
        done.shape,
        done.foot,
        done.deviation,
        done.result,
        watched.stop,
        None if watched.stop else missed,
        Coverage(cloud.summed(cells.astype(np.int32)) > 0),
        tuple(stages),
        met,
    )


def sample_index(count: int) -> np.ndarray:
    """Numbers of the points that stand for a cloud of `count`, whoever holds them: every k-th, `SAMPLE` at most."""
    return np.arange(0, count, max(1, -(-count // SAMPLE)))


def _first_net(
    cloud: ShardedPoints, sample: np.ndarray, spans: tuple[int, int], degree: int, progress: Progress
) -> tuple[BSplineSurface, Array | None]:
    """The net to begin with, and the feet on it if those of all points are known; the same in all processes."""
    start, feet = best_start(sample, parametrise(sample), spans, degree, progress)
    if cloud.alone:
        return start, feet if len(sample) == cloud.count else None
    # machines may differ in the last bits, and the first process counts
    start = jax.tree.map(lambda x: jnp.asarray(processes.from_first(np.asarray(x))), start)
    if feet is None or len(sample) < cloud.count:
        return start, None
    return start, cloud.spread(processes.from_first(np.asarray(feet))[cloud.first : cloud.first + cloud.here])


def _finer(
    done: Fit, cloud: ShardedPoints, stage: Stage, tolerance: Any, quantile: float, max_spans: int
) -> tuple[np.ndarray, np.ndarray] | None:
    """Knots of the next net, or `None` if this one is the last."""
    if tolerance is None or done.stopped or (stage.within or 0) >= quantile:
        return None
    feet, signed = cloud.rows(done.foot.parameters), cloud.rows(done.deviation.signed)
    finer = refined_knots(done.shape, feet, signed, tolerance, max_spans, cloud.summed)
    degree = done.shape.degree_u
    if finer is None or 2 * np.prod([len(k) - degree - 1 for k in finer]) > cloud.count:
        return None
    return finer


def _on_knots(surface: BSplineSurface, knots_u: Array, knots_v: Array) -> BSplineSurface:
    """The same surface on finer knots."""
    matrix_u = refinement_matrix(surface.knots_u, knots_u, surface.degree_u)
    matrix_v = refinement_matrix(surface.knots_v, knots_v, surface.degree_v)
    net = jnp.einsum("ij,kl,jlx->ikx", matrix_u, matrix_v, surface.control_points)
    return BSplineSurface(net, knots_u, knots_v, surface.degree_u, surface.degree_v)


def _refit(start: BSplineSurface, cloud: ShardedPoints, feet: Any, rest: BSplineSurface, options: dict[str, Any]) -> Fit:
    """A fit whose background bending counts from the coarser surface `rest`: curved sheets are not dragged flat."""
    weight = faint_bending(max(start.control_points.shape[:2]), ATTENUATION)
    phase = options.get("phase", "fit {} × {} spans".format(*_spans(start)))
    fixed = {"start": feet, "rest": rest, "bending": weight, "sliding": SLIDING, "release": 1.0, "rtol": _RTOL}
    return fit(start, cloud, **{**fixed, **options, "phase": phase})


def _measured(shape: BSplineSurface, cloud: ShardedPoints) -> Fit:
    """The fit of which only the shape is known any more."""
    foot, deviation = nearest_feet(shape, cloud)
    return Fit(shape, foot, deviation, optx.RESULTS.successful, jnp.asarray(np.int32(0)))


def left_out(count: int, share: float, seed: int, first: int = 0) -> np.ndarray:
    """Which of `count` points a check fit does not see; first: the number of the first of them in the whole cloud."""
    bits = np.random.PCG64(seed)  # those of `default_rng`
    bits.advance(first)
    return np.random.Generator(bits).uniform(size=count) < share


def _hold_out(
    done: Fit, cloud: ShardedPoints, rest: BSplineSurface, share: float, seed: int, options: dict[str, Any]
) -> Deviation | None:
    """Refit with the chosen points weighing nothing, and measure those; the compiled fit serves again."""
    chosen = left_out(cloud.here, share, seed, cloud.first)
    if not cloud.summed(np.asarray(chosen.sum())):
        return None
    weights = jnp.asarray(~chosen, cloud.points.dtype)
    options = {**options, "weights": weights, "phase": "hold-out"}
    again = _refit(done.shape, cloud, done.foot.parameters, rest, options)
    if cloud.alone:
        return Deviation(jnp.asarray(np.asarray(again.deviation)[chosen]))
    return Deviation(again.deviation.signed, cloud.spread(chosen.astype(cloud.points.dtype)) * cloud.counted)


def _stage(done: Fit, cloud: ShardedPoints, tolerance: float | None) -> Stage:
    n, m = done.shape.control_points.shape[:2]
    within = None
    if tolerance is not None:
        inside = np.sum(np.abs(cloud.rows(done.deviation.signed)) <= tolerance)
        within = float(cloud.summed(inside)) / cloud.count
    return Stage(_spans(done.shape), n * m, float(done.deviation.rms), within)


def _spans(surface: BSplineSurface) -> tuple[int, int]:
    n, m = surface.control_points.shape[:2]
    return n - surface.degree_u, m - surface.degree_v


def _check_options(
    count: int, spans: Any, tolerance: Any, quantile: float, degree: int, holdout: float, max_spans: int
) -> None:
    if spans is not None and (len(spans) != 2 or any(int(n) != n or n < 1 for n in spans)):
        raise InputError(f"`spans` must be two whole numbers ≥ 1 such as (8, 8), got {spans!r}.")
    if tolerance is not None and not tolerance > 0:
        raise InputError(f"`tolerance` must be a length > 0, got {tolerance}.")
    if not 0 < quantile <= 1:
        raise InputError(f"`quantile` must be in (0, 1], got {quantile}.")
    if not 1 <= degree <= 7:
        raise InputError(f"`degree` must be from 1 to 7, got {degree}.")
    if not 0 <= holdout < 1:
        raise InputError(f"`holdout` must be in [0, 1), got {holdout}.")
    if max_spans < 1:
        raise InputError(f"`max_spans` must be at least 1, got {max_spans}.")


def _check_enough(count: int, spans: tuple[int, int], degree: int) -> None:
    needed = (spans[0] + degree) * (spans[1] + degree)
    if count < needed:
        raise InputError(
            f"`points` must be at least as many as the {needed} control points of {spans[0]} × {spans[1]} spans of degree "
            f"{degree}, got {count}; take fewer `spans` or measure more points."
        )
