"""Parameter lines: knots, seams, trimming."""

import numpy as np
from view_cases import sheet

from jaxsurf.basis import clamped_knots
from jaxsurf.curve import BSplineCurve
from jaxsurf.surface import Sphere, TrimmedSurface
from jaxsurf.view._isolines import isolines


def loop(corners) -> BSplineCurve:
    closed = np.array([*corners, corners[0]], dtype=float)
    return BSplineCurve(closed, clamped_knots(len(closed), 1), 1)


def test_a_sheet_has_four_borders_and_its_corners_are_theirs():
    lines = isolines(sheet())
    assert len(lines.outline) == 4 and len(lines.inner) == 14
    corners = {tuple(np.round(line[end, :2], 9)) for line in lines.outline for end in (0, -1)}
    assert corners == {(24.0, -14.0), (24.0, -6.0), (36.0, -14.0), (36.0, -6.0)}


def test_a_seam_is_no_border_and_a_pole_is_no_line():
    lines = isolines(Sphere((0.0, 0.0, 0.0), 2.0))
    assert lines.outline == []
    assert all(np.ptp(line, axis=0).max() > 0.1 for line in lines.inner)


def test_lines_of_a_trimmed_sheet_lie_inside_its_loops():
    square, hole = (
        [(2.6, 0.2), (4.4, 0.2), (4.4, 0.8), (2.6, 0.8)],
        [(3.2, 0.4), (3.2, 0.6), (3.8, 0.6), (3.8, 0.4)],
    )
    lines = isolines(TrimmedSurface(sheet(), (loop(square), loop(hole))))
    assert len(lines.outline) == 2
    low, high = lines.outline[0].min(axis=0), lines.outline[0].max(axis=0)
    inner = np.concatenate(lines.inner)
    assert (inner >= low - 1e-9)[:, :2].all() and (inner <= high + 1e-9)[:, :2].all()
    gap_low, gap_high = lines.outline[1].min(axis=0), lines.outline[1].max(axis=0)
    assert not ((inner > gap_low + 1e-3) & (inner < gap_high - 1e-3))[:, :2].all(axis=1).any()
