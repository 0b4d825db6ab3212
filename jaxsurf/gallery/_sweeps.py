"""Paper 000: sweeps, figures 1 to 5 and 9 to 12."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ..build import creases, extended_coons, network, split_at_creases, sweep
from ..convert import interpolate
from ..curve import AbstractCurve, Arc, BSplineCurve, CompositeCurve, Line
from ..differential import normal
from ..edit import reverse
from ..report import Table
from ..surface import AbstractSurface
from ..view import shade
from ._crease_repair import crease_repair
from ._page import Page
from ._undulation import undulation

_CAMERA = (1.0, -1.6, 1.1)
_SIZE = (900, 700)


def make() -> Page:
    """The figures with what is measured on them."""
    pictures, tables, shapes = [], [], {}
    for figure in (_decomposition, _basic_forms, _blend, _kinds, _crease, _sides, _wide, _repair, _comparison):
        for name, caption, drawn, surfaces in figure(tables):
            picture = drawn if isinstance(drawn, np.ndarray) else shade(drawn, size=_SIZE, camera=_CAMERA)
            pictures.append((name, caption, picture))
            shapes[name] = surfaces
    return Page("Wide surfaces from few curves (paper 000)", pictures, tables, shapes)


def _decomposition(tables: list[Table]) -> list[tuple]:
    """Figure 1: many guides and characters, edges missing."""
    guides = [_curve([(x, y, 0.25 * np.sin(1.3 * x + y)) for x in np.linspace(0, 4, 7)]) for y in (0.0, 1.0, 2.2)]
    guides[2] = _curve([(x, 2.2, 0.25 * np.sin(1.3 * x + 2.2)) for x in np.linspace(0, 2.5, 5)])
    characters = [_between(guides[0], guides[1 if x > 2 else 2], x, guides) for x in (0.0, 1.2, 2.5, 4.0)]
    whole = network(guides, characters, tolerance=0.01)  # the curves nearly meet
    rows = [[f"{i}", form] for i, form in enumerate(whole.forms)]
    rows.append(["largest gap of curves that cross", f"{float(whole.largest_gap):.3g}"])
    tables.append(Table("Figure 1: patches of the network", ("patch", "basic form"), rows))
    return [
        ("1", "figure 1: guides and characters, and the patches between them", [*whole.patches, *guides, *characters], whole)
    ]


def _between(first: AbstractCurve, last: AbstractCurve, x: float, guides: list[BSplineCurve]) -> BSplineCurve:
    """A character over x from one guide to another, on those between."""
    places = np.linspace(0, 2.2 if last is guides[2] else 1.0, 7)
    return _curve([(x, y, 0.25 * np.sin(1.3 * x + y)) for y in places])


def _basic_forms(_: list[Table]) -> list[tuple]:
    """Figure 2: one or two characters along one or two guides."""
    (g, h), (c, d) = _frame()
    forms = {
        "2a": ("one guide, one character", sweep(c, g)),
        "2b": ("one guide, two characters", sweep((c, d), g)),
        "2c": ("two guides, two characters", sweep((c, d), (g, h))),
        "2d": ("two guides, one character", sweep(c, (g, h))),
    }
    return [
        (name, f"figure 2 ({name[1]}): {caption}", [s, *s.guides.curves, *s.characters], s)
        for name, (caption, s) in forms.items()
    ]


def _blend(_: list[Table]) -> list[tuple]:
    """Figure 3: two sweeps and their blend."""
    (g, h), (c, d) = _frame()
    first, both = sweep(c, (g, h)), sweep((c, d), (g, h))
    second = sweep(d, (reverse(g), reverse(h)))
    drawn = {"3a": ("S₁", first), "3b": ("S₂", second), "3c": ("(1 − φ) S₁ + φ S₂", both)}
    return [(name, f"figure 3: {caption}", [s, g, h, c, d], s) for name, (caption, s) in drawn.items()]


def _kinds(tables: list[Table]) -> list[tuple]:
    """Figure 4: kinds of R(v)."""
    bent = _curve([(0, 0, 0), (1.5, 0.1, 0.5), (3, 0.6, 0.9), (4.2, 1.6, 1.0), (5, 3.0, 0.8)])
    c = _curve([(0, 0, 0), (0, 0.4, 0.5), (0, 0.9, 0.6), (0, 1.5, 0.1)])
    h = _curve([(0, 1.5, 0.1), (1.4, 1.9, 0.9), (2.6, 2.3, 1.6), (3.2, 2.9, 1.8), (3.4, 3.6, 1.7)])
    drawn = {
        "4a": ("identity", sweep(c, bent, rotation="fixed")),
        "4b": ("Rotation-2: after the tangent of the guide", sweep(c, bent)),
        "4c": ("Rotation-1 and scaling: after the chord", sweep(c, (bent, h), rotation="chord")),
        "4d": ("Rotation-1, Rotation-2 and scaling", sweep(c, (bent, h))),
        "4e": ("scaling along the chord only, height kept (not in the paper)", sweep(c, (bent, h), scale="chord")),
        "4f": ("rotation-minimising (not in the paper)", sweep(c, bent, rotation="minimal")),
    }
    rows = []
    for name, (caption, s) in drawn.items():
        v = np.linspace(0, 1, 101)
        off = [
            np.abs(np.asarray(s(np.full_like(v, u), v) - g(v))).max()
            for u, g in zip((0.0, 1.0), s.guides.curves, strict=False)
        ]
        rows.append([name, caption, *(off + [None])[:2]])
    tables.append(Table("Figure 4: distance from the guides", ("figure", "kind", "first guide", "second guide"), rows))
    return [(name, f"figure 4: {caption}", [s, *s.guides.curves, *s.characters], s) for name, (caption, s) in drawn.items()]


def _crease(tables: list[Table]) -> list[tuple]:
    """Figure 5: guides of lines and arcs; a rotation after their derivative folds the surface."""
    (g, h), c = _lines_and_arcs()
    drawn = {
        "5a": ("(a) smooth: turned after the chord", sweep(c, (g, h), rotation="chord")),
        "5b": ("(b) not smooth: turned after the tangents", sweep(c, (g, h))),
    }
    rows = []
    for name, (caption, s) in drawn.items():
        found = creases(s)
        angle = np.degrees(np.max(np.asarray(found.angles), initial=0.0))
        rows.append([name, caption, float(angle), len(split_at_creases(s))])
    tables.append(
        Table("Figure 5: creases", ("figure", "sweep", "largest angle between normals [°]", "smooth pieces"), rows)
    )
    return [(name, f"figure 5 {caption}", [s, g, h, c], s) for name, (caption, s) in drawn.items()]


def _repair(tables: list[Table]) -> list[tuple]:
    """Figure 11: the creased surface of figure 5 before and after."""
    guides, c = _lines_and_arcs()
    return crease_repair(sweep(c, guides), tables)


def _lines_and_arcs() -> tuple[tuple[CompositeCurve, CompositeCurve], BSplineCurve]:
    """Guides and a character that does not lie across them."""
    guides = _line_and_arc(radius=1.0, y=0.0), _line_and_arc(radius=1.0, y=1.8, lift=0.5)
    return guides, _curve([(0, 0, 0), (0.5, 0.5, 0.7), (0.6, 1.2, 0.9), (0, 1.8, 0.5)])


def _line_and_arc(radius: float, y: float, lift: float = 0.0) -> CompositeCurve:
    """A line along x and an arc upwards that goes on from it."""
    corner = np.array([2.0, y, lift])
    arc = Arc(corner + [0, 0, radius], corner, (0, -1, 0), np.pi / 2)
    return CompositeCurve([Line((0, y, lift), corner), arc])


def _sides(_: list[Table]) -> list[tuple]:
    """Figure 9: a surface and the planes given on its four sides, by their normals."""
    (g, h), (c, d) = _frame()
    s = sweep((c, d), (g, h))
    t = np.linspace(0, 1, 9)
    places = [(np.full(9, 0.0), t), (np.full(9, 1.0), t), (t, np.full(9, 0.0)), (t, np.full(9, 1.0))]
    feet = np.concatenate([np.asarray(s(u, v)) for u, v in places])
    normals = np.concatenate([np.asarray(normal(s, u, v)) for u, v in places])
    arrows = [Line(p, p + 0.35 * n) for p, n in zip(feet, normals, strict=True)]
    return [("9", "figure 9: boundary conditions on four sides", [s, *arrows], s)]


def _wide(tables: list[Table]) -> list[tuple]:
    """Figure 10: a wide surface from few curves."""
    g = _curve([(0, 0, 0), (2, -0.3, 0.5), (5, -0.6, 0.9), (8, -0.5, 0.6), (10, 0, 0)])
    h = _curve([(0, 4, 0), (2, 4.5, 0.8), (5, 5, 1.4), (8, 4.6, 0.9), (10, 4, 0)])
    c = _curve([(0, 0, 0), (-0.4, 1, 1.1), (-0.5, 2, 1.5), (-0.4, 3, 1.1), (0, 4, 0)])
    d = _curve([(10, 0, 0), (10.3, 1, 0.6), (10.5, 2, 0.8), (10.3, 3, 0.6), (10, 4, 0)])
    s = sweep((c, d), (g, h))
    numbers = sum(curve.control_points.size for curve in (g, h, c, d))
    waves = undulation(s)
    tables.append(
        Table(
            "Figure 10: what four curves make",
            ("numbers of the curves", "inflections per isoline", "most"),
            [[numbers, waves.inflections, waves.most]],
        )
    )
    return [("10a", "figure 10 (a): the curves", [g, h, c, d], (g, h, c, d)), ("10b", "figure 10 (b): the surface", [s], s)]


def _comparison(tables: list[Table]) -> list[tuple]:
    """Figure 12: opposite edges of different shape, by extended Coons and by a sweep."""
    g = _curve([(0, 0, 0), (2, 0, 0), (4, 0, 0), (6, 0, 0)])
    h = _curve([(0, 3, 0), (1.5, 3, 1.5), (3, 3, 2), (4.5, 3, 1.5), (6, 3, 0)])
    c = _curve([(0, 0, 0), (0, 1, 0.5), (0, 2, 0.5), (0, 3, 0)])
    d = _curve([(6, 0, 0), (6, 1, 0.5), (6, 2, 0.5), (6, 3, 0)])
    drawn: dict[str, tuple[str, AbstractSurface]] = {
        "12a": ("extended Coons", extended_coons(g, h, c, d)),
        "12b": ("the sweep", sweep((c, d), (g, h))),
    }
    rows = []
    for name, (caption, s) in drawn.items():
        waves = undulation(s)
        rows.append([name, caption, waves.inflections, waves.most, waves.variation])
    columns = ("figure", "surface", "inflections per isoline", "most on one", "size³ ∫ (dκ/ds)² ds, mean of isolines")
    tables.append(Table("Figure 12: undulation", columns, rows))
    return [(name, f"figure 12: {caption}", [s, g, h, c, d], s) for name, (caption, s) in drawn.items()]


def _frame() -> tuple[tuple[BSplineCurve, BSplineCurve], tuple[BSplineCurve, BSplineCurve]]:
    """Two guides and two characters that meet, of different shapes."""
    g = _curve([(0, 3, 0), (1.5, 3.5, 0.9), (3.5, 3.4, 1.2), (5, 2.6, 0.2)])
    h = _curve([(0, 0, 0), (1.5, -0.3, 0.6), (3, -0.2, 0.8), (5, 0, 0.2)])
    c = _curve([(0, 3, 0), (-0.2, 2, 1.2), (-0.3, 0.8, 1.0), (0, 0, 0)])
    d = _curve([(5, 2.6, 0.2), (5.2, 1.8, 0.7), (5.2, 0.7, 0.9), (5, 0, 0.2)])
    return (g, h), (c, d)


def _curve(points: Any) -> BSplineCurve:
    """The cubic through a few points."""
    places: Float[np.ndarray, "n 3"] = np.asarray(points, float)
    return interpolate(places)
