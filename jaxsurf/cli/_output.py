"""What the commands write and print."""

import argparse
import dataclasses
import time
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import check_writable
from .._errors import InputError, import_optional

_CAD = (".step", ".stp", ".iges", ".igs", ".3dm")
_MESH = (".stl", ".obj", ".ply", ".glb")
_NATIVE = (".jxs",)
INTERRUPTED = 130


def pair(text: str) -> tuple[int, int]:
    """Two whole numbers above 0, written as 8x8."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and int(part) > 0 for part in parts):
        raise argparse.ArgumentTypeError(f"expected two whole numbers such as 8x8, got {text!r}")
    return int(parts[0]), int(parts[1])


def add_files(parser: argparse.ArgumentParser) -> None:
    """The unit, and the arguments of what is written beside CAD files."""
    parser.add_argument("--unit", default="mm", help="unit of the points: mm, cm, m or in (default mm)")
    parser.add_argument("--report", metavar="FILE", help="write an HTML report")
    parser.add_argument("--picture", metavar="FILE", help="write a picture of the deviations (.png .svg .pdf)")
    parser.add_argument("--save", metavar="FILE", help="write the surface in the lossless format of js.load (.jxs)")
    parser.add_argument("--quiet", action="store_true", help="print errors only")


def check_targets(options: argparse.Namespace) -> None:
    """Refuse outputs that could not be written, and name missing packages, before any work begins."""
    if not (options.output or options.report or options.picture or options.save):
        raise InputError("Nothing to write: give -o FILE, --report, --picture or --save.")
    from ..io import check_unit

    check_unit(options.unit)
    for target in options.output:
        suffix = Path(target).suffix.lower()
        if suffix not in (*_CAD, *_MESH, *_NATIVE):
            raise InputError(f"`-o` {target!r} must end in one of {', '.join((*_CAD, *_MESH, *_NATIVE))}.")
        if suffix == ".3dm":
            import_optional("rhino3dm", extra="cad", purpose=f"writing {suffix} files")
            if options.trim:
                raise InputError("`--trim` needs a STEP or IGES file: 3DM files are written without trimming.")
        elif suffix in _CAD:
            import_optional("OCP", extra="cad", purpose=f"writing {suffix} files")
        elif suffix in _MESH:
            import_optional("trimesh", extra="mesh", purpose=f"writing {suffix} files")
    for target, suffixes in (
        (options.picture, (".png", ".svg", ".pdf")),
        (options.report, (".html", ".htm")),
        (options.save, _NATIVE),
    ):
        if target and Path(target).suffix.lower() not in suffixes:
            raise InputError(f"{target!r} must end in {' or '.join(suffixes)}.")
    if options.picture or options.report:
        import_optional("matplotlib", extra="plot", purpose="pictures")
    targets = [*options.output, *filter(None, (options.report, options.picture, options.save))]
    for target in targets:
        check_writable(target)
    given = options.cloud if isinstance(options.cloud, list) else [options.cloud]
    sources, names = ([str(Path(path).resolve()) for path in paths] for paths in (given, targets))
    for name in names:
        if (names + sources).count(name) > 1:
            raise InputError(f"{name!r} is named twice: give every output a file of its own, other than the cloud.")


Rows = list[tuple[str, object, str]]


def write_all(options: argparse.Namespace, found: Any, points: np.ndarray, rows: Rows, begun: float) -> list[str]:
    """Write every file that was asked for; returns their names."""
    from ..fit import side_lengths, trim_to_cloud
    from ..io import save

    shape = found.shape
    if options.trim:
        shape = trim_to_cloud(found.shape, found.foot.parameters, side_lengths(found.shape))
    written = []
    for target in options.output:
        write_shape(target, shape, options.unit, conversion_tolerance(found))
        written.append(target)
    if options.save:
        save(options.save, shape)
        written.append(options.save)
    if options.picture:
        deviation_picture(found, points, options.unit, shape, options.picture)
        written.append(options.picture)
    if options.report:
        _write_report(options, found, points, shape, timed(rows, begun))
        written.append(options.report)
    return written


def read_part(cloud: str) -> np.ndarray:
    """This process's part of the points of a file; a part that cannot be read is refused in every process."""
    from ..fit import process_count, process_index, same_error
    from ..io import read_points

    part, error = np.empty((0, 3)), None
    try:
        part = read_points(cloud, shard=(process_index(), process_count()))
    except InputError as refused:
        error = refused
    error = same_error(error)
    if error is not None:
        raise error
    return part


def sampled(found: Any, points: Any) -> tuple[Any, np.ndarray]:
    """The fit of spread points, and the points, with those rows only that a picture shows, in every process."""
    import jax
    import jax.numpy as jnp

    from ..fit import Deviation, sample_index

    index = sample_index(points.count)
    pick = lambda rows: jnp.asarray(points.picked(index, rows))
    shown = {"foot": jax.tree.map(pick, found.foot), "deviation": Deviation(pick(found.deviation.signed))}
    return dataclasses.replace(found, **shown), points.picked(index)


def conversion_tolerance(found: Any) -> float:
    """How far the B-spline in a CAD file may be from the surface that was fitted: far below what the fit leaves."""
    extent = float(np.linalg.norm(np.ptp(np.asarray(found.foot.points), axis=0)))
    return max(1e-3 * float(found.deviation.rms), 1e-7 * extent)


def write_shape(target: str, shape: Any, unit: str, tolerance: float) -> None:
    from .. import io
    from ..convert import to_bspline
    from ..mesh import tessellate

    suffix = Path(target).suffix.lower()
    if suffix in _CAD:
        shape = to_bspline(shape, tolerance).shape
    if suffix in (".step", ".stp"):
        io.write_step(target, shape, unit=unit)
    elif suffix in (".iges", ".igs"):
        io.write_iges(target, shape, unit=unit)
    elif suffix == ".3dm":
        io.write_3dm(target, shape, unit=unit)
    elif suffix in _NATIVE:
        io.save(target, shape)
    else:
        mesh = tessellate(shape)
        io.write_mesh(target, mesh.vertices, mesh.faces, normals=mesh.normals)


def deviation_picture(found: Any, points: np.ndarray, unit: str, shape: Any, path: str | None = None) -> np.ndarray:
    from ..view import deviation

    return deviation(shape, found.foot.parameters, found.deviation.signed, points, unit=unit, path=path)


def figures(options: argparse.Namespace, found: Any, points: Any) -> Rows:
    """(label, value, unit) of everything that was measured."""
    unit, deviation = options.unit, found.deviation
    rows: Rows = [
        ("points", deviation.count, ""),
        *_SIZES[options.family](found.shape),
        ("rms deviation", float(deviation.rms), unit),
        ("mean deviation", float(deviation.mean), unit),
        ("largest deviation", float(deviation.max), unit),
        *((f"{q:.0%} of the points within", float(value), unit) for q, value in deviation.quantiles.items()),
    ]
    if found.holdout is not None:
        rows.append(
            (
                f"rms deviation of {found.holdout.count} points left out",
                float(found.holdout.rms),
                unit,
            )
        )
    if options.family == "qi" and not found.stopped:
        rows.append(_peer_row(options, found, points))
    uncovered = len(found.coverage.uncovered)
    rows.append(("knot cells without points", f"{uncovered} of {found.coverage.covered.size}", ""))
    return rows


def timed(rows: Rows, begun: float) -> Rows:
    """The figures with the time since `begun`, of `time.perf_counter`."""
    return [*rows, ("time", round(time.perf_counter() - begun, 1), "s")]


def spline_size(shape: Any) -> Rows:
    n, m = shape.control_points.shape[:2]
    return [
        ("control points", f"{n} × {m} = {n * m}", ""),
        ("degree", f"{shape.degree_u} × {shape.degree_v}", ""),
        ("spans", f"{n - shape.degree_u} × {m - shape.degree_v}", ""),
    ]


def _qi_size(shape: Any) -> Rows:
    from ..fit import numbers_of

    n, m = shape.tangents.shape[:2]
    return [
        ("control tangents", f"{n} × {m}, and {shape.spine.tangents.shape[0]} of the initial curve", ""),
        ("degree", f"{shape.degree_u} × {shape.degree_v}", ""),
        ("numbers that shape it", numbers_of(shape), ""),
    ]


def _sweep_size(shape: Any) -> Rows:
    from ..fit import sweep_numbers

    points = lambda curves: " and ".join(str(curve.control_points.shape[0]) for curve in curves)
    return [
        ("rotation of the sections", type(shape.rotation).__name__, ""),
        ("control points of the characters", points(shape.characters), ""),
        ("control points of the guides", points(shape.guides.curves), ""),
        ("numbers that shape it", sweep_numbers(shape), ""),
    ]


_SIZES = {"bspline": spline_size, "qi": _qi_size, "sweep": _sweep_size}


def _candidates(found: Any) -> list[tuple[str, int, int, str, int, float, float]]:
    """The rows of the families that a sweep was chosen from, the best first."""
    return [
        (
            c.kind.rotation,
            c.kind.characters,
            c.kind.guides,
            "the longer side" if c.kind.lengthwise else "the shorter side",
            c.numbers,
            c.rms,
            c.criterion,
        )
        for c in getattr(found, "candidates", ())
    ]


def _peer_row(options: argparse.Namespace, found: Any, points: np.ndarray) -> tuple[str, object, str]:
    """The deviation of a B-spline with as many numbers."""
    from ..fit import peer_fit

    peer = peer_fit(points, found.shape, loss=options.loss, fairness=options.smooth)
    n, m = peer.shape.control_points.shape[:2]
    return f"rms deviation of a B-spline with {3 * n * m} numbers", float(peer.deviation.rms), options.unit


def notes(options: argparse.Namespace, found: Any) -> list[str]:
    """Sentences that a reader must not miss."""
    said = []
    if found.stopped:
        said.append("The fit was stopped on request: this is the best surface so far.")
    if found.met is False:
        within = found.stages[-1].within
        said.append(
            f"The tolerance was not met: {within:.1%} of the points lie within {options.tolerance:g} {options.unit}, "
            f"{options.quantile:.1%} were asked for. More spans would need more points or a larger --max-spans."
        )
    extent = np.linalg.norm(np.ptp(np.asarray(found.foot.points), axis=0))
    if float(found.deviation.rms) > 0.01 * extent:
        said.append("The points lie far from the surface: the cloud may not be one sheet; split it into patches.")
    if found.coverage.uncovered and not options.trim:
        said.append(
            "Parts of the surface were not measured: they continue its surroundings. --trim cuts the face to the cloud."
        )
    return said


def summary_lines(options: argparse.Namespace, found: Any, rows: Rows, written: list[str]) -> list[str]:
    """What is printed when all is done."""
    tried = [
        f"tried {rotation}, {characters} × {guides} along {side}: rms {rms:.4g} {options.unit}, {numbers} numbers"
        for rotation, characters, guides, side, numbers, rms, _ in _candidates(found)
    ]
    return [*aligned(rows), *tried, *notes(options, found), "wrote " + ", ".join(written)]


def aligned(rows: Rows) -> list[str]:
    """Figures under each other."""
    shown = [(label, f"{value:.4g}" if isinstance(value, float) else str(value), unit) for label, value, unit in rows]
    width = max(len(label) for label, _, _ in shown)
    return [f"{label.ljust(width)}  {value} {unit}".rstrip() for label, value, unit in shown]


def _candidate_tables(options: argparse.Namespace, found: Any) -> list[Any]:
    from ..report import Table

    rows = _candidates(found)
    columns = ("rotation", "characters", "guides", "guides along", "numbers", f"rms [{options.unit}]", "N ln rms² + P ln N")
    return [Table("Kinds of sweeps that were tried", columns, rows)] if rows else []


def _write_report(options: argparse.Namespace, found: Any, points: np.ndarray, shape: Any, rows: Rows) -> None:
    from ..report import Report, Table, provenance, write_report
    from ..view import png_bytes, shade

    history = Table(
        "Refinement",
        ("spans", "tangents" if options.family == "qi" else "control points", f"rms [{options.unit}]", "within tolerance"),
        [
            (
                f"{s.spans[0]} × {s.spans[1]}",
                s.control_points,
                s.rms,
                "" if s.within is None else f"{s.within:.1%}",
            )
            for s in found.stages
        ],
    )
    pictures = [
        ("Deviation of the points", png_bytes(deviation_picture(found, points, options.unit, shape))),
        ("The surface", png_bytes(shade(shape, unit=options.unit))),
    ]
    report = Report(
        title=f"Surface fitted to {Path(options.cloud).name}",
        summary=rows,
        deviations=np.asarray(found.deviation.signed),
        unit=options.unit,
        pictures=pictures,
        tables=[history, *_candidate_tables(options, found)],
        provenance=provenance(input_path=options.cloud),
        notes=notes(options, found),
    )
    write_report(options.report, report)
