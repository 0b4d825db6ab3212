"""Joins by pseudo-vertices against the merged polygon, the equations of paper 003, and plain jumps of derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

RNG = np.random.default_rng(3)


def uniform(points, first=0):
    """A uniform cubic on whole knots."""
    points = np.asarray(points)
    return js.BSplineCurve(points, np.arange(len(points) + 4.0) + first, 3)


def polygon(count, start):
    """A random polygon that moves on."""
    return start + np.cumsum(np.abs(RNG.normal(size=(count, 3))) + [0.5, 0, 0], axis=0)


def jumps(curve, at, orders=(0, 1, 2)):
    """Largest jumps of derivatives at a knot: those of the segment before at its end, of the one after at its start."""
    knots = np.unique(np.asarray(curve.knots)[curve.degree : len(curve.knots) - curve.degree])
    number = int(np.argmin(np.abs(knots - at)))
    assert abs(knots[number] - at) < 1e-9
    before, after = (js.segment(curve, k) for k in (number - 1, number))
    left, right = np.diff(knots)[number - 1 : number + 1]
    found = [
        np.asarray(before.derivative(1.0, k)) / left**k - np.asarray(after.derivative(0.0, k)) / right**k for k in orders
    ]
    return [float(np.abs(jump).max()) for jump in found]


def test_matched_curvature_is_the_uniform_cubic_of_the_merged_polygon():
    first, second = polygon(6, 0.0), polygon(7, 4.0)
    second[0] = first[-1]
    joined = js.join(uniform(first), uniform(second, 20))
    merged = uniform(np.concatenate([first, second[1:]]))
    assert np.array_equal(joined.control_points, merged.control_points)  # bit for bit
    start, end = (float(x) for x in merged.domain)
    at = np.linspace(start, end, 101)
    np.testing.assert_allclose(joined(at), merged(at), rtol=0, atol=1e-14)
    np.testing.assert_allclose(joined.knots, merged.knots, rtol=0, atol=0)


def test_a_given_part_is_the_same_curve():
    first, second = polygon(6, 0.0), polygon(7, 4.0)
    a, b = uniform(first), uniform(second)
    joined = js.join(a, b, curvature="tangent")
    at = np.linspace(0, 1, 41)
    (s, t), (p, q), (_, end) = ((float(x) for x in c.domain) for c in (a, b, joined))
    size = np.abs(first).max() + np.abs(second).max()
    for curve, own in ((a, s + (t - s) * at), (b, p + (q - p) * at)):
        there = own if curve is a else own + (end - q)
        np.testing.assert_allclose(joined(there), curve(own), rtol=0, atol=4 * np.finfo(float).eps * size)


def test_tangents_are_joined_by_the_pseudo_vertices_of_the_paper():
    """(4): A_{n+1} = B₁ + 2B₀ − 2A_n and B₋₁ = A_{n−1} + 2A_n − 2B₀."""
    first, second = polygon(6, 0.0), polygon(7, 4.0)
    a, b = uniform(first), uniform(second)
    joined = js.join(a, b, curvature="tangent")
    longer = js.extend(a, end=second[1] + 2 * second[0] - 2 * first[-1])
    before = js.extend(b, start=first[-2] + 2 * first[-1] - 2 * second[0])
    assert np.array_equal(longer.control_points[:-1], first) and np.array_equal(before.control_points[1:], second)
    (s, t), (p, q) = ((float(x) for x in c.domain) for c in (longer, before))
    at = np.linspace(0, 1, 41)
    np.testing.assert_allclose(joined(s + (t - s) * at), longer(s + (t - s) * at), rtol=0, atol=1e-14)
    shift = float(joined.domain[1]) - q
    np.testing.assert_allclose(joined(p + (q - p) * at + shift), before(p + (q - p) * at), rtol=0, atol=1e-14)
    point, slope, bend = jumps(joined, t)
    assert point < 1e-12 and slope < 1e-12 and bend > 0.1
    assert np.sum(np.asarray(joined.knots) == t) == 2


def test_no_second_derivative_at_the_seam_where_the_polygons_allow_it():
    first, second = polygon(5, 0.0), polygon(6, 4.0)
    second[0], second[1] = first[-1], 2 * first[-1] - first[-2]
    joined = js.join(uniform(first), uniform(second), curvature="zero")
    seam = float(uniform(first).domain[1]) + 1
    assert np.abs(joined.derivative(seam, 2)).max() < 1e-13
    second[1] += [0, 0, 0.5]
    with pytest.raises(
        js.InputError, match=r'`curvature="zero"` needs that vertex to be midway .* but they are 0\.25 apart'
    ):
        js.join(uniform(first), uniform(second), curvature="zero")
    bridged = js.join(uniform(first), uniform(second), curvature="zero", bridge=True)
    seam = float(uniform(first).domain[1]) + 2
    assert np.abs(bridged.derivative(seam, 2)).max() < 1e-13
    assert max(jumps(bridged, seam)) < 1e-12


def test_ends_that_do_not_coincide_are_bridged_or_refused_with_the_distance():
    first, second = polygon(6, 0.0), polygon(7, 9.0)
    distance = np.linalg.norm(second[0] - first[-1])
    with pytest.raises(js.InputError, match=r"the last vertex of `a` to be the first of `b`.*bridge=True") as raised:
        js.join(uniform(first), uniform(second))
    assert f"{distance:.6g} apart" in str(raised.value)
    joined = js.join(uniform(first), uniform(second), bridge=True)
    assert np.array_equal(joined.control_points, np.concatenate([first, second]))
    assert len(np.unique(joined.knots)) == len(joined.knots)  # single knots: C² throughout


@pytest.mark.parametrize("degrees", [(1, 3), (2, 4), (3, 3), (5, 2)])
@pytest.mark.parametrize("curvature", ["match", "tangent", "zero"])
def test_any_degrees_and_knots_are_joined_smoothly(degrees, curvature):
    curves = []
    for degree, start in zip(degrees, (0.0, 6.0), strict=True):
        knots = np.concatenate([[0] * degree, [0, 0.7, 1.9, 2.3, 4], [4] * degree]).astype(float)
        curves.append(js.BSplineCurve(polygon(degree + 4, start), knots, degree))
    a, b = curves
    joined = js.join(a, b, curvature=curvature, bridge=curvature != "tangent")
    at = np.linspace(0, 4, 31)
    np.testing.assert_allclose(joined(at), a(at), rtol=0, atol=1e-12)
    shift = float(joined.domain[1]) - 4
    np.testing.assert_allclose(joined(at + shift), b(at), rtol=0, atol=1e-12)
    inner, counts = np.unique(np.asarray(joined.knots), return_counts=True)
    between = (inner > 4 - 1e-9) & (inner < shift + 1e-9)
    smooth = 1 if curvature == "tangent" else 2
    raised = 0 if joined.degree in degrees else joined.degree - max(degrees)
    at_ends = counts[between][[0, -1]] - raised
    for seam in inner[between]:
        assert max(jumps(joined, seam)[: smooth + 1]) < 1e-12 * np.abs(joined.control_points).max()
    assert counts[between][1:-1].max(initial=0) <= joined.degree - smooth and at_ends.max() <= joined.degree - smooth


def test_natural_ends():
    curve = js.extend(uniform(polygon(6, 0.0)))
    first, last = (float(x) for x in curve.domain)
    assert len(curve.control_points) == 8
    assert max(np.abs(curve.derivative(t, 2)).max() for t in (first, last)) < 1e-13


def patch(u, v, offset=0.0, rows=6, columns=5):
    x, y = np.meshgrid(np.linspace(u[0], u[1], rows), np.linspace(v[0], v[1], columns), indexing="ij")
    net = np.stack([x, y, 0.3 * np.sin(x + offset) * np.cos(y)], axis=-1)
    return js.BSplineSurface(net, js.clamped_knots(rows, 3), js.clamped_knots(columns, 3), 3, 3)


@pytest.mark.parametrize("edges", [("u1", "u0"), ("u0", "u1"), ("v1", "v0"), ("v0", "u1")])
def test_surfaces_are_joined_along_named_edges(edges):
    a, b = patch((0, 1), (0, 1)), patch((1.3, 2), (0, 1), 0.1, 7, 6)
    # a, on the left, with its right side called edges[0]; b's left side called edges[1]
    a = a if edges[0][1] == "1" else js.reverse(a, "u")
    a = a if edges[0][0] == "u" else js.transpose(a)
    b = b if edges[1][1] == "0" else js.reverse(b, "u")
    b = b if edges[1][0] == "u" else js.transpose(b)
    joined = js.join(a, b, edges=edges, bridge=True)
    at = np.linspace(0, 1, 9)
    direction = 0 if edges[0][0] == "u" else 1
    ends = [float(x) for x in joined.domain[direction]]
    along = at if edges[0][1] == "1" else ends[1] - 1 + at
    u, v = (along, at) if direction == 0 else (at, along)
    np.testing.assert_allclose(joined.grid(u, v), a.grid(at, at), rtol=0, atol=1e-13)
    knots = np.asarray(joined.knots_u if direction == 0 else joined.knots_v)
    inner = knots[(knots > ends[0]) & (knots < ends[1])]
    assert len(np.unique(np.round(inner, 9))) == len(inner)  # C² throughout


@pytest.mark.parametrize("curvature", ["match", "zero", "tangent"])
@pytest.mark.parametrize("bridge", ["shortest", "fairest"])
def test_isolines_over_bridges_have_no_jumps(bridge, curvature):
    a, b = patch((0, 1), (0, 1)), patch((1.3, 2), (0, 1), 0.1, 7, 6)
    whole = js.join(a, b, bridge=bridge, curvature=curvature)
    seams = [float(t) for t in np.unique(whole.knots_u)[1:-1] if t > 0.9]
    assert len(seams) >= 3
    for v in (0.0, 0.3, 1.0):
        net = np.einsum("ijx,j->ix", whole.control_points, whole.basis_v.row(jnp.asarray(v)))
        line = js.BSplineCurve(net, whole.knots_u, 3)
        largest = [np.abs(np.asarray(line.derivative(np.asarray(seams), k))).max() for k in (0, 1, 2)]
        for seam in seams:
            assert np.all(np.array(jumps(line, seam)) < 1e-12 * np.array(largest))


def test_edges_that_run_opposite_ways_are_turned_and_said():
    a, b = patch((0, 1), (0, 1)), patch((1.3, 2), (0, 1), 0.1)
    straight = js.join(a, b, bridge=True)
    with pytest.warns(js.GeometryWarning, match="u0 of `b` runs against u1 of what it is joined to"):
        turned = js.join(a, js.reverse(b, "v"), bridge=True)
    np.testing.assert_allclose(turned.control_points, straight.control_points, rtol=0, atol=1e-13)


def test_gradients_by_both_polygons_are_those_of_differences():
    first, second = jnp.asarray(polygon(6, 0.0)), jnp.asarray(polygon(7, 9.0))
    curves = uniform(first), uniform(second)

    @jax.jit
    def value(first, second):
        moved = zip(curves, (first, second), strict=True)
        a, b = (eqx.tree_at(lambda c: c.control_points, curve, net) for curve, net in moved)
        return jnp.sum(js.join(a, b, curvature="tangent")(7.3) ** 2)

    gradients = jax.grad(value, (0, 1))(first, second)
    step = jnp.asarray(RNG.normal(size=(6, 3))), jnp.asarray(RNG.normal(size=(7, 3)))
    ahead, back = (value(first + way * step[0], second + way * step[1]) for way in (1e-5, -1e-5))
    slope = sum(float(jnp.vdot(g, s)) for g, s in zip(gradients, step, strict=True))
    assert abs(slope) > 0.1 and (ahead - back) / 2e-5 == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda a: js.join(a, a, curvature="no"), "`curvature` must be one of match, zero, tangent, got 'no'"),
        (lambda a: js.join(a, js.Sphere((0, 0, 0), 1.0)), "`a` must be a surface as the others, got BSplineCurve"),
        (lambda a: js.join(a, 3.0), "`b` must be a curve with two ends, got float"),
        (
            lambda a: js.join(a, js.join(a, closed=True, bridge=True)),
            "`b` must be a curve with two ends, got a periodic curve",
        ),
        (lambda a: js.join(a), "`join` needs two shapes or more, or `closed=True` to close one"),
        (lambda a: js.join(a, a, bridge="long"), "`bridge` must be True, False, 'shortest' or 'fairest', got 'long'"),
        (lambda a: js.join(a, a, bridge=True, length=2.0), '`length` must be > 0 and is for `bridge="fairest"`'),
        (lambda a: js.segment(a, 2), "`number` must be a segment from 0 to 1 of the 2, got 2"),
        (lambda a: js.extend(a, end=[1.0, 2.0]), r"`end` must be pseudo-vertices \(3,\) or \(k, 3\), got shape \(1, 2\)"),
        (lambda a: js.join(patch((0, 1), (0, 1)), patch((0, 1), (0, 1)), edges=("u1", "w0")), "`edges` must be two sides"),
    ],
)
def test_what_is_refused(call, sentence):
    with pytest.raises(js.InputError, match=sentence):
        call(uniform(polygon(5, 0.0)))


def test_the_equations_of_the_paper():
    """(2), (4), (5), both (6), the second with its minus mended, by the segments C_i(t*) of both extended polygons."""
    first, second = polygon(5, 0.0), polygon(6, 4.0)
    ends = lambda a, b: (js.segment(uniform(a), -1), js.segment(uniform(b), 0))
    jump = lambda a, b, k: np.abs(np.asarray(a.derivative(1.0, k)) - np.asarray(b.derivative(0.0, k))).max()
    basis = lambda t: np.array([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6
    for number in (0, 1, -1):
        part, own = js.segment(uniform(first), number), np.lib.stride_tricks.sliding_window_view(first, 4, axis=0)
        for t in (0.0, 0.3, 1.0):
            np.testing.assert_allclose(part(t), own[number] @ basis(t), rtol=0, atol=1e-14)
    after, before = second[1] + 2 * second[0] - 2 * first[-1], first[-2] + 2 * first[-1] - 2 * second[0]
    one, two = ends([*first, after], [before, *second])  # (4)
    assert max(jump(one, two, k) for k in (0, 1)) < 1e-13 and jump(one, two, 2) > 0.1
    second[0] = first[-1]  # (5)
    one, two = ends([*first, second[1]], [first[-2], *second])  # (6)
    assert max(jump(one, two, k) for k in (0, 1, 2)) < 1e-13
    assert np.abs(one.derivative(1.0, 2)).max() > 0.1
    second[1] = 2 * first[-1] - first[-2]  # the second (6): A_n = (A_{n-1} + A_{n+1}) / 2
    one, two = ends([*first, second[1]], [first[-2], *second])
    assert max(np.abs(one.derivative(1.0, 2)).max(), np.abs(two.derivative(0.0, 2)).max()) < 1e-13
    assert np.abs(first[-1] - (first[-2] - second[1]) / 2).max() > 0.1  # as printed it does not hold


@pytest.mark.parametrize("degree", [3, 4])
def test_a_closed_chain_is_periodic_and_keeps_its_parts(degree):
    knots = np.concatenate([[0] * degree, [0, 0.7, 1.9, 2.3, 4], [4] * degree]).astype(float)
    parts = [js.BSplineCurve(polygon(degree + 4, start), knots, degree) for start in (0.0, 9.0, 4.0)]
    whole = js.join(*parts, bridge=True, closed=True)
    assert whole.periodic and len(np.unique(np.asarray(whole.knots))) == len(whole.knots)  # C^(degree - 1) throughout
    at = np.linspace(0, 4, 21)
    start = float(whole.domain[0])
    for part in parts:
        shift = [k for k in np.asarray(whole.knots)[:-1] - start if np.abs(whole(start + k) - part(0.0)).max() < 1e-9]
        assert len(shift) == 1
        np.testing.assert_allclose(whole(start + shift[0] + at), part(at), rtol=0, atol=1e-12)
    assert len(whole.control_points) == sum(len(p.control_points) for p in parts)
    first, last = (np.asarray(whole.derivative(t, 2)) for t in whole.domain)
    np.testing.assert_allclose(first, last, rtol=0, atol=1e-9)


def test_a_closed_uniform_polygon_is_the_periodic_curve_of_the_paper():
    points = polygon(7, 0.0)
    closed = js.join(uniform([*points, points[0]]), closed=True)
    np.testing.assert_allclose(closed.knots, np.arange(8.0) + 3, rtol=0, atol=0)
    periodic = js.BSplineCurve(np.roll(points, -0, axis=0), np.arange(8.0), 3, True)
    at = np.linspace(0, 7, 50)
    found = np.asarray(closed(at + 3))
    shifts = [np.abs(found - np.asarray(periodic(at + k))).max() for k in range(7)]
    assert min(shifts) < 1e-13
    with pytest.raises(js.InputError, match="the last vertex of `a` to be the first of `b`.*apart"):
        js.join(uniform(points), closed=True)


@pytest.mark.parametrize("curvature", ["match", "zero"])
def test_the_fairest_bridge_has_the_least_energy_of_all(curvature):
    first, second = polygon(6, 0.0), polygon(7, 9.0)
    a, b = uniform(first), uniform(second)
    fair = js.join(a, b, bridge="fairest", curvature=curvature)
    own = slice(6, len(fair.control_points) - 7)
    inner = np.asarray(fair.knots)
    start, end = float(a.domain[1]), float(fair.domain[1]) - float(b.domain[1] - b.domain[0])
    at = np.linspace(0, 1, 21)
    np.testing.assert_allclose(fair(3 + (start - 3) * at), a(3 + (start - 3) * at), rtol=0, atol=1e-13)
    shift = float(b.domain[1] - b.domain[0])
    np.testing.assert_allclose(fair(end + shift * at), b(float(b.domain[0]) + shift * at), rtol=0, atol=1e-13)
    places = (inner[(inner >= start) & (inner < end - 1e-9)] + inner[(inner > start + 1e-9) & (inner <= end + 1e-9)]) / 2

    def energy(net):
        moved = eqx.tree_at(lambda c: c.control_points, fair, net)
        return float(np.sum(np.asarray(moved.derivative(places, 3)) ** 2))

    middle = inner[(inner > start + 1e-9) & (inner < end - 1e-9)][len(places) // 2 - 1]
    least = energy(fair.control_points)
    for _ in range(5):
        step = np.zeros(fair.control_points.shape)
        step[own] = RNG.normal(size=step[own].shape)
        if curvature == "zero":  # moves that keep the second derivative amid
            bends = []
            for k in range(own.start, own.stop):
                unit = np.zeros(step.shape)
                unit[k, 0] = 1
                alone = eqx.tree_at(lambda c: c.control_points, fair, jnp.asarray(unit))
                bends.append(float(alone.derivative(middle, 2)[0]))
            bends = np.asarray(bends)
            step[own] -= np.outer(bends, bends @ step[own]) / (bends @ bends)
        for way in (-1e-3, 1e-3):
            assert energy(fair.control_points + way * step) > least
    if curvature == "zero":
        assert np.abs(fair.derivative(middle, 2)).max() < 1e-10
    speed = np.linalg.norm(np.asarray(fair.derivative(np.linspace(start, end, 21))), axis=-1)
    assert speed.max() < 4 * speed.min()  # as long as the gap takes


def test_a_fairest_bridge_under_jit_takes_a_length():
    a, b = uniform(polygon(6, 0.0)), uniform(polygon(7, 9.0))
    call = lambda a, **how: js.join(a, b, bridge="fairest", **how).control_points
    with_net = lambda net, **how: call(eqx.tree_at(lambda c: c.control_points, a, net), **how)
    traced = jax.jit(lambda net: with_net(net, length=2.5))(a.control_points)
    np.testing.assert_allclose(traced, with_net(a.control_points, length=2.5), rtol=0, atol=1e-13)
    with pytest.raises(js.InputError, match="give the bridge a `length`"):
        jax.jit(with_net)(a.control_points)


def test_other_shapes_are_joined_as_splines():
    helix = js.QICurve((0, 0, 0), 2.0, [(1, 0, 0.2), (0, 1, 0.3), (-1, 0, 0.1)], 2)
    joined = js.join(helix, js.Line((2, 2, 1), (4, 2, 1)), bridge=True)
    at = np.linspace(float(helix.domain[0]), float(helix.domain[1]), 31)
    np.testing.assert_allclose(joined(at), helix(at), rtol=0, atol=1e-8)
    assert len(np.unique(np.asarray(joined.knots)[3:-3])) >= len(joined.knots) - 8
    spine = [js.QICurve((0, y, 0), 2.0, [(1, 0, 0.2), (1, 0, -0.3), (1, 0, 0.1)], 2) for y in (0.0, 1.0)]
    sheet = js.sweep(js.Line((0, 0, 0), (0, 1, 0)), spine)
    both = js.join(sheet, patch((2.5, 3.5), (0, 1)), bridge=True, edges=("v1", "u0"))
    u, v = (np.linspace(float(along[0]), float(along[1]), 9) for along in sheet.domain)
    np.testing.assert_allclose(both.grid(u, v), sheet.grid(u, v), rtol=0, atol=1e-8)


def test_surfaces_in_a_ring_are_joined_to_a_tube():
    quarter = []
    for k in range(3):
        angle = np.linspace(0, 1.6, 6)[:, None] + k * 2 * np.pi / 3
        height = np.linspace(0, 2, 5)[None, :]
        x, y, z = np.cos(angle) + 0 * height, np.sin(angle) + 0 * height, 0 * angle + height
        quarter.append(js.BSplineSurface(np.stack([x, y, z], -1), js.clamped_knots(6, 3), js.clamped_knots(5, 3), 3, 3))
    ring = js.join(*quarter, bridge="fairest", closed=True)
    assert ring.periodic_u and not ring.periodic_v
    u, v = np.linspace(float(ring.domain[0][0]), float(ring.domain[0][1]), 200), np.linspace(0, 1, 7)
    radius = np.linalg.norm(np.asarray(ring.grid(u, v))[..., :2], axis=-1)
    assert radius.min() > 0.8 and radius.max() < 1.3
    at = np.linspace(0, 1, 9)
    np.testing.assert_allclose(ring.grid(at, at), quarter[0].grid(at, at), rtol=0, atol=1e-13)
