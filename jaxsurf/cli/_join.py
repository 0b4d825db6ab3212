"""`jaxsurf join`: measuring ranges, each fitted alone, joined to one CAD surface."""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from . import _output as output

DESCRIPTION = """Fit measuring ranges, each alone, and join them to one surface with continuous curvature. Ranges overlap or
abut and fill a grid, such as 1 × n or 2 × 2; which sides meet is found. Fitted surfaces stay as they are where one range
lies alone; the bridges between are fitted to the points of all ranges there. Files as of `jaxsurf fit`."""


def add_join(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("cloud", nargs="+", metavar="RANGE", help="files of measured points, one for each range")
    parser.add_argument(
        "-o", "--output", action="append", default=[], metavar="FILE", help=".step .iges .3dm .jxs, or .stl .obj .ply .glb"
    )
    parser.add_argument("--spans", type=output.pair, metavar="UxV", help="knot spans of each range, u along its longer side")
    parser.add_argument("--tolerance", type=float, metavar="T", help="refine ranges until 95 %% of the points lie within T")
    parser.add_argument("--degree", type=int, default=3, metavar="P", help="degree, at least 3 (default 3)")
    parser.add_argument(
        "--smooth", type=float, default=0.0, metavar="W", help="weight of the curvature variation, such as 1e-6 (default 0)"
    )
    parser.add_argument("--loss", default="squared", help="squared, huber, cauchy or tukey (default squared)")
    parser.add_argument("--align", action="store_true", help="first turn and shift the ranges onto each other")
    parser.add_argument(
        "--reach",
        type=float,
        metavar="L",
        help="how far a side may be from the range that it meets (default three spacings of the points)",
    )
    output.add_files(parser)
    parser.set_defaults(run=_join, trim=False)


def _join(options: argparse.Namespace) -> int:
    begun = time.perf_counter()
    if len(options.cloud) < 2:
        raise InputError(f"`jaxsurf join` needs two ranges or more, got {len(options.cloud)}; `jaxsurf fit` fits one.")
    output.check_targets(options)
    import jax

    jax.config.update("jax_enable_x64", True)
    from ..fit import join_ranges
    from ..io import read_points, save
    from ._cache import keep_compilations
    from ._progress_bar import watching

    keep_compilations()
    clouds = [read_points(path) for path in options.cloud]
    with watching(quiet=options.quiet) as progress:
        found = join_ranges(
            clouds,
            spans=options.spans,
            tolerance=options.tolerance,
            degree=options.degree,
            loss=options.loss,
            fairness=options.smooth,
            align=options.align,
            reach=options.reach,
            progress=progress,
        )
    rows = _figures(found, options.unit)
    written = []
    for target in options.output:
        output.write_shape(target, found.shape, options.unit, output.conversion_tolerance(found))
        written.append(target)
    if options.save:
        save(options.save, found.shape)
        written.append(options.save)
    points = np.concatenate([range_.moved(cloud) for range_, cloud in zip(found.ranges, clouds, strict=True)])
    if options.picture:
        output.deviation_picture(found, points, options.unit, found.shape, options.picture)
        written.append(options.picture)
    if options.report:
        _write_report(options, found, points, output.timed(rows, begun))
        written.append(options.report)
    if not options.quiet:
        lines = [*_range_lines(options, found), *_seam_lines(options, found), *output.aligned(output.timed(rows, begun))]
        print("\n".join([*lines, "wrote " + ", ".join(written)]))
    if found.stopped:
        print("jaxsurf: stopped on request; the bridges are the best so far.", file=sys.stderr)
        return output.INTERRUPTED
    return 0


def _figures(found: Any, unit: str) -> output.Rows:
    deviation = found.deviation
    return [
        ("points", len(np.asarray(deviation)), ""),
        *output.spline_size(found.shape),
        ("rms deviation", float(deviation.rms), unit),
        ("largest deviation", float(deviation.max), unit),
        *((f"{q:.0%} of the points within", float(value), unit) for q, value in deviation.quantiles.items()),
        ("largest jump of the point, against the size", max(seam.jumps[0] for seam in found.seams), ""),
        ("largest jump of the first derivative by arc length", max(seam.jumps[1] for seam in found.seams), ""),
        ("largest jump of the second one, times the size", max(seam.jumps[2] for seam in found.seams), ""),
    ]


def _range_rows(options: argparse.Namespace, found: Any) -> list[tuple[object, ...]]:
    """Number, file, place, number of points, rms alone and joined, and how the range was moved."""
    rows = []
    for number, (part, path) in enumerate(zip(found.ranges, options.cloud, strict=True)):
        column, row = part.place
        moved = "" if not options.align else "reference"
        if part.pose is not None:
            shift = float(np.linalg.norm(part.shift))
            before, after = float(part.pose.before.rms), float(part.pose.deviation.rms)
            angle = math.degrees(float(part.pose.angle))
            moved = f"turned by {angle:.3g}°, shifted by {shift:.3g} {options.unit}: overlap rms {before:.3g} → {after:.3g}"
        count, alone, joined = len(np.asarray(part.deviation)), float(part.fit.deviation.rms), float(part.deviation.rms)
        rows.append((number + 1, Path(path).name, f"{column + 1}, {row + 1}", count, alone, joined, moved))
    return rows


def _range_lines(options: argparse.Namespace, found: Any) -> list[str]:
    unit, said = options.unit, []
    for number, name, place, count, alone, joined, moved in _range_rows(options, found):
        measured = f"{count} points, rms alone {alone:.4g} {unit}, joined {joined:.4g} {unit}"
        said.append(f"range {number} {name}: column, row {place}, {measured}{', ' * bool(moved)}{moved}")
    return said


def _seam_lines(options: argparse.Namespace, found: Any) -> list[str]:
    return [
        f"seam: {seam.sides[0]} of range {seam.ranges[0] + 1} to {seam.sides[1]} of range {seam.ranges[1] + 1}, overlap "
        f"{seam.overlap:.0%}, jumps {', '.join(_short(seam.jumps))}"
        for seam in found.seams
    ]


def _short(figures: tuple[float, ...]) -> list[str]:
    return [f"{x:.1e}" for x in figures]


def _write_report(options: argparse.Namespace, found: Any, points: np.ndarray, rows: output.Rows) -> None:
    from ..report import Report, Table, provenance, write_report
    from ..view import png_bytes, shade

    unit = options.unit
    ranges = Table(
        "Measuring ranges",
        ("range", "file", "column, row", "points", f"rms alone [{unit}]", f"rms joined [{unit}]", "pose"),
        _range_rows(options, found),
    )
    seams = Table(
        "Seams: largest jumps of the point against the size, and of first and second derivatives by arc length",
        ("ranges", "sides", "overlap", "point", "first", "second × size"),
        [
            (" – ".join(str(k + 1) for k in s.ranges), " – ".join(s.sides), f"{s.overlap:.0%}", *_short(s.jumps))
            for s in found.seams
        ],
    )
    pictures = [
        ("Deviation of the points", png_bytes(output.deviation_picture(found, points, unit, found.shape))),
        ("The surface", png_bytes(shade(found.shape, unit=unit))),
    ]
    report = Report(
        title=f"{len(found.ranges)} measuring ranges joined",
        summary=rows,
        deviations=np.asarray(found.deviation.signed),
        unit=unit,
        pictures=pictures,
        tables=[ranges, seams],
        provenance=provenance(),
    )
    write_report(options.report, report)
