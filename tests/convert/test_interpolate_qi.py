"""Quaternion integral curves through points: they meet them, and no curve of the kind is fairer."""

from typing import Any

import jax
import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation
from scipy.special import fresnel

import jaxsurf as js
from jaxsurf._errors import InputError
from jaxsurf.convert import interpolate_qi
from jaxsurf.convert._qi_equations import across
from jaxsurf.convert._qi_spans import layout, spans_of
from jaxsurf.convert._qi_variation import blocks, second_derivatives

T = np.linspace(0, 4 * np.pi, 17)
HELIX = np.stack([np.cos(T), np.sin(T), 0.3 * T], axis=1) * 5 + [10, -3, 2]
SPIRAL = np.stack([(1 + 0.2 * T) * np.cos(T), (1 + 0.2 * T) * np.sin(T), 0 * T + 4], axis=1)
S = np.linspace(0, 2 * np.pi, 25)[:-1]
TREFOIL = np.stack([np.sin(S) + 2 * np.sin(2 * S), np.cos(S) - 2 * np.cos(2 * S), -np.sin(3 * S)], axis=1)
U = np.linspace(0, 1, 101)


def chain(count, turn=0.3):
    """A smooth random walk with uneven steps."""
    random = np.random.default_rng(count)
    directions = np.cumsum(random.normal(size=(count, 3)) * turn, axis=0) + [1, 0, 0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.cumsum(directions * random.uniform(0.5, 1.5, (count, 1)), axis=0)


def sites(curve, gaps):
    inner = np.asarray(curve.knots)[curve.degree : len(curve.knots) - curve.degree]
    assert (len(inner) - 1) % gaps == 0
    return inner[:: (len(inner) - 1) // gaps]


def check_met(curve, points, closed=False, tolerance=1e-12):
    loop = np.concatenate([points, points[:1]]) if closed else np.asarray(points)
    u = sites(curve, len(loop) - 1)
    assert u[0] == 0 and u[-1] == 1 and np.all(np.diff(u) > 0)
    size = np.sum(np.linalg.norm(np.diff(loop, axis=0), axis=1))
    np.testing.assert_allclose(np.asarray(curve(u)) / size, loop / size, rtol=0, atol=tolerance)


def directions(curve, u):
    """Unit tangents a second time: all turns one after the other, their shares by scipy's B-splines."""
    tangents, knots, degree = (np.asarray(x) for x in (curve.tangents, curve.knots, curve.degree))
    rows = BSpline(knots, np.eye(len(tangents)), int(degree))(u)
    found = np.tile(tangents[0], (len(u), 1))
    for i in range(1, len(tangents)):
        axis = np.cross(tangents[i - 1], tangents[i])
        sine = np.linalg.norm(axis)
        turn = axis * (np.arctan2(sine, tangents[i - 1] @ tangents[i]) / max(sine, 1e-300))
        found = Rotation.from_rotvec(rows[:, i:].sum(axis=1)[:, None] * turn).apply(found)
    return found


def bends(curve, u, step=1e-4):
    """T × dT/ds, the curvature vector turned by 90°, by differences."""
    slope = (directions(curve, u + step) - directions(curve, u - step)) / (2 * step * float(curve.length))
    return np.cross(directions(curve, u), slope)


def variation(curve):
    """L³ ∫ |T × T_ss|² ds by differences of directions at Gauss nodes of the spans; another way than the solver's."""
    abscissae, weights = np.polynomial.legendre.leggauss(6)
    knots = np.asarray(curve.knots)[curve.degree : len(curve.knots) - curve.degree]
    steps = np.diff(knots)[:, None]
    u, small = (knots[:-1, None] + steps * (1 + abscissae) / 2).ravel(), np.repeat(steps / 100, 6)[:, None]
    before, here, after = (directions(curve, u + k * small[:, 0]) for k in (-1, 0, 1))
    square = np.sum(np.cross(here, (before - 2 * here + after) / small**2) ** 2, axis=1)
    return np.sum(square.reshape(-1, 6) * weights * steps / 2)


def spline_variation(points, closed=False):
    """The same of the spline through the points of degree 5, by differences of its curvature vector."""
    curve = js.interpolate(points, closed=closed, degree=5)
    knots, control = np.asarray(curve.basis.unrolled_knots), np.asarray(curve.basis.unroll(curve.control_points))
    spline = BSpline(knots, control, 5)
    first, second = (spline(np.linspace(0, 1, 20001), k) for k in (1, 2))
    speed = np.linalg.norm(first, axis=1)
    tangent = first / speed[:, None]
    length = np.trapezoid(speed, dx=1 / 20000)
    vector = np.cross(first, second) / speed[:, None] ** 3
    change = np.gradient(vector, 1 / 20000, axis=0) / speed[:, None]
    change -= tangent * np.sum(change * tangent, axis=1, keepdims=True)
    return length**3 * np.trapezoid(np.sum(change**2, axis=1) * speed, dx=1 / 20000)


@pytest.mark.parametrize(
    "points, closed",
    [(HELIX, False), (SPIRAL, False), (TREFOIL, True), (chain(5), False), (chain(50), False), (chain(200), False)],
    ids=["helix", "spiral", "trefoil", "chain of 5", "chain of 50", "chain of 200"],
)
def test_points_are_met_by_a_fairer_curve_than_the_spline(points, closed):
    curve = interpolate_qi(points, closed=closed)
    assert isinstance(curve, js.QICurve)
    check_met(curve, points, closed)
    if len(points) > 5:
        assert variation(curve) < spline_variation(points, closed)


def test_wild_points_are_met():
    points = np.random.default_rng(0).normal(size=(9, 3))
    check_met(interpolate_qi(points), points)


def test_no_neighbour_is_fairer():
    points = chain(8)
    curve = interpolate_qi(points, spans=4)
    least = variation(curve)
    assert least < variation(interpolate_qi(points, spans=2))  # fewer spans are some of these curves
    u = sites(curve, 7)
    between = np.asarray(curve((u[3] + u[4]) / 2))
    for step in ([0, 0, 0], [0, 0, 0.02], [0, -0.02, 0]):
        moved = interpolate_qi(np.insert(points, 4, between + step, axis=0), spans=4)
        if any(step):
            assert variation(moved) > 1.0001 * least  # one more point to meet
        else:
            np.testing.assert_allclose(variation(moved), least, rtol=1e-3)


def test_plane_points_give_a_plane_curve():
    curve = interpolate_qi(SPIRAL)
    np.testing.assert_allclose(curve(U)[:, 2], 4, rtol=0, atol=1e-12)
    tilt = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    np.testing.assert_allclose(np.asarray(interpolate_qi(SPIRAL @ tilt)(U)) @ tilt[2], 4, rtol=0, atol=1e-11)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_closed_curves_are_smooth_where_they_close(degree):
    ring = np.concatenate([TREFOIL, TREFOIL[:1]])
    curve = interpolate_qi(ring, degree, closed=True)
    check_met(curve, TREFOIL, True)
    np.testing.assert_array_equal(curve.tangents[:degree], curve.tangents[-degree:])
    knots = np.asarray(curve.knots)
    np.testing.assert_allclose(knots[: 2 * degree + 1] + 1, knots[-2 * degree - 1 :], rtol=0, atol=1e-15)
    # the same tangents on the same knots; seen in directions and, by differences from either side, in curvature
    start, end = directions(curve, np.array([0, 1e-4, 2e-4])), directions(curve, 1 - np.array([0, 1e-4, 2e-4]))
    np.testing.assert_allclose(start[0], end[0], rtol=0, atol=1e-13)
    if degree > 1:
        slope = 4 * start[1] - start[2] - 3 * start[0]
        np.testing.assert_allclose(slope, -(4 * end[1] - end[2] - 3 * end[0]), rtol=0, atol=1e-3 * np.abs(slope).max())


@pytest.mark.parametrize("degree", [1, 2, 5])
def test_other_degrees(degree):
    curve = interpolate_qi(HELIX, degree)
    assert curve.degree == degree
    check_met(curve, HELIX)


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("closed", [False, True])
def test_circles_are_found(degree, closed):
    angles = np.array([0, 0.3, 0.9, 1.2, 2.2, 2.5, 3.6, 4.4])
    points = 3 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) + 7
    curve = interpolate_qi(points, degree, closed=closed)
    np.testing.assert_allclose(np.linalg.norm(curve(U) - np.array([[7.0, 7, 7]]), axis=1), 3, atol=1e-9)
    np.testing.assert_allclose(curve.length, 6 * np.pi if closed else 3 * 4.4, rtol=1e-9)
    u = np.linspace(0.01, 0.99, 50)
    np.testing.assert_allclose(bends(curve, u), [[0, 0, 1 / 3]] * 50, atol=1e-6)


def test_clothoids_have_linear_curvature():
    s = np.linspace(-1, 1.5, 26)
    y, x = fresnel(s)
    points = np.stack([x, y, 0 * s], axis=1)
    tangent = lambda t: [np.cos(np.pi * t**2 / 2), np.sin(np.pi * t**2 / 2), 0]
    curve = interpolate_qi(points, start_tangent=tangent(-1), end_tangent=tangent(1.5))
    u = np.linspace(0.15, 0.85, 31)
    np.testing.assert_allclose(bends(curve, u)[:, 2], np.pi * (-1 + 2.5 * u), atol=2e-3)
    np.testing.assert_allclose(curve.length, 2.5, rtol=5e-6)


def test_helices_bend_evenly():
    curve = interpolate_qi(HELIX)
    found = np.linalg.norm(bends(curve, np.linspace(0.25, 0.75, 41)), axis=1)
    np.testing.assert_allclose(found, 1 / (5 * 1.09), rtol=5e-3)


@pytest.mark.parametrize("which", [("start_tangent",), ("end_tangent",), ("start_tangent", "end_tangent")])
def test_end_tangents_are_met(which):
    directions_given = {"start_tangent": np.array([0, 2.0, 1]), "end_tangent": np.array([-1, 0, 3.0])}
    given: dict[str, Any] = {name: directions_given[name] for name in which}
    curve = interpolate_qi(HELIX, **given)
    check_met(curve, HELIX)
    for place, name in ((0.0, "start_tangent"), (1.0, "end_tangent")):
        if name in given:
            found = directions(curve, np.array([place]))[0]
            np.testing.assert_allclose(found, given[name] / np.linalg.norm(given[name]), atol=1e-14)


def test_two_points():
    ends = np.array([[1.0, 2, 3], [3, 2, 3]])
    line = interpolate_qi(ends)
    np.testing.assert_allclose(line(U), (1 - U)[:, None] * ends[0] + U[:, None] * ends[1], atol=1e-14)
    half = interpolate_qi(ends, start_tangent=[0, 1, 0], end_tangent=[0, -1, 0])  # antiparallel: a half circle
    np.testing.assert_allclose(half.length, np.pi, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(np.asarray(half(U)) - [2, 2, 3], axis=1), 1, atol=1e-12)
    bow = interpolate_qi(ends, start_tangent=[0, 1, 0], end_tangent=[0, 1, 0])
    check_met(bow, ends)
    places = np.asarray(bow(U))[:, :2]
    np.testing.assert_allclose(places[::-1], [4, 4] - places, atol=1e-8)
    quarter = interpolate_qi(ends, start_tangent=[1, 1, 0])
    np.testing.assert_allclose(quarter.length, np.pi / 2**0.5, rtol=1e-10)


def test_straight_chains():
    line = np.linspace([0.0, 1, 2], [3, 2, 0], 7)
    curve = interpolate_qi(line[[0, 1, 3, 4, 6]])
    np.testing.assert_allclose(curve(np.arange(7) / 6), line, atol=1e-14)
    check_met(interpolate_qi(line, start_tangent=[0, 0, 1.0]), line)


@pytest.mark.parametrize("points, closed, tolerance", [(HELIX, False, 0.4), (TREFOIL, True, 0.08)])
def test_noisy_points_within_a_tolerance(points, closed, tolerance):
    noisy = points + np.random.default_rng(0).normal(size=points.shape) * tolerance / 4
    exact, fair, fairer = (interpolate_qi(noisy, closed=closed, tolerance=times * tolerance) for times in (0, 1, 2))
    assert variation(fairer) < 0.99 * variation(fair) < 0.9 * variation(exact)
    misses = np.linalg.norm(np.asarray(fair(sites(fair, len(points) - 1 + closed)))[: len(points)] - noisy, axis=1)
    assert 0.9 * tolerance < misses.max() <= tolerance


def test_a_circle_within_the_tolerance_is_found():
    arc = np.stack([np.cos(S[:14]), np.sin(S[:14]), 0 * S[:14]], axis=1)
    noise = np.random.default_rng(0).normal(size=arc.shape) * 1e-3
    assert variation(interpolate_qi(arc + noise, tolerance=0.01)) < 1e-6 * variation(interpolate_qi(arc + noise))


def test_many_noisy_points():
    t = np.linspace(0, 2 * np.pi, 100)
    points = np.stack([np.cos(t), np.sin(t), 0.3 * t], axis=1)
    noisy = points + np.random.default_rng(4).normal(size=points.shape) * 0.03  # half their distance
    curve = interpolate_qi(noisy, tolerance=0.12)
    assert np.linalg.norm(np.asarray(curve(sites(curve, 99))) - noisy, axis=1).max() <= 0.12
    np.testing.assert_allclose(curve.length, 2 * np.pi * 1.09**0.5, rtol=0.03)


def test_similar_points_give_similar_curves():
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    points = chain(20)
    curve = np.asarray(interpolate_qi(points)(U))
    similar = interpolate_qi(40 * points @ turn + [100, 200, -50])
    np.testing.assert_allclose(similar(U), 40 * curve @ turn + [100, 200, -50], atol=40 * 1e-7)
    # turns in space do not commute, so that a space curve backwards is none of its family, but near one; in a plane it is
    np.testing.assert_allclose(interpolate_qi(points[::-1])(1 - U), curve, atol=1e-4)
    np.testing.assert_allclose(interpolate_qi(SPIRAL[::-1])(1 - U), interpolate_qi(SPIRAL)(U), atol=1e-7)
    ring = interpolate_qi(TREFOIL, closed=True)
    later = interpolate_qi(np.roll(TREFOIL, -5, axis=0), closed=True)
    np.testing.assert_allclose(later(U), ring((U + sites(ring, 24)[5]) % 1), atol=1e-7)


def test_single_precision():
    curve = interpolate_qi(HELIX.astype(np.float32), start_tangent=np.array([0, 1, 0.3], np.float32))
    assert curve.dtype == np.float32
    check_met(curve, HELIX, tolerance=2e-6)
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", False)
    try:
        alone = interpolate_qi(TREFOIL, closed=True)
        assert alone.dtype == np.float32
        check_met(alone, TREFOIL, True, tolerance=2e-6)
    finally:
        jax.config.update("jax_enable_x64", before)


@pytest.mark.parametrize("degree, parts, closed", [(3, 2, False), (3, 2, True), (1, 2, False), (1, 3, True), (2, 3, False)])
def test_derivatives_of_spans_are_differences(degree, parts, closed):
    random = np.random.default_rng(2)
    plan = layout(5, degree, parts, closed)
    tangents = np.cumsum(random.normal(size=(plan.count, 3)) * 0.4, axis=0) + [1, 0, 0]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    lengths = random.uniform(0.1, 0.3, 5)
    spans = spans_of(plan, tangents, across(tangents), lengths)
    pull = random.normal(size=(len(spans.tangents), 3))

    def moved(step):
        """All spans moved in one random direction; those do not share what they see."""
        turned = spans.tangents + step * np.einsum("stxk,stk->stx", spans.frames, turns)
        turned /= np.linalg.norm(turned, axis=2, keepdims=True)
        frames = spans.frames - turned[..., None] * np.einsum("stx,stxk->stk", turned, spans.frames)[:, :, None]
        return blocks(plan, spans._replace(tangents=turned, frames=frames, lengths=spans.lengths + step * steps))

    turns = random.normal(size=spans.tangents.shape[:2] + (2,))
    steps = random.normal(size=spans.lengths.shape) * 0.1 * plan.inside
    move = np.concatenate([turns.reshape(len(turns), -1), steps], axis=1)
    here, before, after = blocks(plan, spans), moved(-1e-6), moved(1e-6)
    for name, by in (("residuals", "by_unknowns"), ("means", "means_by_unknowns")):
        slope = (getattr(after, name) - getattr(before, name)) / 2e-6
        found = np.einsum("src,sc->sr", getattr(here, by), move)
        np.testing.assert_allclose(found, slope, atol=1e-7 * np.abs(slope).max())
    gradient = lambda b: (
        np.einsum("sr,src->sc", b.residuals, b.by_unknowns) + np.einsum("sx,sxc->sc", pull, b.means_by_unknowns)
    )
    slope = (gradient(after) - gradient(before)) / 2e-6
    found = np.einsum("scd,sd->sc", second_derivatives(plan, spans, pull), move)
    np.testing.assert_allclose(found, slope, atol=1e-4 * np.abs(slope).max())


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: interpolate_qi(HELIX[:1]), "`points` must be at least 2, got 1"),
        (lambda: interpolate_qi(HELIX[:2], closed=True), "closed curve must be at least 3 different ones, got 2"),
        (lambda: interpolate_qi(HELIX[[0, 1, 0]], closed=True), "closed curve must be at least 3 different ones, got 2"),
        (lambda: interpolate_qi(HELIX[:, :2]), r"`points` must have shape \(n, 3\), got \(17, 2\)"),
        (lambda: interpolate_qi(HELIX[0]), r"`points` must have shape \(n, 3\), got \(3,\)"),
        (lambda: interpolate_qi([[0.0, 0, 0], [1, np.nan, 0]]), r"`points` must be finite, got nan at index \[1, 1\]"),
        (lambda: interpolate_qi(HELIX[[0, 1, 2, 2, 3]]), "`points` 2 and 3 coincide; remove one of them"),
        (lambda: interpolate_qi(HELIX[[0, 1, 2, 0, 0]], closed=True), "`points` 3 and 0 coincide"),
        (lambda: interpolate_qi(np.ones((5, 3))), "`points` 0 and 1 coincide"),
        (lambda: interpolate_qi(HELIX, 0), "`degree` must be at least 1, got 0"),
        (lambda: interpolate_qi(HELIX, closed=True, start_tangent=[1.0, 0, 0]), "are for open curves"),
        (lambda: interpolate_qi(HELIX, start_tangent=[0.0, 0, 0]), "`start_tangent` must be a direction"),
        (lambda: interpolate_qi(HELIX, end_tangent=[0.0, 1]), r"`end_tangent` must have shape \(3,\)"),
        (lambda: interpolate_qi(HELIX, tolerance=-1.0), "`tolerance` must be a length ≥ 0, got -1.0"),
        (lambda: interpolate_qi(HELIX, tolerance=np.nan), "`tolerance` must be a length ≥ 0, got nan"),
        (lambda: interpolate_qi(HELIX, spans=0), "`spans` must be at least 1, got 0"),
        (lambda: interpolate_qi(HELIX, max_steps=0), "`max_steps` must be at least 1, got 0"),
        (lambda: interpolate_qi(HELIX, max_steps=2), "was not found in `max_steps` = 2: allow more steps"),
        (lambda: interpolate_qi([[0.0, 0, 0], [2, 0, 0], [1, 0, 0]]), "turn straight back, to no side"),
        (lambda: interpolate_qi([[0.0, 0, 0], [2, 0, 0]], start_tangent=[-1, 0, 0]), "turn straight back, to no side"),
        (
            lambda: interpolate_qi([[0.0, 0, 0], [1, 0, 0]], 1, start_tangent=[1, 1, 0], end_tangent=[1, 1, 1], spans=1),
            "could not be met: .* give more points where they turn sharply, more `spans`",
        ),
        (lambda: jax.jit(interpolate_qi)(HELIX), "needs concrete numbers; call it outside `jit`"),
        (lambda: jax.grad(lambda p: interpolate_qi(p).length)(jax.numpy.asarray(HELIX)), "needs concrete numbers"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
