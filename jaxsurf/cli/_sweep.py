"""`jaxsurf sweep`: a surface from curves in a TOML file."""

import argparse
from typing import Any

import numpy as np

from . import _output as output

DESCRIPTION = """Sweep one or two characters along one or two guides and write the surface. SPEC is a TOML file: tables
[[guides]] and [[characters]], each with points = [[x, y, z], …] or file = "points.csv", kind = "through" (default),
"control", "line", "arc" or "polyline", degree and closed; at the top, rotation = "guide" "chord" "minimal" "frenet" "up"
or "fixed", scale = true, false or "chord", blend = "smoothstep" or "linear", pairing = "arc length", move = true, tolerance,
up = [x, y, z]."""


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("cloud", metavar="SPEC", help="TOML file with the curves")
    parser.add_argument(
        "-o", "--output", action="append", default=[], metavar="FILE", help=".step .iges .3dm .jxs, or .stl .obj .ply .glb"
    )
    parser.add_argument("--picture", metavar="FILE", help="write a picture (.png .svg .pdf)")
    parser.add_argument("--unit", default="mm", help="unit of the points: mm, cm, m or in (default mm)")
    parser.add_argument(
        "--tolerance", type=float, metavar="T", help="how far a CAD file may be from the sweep (default 1e-6 of its size)"
    )
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(run=_sweep, report=None, save=None, trim=False)


def _sweep(options: argparse.Namespace) -> int:
    output.check_targets(options)
    import jax

    jax.config.update("jax_enable_x64", True)
    from ..build import sweep
    from ._cache import keep_compilations
    from ._sweep_spec import read_spec

    keep_compilations()
    characters, guides, keywords = read_spec(options.cloud)
    surface = sweep(characters, guides, **keywords)
    (a, b), (c, d) = surface.domain
    v = np.linspace(float(c), float(d), 201)
    net = np.asarray(surface.grid(np.linspace(float(a), float(b), 41), v))
    size = float(np.linalg.norm(np.ptp(net.reshape(-1, 3), axis=0)))
    rows: output.Rows = [
        ("characters", len(characters), ""),
        ("guides", len(guides), ""),
        ("rotation", type(surface.rotation).__name__, ""),
        ("size", size, options.unit),
    ]
    for index in range(len(guides)) if len(guides) == 2 else ():
        rail = np.asarray(_on_guide(surface, index, v))
        off = float(np.linalg.norm(net[(0, -1)[index]] - rail, axis=1).max())
        rows.append((f"largest distance from guide {index + 1}", off, options.unit))
    written = []
    for target in options.output:
        output.write_shape(target, surface, options.unit, 1e-6 * size if options.tolerance is None else options.tolerance)
        written.append(target)
    if options.picture:
        from ..view import shade

        shade([surface, *surface.guides.curves, *surface.characters], path=options.picture, unit=options.unit)
        written.append(options.picture)
    if not options.quiet:
        print("\n".join([*output.aligned(rows), "wrote " + ", ".join(written)]))
    return 0


def _on_guide(surface: Any, index: int, v: np.ndarray) -> Any:
    import jax
    import jax.numpy as jnp

    guides = surface.guides.prepared()
    return jax.vmap(lambda t: guides.at(t).positions[index])(jnp.asarray(v))
