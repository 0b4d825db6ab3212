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
    """Largest jumps of derivatives at a parameter, from polynomials fitted on both sides."""
    found = []
    for k in orders:
        sides = [np.asarray(curve.derivative(at + way * 1e-9, k)) for way in (-1, 1)]
        found.append(float(np.abs(sides[0] - sides[1]).max()))
    return found


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
    assert point < 1e-7 and slope < 1e-7 and bend > 0.1
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
    assert max(jumps(bridged, seam)) < 1e-7


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


def test_edges_that_run_opposite_ways_are_turned_and_said():
    a, b = patch((0, 1), (0, 1)), patch((1.3, 2), (0, 1), 0.1)
    straight = js.join(a, b, bridge=True)
    with pytest.warns(js.GeometryWarning, match="u0 of `b` runs against u1 of `a`"):
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
        (lambda a: js.join(a, js.Sphere((0, 0, 0), 1.0)), "`a` must be a B-spline surface as the other, got BSplineCurve"),
        (
            lambda a: js.join(a, js.Circle((0, 0, 0), (0, 0, 1), 1.0)),
            "`b` must be a B-spline curve with two ends, got Circle",
        ),
        (lambda a: js.extend(a, end=[1.0, 2.0]), r"`end` must be pseudo-vertices \(3,\) or \(k, 3\), got shape \(1, 2\)"),
        (lambda a: js.join(patch((0, 1), (0, 1)), patch((0, 1), (0, 1)), edges=("u1", "w0")), "`edges` must be two sides"),
    ],
)
def test_what_is_refused(call, sentence):
    with pytest.raises(js.InputError, match=sentence):
        call(uniform(polygon(5, 0.0)))
