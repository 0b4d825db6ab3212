"""Measured scans fitted: how closely, with how many numbers, and how long it takes.

The folder is named by the environment variable JAXSURF_SCANS, by default `tests/data`; files that are not there are left
out.
"""

import os
import time
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

import jaxsurf as js
from jaxsurf.fit import numbers_of

from . import harness

HOLDOUT = 0.1


class Scan(NamedTuple):
    """A file, what is fitted to it and how, and a remark."""

    file: str
    unit: str
    what: str
    options: dict[str, Any]
    remark: str = ""


SCANS = (
    Scan("bunny_back.ply", "mm", "net", {"tolerance": 0.1}, "95 % of the points within 0.1 mm"),
    Scan("bunny_back.ply", "mm", "QI surface", {"tangents": (3, 3)}),
    Scan("bunny_haunch.ply", "mm", "net", {"tolerance": 0.3}, "95 % of the points within 0.3 mm"),
    Scan("bunny_ear.ply", "mm", "net", {"tolerance": 0.1}, "95 % of the points within 0.1 mm; a strip"),
    Scan("bunny.ply", "mm", "net", {}, "a closed body: one sheet cannot cover it, fit patches of it"),
    Scan("laser_plane.ply", "m", "plane", {}, "coordinates rounded to 0.01 m, which is more than what is left"),
    Scan("laser_plane.ply", "m", "net", {"spans": (1, 1)}, "it is a little bent"),
    Scan("volcano.xyz", "m", "net", {"tolerance": 2.0}, "95 % of the points within 2 m; heights in whole metres"),
)


def report() -> dict[str, Any]:
    """Fit all scans of the folder that are there."""
    jax.config.update("jax_enable_x64", True)
    folder = Path(os.environ.get("JAXSURF_SCANS", Path(__file__).parents[1] / "tests" / "data"))
    present = [scan for scan in SCANS if (folder / scan.file).exists()]
    return {"machine": harness.machine(), "rows": [_measured(scan, folder) for scan in present]}


def table(report: dict[str, Any]) -> str:
    """A Markdown table: a line for every fit, and the machine."""
    lines = ["| scan | points | fitted | numbers | rms | hold-out rms | time, warm | cold | |", "|" + "---|" * 9]
    for row in report["rows"]:
        start = [row["file"], f"{row['points']:,}", row["fitted"]]
        if row["refused"]:
            rest = ["", "", "", "", "", f"refused: {row['refused']} {row['remark']}"]
        else:
            rest = [str(row["numbers"]), *(f"{row[key]:.3g} {row['unit']}" for key in ("rms", "holdout"))]
            rest += [f"{row['warm']:.2g} s", f"{row['cold']:.2g} s", row["remark"]]
        lines.append("| " + " | ".join([*start, *rest]) + " |")
    share = f"Hold-out: of the {HOLDOUT:.0%} of the points that a second fit of the same size did not see"
    lines += ["", f"{share}; cold: with compilation, in one process. {harness.machine_line(report['machine'])}"]
    return "\n".join(lines)


def _measured(scan: Scan, folder: Path) -> dict[str, Any]:
    points = js.io.read_points(folder / scan.file)
    row = {**scan._asdict(), "options": repr(scan.options), "points": len(points), "fitted": scan.what, "refused": ""}
    fit = {"net": _net, "QI surface": _qi, "plane": _plane}[scan.what]
    start = time.perf_counter()
    try:
        fit(points, scan.options, 0.0)
    except js.InputError as error:
        return {**row, "refused": str(error)}
    cold = time.perf_counter() - start
    start = time.perf_counter()
    fitted, numbers, rms, _ = fit(points, scan.options, 0.0)
    warm = time.perf_counter() - start
    holdout = fit(points, scan.options, HOLDOUT)[3]
    return {**row, "fitted": fitted, "numbers": numbers, "rms": rms, "holdout": holdout, "cold": cold, "warm": warm}


Measured = tuple[str, int, float, float | None]


def _net(points: np.ndarray, options: dict[str, Any], holdout: float) -> Measured:
    found = js.fit_cloud(points, holdout=holdout, **options)
    n, m = found.shape.control_points.shape[:2]
    return f"net of {n} × {m}, degree 3", 3 * n * m, float(found.deviation.rms), found.holdout and float(found.holdout.rms)


def _qi(points: np.ndarray, options: dict[str, Any], holdout: float) -> Measured:
    found = js.fit_qi(points, holdout=holdout, **options)
    n, m = options["tangents"]
    rms = float(found.deviation.rms)
    return f"QI surface, {n} × {m}", numbers_of(found.shape), rms, found.holdout and float(found.holdout.rms)


def _plane(points: np.ndarray, _: dict[str, Any], holdout: float) -> Measured:
    """From the plane of inertia, twice as wide as the points."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    start = js.Plane(middle, normal, 2 * float(np.linalg.norm(np.ptp(points, axis=0))))
    fit = lambda weights: js.fit(start, points, free=lambda s: (s.origin, s.normal), weights=weights)
    rms = float(fit(np.ones(len(points))).deviation.rms)
    missed = None
    if holdout > 0:
        out = np.random.default_rng(0).uniform(size=len(points)) < holdout
        missed = float(np.sqrt(np.mean(np.asarray(fit(1.0 * ~out).deviation.signed)[out] ** 2)))
    return "plane", 3, rms, missed
