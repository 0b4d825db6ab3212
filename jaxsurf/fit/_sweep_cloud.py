"""Sweeps fitted to clouds, and the choice of the kind of R(v) that explains one with the fewest numbers."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._array import Numbers, as_float
from .._errors import InputError
from .._progress import Event, Progress, silent
from ..basis import clamped_knots, collocation_matrix
from ..build import RotationMinimising, Sweep, sweep
from ..build._rotations import NAMES, ONE_GUIDE
from ..curve import BSplineCurve
from ..edit import transpose
from ..surface import AbstractSurface
from ._cloud import CloudFit, Stage, fit_cloud, left_out
from ._coverage import coverage
from ._deviation import Deviation
from ._fit import Fit, check_weights, fit
from ._losses import find_loss

_SPANS = (3, 3)  # of the net whose isolines are the first guides and characters
_SLIDING = 0.1
_RELEASE = 1e4  # guides and characters must find their own lines on the sheet
_RTOL = 1e-3
_SAMPLES = 60
_STEPS = 64  # of rotation-minimising frames, however much the guide bends: one compiled fit


class SweepKind(NamedTuple):
    """A family of sweeps: the rotation's name, how many characters and guides, and whether the guides run along the longer
    side of the cloud."""

    rotation: str
    characters: int
    guides: int
    lengthwise: bool


KINDS = tuple(
    SweepKind(rotation, characters, guides, lengthwise)
    for rotation, characters, guides in (
        ("fixed", 1, 1),
        ("guide", 1, 1),
        ("minimal", 1, 1),
        ("chord+guide", 1, 2),
        ("chord+guide", 2, 2),
    )
    for lengthwise in (True, False)
)
"""The families that `fit_sweep` tries by default."""


class Candidate(eqx.Module):
    """A family that was tried: rms deviation, how many numbers shape it, solver steps, and N ln rms² + P ln N."""

    kind: SweepKind = eqx.field(static=True)
    rms: float = eqx.field(static=True)
    numbers: int = eqx.field(static=True)
    steps: int = eqx.field(static=True)
    criterion: float = eqx.field(static=True)


class SweepFit(CloudFit):
    """A `CloudFit` of the best family, and all that were tried, the best first."""

    candidates: tuple[Candidate, ...]


def fit_sweep(
    points: Numbers,
    *,
    kinds: Sequence[SweepKind | str] | None = None,
    guide_points: int = 5,
    character_points: int = 5,
    loss: str = "squared",
    fairness: float = 0.0,
    holdout: float = 0.0,
    seed: int = 0,
    progress: Progress = silent,
) -> SweepFit:
    """Fit sweeps of cubic guides and characters to an unordered sheet-like cloud (N, 3); the best family is returned.

    kinds: families to try, as `SweepKind` or by the name of the rotation, which stands for all of `KINDS` with it; by
    default all. guide_points, character_points: control points of each curve, ≥ 4. The start of each is made of isolines of
    a coarse net; guides and characters then move freely. The best has the least Bayesian information criterion,
    N ln rms² + P ln N for P numbers. loss, fairness: as in `fit`; holdout, seed: as in `fit_cloud`, for the best one. A true
    return value of `progress` stops at the best so far. Raises `InputError` on clouds that carry no surface.
    """
    points = as_float(points)
    find_loss(loss)
    check_weights(fairness, None)
    chosen = _chosen(kinds)
    for name, count in (("guide_points", guide_points), ("character_points", character_points)):
        if int(count) != count or count < 4:
            raise InputError(f"`{name}` must be a whole number ≥ 4, got {count!r}.")
    if not 0 <= holdout < 1:
        raise InputError(f"`holdout` must be in [0, 1), got {holdout}.")
    most = 3 * 2 * (guide_points + character_points)
    if points.shape[0] < most:
        raise InputError(f"`points` must be at least as many as the {most} numbers of a sweep, got {points.shape[0]}.")
    sheet = fit_cloud(points, spans=_SPANS, progress=lambda event: progress(Event("parametrise", event.step)))
    options = {"loss": loss, "fairness": fairness, "sliding": _SLIDING, "release": _RELEASE, "rtol": _RTOL}
    options["progress"] = progress
    tried: list[tuple[Candidate, Fit]] = []
    for kind in chosen:
        start = _start(sheet.shape, kind, guide_points, character_points)
        if start is None:
            continue
        feet = sheet.foot.parameters[:, ::-1] if kind.lengthwise else sheet.foot.parameters
        phase = f"fit {kind.characters} × {kind.guides} {kind.rotation}"
        done = fit(start, points, start=feet, phase=phase, **options)
        tried.append((_judged(kind, done, points.shape[0]), done))
        if done.stopped:
            break
    if not tried:
        raise InputError(f"None of {len(chosen)} `kinds` of sweeps is defined on this cloud; try others of `fit.KINDS`.")
    tried.sort(key=lambda pair: pair[0].criterion)
    best, done = tried[0]
    missed = None
    if holdout > 0 and not done.stopped:
        out = left_out(points.shape[0], holdout, seed)
        weights = jnp.asarray(~out, points.dtype)
        again = fit(done.shape, points, start=done.foot.parameters, weights=weights, phase="hold-out", **options)
        missed = Deviation(jnp.asarray(np.asarray(again.deviation)[out])) if out.any() else None
    covered = coverage(done.shape, done.foot.parameters)
    stage = Stage(tuple(covered.covered.shape), best.numbers // 3, best.rms, None)
    stopped = any(one.stopped for _, one in tried)
    candidates = tuple(candidate for candidate, _ in tried)
    return SweepFit(done.shape, done.foot, done.deviation, done.result, stopped, missed, covered, (stage,), None, candidates)


def sweep_numbers(surface: Sweep) -> int:
    """How many numbers shape a sweep of B-splines: three for a control point; ends of characters that lie on two guides are
    the guides', and with one guide the place of the guide to the section is free."""
    curves: Any = (*surface.guides.curves, *surface.characters)
    both = sum(curve.control_points.size for curve in curves)
    return both - (6 * len(surface.characters) if len(surface.guides.curves) == 2 else 3)


def _chosen(kinds: Sequence[SweepKind | str] | None) -> tuple[SweepKind, ...]:
    if kinds is None:
        return KINDS
    found: list[SweepKind] = []
    for kind in [kinds] if isinstance(kinds, str) else kinds:
        name = kind.rotation if isinstance(kind, SweepKind) else kind
        if name not in NAMES:
            raise InputError(f"`kinds` must hold `SweepKind`s or names among {', '.join(map(repr, NAMES))}, got {kind!r}.")
        same = [k for k in KINDS if k.rotation == name]
        guides = 1 if name in ONE_GUIDE else 2
        all_of_name = same or [SweepKind(name, 1, guides, lengthwise) for lengthwise in (True, False)]
        found += [kind] if isinstance(kind, SweepKind) else all_of_name
    if not found:
        raise InputError("`kinds` must name at least one family of sweeps, got none.")
    return tuple(found)


def _start(sheet: Any, kind: SweepKind, guide_points: int, character_points: int) -> Sweep | None:
    """The sweep through the borders of the sheet, with its parameters; None where the kind is not defined on them."""
    surface: AbstractSurface = transpose(sheet) if kind.lengthwise else sheet
    (a, b), (c, d) = ((float(x), float(y)) for x, y in surface.domain)
    u, v = np.linspace(a, b, _SAMPLES), np.linspace(c, d, _SAMPLES)
    net = np.asarray(surface.grid(u, v))
    guides = [_through(net[side], guide_points) for side in (0, -1)[: kind.guides]]
    characters = [_through(net[:, side], character_points) for side in (0, -1)[: kind.characters]]
    rotation = RotationMinimising(steps=_STEPS) if kind.rotation == "minimal" else kind.rotation
    try:
        return sweep(characters, guides, rotation=rotation, move=True)
    except InputError:
        return None


def _through(places: Float[np.ndarray, "n 3"], count: int) -> BSplineCurve:
    """The cubic of least squares near a row of points, its ends the first and the last."""
    knots = clamped_knots(count, 3)
    matrix = np.asarray(collocation_matrix(knots, 3, jnp.linspace(0, 1, len(places))), np.float64)
    net = np.zeros((count, 3))
    net[[0, -1]] = places[[0, -1]]
    net[1:-1] = np.linalg.lstsq(matrix[:, 1:-1], places - matrix @ net, rcond=None)[0]
    return BSplineCurve(net.astype(places.dtype), knots.astype(places.dtype), 3)


def _judged(kind: SweepKind, done: Fit, count: int) -> Candidate:
    rms, numbers = float(done.deviation.rms), sweep_numbers(done.shape)
    criterion = 2 * count * math.log(max(rms, 1e-300)) + numbers * math.log(count)
    return Candidate(kind, rms, numbers, int(done.steps), criterion)
