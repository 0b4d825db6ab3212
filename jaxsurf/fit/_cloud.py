"""From an unordered cloud to a B-spline surface: the main job."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete
from .._errors import InputError
from .._progress import Event, Progress, silent
from ..basis import clamped_knots, refinement_matrix
from ..surface import BSplineSurface
from ._bending import bending_of
from ._coverage import Coverage, coverage
from ._deviation import Deviation
from ._fit import Fit, check_weights, fit
from ._losses import find_loss
from ._parametrise import Parametrisation, check_sheet, parametrise
from ._pose import faint_bending, side_lengths
from ._refine import refined_knots

_COARSE = 4  # spans of the first net where a tolerance is to be met: enough to bend with the sheet
_STIFF = 1.0  # the same for the first net, which must not fold
_RTOL = 0.005  # relative gain of the objective below which a stage ends: the rest is gliding along the sheet
_SLIDING = 0.1  # keeps the isolines of the net even: they follow the unrolled sheet
_ATTENUATION = 0.1  # share of the shortest ripple of the net that the background bending takes away


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
    points: Numbers,
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
) -> CloudFit:
    """Fit a B-spline surface to an unordered sheet-like cloud (N, 3) of unknown parametrisation.

    spans: knot intervals per direction of the first net, u along the longer side; by default 8 × 8, or 4 × 4 where a
    tolerance is given. tolerance: knots are inserted where points lie farther than that, until a share `quantile` of them
    lies within, or `max_spans` are reached, or there would be fewer than two points for a control point. degree, loss,
    fairness: as in `fit`. holdout: share of the points that a second fit of the same net leaves out, to measure the
    deviation of points it has not seen (the surface that is returned has seen all).

    The cloud is unrolled (`parametrise`), a first net fitted, and refined; a true return value of `progress` stops at
    the best surface so far. Raises `InputError` on clouds that carry no surface.
    """
    points = as_float(points)
    host = np.asarray(concrete(points), np.float64)
    check_sheet(host)
    find_loss(loss)
    check_weights(fairness, None)
    _check_options(len(host), spans, tolerance, quantile, degree, holdout, max_spans)
    most = min(8 if tolerance is None else _COARSE, max_spans)
    first = (most, most) if spans is None else spans
    _check_enough(len(host), first, degree)

    watched = Watched(progress)
    watched(Event("parametrise"))
    options = {"loss": loss, "fairness": fairness, "progress": watched}
    start, feet = _best_start(points, parametrise(host), first, degree, watched)
    rest = start
    done = _refit(start, points, feet, rest, options)
    stages = [_stage(done, tolerance)]
    while tolerance is not None and not done.stopped and (stages[-1].within or 0) < quantile:
        finer = refined_knots(done.shape, done.foot.parameters, done.deviation.signed, tolerance, max_spans)
        if finer is None or 2 * np.prod([len(k) - degree - 1 for k in finer]) > len(host):
            break
        knots_u, knots_v = (jnp.asarray(k, points.dtype) for k in finer)
        start = linear_start(points, done.foot.parameters, knots_u, knots_v, degree, side_lengths(done.shape))
        rest = _on_knots(done.shape, knots_u, knots_v)
        done = _refit(start, points, done.foot.parameters, rest, options)
        stages.append(_stage(done, tolerance))
    missed = None
    if holdout > 0 and not done.stopped:
        missed = _hold_out(done, points, rest, holdout, seed, options)
    met = None if tolerance is None else (stages[-1].within or 0) >= quantile
    return CloudFit(
        done.shape,
        done.foot,
        done.deviation,
        done.result,
        watched.stop,
        None if watched.stop else missed,
        coverage(done.shape, done.foot.parameters),
        tuple(stages),
        met,
    )


def linear_start(
    points: Float[Array, "N 3"],
    parameters: Float[Array, "N 2"],
    knots_u: Float[Array, "k"],
    knots_v: Float[Array, "l"],
    degree: int,
    sides: tuple[Any, Any],
    attenuation: float = _ATTENUATION,
) -> BSplineSurface:
    """The net of least squares at known parameters, held by its bending energy where there are no points."""
    from scipy.interpolate import BSpline
    from scipy.linalg import solve

    host = np.asarray(points, np.float64)
    feet, knots = np.asarray(parameters, np.float64), [np.asarray(k, np.float64) for k in (knots_u, knots_v)]
    along_u: Any = BSpline.design_matrix(feet[:, 0], knots[0], degree)
    along_v: Any = BSpline.design_matrix(feet[:, 1], knots[1], degree)
    count = along_u.shape[1], along_v.shape[1]
    design = row_products(along_u, along_v)
    flat = BSplineSurface(jnp.asarray(np.zeros((*count, 3)), points.dtype), knots_u, knots_v, degree, degree)
    bending = np.asarray(bending_of(flat, sides), np.float64)
    weight = faint_bending(max(count), attenuation)
    matrix = (design.T @ design).toarray() / len(host) + weight * bending
    matrix += np.eye(len(matrix)) * (1e-13 * np.trace(matrix) / len(matrix))
    net = solve(matrix, design.T @ (host - host.mean(axis=0)) / len(host), assume_a="pos") + host.mean(axis=0)
    return BSplineSurface(jnp.asarray(net.reshape(*count, 3), points.dtype), knots_u, knots_v, degree, degree)


def row_products(a: Any, b: Any) -> Any:
    """The sparse matrix whose rows are the Kronecker products of the rows of two with equally many entries in each."""
    from scipy.sparse import csr_matrix

    rows, n, m = a.shape[0], a.shape[1], b.shape[1]
    index_a, index_b = a.indices.reshape(rows, -1), b.indices.reshape(rows, -1)
    values = a.data.reshape(rows, -1)[:, :, None] * b.data.reshape(rows, -1)[:, None, :]
    indices = index_a[:, :, None] * m + index_b[:, None, :]
    starts = np.arange(rows + 1) * values[0].size
    return csr_matrix((values.ravel(), indices.ravel(), starts), shape=(rows, n * m))


class Watched:
    """The caller's progress, remembering a wish to stop; never the silent default itself, so that every fit of a cloud is
    stepped by the same compiled function."""

    def __init__(self, progress: Progress):
        self.progress, self.stop = progress, False

    def __call__(self, event: Event) -> bool:
        self.stop = bool(self.progress(event)) or self.stop
        return self.stop


def _best_start(
    points: Float[Array, "N 3"],
    candidates: list[Parametrisation],
    spans: tuple[int, int],
    degree: int,
    progress: Progress,
) -> tuple[BSplineSurface, Array | None]:
    """A first net, stiff, and the feet on it: of the candidate whose short fit comes closest to the thinned cloud."""
    best, best_rms = None, np.inf
    knots_u, knots_v = (as_float(clamped_knots(n + degree, degree), points.dtype) for n in spans)
    sample = points[candidates[0].index]
    for candidate in candidates:
        parameters = jnp.asarray(candidate.parameters, points.dtype)
        start = linear_start(sample, parameters, knots_u, knots_v, degree, candidate.sides, _STIFF)
        start, parameters = _facing_outwards(start, parameters, np.asarray(sample).mean(axis=0))
        stiff = faint_bending(max(spans) + degree, _STIFF)
        trial = fit(
            start,
            sample,
            start=parameters,
            bending=stiff,
            sliding=_SLIDING,
            max_steps=6,
            progress=progress,
            phase="unroll",
        )
        if float(trial.deviation.rms) < best_rms:
            best, best_rms = trial, float(trial.deviation.rms)
        if trial.stopped:
            break
    assert best is not None
    return best.shape, best.foot.parameters if len(sample) == len(points) else None


def _facing_outwards(surface: BSplineSurface, parameters: Array, centre: np.ndarray) -> tuple[BSplineSurface, Array]:
    """Turn u round if the normal points to the hollow side, or, on a flat sheet, against its main axis."""
    net = np.asarray(surface.control_points)
    # twice the area vector of the net, and where its middle lies from the centre of the points
    normal = np.cross(net[1:, 1:] - net[:-1, :-1], net[:-1, 1:] - net[1:, :-1]).sum(axis=(0, 1))
    outwards = net[net.shape[0] // 2, net.shape[1] // 2] - centre
    extent = np.linalg.norm(np.ptp(net.reshape(-1, 3), axis=0))
    if np.linalg.norm(outwards) < 0.02 * extent:
        outwards = np.eye(3)[int(np.argmax(np.abs(normal)))]
    if float(normal @ outwards) >= 0:
        return surface, parameters
    knots = np.asarray(surface.knots_u)
    turned = (jnp.asarray(net[::-1]), jnp.asarray((knots[0] + knots[-1] - knots)[::-1]))
    flipped = np.asarray(parameters) * [-1, 1] + [knots[0] + knots[-1], 0]
    return eqx.tree_at(lambda s: (s.control_points, s.knots_u), surface, turned), jnp.asarray(flipped, parameters.dtype)


def _on_knots(surface: BSplineSurface, knots_u: Array, knots_v: Array) -> BSplineSurface:
    """The same surface on finer knots."""
    matrix_u = refinement_matrix(surface.knots_u, knots_u, surface.degree_u)
    matrix_v = refinement_matrix(surface.knots_v, knots_v, surface.degree_v)
    net = jnp.einsum("ij,kl,jlx->ikx", matrix_u, matrix_v, surface.control_points)
    return BSplineSurface(net, knots_u, knots_v, surface.degree_u, surface.degree_v)


def _refit(start: BSplineSurface, points: Array, feet: Any, rest: BSplineSurface, options: dict[str, Any]) -> Fit:
    """A fit whose background bending counts from the coarser surface `rest`: curved sheets are not dragged flat."""
    weight = faint_bending(max(start.control_points.shape[:2]), _ATTENUATION)
    phase = options.get("phase", "fit {} × {} spans".format(*_spans(start)))
    fixed = {"start": feet, "rest": rest, "bending": weight, "sliding": _SLIDING, "rtol": _RTOL}
    return fit(start, points, **{**fixed, **options, "phase": phase})


def left_out(count: int, share: float, seed: int) -> np.ndarray:
    """Which of `count` points a check fit does not see."""
    return np.random.default_rng(seed).uniform(size=count) < share


def _hold_out(
    done: Fit, points: Array, rest: BSplineSurface, share: float, seed: int, options: dict[str, Any]
) -> Deviation | None:
    """Refit with the chosen points weighing nothing, and measure those; the compiled fit serves again."""
    chosen = left_out(points.shape[0], share, seed)
    if not chosen.any():
        return None
    weights = jnp.asarray(~chosen, points.dtype)
    options = {**options, "weights": weights, "phase": "hold-out"}
    again = _refit(done.shape, points, done.foot.parameters, rest, options)
    return Deviation(jnp.asarray(np.asarray(again.deviation)[chosen]))


def _stage(done: Fit, tolerance: float | None) -> Stage:
    n, m = done.shape.control_points.shape[:2]
    within = None if tolerance is None else float(np.mean(np.abs(np.asarray(done.deviation)) <= tolerance))
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
