"""What a fit is told to keep, it keeps to rounding, and fits the rest."""

import numpy as np
import pytest
from fit_cases import dented, points_on, sheet

import jaxsurf as js

TRUTH = sheet()
POINTS = points_on(TRUTH, 600, seed=1) + 0.01 * np.random.default_rng(2).normal(size=(600, 3))
START = dented(TRUTH, 3, depth=0.1)
ALONG = np.linspace(0, 1, 33)
TIGHT = 1e-12


def side(surface, name):
    (a, b), (c, d) = surface.domain
    u, v = a + (b - a) * ALONG, c + (d - c) * ALONG
    return {"u0": (a + 0 * u, v), "u1": (b + 0 * u, v), "v0": (u, c + 0 * v), "v1": (u, d + 0 * v)}[name]


def off(a, b):
    return np.max(np.abs(np.asarray(a) - np.asarray(b)))


@pytest.mark.parametrize("name", ["u0", "v1"])
def test_an_edge_stays(name):
    found = js.fit(START, POINTS, fixed=js.FixedEdge(name))
    assert off(found.shape(*side(START, name)), START(*side(START, name))) < TIGHT * 12
    assert found.deviation.rms < 0.05 and found.converged


def test_an_edge_is_given():
    u, v = side(TRUTH, "v0")
    edge = js.BSplineCurve(TRUTH.control_points[:, 0], TRUTH.knots_u, 3)
    found = js.fit(START, POINTS, fixed=js.FixedEdge("v0", edge))
    assert off(found.shape(u, v), edge(u)) < TIGHT * 12
    assert found.deviation.rms < 0.011


def test_points_stay_and_are_given():
    fixed = [js.FixedPoint((2.0, 0.0)), js.FixedPoint((3.3, 0.4), (25.0, -5.0, 6.0))]
    found = js.fit(START, POINTS, fixed=fixed)
    assert off(found.shape(2.0, 0.0), START(2.0, 0.0)) < TIGHT * 12
    assert off(found.shape(3.3, 0.4), (25.0, -5.0, 6.0)) < TIGHT * 12


LEVEL = [js.TangentPlane("u0", (0, 0, 1)), js.FixedEdge("u0")]


def flat():
    return js.BSplineSurface(np.asarray(START.control_points) * [1, 1, 0] + [0, 0, 5], START.knots_u, START.knots_v, 3, 3)


def test_an_edge_is_level():
    level = js.fit(flat(), POINTS, fixed=LEVEL, bending=1e-4)
    assert off(js.normal(level.shape, *side(START, "u0")), [0, 0, 1]) < 1e-9 and level.deviation.rms < 0.2


def test_a_net_that_folds_over_at_its_edge_is_told():
    """The points are not level there: a fold comes nearer to them."""
    with pytest.warns(js.GeometryWarning, match="along 'u0', but has folded over there"):
        folded = js.fit(flat(), POINTS, fixed=LEVEL)
    assert folded.shape.control_points.shape == (6, 6, 3)


def test_the_planes_of_the_start_stay():
    found = js.fit(START, POINTS, fixed=[js.TangentPlane("v1"), js.FixedEdge("v1")])
    greville = np.mean([np.asarray(START.knots_u)[i : i + 6] for i in (1, 2, 3)], axis=0)
    at = (greville, np.ones(6))
    assert off(js.normal(found.shape, *at), js.normal(START, *at)) < 1e-9


def test_a_mirrored_half():
    u, v = np.meshgrid(np.linspace(-5, 5, 6), np.linspace(0, 6, 5), indexing="ij")
    flat = js.BSplineSurface(np.stack([u, v, 0 * u], -1), js.clamped_knots(6, 3), js.clamped_knots(5, 3), 3, 3)
    rng = np.random.default_rng(3)
    x, y = rng.uniform([-5, 0], [5, 6], size=(400, 2)).T
    points = np.stack([x, y, 0.05 * x**2 + 0.02 * x * y], -1)  # the second term is not symmetric
    found = js.fit(flat, points, fixed=js.Symmetry((0, 0, 0), (1, 0, 0), along="u"))
    s, t = rng.uniform(size=(2, 50))
    assert off(found.shape(s, t), np.asarray(found.shape(1 - s, t)) * [-1, 1, 1]) < TIGHT * 10
    without = points * [1, 1, 0] + np.stack([0 * x, 0 * x, 0.05 * x**2], -1)
    assert np.sqrt(np.mean(np.square(js.closest_point(found.shape, without).distance))) < 0.15


def test_edges_become_plane_and_straight():
    found = js.fit(START, POINTS, fixed=[js.PlanarEdge("u0"), js.StraightEdge("v1")]).shape
    places = lambda name: np.asarray(found(*side(found, name)))
    spread = lambda name: np.linalg.svd(places(name) - places(name).mean(axis=0))[1]
    assert spread("u0")[2] < 1e-10 and spread("u0")[1] > 1e-3
    assert spread("v1")[1] < 1e-10
    given = js.fit(START, POINTS, fixed=js.PlanarEdge("u1", (30, 0, 0), (1, 0, 0))).shape
    assert off(np.asarray(given(*side(given, "u1")))[:, 0], 30) < 1e-11


def test_conditions_of_ones_own():
    above = lambda s: s(3.0, 0.5)[2] - 7.0
    found = js.fit(START, POINTS, fixed=above)
    np.testing.assert_allclose(found.shape(3.0, 0.5)[2], 7.0, rtol=0, atol=1e-11)


def test_conditions_given_twice_are_no_harm():
    once, twice = (js.fit(START, POINTS, fixed=n * [js.FixedEdge("u0")]) for n in (1, 2))
    assert off(once.shape.control_points, twice.shape.control_points) < 1e-6


def test_a_sphere_through_a_point():
    rng = np.random.default_rng(2)
    direction = rng.normal(size=(300, 3))
    points = [1, 2, 3] + 2 * direction / np.linalg.norm(direction, axis=1)[:, None]
    found = js.fit(js.Sphere([1.1, 2.1, 2.9], 1.8), points, fixed=js.FixedPoint((0.3, 0.2), (3.0, 2.2, 3.1)))
    assert off(found.shape(0.3, 0.2), (3.0, 2.2, 3.1)) < 1e-11


REFUSED = {
    "contradiction": ([js.FixedPoint((3.0, 0.5), (25, -5, 5)), js.FixedPoint((3.0, 0.5), (25, -5, 6))], "cannot be kept"),
    "a level side whose corner is on a steep edge": (
        [js.TangentPlane("u0", (0, 0, 1)), js.FixedEdge("v0")],
        "cannot be kept by this shape: condition .* the conditions contradict each other",
    ),
    "parameters": (js.FixedPoint((3.0,)), "`FixedPoint` needs 2 parameters on this shape"),
}


@pytest.mark.parametrize("fixed, message", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_kept_is_refused(fixed, message):
    with pytest.raises(js.InputError, match=message):
        js.fit(START, POINTS, fixed=fixed)


def test_conditions_that_mean_nothing_are_refused():
    with pytest.raises(js.InputError, match="`side` must be one of 'u0', 'u1', 'v0', 'v1', got 'w0'"):
        js.FixedEdge("w0")
    with pytest.raises(js.InputError, match="`along` must be 'u' or 'v', got 'x'"):
        js.Symmetry((0, 0, 0), (1, 0, 0), along="x")
    with pytest.raises(js.InputError, match="must be given both"):
        js.PlanarEdge("u0", point=(0, 0, 0))
    curve = js.BSplineCurve(TRUTH.control_points[:, 0], TRUTH.knots_u, 3)
    for fixed in (js.FixedEdge("u0"), js.TangentPlane("u0"), js.PlanarEdge("u1"), js.StraightEdge("u1")):
        with pytest.raises(js.InputError, match="`fixed` names the side 'u.', but the shape is a curve"):
            js.fit(curve, POINTS, fixed=fixed)
