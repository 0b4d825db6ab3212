"""Gaps along shared edges against known angles and curvatures, and OCCT."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.surface import AbstractSurface

RNG = np.random.default_rng(3)
NET = np.stack(np.meshgrid(np.arange(8.0), np.arange(6.0), indexing="ij"), axis=-1) + [7.0, -3.0]
NET = np.concatenate([NET, 4 + 0.4 * RNG.normal(size=(8, 6, 1))], axis=-1)
WHOLE = js.BSplineSurface(NET, js.clamped_knots(8, 3, (2, 5)), js.clamped_knots(6, 3, (-1, 1)), 3, 3)
LEFT, RIGHT = js.split(WHOLE, 3.5, "u")  # of one structure, 6 × 6 points: compiled once
LENGTH = float(js.arc_length(js.BSplineCurve(RIGHT.control_points[0], RIGHT.knots_v, 3)))


def hinged(angle, gap=0.0):
    """A square over x > 0 that meets the plane of `FLAT` at x = 0 under an angle."""
    way = jnp.stack([jnp.cos(angle), jnp.zeros_like(angle), jnp.sin(angle)])
    start, end = (jnp.stack([jnp.zeros(()), jnp.asarray(y), jnp.asarray(gap)]) for y in (0.0, 2.0))
    net = jnp.stack([jnp.stack([start, end]), jnp.stack([start + way, end + way])])
    return js.BSplineSurface(net, (0, 0, 1, 1), (0, 0, 1, 1), 1, 1)


FLAT = js.BSplineSurface([[[-1, 0, 0], [-1, 2, 0]], [[0, 0, 0], [0, 2, 0.0]]], (0, 0, 1, 1), (0, 0, 1, 1), 1, 1)


def turned(surface, *ways):
    for way in ways:
        surface = js.transpose(surface) if way == "transposed" else js.reverse(surface, way)
    return surface


@pytest.mark.parametrize(
    ("first", "second", "sides", "runs_back"),
    [
        (LEFT, RIGHT, ("u1", "u0"), False),
        (RIGHT, LEFT, ("u0", "u1"), False),
        (LEFT, turned(RIGHT, "v"), ("u1", "u0"), True),
        (LEFT, turned(RIGHT, "u"), ("u1", "u1"), False),
        (turned(LEFT, "transposed"), RIGHT, ("v1", "u0"), False),
        (LEFT, turned(RIGHT, "u", "v", "transposed"), ("u1", "v1"), True),
    ],
)
def test_pieces_of_one_surface_go_on_into_each_other(first, second, sides, runs_back):
    found = js.continuity(first, second)
    assert (found.side_a, found.side_b) == sides
    assert bool(found.reversed) == runs_back
    assert float(found.max_g0) < 1e-13 and float(found.max_g1) < 1e-12 and float(found.max_g2_relative) < 1e-10
    assert found.order() == 2 and not bool(found.folded.any())
    assert float(found.length) == pytest.approx(LENGTH, rel=1e-7)
    np.testing.assert_allclose(first(*found.parameters_a.T), found.points_a, atol=1e-13)
    np.testing.assert_allclose(second(*found.parameters_b.T), found.points_b, atol=1e-13)
    given = js.continuity(first, second, *sides)
    np.testing.assert_array_equal(given.g2, found.g2)


def test_curvature_across_is_that_of_the_surface():
    """Normal curvature by Euler's formula from the principal curvatures, at the same places."""
    found = js.continuity(LEFT, RIGHT, "u1", "u0")
    bend = js.curvature(LEFT, *found.parameters_a.T)
    normal = np.asarray(js.normal(LEFT, *found.parameters_a.T))
    along = np.asarray(LEFT.derivative(*found.parameters_a.T, (0, 1)))
    across = np.cross(normal, along / np.linalg.norm(along, axis=1, keepdims=True))
    shares = np.einsum("nkd,nd->nk", np.asarray(bend.directions), across) ** 2
    expected = np.sum(shares * np.asarray(bend.principal), axis=1)
    np.testing.assert_allclose(np.abs(found.curvature_a), np.abs(expected), atol=1e-11)
    assert np.ptp(expected) > 0.1


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.3, np.pi / 2, 3.0, np.pi])
@pytest.mark.parametrize("ways", [(), ("u",), ("v",), ("transposed",)])
def test_planes_at_a_known_angle(angle, ways):
    """Whichever way their normals point; folded back is π and not 0."""
    found = js.continuity(FLAT, turned(hinged(jnp.asarray(angle)), *ways), "u1", {(): "u0", ("u",): "u1"}.get(ways))
    np.testing.assert_allclose(found.g1, angle, rtol=1e-9)
    assert float(found.max_g0) < 1e-15
    assert bool(found.folded.all()) == (angle > 2.5)
    assert found.order() == (2 if angle < 1e-3 else 0)


def test_a_gap_is_measured_at_the_foot():
    """The other side is moved across and along: the distance is the way across alone."""
    moved = js.translate(hinged(jnp.asarray(0.0)), (0.03, 0.4, 0.04))
    found = js.continuity(FLAT, moved, "u1", "u0", tolerance=0.1)
    np.testing.assert_allclose(found.g0, 0.05, rtol=1e-12)
    np.testing.assert_allclose(found.points_a[np.array([0, -1]), 1], [0.4, 2.0], atol=1e-12)
    assert float(found.length) == pytest.approx(1.6, rel=1e-12)
    assert found.order() == -1 and found.order(gap=0.06) == 2


def cylinder(radius, part):
    """A piece of a cylinder through the z-axis with its axis on the x-axis, in angles from the z-axis."""
    center, start = np.array([-radius, 0.0, 0.0]), np.array([np.sign(radius), 0.0, 0.0])
    whole = js.Cylinder(center, (0, 0, 1), abs(radius), 2.0, start)
    if part == "before":
        return js.split(whole, 2 * np.pi - 0.5, "u")[1]
    return js.split(whole, 0.5, "u")[0]


@pytest.mark.parametrize(
    ("radius", "part", "jump", "angle"),
    [(2.0, "before", 0.0, 0.0), (5.0, "before", 0.3, 0.0), (-5.0, "after", 0.7, 0.0), (5.0, "after", 0.7, np.pi)],
)
def test_cylinders_that_touch_along_a_ruling(radius, part, jump, angle):
    """Curvatures 1/2 and ±1/5; a cusp of the same tangent planes is folded back, with opposite normals."""
    found = js.continuity(cylinder(2.0, "after"), cylinder(radius, part), "u0", "u1" if part == "before" else "u0")
    np.testing.assert_allclose(found.g2, jump, atol=1e-13)
    np.testing.assert_allclose(found.g2_relative, 2 * jump, atol=1e-13)
    np.testing.assert_allclose(found.g1, angle, atol=1e-13)
    assert found.order() == (0 if angle else 1 if jump else 2)


def trough(curvature, start, end):
    """The cylinder z = ½ curvature x² over an interval of x."""
    rows = [(x, curvature * z / 2) for x, z in ((start, start**2), ((start + end) / 2, start * end), (end, end**2))]
    net = [[(x, y, z) for y in (0.0, 1.0, 2.0)] for x, z in rows]
    knots = lambda a, b: [a] * 3 + [b] * 3
    return js.BSplineSurface(net, knots(start, end), knots(0.0, 2.0), 2, 2)


@pytest.mark.parametrize("jump", [0.0, 1e-10, 1e-3])
def test_small_jumps_of_curvature_are_resolved(jump):
    found = js.continuity(trough(0.7, -1.0, 0.0), trough(0.7 * (1 + jump), 0.0, 1.5))
    np.testing.assert_allclose(found.g2_relative, jump / (1 + jump), rtol=1e-4, atol=1e-14)
    assert float(found.max_g1) < 1e-15


BALL = js.rotate(js.split(js.Sphere((0, 0, 2), 1.5), 0.0, "v")[1], (0, 0, 1), 0.7)
TUBE = js.Cylinder((0, 0, 0), (0, 0, 1), 1.5, 2.0)


def test_a_dome_on_a_tube():
    """Both sides are closed and start at different places."""
    found = js.continuity(TUBE, BALL)
    assert (found.side_a, found.side_b) == ("v1", "v0")
    assert float(found.max_g0) < 1e-14 and float(found.max_g1) < 1e-14
    np.testing.assert_allclose(found.g2, 1 / 1.5, rtol=1e-13)
    assert float(found.length) == pytest.approx(3 * np.pi, rel=1e-5)
    assert found.order() == 1


def test_a_part_that_goes_on_over_the_seam():
    """Of a dome from 2.7 to 2π + 0.7."""
    found = js.continuity(TUBE, js.split(BALL, 2.0, "u")[1])
    np.testing.assert_allclose(found.parameters_a[np.array([0, -1]), 0], [2.7, 0.7], atol=1e-12)
    assert float(found.length) == pytest.approx(1.5 * (2 * np.pi - 2), rel=1e-5)
    assert float(found.max_g0) < 1e-14


def test_the_seam_of_a_closed_surface():
    assert js.continuity(TUBE, TUBE, "u0", "u1").order() == 2


def test_a_side_that_is_shared_in_part():
    """Its end is at the exact foot of the shorter side's end, whichever is first."""
    piece = js.insert_knots(js.split(RIGHT, 0.3, "v")[1], [0.7], "v")  # again 6 × 6 points
    first, second = js.continuity(LEFT, piece), js.continuity(piece, LEFT)
    np.testing.assert_allclose(first.parameters_a[np.array([0, -1]), 1], [0.3, 1.0], atol=1e-14)
    np.testing.assert_allclose(second.parameters_b[np.array([0, -1]), 1], [0.3, 1.0], atol=1e-14)
    assert max(float(found.max_g2_relative) for found in (first, second)) < 1e-10
    assert float(first.length) == pytest.approx(float(second.length), rel=1e-9)
    given = js.continuity(LEFT, piece, "u1", "u0", part=(0.65, 1.0))
    np.testing.assert_allclose(given.points_a, first.points_a, atol=1e-13)


def test_a_short_side_between_two_samples():
    """Found from either side."""
    sliver = js.insert_knots(js.split(js.split(RIGHT, 0.311, "v")[1], 0.318, "v")[0], [0.314, 0.316], "v")
    for found in (js.continuity(LEFT, sliver, "u1", "u0"), js.continuity(sliver, LEFT, "u0", "u1")):
        np.testing.assert_allclose(found.points_a[np.array([0, -1])], sliver(2 * [3.5], [0.311, 0.318]), atol=1e-13)
        assert float(found.max_g0) < 1e-13


def test_a_pole_is_left_out():
    """Two wedges of a sphere share a meridian from pole to equator."""
    cap = js.split(js.Sphere((4, 1, 2), 1.5), 0.0, "v")[1]
    wedge, rest = js.split(cap, 1.0, "u")
    found = js.continuity(wedge, js.split(rest, 2.0, "u")[0])
    assert (found.side_a, found.side_b) == ("u1", "u0") and len(found.g0) == 64
    assert found.order() == 2 and float(found.max_g2_relative) < 1e-10
    with pytest.raises(js.InputError, match=r"Side v1 of `a` is a single point; give a side that has a length\."):
        js.continuity(cap, cap, "v1", "v0")


def test_edges_of_networks():
    """Patches of a network, named by its own list of inner edges."""
    t = np.linspace(0, 1, 6)
    height = lambda x, y: 0.4 * np.sin(2.1 * x + 0.3) * np.cos(1.7 * y + 0.5)
    guides = [js.interpolate(np.stack([np.full(6, x), t, height(x, t)], axis=1)) for x in (0.0, 1.0)]
    characters = [js.interpolate(np.stack([t, np.full(6, y), height(t, y)], axis=1)) for y in (0.0, 0.5, 1.0)]
    network = js.network(guides, characters, tolerance=1e-2)
    ((first, side_a), (second, side_b), runs_back, part, _) = network.inner_edges()[0]
    found = js.continuity(network.patches[first], network.patches[second], side_a, side_b)
    assert float(found.max_g0) < 1e-12 and bool(found.reversed) == runs_back
    along = found.parameters_a[:, 1 if side_a[0] == "u" else 0]
    np.testing.assert_allclose([along[0], along[-1]], part, atol=1e-12)
    np.testing.assert_allclose(np.asarray(found.points_a)[:, 1], 0.5, atol=1e-2)
    assert 1e-3 < float(found.max_g1) < 0.3  # sweeps keep curves, not tangents


def ours(surface):
    from jaxsurf.io._occt_geometry import geometric_surface
    from jaxsurf.io._spline_arrays import spline_arrays

    return geometric_surface(spline_arrays(surface))


def test_against_occt():
    """Distance and angle of a disturbed seam at places that were found, by `LocalAnalysis_SurfaceContinuity`."""
    from jaxsurf.io._occt_session import occt

    moved = js.translate(js.rotate(RIGHT, (0.2, 1, 0.1), 0.003, (10.5, 0, 4)), (0, 0, 1e-3))
    found = js.continuity(LEFT, moved, "u1", "u0")
    first, second = ours(LEFT), ours(moved)
    order = occt("GeomAbs").GeomAbs_Shape.GeomAbs_G1
    for k in range(0, 65, 16):
        places = [float(x) for x in (*found.parameters_a[k], *found.parameters_b[k])]
        theirs = occt("LocalAnalysis").LocalAnalysis_SurfaceContinuity(first, *places[:2], second, *places[2:], order)
        assert theirs.IsDone()
        assert float(found.g0[k]) == pytest.approx(theirs.C0Value(), rel=1e-9)
        assert float(found.g1[k]) == pytest.approx(theirs.G1Angle(), rel=1e-7)
    assert float(found.max_g0) > 5e-4 and float(found.max_g1) > 1e-3


def test_gradients():
    """Of an angle by itself and of a gap by itself 1; of all gaps of a spline as differences say, and finite at no gap."""

    def figures(angle, gap):
        found = js.continuity(FLAT, hinged(angle, gap), "u1", "u0", count=3)
        return jnp.stack([found.max_g0, found.max_g1])

    slopes = jax.jit(jax.jacfwd(figures, (0, 1)))(0.3, 0.01)
    np.testing.assert_allclose(jnp.stack(slopes), [[0, 1], [1, 0]], atol=1e-12)

    @jax.jit
    def total(points):
        found = js.continuity(eqx.tree_at(lambda s: s.control_points, LEFT, points), RIGHT, "u1", "u0", count=9)
        return jnp.sum(found.g0) + jnp.sum(found.g1) + jnp.sum(found.g2) + found.length

    points, way = LEFT.control_points, jnp.asarray(RNG.normal(size=LEFT.control_points.shape))
    slopes = jax.jit(jax.grad(total))
    assert bool(jnp.isfinite(slopes(points)).all())
    apart = points + 0.03 * way
    expected = (total(apart + 1e-6 * way) - total(apart - 1e-6 * way)) / 2e-6
    assert float(jnp.sum(slopes(apart) * way)) == pytest.approx(float(expected), rel=1e-6)


def test_single_precision():
    """Results have the type of the surfaces, to its rounding."""
    first, second = (jax.tree.map(lambda x: x.astype(jnp.float32), s) for s in (LEFT, RIGHT))
    found = js.continuity(first, second)
    assert found.g0.dtype == found.g2.dtype == found.length.dtype == jnp.float32
    assert (found.side_a, found.side_b) == ("u1", "u0")
    assert float(found.max_g0) < 1e-5 and float(found.max_g1) < 1e-4 and float(found.max_g2_relative) < 1e-3


class Counted(AbstractSurface):
    """A paraboloid that counts how often it is traced."""

    shift: jax.Array
    calls = [0]

    @property
    def domain(self):
        return (0.0, 1.0), (0.0, 1.0)

    def point(self, u, v):
        self.calls[0] += 1
        return jnp.stack([u, v, u * u + u * v]) + self.shift

    def grid_points(self, u, v):
        return jax.vmap(lambda s: jax.vmap(lambda t: self.point(s, t))(v))(u)


def test_edges_of_one_structure_are_compiled_once():
    """Whichever sides they are."""
    at = lambda *shift: Counted(jnp.asarray(shift))
    js.continuity(at(0.0, 0, 0), at(1.0, 0, 1), "u1", "u0", tolerance=3.0)
    before = Counted.calls[0]
    js.continuity(at(0.0, 0, 0), at(0.0, 1, 0.5), "v1", "v0", tolerance=3.0)
    assert Counted.calls[0] == before > 0


POINT = js.BSplineSurface(np.ones((2, 2, 3)), (0, 0, 1, 1), (0, 0, 1, 1), 1, 1)
FOLDED = js.BSplineSurface([[[0, 0, 0], [0, 0, 0]], [[1, 0, 0], [1, 0, 0.0]]], (0, 0, 1, 1), (0, 0, 1, 1), 1, 1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: js.continuity(FLAT, js.translate(FLAT, (4.0, 0, 0))),
            r"no edge within `tolerance` = 0\.0\d+: .* u1 of `a` and u0",
        ),
        (
            lambda: js.continuity(FLAT, js.translate(FLAT, (4.0, 0, 0))),
            r"are 3 apart; move the surfaces together, give other",
        ),
        (lambda: js.continuity(FLAT, hinged(jnp.asarray(0.0), 0.2), "u1", "u0"), r"are 0\.2 apart"),
        (lambda: js.continuity(FLAT, js.translate(FLAT, (1.0, 2.0, 0))), r"share no edge"),
        (lambda: js.continuity(FLAT, FLAT, "u2", "u0"), r"`side_a` must be one of u0, u1, v0, v1, got 'u2'"),
        (lambda: js.continuity(FLAT, FLAT, "u0", "w"), r"`side_b` must be one of u0, u1, v0, v1, got 'w'"),
        (lambda: js.continuity(FLAT, js.Line((0, 0, 0), (1, 0, 0))), r"`b` must be a surface, got a Line"),
        (lambda: js.continuity(FLAT, FLAT, tolerance=0.0), r"`tolerance` must be a length above 0, got 0"),
        (
            lambda: js.continuity(FLAT, FLAT, "u1", "u1", part=(0, 1.5)),
            r"two shares of `side_a` between 0 and 1, got \(0\.0, 1\.5",
        ),
        (lambda: js.continuity(POINT, FLAT), r"Every side of `a` is a single point"),
        (
            lambda: js.continuity(FOLDED, FOLDED, "v0", "v1"),
            r"Along v0 of `a` and v1 of `b` the surfaces have no tangent plane",
        ),
        (lambda: js.continuity(FLAT, FLAT, count=1), r"`count` must be at least 2, got 1"),
        (lambda: jax.jit(lambda x: js.continuity(FLAT, hinged(x)).g1)(0.1), r"give `side_a` and `side_b`"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(js.InputError, match=message):
        call()


def test_printing():
    text = str(js.continuity(FLAT, hinged(jnp.asarray(np.pi)), "u1", "u0"))
    assert "u1 of a on u0 of b, length 2, 65 samples" in text
    assert "G1 3.142e+00 rad (1.800e+02°), folded back" in text
