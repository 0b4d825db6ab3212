"""Trimmed surfaces: what counts."""

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf.basis import periodic_knots
from jaxsurf.curve import BSplineCurve, Line
from jaxsurf.surface import Plane, TrimmedSurface, breaks

SHEET = Plane([1, 2, 3], [0, 0, 1], 20)


def polygon(corners):
    corners = [*corners, corners[0]]
    count = len(corners)
    return BSplineCurve(corners, [2, *range(2, 2 + count), 1 + count], 1)


def round_hole(radius, turns=1):
    angles = turns * np.arange(12) * np.pi / 6
    corners = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return BSplineCurve(corners, periodic_knots(12, 3), 3, periodic=True)


SQUARE = [[-4, -4], [4, -4], [4, 4], [-4, 4]]
WEDGE = [[1, 1], [3, 1], [3, 3], [2, 1.5]]


@pytest.mark.parametrize("outer", [SQUARE, SQUARE[::-1]])
@pytest.mark.parametrize("turns", [1, -1])
def test_what_counts_is_inside_the_outer_loop_and_outside_the_holes(outer, turns):
    trimmed = TrimmedSurface(SHEET, [polygon(outer), round_hole(1.0, turns)])
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-6, 6, (2, 500))
    inside = (np.maximum(abs(u), abs(v)) < 4) & (np.hypot(u, v) > 0.95)
    clear = abs(np.hypot(u, v) - 0.95) > 0.03  # the loop of twelve points has a radius of about 0.95
    found = np.asarray(trimmed.contains(u, v))
    assert found.dtype == bool
    np.testing.assert_array_equal(found[clear], inside[clear])


def test_polygons_are_exact_and_half_open():
    trimmed = TrimmedSurface(SHEET, [polygon(SQUARE), polygon(WEDGE)])
    near = 1e-9
    u = np.array([[-4 + near, -4 - near, 2.5, 2.5, 4 - near]])
    v = np.array([[-4 + near, 0, 1 + near, 1 - near, 4 - near]])
    np.testing.assert_array_equal(trimmed.contains(u, v), [[True, False, False, True, True]])
    assert trimmed.contains(0.0, [0.0, 9.0]).shape == (2,)


def test_the_loops_are_turned_the_right_way_round():
    right = TrimmedSurface(SHEET, [polygon(SQUARE), polygon(WEDGE[::-1]), round_hole(0.5, -1)])
    wrong = TrimmedSurface(SHEET, [polygon(SQUARE[::-1]), polygon(WEDGE), round_hole(0.5)])
    np.testing.assert_allclose(wrong.loops[0].control_points[1], SQUARE[0], rtol=0, atol=0)
    np.testing.assert_allclose(wrong.loops[1].control_points[1], WEDGE[-1], rtol=0, atol=0)
    np.testing.assert_array_equal(right.loops[1].control_points, polygon(WEDGE[::-1]).control_points)
    u = np.linspace(0, 1, 7)
    np.testing.assert_allclose(wrong.loops[2](u), round_hole(0.5)(1 - u), rtol=0, atol=1e-12)


def test_points_are_those_of_the_whole_surface():
    trimmed = TrimmedSurface(SHEET, [polygon(SQUARE)])
    assert trimmed.domain == SHEET.domain
    u, v = np.array([-3.0, 0, 2]), np.array([1.0, 5])
    np.testing.assert_array_equal(trimmed.grid(u, v), SHEET.grid(u, v))
    np.testing.assert_array_equal(trimmed(u, v[:1]), SHEET(u, v[:1]))
    assert [len(along) for along in breaks(trimmed)] == [9, 9]


def test_containment_under_jit_and_traced_loops():
    @eqx.filter_jit
    def inside(loop, u):
        return TrimmedSurface(SHEET, [loop]).contains(u, 0.0)

    np.testing.assert_array_equal(inside(polygon(SQUARE), np.array([3.0, 5.0])), [True, False])

    @jax.jit
    @jax.vmap
    def many(size):
        loop = polygon(SQUARE)
        loop = eqx.tree_at(lambda s: s.control_points, loop, size * loop.control_points)
        return TrimmedSurface(SHEET, [loop]).contains(3.0, 0.0)

    np.testing.assert_array_equal(many(np.array([0.5, 1.0])), [False, True])


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ([], "`loops` must hold at least the outer loop, got none"),
        ([Line([0, 0], [1, 1])], r"`loops\[0\]` must be a closed 2-D BSplineCurve, got a Line"),
        ([BSplineCurve(np.eye(3), [0, 0, 1, 2, 2], 1)], r"`loops\[0\]` must have 2-D control points"),
        (
            [polygon(SQUARE), BSplineCurve([[0, 0], [1, 0], [0, 1]], [0, 0, 1, 2, 2], 1)],
            r"`loops\[1\]` must be closed, but its ends are 1 apart",
        ),
        ([polygon([[0, 0], [1, 1], [3, 3]])], r"`loops\[0\]` encloses no area"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(loops, message):
    with pytest.raises(InputError, match=message):
        TrimmedSurface(SHEET, loops)
