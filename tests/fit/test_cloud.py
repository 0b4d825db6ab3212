"""`fit_cloud`: from unordered points to a surface, its figures, its outline."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.fit import coverage, side_lengths
from jaxsurf.fit._parametrise import thin
from jaxsurf.fit._refine import refined_knots
from jaxsurf.io import read_points

DATA = Path(__file__).parents[1] / "data"
RADIUS, HEIGHT, NOISE = 10.0, 50.0, 0.02


def half_cylinder(count=1500):
    """A half turn, no height field over any plane but one; in no order."""
    rng = np.random.default_rng(1)
    angle, height = rng.uniform(0, np.pi, count), rng.uniform(0, HEIGHT, count)
    points = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), height], -1)
    return points + NOISE * rng.normal(size=points.shape) + [7, -3, 4]


def l_shape(count=1400):
    """A gently bent square, 12 × 12, without one of its quarters."""
    points = np.random.default_rng(1).uniform(0, 12, (count, 2))
    points = points[~((points[:, 0] > 6) & (points[:, 1] > 6))]
    return np.stack([*points.T, 0.02 * points[:, 0] ** 2 - 0.01 * points[:, 1] ** 2], -1)


@pytest.fixture(scope="module")
def cylinder():
    return js.fit_cloud(half_cylinder(), spans=(3, 6), holdout=0.2)


@pytest.fixture(scope="module")
def corner():
    return js.fit_cloud(l_shape(), spans=(6, 6))


# --- a sheet that is no height field


def test_a_half_cylinder_is_met_all_round(cylinder):
    assert cylinder.deviation.rms < 1.1 * NOISE and cylinder.deviation.max < 6 * NOISE
    (a, b), (c, d) = cylinder.shape.domain
    net = np.asarray(cylinder.shape.grid(np.linspace(a, b, 40), np.linspace(c, d, 40))) - [7, -3, 4]
    angle = np.pi / 2 - np.arctan2(net[..., 0], net[..., 1])
    assert angle.min() < 0.03 and angle.max() > np.pi - 0.03
    assert angle.min() > -0.1 and angle.max() < np.pi + 0.1
    np.testing.assert_allclose(np.hypot(net[..., 0], net[..., 1]), RADIUS, rtol=0, atol=5 * NOISE)
    assert cylinder.coverage.share == 1 and cylinder.coverage.uncovered == []


def test_the_longer_side_is_along_u(cylinder):
    along_u, along_v = side_lengths(cylinder.shape)
    np.testing.assert_allclose(along_u, HEIGHT, rtol=0.03)
    np.testing.assert_allclose(along_v, np.pi * RADIUS, rtol=0.03)


def test_normals_point_to_the_outer_side(cylinder):
    u, v = cylinder.foot.parameters.T
    outwards = (np.asarray(cylinder.foot.points) - [7, -3, 4]) * [1, 1, 0]
    assert np.all(np.sum(np.asarray(js.normal(cylinder.shape, u, v)) * outwards, axis=-1) > 0.9 * RADIUS)


def test_points_left_out_deviate_as_the_noise(cylinder):
    """The share left out is that asked for, and its points deviate a little more than those that were seen."""
    count = cylinder.holdout.signed.shape[0]
    assert 0.15 * 1500 < count < 0.25 * 1500
    assert 0.8 * NOISE < cylinder.holdout.rms < 1.3 * NOISE


def test_a_cloud_fit_tells_what_it_did(cylinder):
    assert cylinder.met is None and not cylinder.stopped
    (stage,) = cylinder.stages
    assert (stage.spans, stage.control_points, stage.within) == ((3, 6), 6 * 9, None)
    assert stage.rms == pytest.approx(float(cylinder.deviation.rms))
    np.testing.assert_allclose(
        np.abs(cylinder.deviation), np.linalg.norm(half_cylinder() - cylinder.foot.points, axis=1), atol=1e-12
    )


# --- unrolling


def test_a_half_cylinder_unrolls_to_its_side_lengths():
    unrolled, projected = js.parametrise(half_cylinder())
    inside = 0.98  # the share of the unit square that the margins leave
    # ways from point to point zigzag, and are a little longer than the sheet
    np.testing.assert_allclose(np.multiply(unrolled.sides, inside), (HEIGHT, np.pi * RADIUS), rtol=0.05)
    np.testing.assert_allclose(np.multiply(projected.sides, inside), (HEIGHT, 2 * RADIUS), rtol=0.01)
    assert unrolled.parameters.min() > 0 and unrolled.parameters.max() < 1


def test_unrolled_parameters_are_lengths_along_the_sheet():
    points = half_cylinder()
    unrolled = js.parametrise(points)[0]
    centred = points[unrolled.index] - [7, -3, 4]
    along = -RADIUS * np.arctan2(centred[:, 0], centred[:, 1]), centred[:, 2]  # from -π/2 to π/2
    for found, length in zip(unrolled.parameters.T, along[::-1], strict=True):
        assert abs(np.corrcoef(found, length)[0, 1]) > 0.999


def test_the_order_of_the_points_does_not_matter():
    points = half_cylinder()
    order = np.random.default_rng(2).permutation(len(points))
    sides = [js.parametrise(cloud)[0].sides for cloud in (points, points[order])]
    np.testing.assert_allclose(*sides, rtol=0.01)


def test_islands_are_bridged():
    """Two pieces of one sheet, a gap between them: the unrolled cloud has the length of both and the gap.

    Across the gap ways keep to the bridges, so that it opens a little like a fan.
    """
    points = half_cylinder()
    islands = points[np.abs(points[:, 2] - 4 - HEIGHT / 2) > 8]
    found = js.parametrise(islands)[0]
    np.testing.assert_allclose(found.sides, (HEIGHT, np.pi * RADIUS), rtol=0.2)
    assert js.fit_cloud(islands, spans=(3, 6)).deviation.rms < 1.1 * NOISE


@pytest.mark.parametrize("most", [5000, 400])
def test_thinned_clouds_are_evenly_spread(most):
    points = half_cylinder()
    index = thin(points, most)
    assert len(np.unique(index)) == len(index) <= most and np.all(np.diff(index) > 0)
    if most < len(points):
        assert len(index) > 0.6 * most
        from_kept = np.linalg.norm(points[:, None] - points[index], axis=-1).min(axis=1)
        assert from_kept.max() < 6  # the cells of 400 points on this sheet are 2 wide


# --- coverage and outline


def test_cells_without_points_are_named(corner):
    found = corner.coverage
    empty = {(i, j) for i in (0, 1, 4, 5) for j in (0, 1, 4, 5)} & set(found.uncovered)
    assert len(empty) == 4 and 6 <= len(found.uncovered) <= 9  # one corner, whichever way the sheet was turned
    assert found.share == pytest.approx(1 - len(found.uncovered) / 36)
    assert found.covered.shape == (6, 6)


def test_empty_corners_continue_gently(corner):
    """Where nothing was measured the net bends on as its surroundings do, instead of flapping."""
    (a, b), (c, d) = corner.shape.domain
    net = np.asarray(corner.shape.grid_points(jnp.linspace(a, b, 30), jnp.linspace(c, d, 30)))
    low, high = l_shape().min(axis=0), l_shape().max(axis=0)
    assert np.all(net > low - 1.5) and np.all(net < high + 1.5)


def test_the_outline_follows_the_cloud(corner):
    trimmed = js.trim_to_cloud(corner.shape, corner.foot.parameters, side_lengths(corner.shape))
    parameters = np.asarray(corner.foot.parameters)
    assert np.mean(trimmed.contains(*parameters.T)) > 0.97
    # the middle of the empty quarter, by its nearest parameters
    hole = js.closest_point(corner.shape, [[9.0, 9.0, 0.02 * 81 - 0.01 * 81], [8.0, 10.0, 0.28]]).parameters
    assert not np.any(trimmed.contains(*hole.T))
    area = np.mean(trimmed.contains(*np.random.default_rng(1).uniform(0, 1, (2, 4000))))
    assert 0.66 < area < 0.78  # three quarters, less the ragged border


def test_coverage_counts_feet_in_uneven_cells():
    net = np.zeros((5, 4, 3))
    surface = js.BSplineSurface(net, [2.0] * 4 + [3.0] + [5.0] * 4, [0.0] * 3 + [0.25] + [1.0] * 3, 3, 2)
    found = coverage(surface, jnp.asarray([[2.9, 0.1], [3.1, 0.9], [5.0, 1.0]]))
    np.testing.assert_array_equal(found.covered, [[True, False], [False, True]])
    assert found.uncovered == [(0, 1), (1, 0)] and found.share == 0.5


@pytest.mark.parametrize("count", [4, 3])
def test_few_points_are_outlined_by_a_polygon(count):
    surface = js.BSplineSurface(np.zeros((4, 4, 3)), [0.0] * 4 + [1.0] * 4, [0.0] * 4 + [1.0] * 4, 3, 3)
    corners = np.array([[0.2, 0.2], [0.8, 0.3], [0.7, 0.7], [0.3, 0.8]])[:count]
    trimmed = js.trim_to_cloud(surface, jnp.asarray(corners), (1.0, 1.0))
    assert trimmed.contains(*corners.mean(axis=0)) and not trimmed.contains(0.05, 0.05)


def test_feet_without_an_area_have_no_outline():
    surface = js.BSplineSurface(np.zeros((4, 4, 3)), [0.0] * 4 + [1.0] * 4, [0.0] * 4 + [1.0] * 4, 3, 3)
    line = np.linspace(0, 1, 9)[:, None] * [1.0, 1.0]
    for feet in (line, line[:2]):
        with pytest.raises(js.InputError, match="`parameters` have no outline"):
            js.trim_to_cloud(surface, jnp.asarray(feet), (1.0, 1.0))


# --- a tolerance


def wavy(count=900):
    u, v = np.random.default_rng(1).uniform(0, 10, (2, count))
    return np.stack([u, v, 0.3 * np.sin(1.5 * u) * np.cos(v)], -1)


def test_the_net_is_refined_until_the_tolerance_is_met():
    events = []
    found = js.fit_cloud(wavy(), tolerance=0.005, quantile=0.9, spans=(4, 4), progress=events.append)
    within = [stage.within or 0 for stage in found.stages]
    assert found.met and within[-1] >= 0.9 and len(within) > 1
    assert np.mean(np.abs(found.deviation) <= 0.005) == pytest.approx(within[-1])
    assert found.stages[0].spans == (4, 4) and within[0] < 0.9
    assert all(a.control_points < b.control_points for a, b in zip(found.stages, found.stages[1:], strict=False))
    assert found.stages[-1].control_points == found.shape.control_points.size // 3
    phases = list(dict.fromkeys(event.phase for event in events))
    spans = ["fit {} × {} spans".format(*stage.spans) for stage in found.stages]
    assert phases == ["parametrise", "unroll", *spans]


def test_a_tolerance_out_of_reach_is_told():
    found = js.fit_cloud(wavy(), tolerance=1e-4, spans=(4, 4), max_spans=4)
    assert found.met is False and [stage.spans for stage in found.stages] == [(4, 4)]
    assert (found.stages[-1].within or 0) < 0.95


def test_progress_stops_a_cloud_fit_at_its_best_surface():
    found = js.fit_cloud(wavy(), spans=(4, 4), holdout=0.5, progress=lambda event: event.phase.startswith("fit"))
    assert found.stopped and found.holdout is None and found.deviation.rms < 0.3


def test_a_wish_to_stop_during_the_check_fit_is_told_too():
    whole = js.fit_cloud(wavy(), spans=(4, 4), progress=lambda event: False)
    cut = js.fit_cloud(wavy(), spans=(4, 4), holdout=0.5, progress=lambda event: event.phase == "hold-out")
    assert cut.stopped and cut.holdout is None
    np.testing.assert_array_equal(cut.shape.control_points, whole.shape.control_points)


def test_spans_are_halved_where_points_lie_beyond():
    surface = js.BSplineSurface(np.zeros((5, 5, 3)), [0.0] * 4 + [0.5] + [1.0] * 4, [0.0] * 4 + [0.4] + [1.0] * 4, 3, 3)
    parameters = np.random.default_rng(1).uniform(size=(400, 2))
    far = (parameters[:, 0] < 0.5) & (parameters[:, 1] > 0.4)
    options = (surface, jnp.asarray(parameters), jnp.asarray(np.where(far, -2.0, 0.1)), 1.0)
    knots_u, knots_v = refined_knots(*options, 40) or pytest.fail("nothing was halved")
    np.testing.assert_allclose(knots_u[4:-4], [0.25, 0.5])
    np.testing.assert_allclose(knots_v[4:-4], [0.4, 0.7])
    assert refined_knots(*options, 2) is None
    lone = jnp.asarray(np.where(np.arange(400) == 7, 9.0, 0.1))
    assert refined_knots(*options[:2], lone, 1.0, 40) is None


# --- scans

# rms in mm at 5 and 9 spans; the last knot of 8 × 8 spans and more has more control points than the patch has scan lines
PATCHES = {"bunny_back": (0.184, 0.099), "bunny_haunch": (0.287, 0.183), "bunny_ear": (0.093, 0.062)}


@pytest.mark.parametrize("name", PATCHES)
def test_measured_patches_are_met(name):
    points = read_points(DATA / f"{name}.ply")
    rms = [float(js.fit_cloud(points, spans=(n, n)).deviation.rms) for n in (5, 9)]
    assert rms[0] <= PATCHES[name][0] and rms[1] <= PATCHES[name][1]


def test_a_fine_net_on_a_ragged_patch_stays_by_its_points():
    points = read_points(DATA / "bunny_ear.ply")
    found = js.fit_cloud(points, spans=(17, 17))
    (a, b), (c, d) = found.shape.domain
    net = np.asarray(found.shape.grid_points(jnp.linspace(a, b, 60), jnp.linspace(c, d, 60)))
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.15 * np.linalg.norm(high - low)
    assert np.all(net > low - room) and np.all(net < high + room)
    assert found.deviation.rms < 0.06 and found.deviation.max < 0.4


# --- refusals

GOOD = wavy(60)
SPOILED = GOOD.copy()
SPOILED[[16, 40], 1] = np.nan

REFUSED = {
    "plane points": ({"points": GOOD[:, :2]}, r"`points` must have shape \(N, 3\), got \(60, 2\)"),
    "one row": ({"points": GOOD[0]}, r"`points` must have shape \(N, 3\), got \(3,\)"),
    "NaN": ({"points": SPOILED}, r"`points` must be finite, but point 17 is \[.*nan.*\]; remove it"),
    "no points": ({"points": np.zeros((0, 3))}, "at least 4 distinct points, got 0 distinct ones among 0"),
    "duplicates": (
        {"points": np.tile(GOOD[:3], (40, 1))},
        "at least 4 distinct points, got 3 distinct ones among 120",
    ),
    "a line": (
        {"points": np.linspace(0, 1, 50)[:, None] * [1.0, 2.0, 3.0] + 5},
        "`points` must span a sheet, but all 50 lie on one line .*fit a curve",
    ),
    "few points": (
        {"spans": (5, 5)},
        r"at least as many as the 64 control points of 5 × 5 spans of degree 3, got 60; take fewer `spans`",
    ),
    "spans": ({"spans": (0, 3)}, r"`spans` must be two whole numbers ≥ 1 such as \(8, 8\), got \(0, 3\)"),
    "half a span": ({"spans": (2.5, 3)}, "`spans` must be two whole numbers"),
    "three spans": ({"spans": (2, 3, 4)}, "`spans` must be two whole numbers"),
    "tolerance": ({"tolerance": 0.0}, "`tolerance` must be a length > 0, got 0.0"),
    "quantile": ({"quantile": 1.5}, r"`quantile` must be in \(0, 1\], got 1.5"),
    "degree": ({"degree": 8}, "`degree` must be from 1 to 7, got 8"),
    "holdout": ({"holdout": 1.0}, r"`holdout` must be in \[0, 1\), got 1.0"),
    "most spans": ({"max_spans": 0}, "`max_spans` must be at least 1, got 0"),
    "loss": ({"loss": "hubert", "spans": (3, 3)}, "`loss` must be one of"),
    "fairness": ({"fairness": np.nan, "spans": (3, 3)}, "`fairness` and `bending` must be ≥ 0, got nan"),
}


@pytest.mark.parametrize("options, message", REFUSED.values(), ids=REFUSED)
def test_what_carries_no_surface_is_refused(options, message):
    options = {"points": GOOD, **options}
    with pytest.raises(js.InputError, match=message):
        js.fit_cloud(options.pop("points"), **options)


def test_parametrise_refuses_what_is_no_sheet():
    for name in ("plane points", "NaN", "duplicates", "a line"):
        options, message = REFUSED[name]
        with pytest.raises(js.InputError, match=message):
            js.parametrise(options["points"])
