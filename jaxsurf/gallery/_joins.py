"""Paper 003, figures 1 to 3: pseudo-vertices, a C² join, and one without second derivative at the seam."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from ..build import extend, join, segment
from ..curve import BSplineCurve
from ..report import Table
from ..view._sheet import finished, new_figure
from ._page import Page

_FIRST = np.array([[0, 0, 0], [1, 2, 0], [2.6, 2.6, 0], [4, 1.6, 0], [5.2, 0.4, 0]], float)
_SECOND = np.array([[5.2, 0.4, 0], [6.9, 0.2, 0], [8, 1.8, 0], [9.6, 2.2, 0], [10.6, 0.6, 0]], float)
_BEFORE, _AFTER = np.array([-0.6, -1.4, 0]), np.array([6.3, 0.2, 0])
_SIZE = (1000, 460)
_COUNT = 25  # places with an arrow on each segment
_LENGTH = 0.12  # of arrows, by second derivative
_GIVEN, _ADDED, _ARROW = (0.13, 0.24, 0.42), (0.78, 0.30, 0.09), (0.45, 0.62, 0.35)


def make() -> Page:
    """The page of paper 003."""
    straight = _SECOND.copy()
    straight[1] = 2 * _FIRST[-1] - _FIRST[-2]
    a = _uniform(_FIRST)
    longer = extend(a, start=_BEFORE, end=_AFTER)
    matched, zero = (join(a, _uniform(points), curvature=kind) for points, kind in ((_SECOND, "match"), (straight, "zero")))
    added = (2, 3)  # segments between both curves
    shown = [
        ("1", "(1) pseudo-vertices add a segment at each end and leave the given ones", longer, [_FIRST], (0, 3)),
        ("2", "(2) two curves joined C² by pseudo-vertices, with second derivatives", matched, [_FIRST, _SECOND], added),
        ("3", "(3) the same without second derivative at the seam", zero, [_FIRST, straight], added),
    ]
    pictures = [(name, caption, _drawn(curve, *rest)) for name, caption, curve, *rest in shown]
    rows = [_measured(name, curve, polygons) for name, _, curve, polygons, _ in shown]
    columns = (
        "figure",
        "segments",
        "given ones moved by",
        "jump of point",
        "of first",
        "of second derivative",
        "second at seam",
    )
    table = Table("Figures 1 to 3: what was given stays; largest jumps over all knots", columns, rows)
    return Page("Joins by pseudo-vertices", pictures, [table], {name: curve for name, _, curve, *_ in shown})


def _uniform(points: Float[np.ndarray, "n 3"]) -> BSplineCurve:
    return BSplineCurve(points, np.arange(len(points) + 4.0), 3)


def _count(curve: BSplineCurve) -> int:
    return len(curve.control_points) - curve.degree


def _measured(name: str, curve: BSplineCurve, polygons: Sequence[np.ndarray]) -> list[object]:
    """Number of segments, by how much given ones moved, jumps over all knots, second derivative at the seam or start."""
    share = np.linspace(0, 1, 21)
    parts = [segment(curve, k) for k in range(_count(curve))]
    offset, moved = (1 if len(polygons) == 1 else 0), 0.0
    for polygon in polygons:
        for k in range(len(polygon) - 3):
            own = segment(_uniform(polygon), k)
            moved = max(moved, float(np.abs(np.asarray(own(share)) - np.asarray(parts[offset + k](share))).max()))
        offset += len(polygon) - 3 + 2
    jumps = [
        max(
            float(np.abs(np.asarray(one.derivative(1.0, order)) - np.asarray(other.derivative(0.0, order))).max())
            for one, other in zip(parts[:-1], parts[1:], strict=True)
        )
        for order in (0, 1, 2)
    ]
    seam = 3 if len(polygons) == 2 else 0
    return [name, len(parts), moved, *jumps, float(np.linalg.norm(np.asarray(parts[seam].derivative(0.0, 2))))]


def _drawn(curve: BSplineCurve, polygons: Sequence[np.ndarray], added: tuple[int, ...]) -> UInt8[np.ndarray, "h w 3"]:
    """Polygons with their vertices, the given and the added segments; of joins, arrows of second derivatives."""
    arrows = len(polygons) == 2
    figure = new_figure(_SIZE)
    axes = figure.add_axes((0.03, 0.05, 0.94, 0.9))
    for polygon in polygons:
        axes.plot(*polygon[:, :2].T, color="0.65", lw=1, marker="*", ms=11, mfc="0.35", mec="none", zorder=2)
    if len(polygons) == 1:
        for pair in ((_BEFORE, polygons[0][0]), (polygons[0][-1], _AFTER)):
            axes.plot(*np.stack(pair)[:, :2].T, color=_ADDED, lw=1, ls=":", zorder=1)
        axes.plot(*np.stack([_BEFORE, _AFTER])[:, :2].T, ls="", marker="o", ms=8, mfc="white", mec=_ADDED, zorder=3)
        names = (("B₋₁", _BEFORE, 8), ("B₀", polygons[0][0], -26), ("Bₙ", polygons[0][-1], 8), ("Bₙ₊₁", _AFTER, 8))
        for text, at, aside in names:
            axes.annotate(text, at[:2], (aside, 6), textcoords="offset points", fontsize=13)
    share = np.linspace(0, 1, _COUNT)
    for k in range(_count(curve)):
        part = segment(curve, k)
        points, bends = np.asarray(part(share)), np.asarray(part.derivative(share, 2))
        axes.plot(*points[:, :2].T, color=_ADDED if k in added else _GIVEN, lw=2.6, zorder=4, solid_capstyle="round")
        if arrows:
            axes.quiver(
                *points[:, :2].T,
                *(_LENGTH * 4 * bends[:, :2]).T,
                angles="xy",
                scale_units="xy",
                scale=1,
                width=0.0016,
                color=_ARROW,
                zorder=3,
            )
    if arrows:
        seam = np.asarray(segment(curve, 3)(0.0))
        axes.plot(*seam[:2], marker="o", ms=8, mfc="white", mec=_ADDED, zorder=5)
    axes.set_aspect("equal")
    axes.margins(0.06)
    axes.axis("off")
    return finished(figure, None)
