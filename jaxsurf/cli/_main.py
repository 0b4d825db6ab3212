"""The command line: parse, call a room, print."""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from .._errors import InputError
from . import _output as output
from ._cache import keep_compilations
from ._workers import add_processes, as_worker, checkpoint_of, is_member, is_parent, run_workers

_FAILED = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `jaxsurf …`; returns the exit status: 0, 2 after bad input (one sentence on stderr), 130 after Ctrl-C."""
    options = _parser().parse_args(arguments)
    options.arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return options.run(options)
    except InputError as error:
        print(f"jaxsurf: {error}", file=sys.stderr)
        return _FAILED
    except KeyboardInterrupt:
        print("\njaxsurf: interrupted before there was a surface; nothing was written.", file=sys.stderr)
        return output.INTERRUPTED


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as everywhere; the usage is what `--help` shows."""

    def error(self, message: str) -> NoReturn:
        self.exit(_FAILED, f"jaxsurf: {message}; see `{self.prog} --help`.\n")


def _parser() -> argparse.ArgumentParser:
    from importlib.metadata import version

    parser = _Parser(prog="jaxsurf", description="Differentiable surface modelling on JAX.")
    parser.add_argument("--version", action="version", version=f"jaxsurf {version('jaxsurf')}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _add_fit(commands.add_parser("fit", help="fit a CAD surface to a measured point cloud", description=_FIT))
    from ._sweep import DESCRIPTION, add_sweep

    add_sweep(commands.add_parser("sweep", help="make a surface from guides and characters", description=DESCRIPTION))
    from ._join import DESCRIPTION as JOIN, add_join

    add_join(commands.add_parser("join", help="join measuring ranges, each fitted alone, to one surface", description=JOIN))
    from ._audit import DESCRIPTION as AUDIT, add_audit

    add_audit(commands.add_parser("audit", help="measure how closely the faces of a model meet", description=AUDIT))
    gallery = commands.add_parser(
        "gallery", help="rebuild the figures of the papers and measure them", description="Pages with pictures and figures."
    )
    gallery.add_argument("names", nargs="*", help="which pages (default: all)")
    gallery.add_argument("-o", "--output", default="gallery", metavar="FOLDER", help="where to write (default ./gallery)")
    gallery.set_defaults(run=_gallery)
    bench = commands.add_parser("bench", help="run the benchmarks of a checkout and print their tables")
    bench.add_argument("names", nargs="*", help="which ones (default: all)")
    bench.set_defaults(run=_bench)
    return parser


_FIT = """Fit a surface to an unordered, sheet-like point cloud and write it as a CAD file. Points: .xyz .txt
.csv .npz .npy .ply .stl .obj, and .las .laz .e57 .pcd with the extra `scan`. Ctrl-C stops at the best surface so far
and writes that. With --processes the points are shared out to several processes; what --distributed joins is started by
a launcher, or told by JAX_COORDINATOR_ADDRESS, JAX_NUM_PROCESSES and JAX_PROCESS_ID."""


def _add_fit(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("cloud", metavar="CLOUD", help="file of measured points")
    parser.add_argument(
        "-o",
        "--output",
        action="append",
        default=[],
        metavar="FILE",
        help=".step .iges .3dm .jxs, or .stl .obj .ply .glb; may be repeated",
    )
    parser.add_argument(
        "--family",
        default="bspline",
        choices=("bspline", "qi", "sweep", "best"),
        help="bspline, qi: a quaternion integral surface, shaped by tangents, sweep: of the kind that explains the cloud "
        "with the fewest numbers, or best: of all these, in several sizes, the one that does (default bspline)",
    )
    parser.add_argument(
        "--rotation",
        action="append",
        metavar="NAME",
        help="kinds that --family sweep tries, such as minimal or chord+guide; may be repeated (default: all)",
    )
    parser.add_argument(
        "--tangents",
        type=output.pair,
        metavar="NxM",
        help="control tangents of --family qi, u along the longer side (default 3x3)",
    )
    parser.add_argument(
        "--spans",
        type=output.pair,
        metavar="UxV",
        help="knot spans of the net, u along the longer side (default 8x8)",
    )
    parser.add_argument("--tolerance", type=float, metavar="T", help="refine until the quantile of the points lies within T")
    parser.add_argument(
        "--quantile",
        type=float,
        default=0.95,
        metavar="Q",
        help="share of the points for --tolerance (default 0.95)",
    )
    parser.add_argument("--max-spans", type=int, default=40, metavar="N", help="most spans per direction (default 40)")
    parser.add_argument("--degree", type=int, metavar="P", help="degree in both directions (default 3, of --family qi 2)")
    parser.add_argument(
        "--smooth",
        type=float,
        default=0.0,
        metavar="W",
        help="weight of the curvature variation, such as 1e-6 (default 0)",
    )
    parser.add_argument("--loss", default="squared", help="squared, huber, cauchy or tukey (default squared)")
    parser.add_argument(
        "--holdout",
        type=float,
        default=0.1,
        metavar="S",
        help="share of the points left out of a check fit (default 0.1)",
    )
    parser.add_argument("--trim", action="store_true", help="trim the exported face to the outline of the cloud")
    add_processes(parser)
    output.add_files(parser)
    parser.set_defaults(run=_fit)


def _fit(options: argparse.Namespace) -> int:
    begun = time.perf_counter()
    output.check_targets(options)
    options.checkpoint = checkpoint_of(options)
    if is_parent(options):
        return run_workers(options.arguments, options.processes, options.checkpoint)
    import jax

    jax.config.update("jax_enable_x64", True)
    keep_compilations()
    if is_member(options):
        with as_worker(options.checkpoint) as leader:
            return _fit_together(options, begun, leader)
    from ..io import read_points
    from ._progress_bar import watching

    points = read_points(options.cloud)
    with watching(quiet=options.quiet) as progress:
        found = _FAMILIES[options.family](options, points, progress)
    rows = output.figures(options, found, points)
    return _write(options, found, points, rows, begun)


def _fit_together(options: argparse.Namespace, begun: float, leader: bool) -> int:
    """The same fit in one of several processes; all measure, and the leader writes and prints."""
    from ..fit import shard_points
    from ._progress_bar import watching

    points = shard_points(output.read_part(options.cloud))
    with watching(quiet=options.quiet or not leader) as progress:
        found = _found_bspline(options, points, progress)
    rows = output.figures(options, found, points)
    found, points = output.sampled(found, points)
    return _write(options, found, points, rows, begun) if leader else 0


def _write(options: argparse.Namespace, found: Any, points: Any, rows: output.Rows, begun: float) -> int:
    written = output.write_all(options, found, points, rows, begun)
    if options.checkpoint and not found.stopped:
        Path(options.checkpoint).unlink(missing_ok=True)
    if not options.quiet:
        print("\n".join(output.summary_lines(options, found, output.timed(rows, begun), written)))
    if found.stopped:
        print("jaxsurf: stopped on request; what was written is the best surface so far.", file=sys.stderr)
        return output.INTERRUPTED
    return 0


def _found_bspline(options: argparse.Namespace, points: Any, progress: Any) -> Any:
    from ..fit import fit_cloud

    _refuse(options, "bspline")
    return fit_cloud(
        points,
        spans=options.spans,
        tolerance=options.tolerance,
        quantile=options.quantile,
        max_spans=options.max_spans,
        degree=3 if options.degree is None else options.degree,
        loss=options.loss,
        fairness=options.smooth,
        holdout=options.holdout,
        progress=progress,
        checkpoint=options.checkpoint,
        resume=options.resume,
    )


def _found_qi(options: argparse.Namespace, points: Any, progress: Any) -> Any:
    from ..fit import fit_qi

    _refuse(options, "qi")
    return fit_qi(
        points,
        tangents=options.tangents or (3, 3),
        degree=2 if options.degree is None else options.degree,
        loss=options.loss,
        fairness=options.smooth,
        holdout=options.holdout,
        progress=progress,
    )


def _found_sweep(options: argparse.Namespace, points: Any, progress: Any) -> Any:
    from ..build._rotations import NAMES
    from ..fit import fit_sweep

    _refuse(options, "sweep")
    for name in options.rotation or ():
        if name not in NAMES:
            raise InputError(f"`--rotation` must be one of {', '.join(NAMES)}, got {name!r}.")
    if options.degree not in (None, 3):
        raise InputError(f"`--degree` of `--family sweep` is 3, got {options.degree}; leave it out.")
    return fit_sweep(
        points,
        kinds=options.rotation,
        loss=options.loss,
        fairness=options.smooth,
        holdout=options.holdout,
        progress=progress,
    )


def _found_best(options: argparse.Namespace, points: Any, progress: Any) -> Any:
    from ..fit import fit_best

    _refuse(options, "best")
    if options.degree is not None:
        raise InputError(f"`--degree` does not go with `--family best`, got {options.degree}; leave it out.")
    found = fit_best(points, loss=options.loss, fairness=options.smooth, holdout=options.holdout or None, progress=progress)
    if not options.quiet:
        print(found)
    options.family = found.name.split()[0]
    return found


_FAMILIES = {"bspline": _found_bspline, "qi": _found_qi, "sweep": _found_sweep, "best": _found_best}


def _refuse(options: argparse.Namespace, family: str) -> None:
    """Refuse options that another family takes."""
    for name, owner in (("spans", "bspline"), ("tolerance", "bspline"), ("tangents", "qi"), ("rotation", "sweep")):
        if owner != family and getattr(options, name) is not None:
            raise InputError(f"`--{name}` belongs to `--family {owner}`, and the family is {family}; leave one of them out.")


def _gallery(options: argparse.Namespace) -> int:
    import jax

    jax.config.update("jax_enable_x64", True)
    keep_compilations()
    from ..gallery import names, write_page

    for name in options.names:
        if name not in names():
            raise InputError(f"There is no gallery page {name!r}; there are {', '.join(names())}.")
    for name in options.names or names():
        print("wrote " + ", ".join(str(path) for path in write_page(options.output, name)))
    return 0


def _bench(options: argparse.Namespace) -> int:
    import runpy

    folder = Path(__file__).resolve().parents[2] / "benchmarks"
    if not (folder / "__main__.py").is_file():
        raise InputError(
            "`jaxsurf bench` runs the benchmarks of a checkout, and this installation has none: clone the repository and "
            "install it with `pip install -e '.[bench]'`."
        )
    sys.path.insert(0, str(folder.parent))
    sys.argv = ["jaxsurf bench", *options.names]
    runpy.run_module("benchmarks", run_name="__main__")
    return 0
