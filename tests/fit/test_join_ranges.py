"""Ranges measured apart, each fitted alone and joined: deviations, seams, poses, and what is refused."""

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.fit import fit_cloud
from jaxsurf.io import read_points

DATA = Path(__file__).parents[1] / "data"
RNG = np.random.default_rng(5)
COUNT = 400


def bunny(columns, rows):
    """The back of the bunny in overlapping ranges, all of as many points."""
    points = np.asarray(read_points(DATA / "bunny_back.ply"))
    centred = points - points.mean(axis=0)
    places = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
    masks = [np.ones(len(points), bool)]
    for axis, parts in ((0, columns), (1, rows)):
        first, last = places[:, axis].min(), places[:, axis].max()
        step = (last - first) / parts
        bands = [np.abs(places[:, axis] - first - (k + 0.5) * step) < 0.5 * step + 3.5 for k in range(parts)]
        masks = [mask & band for mask in masks for band in bands]
    least = min(int(mask.sum()) for mask in masks)
    return points, [points[RNG.choice(np.flatnonzero(mask), least, replace=False)] for mask in masks]


def sheet(u, v, count=COUNT):
    """Points of one bent sheet over [u0, u1] × [v0, v1]."""
    shares = RNG.uniform(size=(2, count))
    lines, along = np.repeat(np.linspace(0, 1, 4), 10), np.tile(np.linspace(0, 1, 10), 4)
    shares[:, :80] = np.concatenate([[along, lines], [lines, along]], axis=1)  # the rim too
    x, y = (ends[0] + (ends[1] - ends[0]) * share for ends, share in zip((u, v), shares, strict=True))
    return height(x, y)


def height(x, y):
    return np.stack([x, y, 0.8 * np.sin(0.5 * x) * np.cos(0.4 * y)], axis=-1)


@pytest.mark.parametrize(("columns", "rows", "spans"), [(2, 1, (8, 5)), (2, 2, (5, 5))])
def test_the_bunny_in_ranges_is_as_near_as_in_one_piece(columns, rows, spans):
    points, clouds = bunny(columns, rows)
    single = fit_cloud(np.concatenate(clouds), spans=(8, 8))
    found = js.join_ranges(clouds, spans=spans)
    assert found.deviation.rms < 1.1 * single.deviation.rms
    size = tuple(sorted(max(part.place[k] for part in found.ranges) + 1 for k in (0, 1)))
    assert size == (rows, columns) and len({part.place for part in found.ranges}) == columns * rows
    assert len(found.seams) == (1 if rows == 1 else 4)
    for seam in found.seams:
        assert max(seam.jumps) < 1e-10 and 0.05 < seam.overlap < 0.5
    for knots, degree in ((found.shape.knots_u, 3), (found.shape.knots_v, 3)):
        inner = np.asarray(knots)[degree + 1 : -degree - 1]
        assert len(np.unique(inner)) == len(inner)  # C² throughout
    for part in found.ranges:
        at = [np.linspace(first, last, 13) for first, last in part.cell]
        own = np.asarray(found.shape.grid(*at)).reshape(-1, 3)
        assert np.abs(np.asarray(js.closest_point(part.fit.shape, own).distance)).max() < 1e-9  # what was fitted stays
        assert float(part.deviation.rms) < 1.25 * float(part.fit.deviation.rms)


def test_a_row_of_ranges_whatever_way_they_run():
    """Wide, tall and abutting ranges in any order: u runs along the longer side of each."""
    clouds = [sheet((0, 3), (0, 5)), sheet((8.1, 15), (0, 5)), sheet((2.4, 8), (0, 5))]
    found = js.join_ranges(clouds, spans=(4, 4), reach=0.5)
    line = [part.place for part in found.ranges]
    assert sorted(line) in ([(0, 0), (0, 1), (0, 2)], [(0, 0), (1, 0), (2, 0)])
    assert abs(np.subtract(line[0], line[2]).sum()) == abs(np.subtract(line[1], line[2]).sum()) == 1
    assert {frozenset(seam.ranges) for seam in found.seams} == {frozenset((0, 2)), frozenset((1, 2))}
    assert all(max(seam.jumps) < 1e-10 for seam in found.seams)
    u, v = (np.linspace(float(first), float(last), 60) for first, last in found.shape.domain)
    net = np.asarray(found.shape.grid(u, v)).reshape(-1, 3)
    assert np.abs(net[:, 2] - height(net[:, 0], net[:, 1])[:, 2]).max() < 0.02
    assert net[:, 0].min() < 0.05 and net[:, 0].max() > 14.95  # the whole of it, once


def test_alignment_finds_the_pose_of_a_range():
    clouds = [sheet((0, 5), (0, 5)), sheet((3.5, 9), (0, 5))]
    turned = [js.rotate(js.Line((0, 0, 0), axis), (1, 2, 3), 0.03).end for axis in np.eye(3)]
    matrix = np.stack([np.asarray(column) for column in turned], axis=1)
    moved = clouds[1] @ matrix.T + [0.1, -0.05, 0.1]
    crooked = js.join_ranges([clouds[0], moved], spans=(4, 4), reach=0.6)
    found = js.join_ranges([clouds[0], moved], spans=(4, 4), align=True, reach=0.6)
    pose: Any = found.ranges[1].pose
    assert found.ranges[0].pose is None and crooked.ranges[1].pose is None
    assert float(pose.angle) == pytest.approx(0.03, rel=0.05) and float(pose.before.rms) > 20 * float(pose.deviation.rms)
    assert np.abs(found.ranges[1].moved(moved) - clouds[1]).max() < 0.01
    assert float(found.deviation.rms) < 0.2 * float(crooked.deviation.rms)


def piece(u, v, rows=6, columns=5):
    x, y = np.meshgrid(np.linspace(u[0], u[1], rows), np.linspace(v[0], v[1], columns), indexing="ij")
    return js.BSplineSurface(height(x, y), js.clamped_knots(rows, 3), js.clamped_knots(columns, 3), 3, 3)


def four(gap=0.6):
    """Patches left and right, low and high, of different sizes and knots, all on nearly one sheet."""
    return [
        [piece(u, v, rows, columns) for v, columns in (((0, 3), 5), ((3 + gap, 5), 6))]
        for u, rows in (((0, 2), 6), ((2 + gap, 5), 7))
    ]


def test_four_patches_are_kept_in_one_surface():
    grid = four()
    found = js.join_patches(grid)
    for c, column in enumerate(grid):
        for r, own in enumerate(column):
            ends, places = (found.columns[c], found.rows[r]), np.linspace(0, 1, 7)
            at = [first + (last - first) * places for first, last in ends]
            np.testing.assert_allclose(found.shape.grid(*at), own.grid(places, places), rtol=0, atol=1e-12)
    for knots in (found.shape.knots_u, found.shape.knots_v):
        assert len(np.unique(np.asarray(knots)[4:-4])) == len(knots) - 8  # C² throughout, in the corner too
    u, v = (np.linspace(float(first), float(last), 40) for first, last in found.shape.domain)
    net = np.asarray(found.shape.grid(u, v))
    off = lambda net: np.abs(net[..., 2] - height(net[..., 0], net[..., 1])[..., 2]).max()
    assert off(net) < 0.12
    points = sheet((0, 5), (0, 5))
    fitted = js.join_patches(grid, points).shape
    feet = lambda surface: np.asarray(js.closest_point(surface, points).distance)
    assert np.square(feet(fitted)).mean() < np.square(feet(found.shape)).mean()


@pytest.mark.parametrize(
    ("patches", "message"),
    [
        (
            lambda g: [g[0], g[1][:1]],
            r"must be columns of equally many surfaces, two in all or more, got columns of \[2, 1\]",
        ),
        (lambda g: [[js.Plane((0, 0, 0), (0, 0, 1)), g[0][1]], g[1]], r"`patches\[0\]\[0\]` must be a B-spline surface"),
        (lambda g: [[js.elevate_degree(g[0][0], direction="u"), g[0][1]], g[1]], "must be of one degree of at least 3, got"),
        (
            lambda g: [[js.reverse(g[0][0], "v"), g[0][1]], g[1]],
            "The sides after column 1 of `patches` run against",
        ),
        (lambda g: four(0.0), "The sides after column 1 of `patches` touch or overlap"),
        (lambda g: [g[1], g[0]], "The sides after column 1 of `patches` touch or overlap"),
    ],
)
def test_grids_that_cannot_be_bridged(patches, message):
    with pytest.raises(js.InputError, match=message):
        js.join_patches(patches(four()))


def patch():
    x, y = np.meshgrid(np.linspace(0, 4, 8), np.linspace(0, 3, 7), indexing="ij")
    net = np.stack([x, y, 0.6 * np.sin(1.3 * x) * np.cos(y)], axis=-1)
    return js.BSplineSurface(net, js.clamped_knots(8, 3), js.clamped_knots(7, 3), 3, 3)


@pytest.mark.parametrize("scale", [False, True])
def test_clouds_are_moved_onto_shapes(scale):
    shape = patch()
    u, v = RNG.uniform(0.1, 0.9, (2, 200))
    there = np.asarray(shape(u, v))
    away = np.asarray(js.rotate(shape, (1, 2, 3), 0.05)(u, v)) * (1.02 if scale else 1) + [0.05, -0.02, 0.03]
    pose = js.align(away, shape, scale=scale)
    np.testing.assert_allclose(pose(away), there, rtol=0, atol=1e-9)
    assert pose.converged and float(pose.angle) == pytest.approx(0.05, abs=1e-9)
    assert float(pose.scale) == pytest.approx(1 / 1.02 if scale else 1, abs=1e-9)
    np.testing.assert_allclose(pose(js.translate(shape, (0, 0, 0)))(u, v), pose(shape(u, v)), rtol=0, atol=1e-12)
    assert float(pose.before.rms) > 0.01 and float(pose.deviation.rms) < 1e-10


def test_the_pose_is_differentiable_in_the_points():
    shape = patch()
    u, v = RNG.uniform(0.1, 0.9, (2, 100))
    points = jnp.asarray(np.asarray(js.rotate(shape, (1, 2, 3), 0.05)(u, v)) + 0.01 * RNG.normal(size=(100, 3)))
    value = jax.jit(lambda p: (lambda pose: pose.offset[2] + pose.matrix[0, 1])(js.align(p, shape)))
    step = jnp.asarray(RNG.normal(size=(100, 3)))
    slope = float(jnp.vdot(jax.grad(value)(points), step))
    plain = float(value(points + 1e-4 * step) - value(points - 1e-4 * step)) / 2e-4
    assert abs(plain) > 1e-3 and slope == pytest.approx(plain, rel=1e-3)


def test_what_is_refused():
    a, far = sheet((0, 5), (0, 5)), sheet((9, 14), (0, 5))
    with pytest.raises(js.InputError, match=r"Range 2 touches no other: .* its nearest point is [34]\.\d+ away"):
        js.join_ranges([a, far], spans=(4, 4))
    with pytest.raises(js.InputError, match="Range 2 shares no points with another one within 0.3, and `align` needs"):
        js.join_ranges([a, far], spans=(4, 4), align=True, reach=0.3)
    with pytest.raises(js.InputError, match="Ranges must fill a grid of 2 columns and 2 rows, but there is none in column"):
        js.join_ranges([a, sheet((4.4, 9), (0, 5)), sheet((0, 5), (4.4, 9))], spans=(4, 4), reach=0.5)
    with pytest.raises(js.InputError, match="`clouds` must be two ranges or more, got 1"):
        js.join_ranges([a])
    with pytest.raises(js.InputError, match="`degree` must be at least 3"):
        js.join_ranges([a, a], degree=2)
    with pytest.raises(js.InputError, match="`reach` must be a length > 0, got -1"):
        js.join_ranges([a, a], reach=-1)
    with pytest.raises(js.InputError, match=r"`points` must have shape \(N, 3\) with N of at least 6, got \(5, 3\)"):
        js.align(a[:5], patch())
    with pytest.raises(js.InputError, match=r"`weights` must have shape \(400,\), one for each point, got \(3,\)"):
        js.align(a, patch(), weights=[1, 1, 1])
