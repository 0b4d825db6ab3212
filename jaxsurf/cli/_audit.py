"""`jaxsurf audit`: how closely the faces of a model meet along the edges that they share."""

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import check_writable, replacing
from .._errors import InputError

DESCRIPTION = """Measure gaps of position (G0), tangent plane (G1) and curvature (G2) along every edge that two faces of a
model share, and say which order of continuity holds. MODEL is a STEP file or a .jxs file of jaxsurf. Faces are numbered from
0 in the order of the file. Exit status 0; with --require 1 if an edge falls short; 2 after bad input."""

_STEP, _NATIVE = (".step", ".stp"), ".jxs"
_ORDERS = {"g0": 0, "g1": 1, "g2": 2}
_HEADINGS = ("faces", "edges", "length", "G0", "G1 rad", "G1 deg", "G2", "G2 rel.", "holds")


def add_audit(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("model", metavar="MODEL", help="file with the faces: .step .stp .jxs")
    parser.add_argument(
        "--gap", type=_positive, metavar="L", help="limit of G0, a length (default 1e-6 of the model's size)"
    )
    parser.add_argument(
        "--angle", type=_positive, default=1e-3, metavar="A", help="limit of G1 in radians (default 1e-3, 0.057°)"
    )
    parser.add_argument(
        "--curvature",
        type=_positive,
        default=1e-2,
        metavar="C",
        help="limit of G2, relative (default 1e-2: 1 %% of the curvature)",
    )
    parser.add_argument(
        "--tolerance",
        type=_positive,
        metavar="T",
        help="how far apart two sides may be and still be taken for one edge (default 1e-3 of the model's size)",
    )
    parser.add_argument("--samples", type=int, default=65, metavar="N", help="places measured on each edge (default 65)")
    parser.add_argument("--require", choices=tuple(_ORDERS), help="exit with status 1 if an edge does not hold this order")
    parser.add_argument("--json", metavar="FILE", help="write all figures as JSON")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.set_defaults(run=_audit)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got {text!r}")
    return value


def _audit(options: argparse.Namespace) -> int:
    if options.samples < 2:
        raise InputError(f"`--samples` must be at least 2, got {options.samples}.")
    if options.json:
        check_writable(options.json)
        if Path(options.json).resolve() == Path(options.model).resolve():
            raise InputError(f"`--json` names the model {options.model!r} itself; give the report a file of its own.")
    import jax

    jax.config.update("jax_enable_x64", True)
    from ..audit import shared_edges
    from ._cache import keep_compilations

    keep_compilations()
    faces, unit = _faces(options.model)
    size = _size(faces)
    gap = 1e-6 * size if options.gap is None else options.gap
    edges = shared_edges(faces, count=options.samples, tolerance=options.tolerance)
    limits = {"gap": gap, "angle": options.angle, "curvature": options.curvature}
    rows = [_figures(edge, limits) for edge in edges]
    if options.json:
        report = {"model": str(options.model), "unit": unit, "faces": len(faces), "size": size, "limits": limits}
        text = json.dumps({**report, "worst": _worst(rows), "edges": rows}, indent=1)
        with replacing(options.json) as temporary:
            temporary.write_text(text + "\n")
    if not options.quiet:
        print("\n".join(_lines(rows, len(faces), limits, unit)))
        if options.json:
            print(f"wrote {options.json}")
    return int(options.require is not None and any(row["order"] < _ORDERS[options.require] for row in rows))


def _faces(path: str) -> tuple[list[Any], str]:
    """The surfaces of a file, and the unit of their lengths if that is known."""
    from ..build import Network
    from ..surface import AbstractSurface

    suffix = Path(path).suffix.lower()
    if suffix in _STEP:
        from ..io import read_step, step_unit

        shapes, unit = read_step(path), step_unit(path)
    elif suffix == _NATIVE:
        from ..io import load

        shapes, unit = load(path), ""
    else:
        raise InputError(f"MODEL must end in one of {', '.join((*_STEP, _NATIVE))}, got {path!r}; export it as STEP.")
    import jax

    leaves = jax.tree.leaves(shapes, is_leaf=lambda x: isinstance(x, AbstractSurface | Network))
    faces = []
    for leaf in leaves:
        faces += leaf.patches if isinstance(leaf, Network) else [leaf] if isinstance(leaf, AbstractSurface) else []
    if not faces:
        raise InputError(f"{path!r} holds no surfaces whose edges could be measured; export faces or solids, not curves.")
    return faces, unit


def _size(faces: list[Any]) -> float:
    """The diagonal of the box around all faces."""
    share = np.linspace(0, 1, 9)
    ends = []
    for face in faces:
        (a, b), (c, d) = ([float(x) for x in pair] for pair in face.domain)
        points = np.asarray(face.grid(a + (b - a) * share, c + (d - c) * share)).reshape(-1, 3)
        ends += [points.min(axis=0), points.max(axis=0)]
    return float(np.linalg.norm(np.ptp(np.stack(ends), axis=0)))


def _figures(edge: Any, limits: dict[str, float]) -> dict[str, Any]:
    """What the report says of an edge."""
    found = edge.continuity
    return {
        "faces": [edge.first, edge.second],
        "edges": [found.side_a, found.side_b],
        "length": float(found.length),
        "g0": float(found.max_g0),
        "g1": float(found.max_g1),
        "g1_degrees": math.degrees(float(found.max_g1)),
        "g2": float(found.max_g2),
        "g2_relative": float(found.max_g2_relative),
        "folded": bool(np.any(np.asarray(found.folded))),
        "reversed": bool(found.reversed),
        "order": found.order(**limits),
    }


def _worst(rows: list[dict[str, Any]]) -> dict[str, float] | None:
    return {key: max(row[key] for row in rows) for key in ("g0", "g1", "g1_degrees", "g2", "g2_relative")} if rows else None


def _lines(rows: list[dict[str, Any]], faces: int, limits: dict[str, float], unit: str) -> list[str]:
    """The table and the summary."""
    if not rows:
        return [
            f"{faces} faces, no shared edges: nothing to compare; a larger --tolerance would bring edges with wide gaps."
        ]
    cells = [_HEADINGS, *(_cells(row) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(_HEADINGS))]
    table = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in cells]
    worst, lowest = _worst(rows), min(row["order"] for row in rows)
    assert worst is not None
    counts = ", ".join(f"{sum(row['order'] == k for row in rows)} {_name(k)}" for k in (2, 1, 0, -1))
    length = f" {unit}" if unit else ""
    return [
        *table,
        f"limits: G0 {limits['gap']:.3g}{length}, G1 {limits['angle']:.3g} rad ({math.degrees(limits['angle']):.3g}°), "
        f"G2 {limits['curvature']:.3g} relative",
        f"{faces} faces, {len(rows)} shared edges ({counts}); worst: {_name(lowest)}, G0 {worst['g0']:.3e}{length}, "
        f"G1 {worst['g1']:.3e} rad ({worst['g1_degrees']:.3e}°), G2 {worst['g2_relative']:.3e} relative",
    ]


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    pair = lambda two: f"{two[0]} - {two[1]}"
    figures = (f"{row[key]:.3e}" for key in ("g0", "g1", "g1_degrees", "g2", "g2_relative"))
    holds = _name(row["order"]) + (" (folded back)" if row["folded"] else "")
    return (pair(row["faces"]), pair(row["edges"]), f"{row['length']:.4g}", *figures, holds)


def _name(order: int) -> str:
    return "open" if order < 0 else f"G{order}"
