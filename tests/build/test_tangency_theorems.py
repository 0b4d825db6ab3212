"""The theorems of paper 000, section 5: which planes a surface can meet on one, two and four sides at once."""

import numpy as np
import pytest
from build.tangency_cases import SIDES, at_odds, boundary_error, report, surface, tilted, to

import jaxsurf as js


@pytest.mark.parametrize(
    ("sides", "operator"),
    [
        (("u1",), "hermite"),
        (("v0", "v1"), "scaling"),
        (SIDES, "scaling"),
        (SIDES, "hermite"),
        (SIDES, "gregory"),
        (SIDES, "blend"),
    ],
)
def test_planes_are_met_and_boundaries_kept(sides, operator):
    base, given = surface(1), to(tilted(1), *sides)
    found = report(base, **given, operator=operator)
    assert found.operator == operator and found.compatible
    assert [row.side for row in found.sides] == [side for side in SIDES if side in sides]
    assert all(row.before > 0.05 and row.after < 1e-12 for row in found.sides)
    bent = js.tangent_to(base, **given, operator=operator)
    assert boundary_error(bent, base) < 1e-13
    assert found.moved > 1e-3


@pytest.mark.parametrize("operator", ["scaling", "hermite"])
def test_the_opposite_side_keeps_its_planes(operator):
    base = surface()
    bent = js.tangent_to(base, u1=(tilted(), "u1"), operator=operator)
    at = np.linspace(0, 1, 17)
    one, other = (np.asarray(js.normal(shape, np.zeros(17), at)) for shape in (base, bent))
    assert np.abs(np.cross(one, other)).max() < 1e-12


def test_auto_takes_f_where_lines_behave_and_gregory_where_corners_do_not():
    base = surface()
    assert js.tangent_to(base, **to(tilted(), "u0", "u1")).operator == "scaling"
    assert js.tangent_to(base, **at_odds()).operator == "gregory"


def test_slopes_of_k_vanish_exactly_where_twists_are_kept():
    """Theorems 1 and 2: k'(1) = 0 if and only if M'(1) is the slope of the surface's own normal."""
    kept = report(surface(), **to(tilted(), "u1"), operator="scaling").sides[0]
    broken = report(surface(), **to(tilted(twisted=True), "u1"), operator="scaling").sides[0]
    assert np.abs(kept.slopes_of_k).max() < 1e-11 < 1e-2 < np.abs(broken.slopes_of_k).max()


def test_violated_corners_leave_what_the_report_predicts_and_gregory_nothing():
    """Theorem 3, necessity: (5.7) to (5.10) broken leaves an angle, and that one."""
    base = surface()
    with pytest.warns(js.GeometryWarning, match="gregory"):
        found = report(base, **at_odds(), operator="hermite")
    assert not found.compatible and max(abs(c.twist) for c in found.corners) > 0.1
    rows = {side.side: side for side in found.sides}
    assert max(rows[s].predicted for s in ("u0", "u1")) > 1e-3
    for side in SIDES:
        assert rows[side].before > 0.05
        assert abs(rows[side].after - rows[side].predicted) < 1e-6 * (1e-6 + rows[side].predicted)
    assert "corner u0 v1" in str(found)
    found = report(base, **at_odds(), operator="gregory")
    assert max(row.after for row in found.sides) < 1e-12
    assert boundary_error(js.tangent_to(base, **at_odds(), operator="gregory"), base) < 1e-13
