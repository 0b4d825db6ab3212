"""The family and size that explain a cloud with the fewest numbers: a table of candidates, the best of them fitted."""

import math
import re
import time
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import numpy as np

from .._array import Numbers, as_float, concrete
from .._errors import InputError
from .._progress import Event, Progress, silent
from ._cloud import CloudFit, fit_cloud
from ._fit import check_weights
from ._losses import find_loss
from ._parametrise import check_sheet
from ._quaternion_cloud import fit_qi, numbers_of
from ._sweep_cloud import fit_sweep, sweep_numbers

CANDIDATES = ("bspline 2x2", "bspline 4x4", "bspline 8x8", "bspline 16x16", "qi 3x3", "sweep")
"""What `fit_best` tries by default."""

_HOLDOUT = 0.2


class FamilyCandidate(eqx.Module):
    """One that was tried: how many numbers shape it, rms deviation, that of points left out (`None` if none were), what was
    compared, the least being best, and seconds, compilation included."""

    name: str = eqx.field(static=True)
    numbers: int = eqx.field(static=True)
    rms: float = eqx.field(static=True)
    holdout: float | None = eqx.field(static=True)
    criterion: float = eqx.field(static=True)
    seconds: float = eqx.field(static=True)


class BestFit(CloudFit):
    """A `CloudFit` of the best candidate; name: which it was; tried: all of them, the best first."""

    name: str
    tried: tuple[FamilyCandidate, ...]

    def __str__(self) -> str:
        lines = [f"{'candidate':<14} {'numbers':>8} {'rms':>10} {'left out':>10} {'criterion':>12}"]
        for c in self.tried:
            left = "" if c.holdout is None else f"{c.holdout:.4g}"
            lines.append(f"{c.name:<14} {c.numbers:>8} {c.rms:>10.4g} {left:>10} {c.criterion:>12.5g}")
        return "\n".join(lines)


def fit_best(
    points: Numbers,
    *,
    candidates: Sequence[str] = CANDIDATES,
    criterion: str = "bic",
    loss: str = "squared",
    fairness: float = 0.0,
    holdout: float | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> BestFit:
    """Fit several families and sizes to an unordered sheet-like cloud (N, 3), and choose.

    candidates: "bspline UxV" spans, "qi NxM" control tangents, or "sweep", by default `CANDIDATES`; those that need more
    points than there are, are left out. criterion: "bic", the Bayesian information criterion N ln rms² + P ln N for P
    numbers; "aic", N ln rms² + 2 P; or "holdout", the rms of points that a check fit has not seen. holdout: the share of
    those, by default 0.2 where they decide. loss, fairness, seed: as in `fit_cloud`. A true return value of `progress` stops
    at the best so far. Raises `InputError` on clouds that carry no surface and on names that mean nothing.
    """
    points = as_float(points)
    check_sheet(np.asarray(concrete(points), np.float64))
    find_loss(loss)
    check_weights(fairness, None)
    if criterion not in ("bic", "aic", "holdout"):
        raise InputError(f"`criterion` must be 'bic', 'aic' or 'holdout', got {criterion!r}.")
    share = (_HOLDOUT if criterion == "holdout" else 0.0) if holdout is None else holdout
    if not (0 < share < 1 or (share == 0 and criterion != "holdout")):
        raise InputError(f"`holdout` must be a share in (0, 1) where it decides, got {share}.")
    if isinstance(candidates, str) or not candidates:
        raise InputError(f"`candidates` must be a list of names such as {list(CANDIDATES)}, got {candidates!r}.")
    stopped = False

    def watched(event: Event) -> bool:
        nonlocal stopped
        stopped = bool(progress(event)) or stopped
        return stopped

    options = {"loss": loss, "fairness": fairness, "holdout": share, "seed": seed, "progress": watched}
    tried: list[tuple[FamilyCandidate, CloudFit]] = []
    for name, needed, run in [_understood(name) for name in candidates]:
        if needed > points.shape[0]:
            continue
        begun = time.perf_counter()
        found = run(points, options)
        tried.append((_judged(name, found, points.shape[0], criterion, time.perf_counter() - begun), found))
        if stopped:
            break
    if not tried:
        raise InputError(f"None of the `candidates` can be fitted to {points.shape[0]} points; name smaller ones.")
    tried.sort(key=lambda pair: pair[0].criterion)
    best, found = tried[0]
    parts: dict[str, Any] = {name: getattr(found, name) for name in CloudFit.__dataclass_fields__}
    parts["stopped"] = stopped
    return BestFit(**parts, name=best.name, tried=tuple(candidate for candidate, _ in tried))


def _understood(name: str) -> tuple[str, int, Callable[[Any, dict[str, Any]], CloudFit]]:
    """The name, how many points it needs, and how it is fitted."""
    if name == "sweep":
        return name, 60, lambda points, options: fit_sweep(points, **options)
    match = re.fullmatch(r"(bspline|qi) (\d+)x(\d+)", name)
    if match is None:
        raise InputError(f"`candidates` must be 'sweep' or such as 'bspline 8x8' and 'qi 3x3', got {name!r}.")
    n, m = int(match[2]), int(match[3])
    if match[1] == "bspline":
        return name, 2 * (n + 3) * (m + 3), lambda points, options: fit_cloud(points, spans=(n, m), **options)
    return name, 6 * n * m, lambda points, options: fit_qi(points, tangents=(n, m), **options)


def _judged(name: str, found: CloudFit, count: int, criterion: str, seconds: float) -> FamilyCandidate:
    shape, rms = found.shape, float(found.deviation.rms)
    family = name.split()[0]
    numbers = {"bspline": lambda s: s.control_points.size, "qi": numbers_of, "sweep": sweep_numbers}[family](shape)
    missed = None if found.holdout is None else float(found.holdout.rms)
    misfit = count * 2 * math.log(max(rms, 1e-300))
    values = {"bic": misfit + numbers * math.log(count), "aic": misfit + 2 * numbers, "holdout": missed or math.inf}
    return FamilyCandidate(name, int(numbers), rms, missed, values[criterion], seconds)
