"""Lofts."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.surface import breaks


def spline(z, count, degree, domain, seed):
    points = np.linspace([0, 0, z], [3, 0, z], count) + 0.2 * np.random.default_rng(seed).normal(size=(count, 3))
    knots = js.clamped_knots(count, degree, domain)
    knots = knots.at[degree + 1 : -degree - 1].add(0.03)  # uneven
    return js.BSplineCurve(points, knots, degree)


SPLINES = [
    spline(0.0, 6, 3, (2, 5), 1),
    spline(1.0, 5, 2, (0, 1), 2),
    spline(2.5, 7, 3, (0, 4), 3),
    js.Line((0, 1, 3), (3, 1, 4)),
    spline(5.0, 6, 4, (0, 1), 4),
]
MIXED = [SPLINES[0], js.Arc.through((0, 0, 1), (1.5, 1, 1), (3, 0, 1.3)), SPLINES[3]]
PLACES = np.array([0.0, 0.2, 0.5, 0.7, 1.0])
SHARES = np.linspace(0, 1, 23)


def at_shares(curve, shares=SHARES):
    a, b = (float(end) for end in curve.domain)
    return np.asarray(curve((1 - shares) * a + shares * b))


def off_sections(surface, curves, places):
    a, b = (float(end) for end in surface.domain[0])
    u = (1 - SHARES) * a + SHARES * b
    return max(float(np.abs(np.asarray(surface(u, v)) - at_shares(c)).max()) for c, v in zip(curves, places, strict=True))


@pytest.fixture(scope="module")
def lofted():
    return js.loft(SPLINES, PLACES)


def test_splines_give_one_spline_through_all_sections(lofted):
    assert type(lofted) is js.BSplineSurface
    assert (lofted.degree_u, lofted.degree_v) == (4, 3)
    assert off_sections(lofted, SPLINES, PLACES) < 1e-12


def test_both_kinds_of_loft_are_the_same_surface(lofted):
    blended = js.Loft(tuple(SPLINES), jnp.asarray(PLACES), 3, False)
    u, v = np.linspace(2, 5, 31), np.linspace(0, 1, 17)
    np.testing.assert_allclose(blended.grid(u, v), lofted.grid(u, v), atol=1e-13)
    np.testing.assert_allclose(blended(u[:17], v), np.asarray(lofted.grid(u[:17], v))[range(17), range(17)], atol=1e-13)
    found = js.to_bspline(blended, 1e-9)
    assert float(found.max_error) < 1e-13 and found.shape.control_points.shape == lofted.control_points.shape
    (own, own_v), (knots, knots_v) = breaks(blended), breaks(lofted)
    np.testing.assert_allclose(own_v, knots_v, atol=1e-14)
    assert np.abs(np.asarray(own)[:, None] - np.asarray(knots)[None]).min(axis=0).max() < 1e-14


def test_curves_of_any_kind():
    surface = js.loft(MIXED)
    assert type(surface) is js.Loft and surface.degree == 2
    assert off_sections(surface, MIXED, surface.parameters) < 1e-14


def test_parameters_are_mean_chord_lengths():
    """Sections moved in parallel: in proportion to the steps."""
    first = js.Arc.through((0, 0, 0), (1, 1, 0), (2, 0, 0))
    surface = js.loft([js.translate(first, (0, 0, z)) for z in (0.0, 1.0, 4.0, 5.0)])
    np.testing.assert_allclose(surface.parameters, [0, 0.2, 0.8, 1], atol=1e-14)
    even = js.loft(MIXED, "uniform")
    np.testing.assert_allclose(even.parameters, [0, 0.5, 1], atol=1e-15)


def ring(t, radius=1.0):
    normal, outward = np.array([-np.sin(t), np.cos(t), 0]), np.array([np.cos(t), np.sin(t), 0])
    return js.Circle(3 * outward, normal, radius, outward)


def test_closed_lofts_are_smooth_where_they_close():
    """A torus from six circles: off by what cubic interpolation of a circle leaves, C² at the seam."""
    rings = [ring(t) for t in np.linspace(0, 2 * np.pi, 7)[:-1]]
    surface = js.loft(rings, closed=True)
    assert off_sections(surface, [*rings, rings[0]], surface.parameters) < 1e-14 * 10
    for order in (0, 1, 2):
        before, after = (surface.derivative([0.3, 2.0], v, (0, order)) for v in (1.0 - 1e-9, 1e-9))
        np.testing.assert_allclose(before, after, atol=1e-5)
    points = np.asarray(surface.grid(np.linspace(0, 6, 9), np.linspace(0, 1, 41)))
    ring_off = (np.hypot(points[..., 0], points[..., 1]) - 3) ** 2 + points[..., 2] ** 2 - 1
    assert 1e-4 < np.abs(ring_off).max() < 0.04


def test_closed_lofts_of_closed_splines_stay_periodic():
    rows = [js.interpolate(np.asarray(ring(t)(np.linspace(0, 2 * np.pi, 9)[:-1])), closed=True) for t in (0.0, 2.1, 4.2)]
    surface = js.loft(rows, closed=True)
    assert surface.periodic_u and surface.periodic_v
    assert off_sections(surface, rows, np.asarray(surface.knots_v)[:-1]) < 1e-13


def test_sections_that_run_against_the_others_are_turned(lofted):
    crossed = [*SPLINES[:3], js.reverse(SPLINES[3]), SPLINES[4]]
    u, v = np.linspace(2, 5, 9), np.linspace(0, 1, 7)
    np.testing.assert_allclose(js.loft(crossed, PLACES).grid(u, v), lofted.grid(u, v), atol=1e-13)
    with pytest.warns(js.GeometryWarning, match=r"`curves\[[34]\]` runs against `curves\[[23]\]`: the loft is twisted"):
        kept = js.loft(crossed, PLACES, align=False)
    assert off_sections(kept, crossed, PLACES) < 1e-12


def test_closed_sections_are_turned_and_those_that_start_elsewhere_are_told_of():
    one = js.scale(js.Circle((0, 0, 0), (0, 0, 1), 1.0, (1, 0, 0)), (1, 2, 1))
    two = js.scale(js.Circle((0, 0, 1), (0, 0, -1), 1.0, (1, 0, 0)), (1, 2, 1))
    surface = js.loft([one, two])
    np.testing.assert_allclose(surface(1.0, 1.0), one(1.0) + np.array([0, 0, 1.0]), atol=1e-14)
    bent = js.CompositeCurve(
        [js.Line((2, 0, 1), (0, 1, 1)), js.Line((0, 1, 1), (-1, -1, 1)), js.Line((-1, -1, 1), (2, 0, 1))]
    )
    before, after = js.split(bent, 1.0)
    elsewhere = js.CompositeCurve([after, before])
    with pytest.warns(js.GeometryWarning, match=r"closed `curves\[1\]` starts elsewhere .* at its parameter 3\.0"):
        js.loft([js.translate(bent, (0, 0, -1)), elsewhere])


def test_a_point_as_a_section_makes_a_cap():
    cap = js.loft([js.Line((0, 0, 0), (0, 0, 0)), js.Circle((0, 0, 1), (0, 0, 1), 1.0)], [0, 1])
    np.testing.assert_allclose(cap(0.25, 0.5), [0, 0.5, 0.5], atol=1e-14)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((SPLINES[:1],), {}, "`curves` must be at least 2 curves, got 1"),
        ((SPLINES[:2],), dict(closed=True), "`curves` must be at least 3 curves, got 2"),
        ((SPLINES[0],), {}, "`curves` must be a sequence of at least 2 curves, got BSplineCurve"),
        (([SPLINES[0], 3],), {}, r"`curves\[1\]` must be a curve, got int"),
        (([SPLINES[0], js.Line([0, 0], [1, 1])],), {}, r"`curves\[1\]` must be a curve in space"),
        ((SPLINES, [0, 1]), {}, r"`parameters` must have shape \(5,\)"),
        ((SPLINES, [0, 1, 1, 2, 3]), {}, "`parameters` must ascend"),
        ((SPLINES, "chords"), {}, '`parameters` must be one of "chord"'),
        ((SPLINES,), dict(degree=0), "`degree` must be a whole number ≥ 1, got 0"),
        ((SPLINES,), dict(degree=2, closed=True), "`degree` must be an odd whole number ≥ 1 for a closed loft"),
        (([SPLINES[0], SPLINES[0]],), {}, r"`curves\[0\]` and `curves\[1\]` are the same curve"),
        (([*SPLINES[:3], SPLINES[0]],), dict(closed=True), "a closed loft returns to the first section by itself"),
    ],
)
def test_bad_arguments_are_refused(arguments, options, message):
    with pytest.raises(js.InputError, match=message):
        js.loft(*arguments, **options)


@pytest.mark.parametrize("kind", ["splines, their points alone", "mixed"])
def test_derivatives_by_all_sections_agree(kind):
    """Forward, reverse and differences, the mean chord lengths included; lofted inside `jit`, as one spline where knots are
    not traced."""
    curves = MIXED if kind == "mixed" else [SPLINES[0], SPLINES[1], SPLINES[3]]
    points_alone = kind == "splines, their points alone"
    chosen = jax.tree.map(eqx.is_inexact_array, curves)
    if points_alone:
        chosen = eqx.tree_at(lambda c: [c[0].knots, c[1].knots], chosen, [False, False])
    data, static = eqx.partition(curves, chosen)
    u, v = np.array([2.0, 2.9, 4.0]), np.array([0.0, 0.4, 0.8])
    kinds = []

    def value(data):
        surface = js.loft(eqx.combine(data, static))
        kinds.append(type(surface))
        return jnp.sum(jnp.sin(surface.grid(u, v)))

    along = jax.tree.map(lambda x: jnp.asarray(np.random.default_rng(2).normal(size=x.shape)), data)

    @jax.jit
    def slopes(data, along):
        gradient = jax.grad(value)(data)
        moved = jax.vmap(lambda h: value(jax.tree.map(lambda x, a: x + h * a, data, along)))(jnp.asarray([1e-6, -1e-6]))
        return gradient, jax.jvp(value, (data,), (along,))[1], (moved[0] - moved[1]) / 2e-6

    gradient, pushed, difference = slopes(data, along)
    pulled = sum(np.sum(g * a) for g, a in zip(jax.tree.leaves(gradient), jax.tree.leaves(along), strict=True))
    np.testing.assert_allclose(pushed, pulled, rtol=1e-10)
    np.testing.assert_allclose(pulled, difference, rtol=1e-6)
    assert set(kinds) == {js.BSplineSurface if points_alone else js.Loft}


def test_splines_on_traced_knots_are_blended():
    surface = eqx.filter_eval_shape(js.loft, SPLINES[:3])
    assert type(surface) is js.Loft


def test_files_types_and_many_alike_sections(tmp_path):
    arcs = [js.Arc.through((0, 0, z), (1, 1 + z / 3, z), (2 + z / 4, 0, z)) for z in range(7)]
    surface = js.loft(arcs)
    assert off_sections(surface, arcs, surface.parameters) < 1e-13
    js.save(tmp_path / "a.jxs", surface)
    assert eqx.tree_equal(js.load(tmp_path / "a.jxs"), surface)
    single = js.loft([jax.tree.map(lambda x: x.astype(jnp.float32), arc) for arc in arcs])
    assert single.dtype == single(0.3, 0.4).dtype == jnp.float32
    np.testing.assert_allclose(single(0.3, [0.1, 0.4]), surface(0.3, [0.1, 0.4]), atol=1e-5)
    splines = js.loft([jax.tree.map(lambda x: x.astype(jnp.float32), curve) for curve in SPLINES], PLACES)
    assert splines.dtype == jnp.float32
    assert off_sections(splines, SPLINES, PLACES) < 1e-5
