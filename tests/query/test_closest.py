"""Feet are nearest: against samples, closed forms and the conditions that a nearest point meets."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from query_cases import (
    clamped,
    fan,
    far,
    least_distance,
    loop,
    near,
    places,
    ring,
    sheet,
    size,
    strand,
    wave,
)

import jaxsurf as js

SHAPES = {
    "gentle sheet": wave,
    "bumpy sheet": lambda: sheet(8, 0.2),
    "tube": ring,
    "triangle": fan,
    "open curve": strand,
    "closed curve": loop,
}
every_shape = pytest.mark.parametrize("name", SHAPES)
COUNT = 600


@pytest.fixture(scope="module")
def feet():
    """Shape, points around it and their feet, by name and kind of cloud; each computed once."""
    known = {}

    def of(name, kind):
        if (name, kind) not in known:
            shape = SHAPES[name]()
            points = near(shape, COUNT, 0.2) if kind == "near" else far(shape, COUNT)
            known[name, kind] = shape, points, js.closest_point(shape, points)
        return known[name, kind]

    return of


@every_shape
@pytest.mark.parametrize("kind", ["near", "far"])
def test_no_sample_is_nearer_than_the_foot(feet, name, kind):
    shape, points, foot = feet(name, kind)
    assert np.all(np.abs(foot.distance) <= least_distance(shape, points) + 1e-12)


@every_shape
@pytest.mark.parametrize("kind", ["near", "far"])
def test_feet_lie_on_the_shape_at_their_distance(feet, name, kind):
    shape, points, foot = feet(name, kind)
    parameters = np.moveaxis(np.asarray(foot.parameters).reshape(COUNT, -1), -1, 0)
    assert np.all((parameters >= 2) & (parameters <= 5))
    np.testing.assert_allclose(shape(*parameters), foot.points, rtol=0, atol=1e-13 * size(shape) + 1e-14)
    distance = np.linalg.norm(points - foot.points, axis=-1)
    np.testing.assert_allclose(np.abs(foot.distance), distance, rtol=0, atol=1e-12 * size(shape))


@every_shape
@pytest.mark.parametrize("kind", ["near", "far"])
def test_offsets_are_normal_inside_and_outward_on_borders(feet, name, kind):
    """⟨p − S, T⟩ = 0 for unit tangents T, and at an end of the domain the offset points across it."""
    shape, points, foot = feet(name, kind)
    parameters = np.moveaxis(np.asarray(foot.parameters).reshape(COUNT, -1), -1, 0)
    offset = points - foot.points
    closed = [getattr(shape, f, False) for f in ("periodic_u", "periodic_v")]
    if len(parameters) == 1:
        tangents, closed = [shape.derivative(*parameters)], [shape.periodic]
    else:
        tangents = [shape.derivative(*parameters, order) for order in ((1, 0), (0, 1))]
    for at, tangent, loops in zip(parameters, tangents, closed, strict=True):
        # where a side is shrunk to a point its tangent is rounding
        unit = tangent / np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), 1e-3 * size(shape))
        slope = np.sum(offset * unit, axis=-1) / size(shape)
        start, end = (at == 2) & (not loops), (at == 5) & (not loops)
        assert np.max(np.abs(slope[~start & ~end])) < 1e-10
        assert np.all(slope[start] < 1e-10) and np.all(slope[end] > -1e-10)


@pytest.mark.parametrize("bump, n, missed", [(0.05, 20, 0), (0.3, 20, 5), (0.5, 8, 5)])
def test_far_from_very_bumpy_sheets_few_feet_are_missed(bump, n, missed):
    """Distances have very many minima there; of 3000 points at most `missed` get another than the least."""
    shape = sheet(n, bump)
    points = far(shape, 3000)
    foot = js.closest_point(shape, points)
    further = np.abs(foot.distance) > least_distance(shape, points, 400) + 1e-12
    assert np.sum(further) <= missed


def test_feet_of_points_on_the_shape_are_where_they_came_from(feet):
    for name in SHAPES:
        shape = SHAPES[name]()
        at = places(shape, COUNT, seed=9)
        foot = js.closest_point(shape, shape(*at))
        assert np.max(np.abs(foot.distance)) < 1e-12 * size(shape), name
        if name not in ("triangle", "bumpy sheet"):
            parameters = np.asarray(foot.parameters).reshape(COUNT, -1).T
            np.testing.assert_allclose(parameters, at, rtol=0, atol=1e-7, err_msg=name)


def test_feet_on_edges_and_corners():
    """Beyond the sides of a flat rectangle they are known."""
    net = np.stack(np.meshgrid(np.linspace(1, 3, 5), np.linspace(-1, 0, 4), [0.5], indexing="ij"), -1)[:, :, 0]
    plate = js.BSplineSurface(net, clamped(3, 3.5), clamped(3), 3, 3)
    points = np.random.default_rng(0).uniform([-1, -3, -1], [5, 2, 2], (400, 3))
    foot = js.closest_point(plate, points)
    expected = np.clip(points, [1, -1, 0.5], [3, 0, 0.5])
    np.testing.assert_allclose(foot.points, expected, rtol=0, atol=1e-9)
    side = np.sign(points[:, 2] - 0.5)
    np.testing.assert_allclose(foot.distance, side * np.linalg.norm(points - expected, axis=-1), rtol=0, atol=1e-12)
    corner = np.sum((expected[:, :2] == points[:, :2]), axis=1) == 0
    on_end = (np.asarray(foot.parameters) == 2) | (np.asarray(foot.parameters) == 5)
    np.testing.assert_array_equal(np.all(on_end, axis=1), corner)


@pytest.mark.parametrize("name", ["tube", "closed curve"])
def test_feet_across_the_seam_are_found(name):
    """Points over places on both sides of the seam come back to them, from any side of it."""
    shape = SHAPES[name]()
    u = np.array([2, 2 + 1e-9, 2.001, 2.02, 4.98, 4.999, 5 - 1e-9])
    at = (u,) if name == "closed curve" else (u, np.full_like(u, 3.3))
    foot = js.closest_point(shape, shape(*at))
    found = np.asarray(foot.parameters).reshape(len(u), -1)[:, 0]
    np.testing.assert_allclose((found - u + 1.5) % 3 - 1.5, 0, atol=1e-7)
    other_end = np.where(u < 3, 4.98, 2.02)
    start = other_end if name == "closed curve" else np.stack([other_end, at[-1]], axis=-1)
    again = js.closest_point(shape, shape(*at), start=start)
    np.testing.assert_allclose(again.distance, 0, atol=1e-12)


CENTRE = np.array([1.0, -2.0, 0.5])
AXIS = np.array([0.36, -0.48, 0.8])


def _split(points):
    """Height along the axis, and the rest of p − centre."""
    height = (points - CENTRE) @ AXIS
    return height, points - CENTRE - height[:, None] * AXIS


def _to_torus(p):
    height, flat = _split(p)
    return np.hypot(np.linalg.norm(flat, axis=-1) - 2.7, height) - 0.8


CLOSED_FORMS = {
    "sphere": (lambda: js.Sphere(CENTRE, 1.7), lambda p: np.linalg.norm(p - CENTRE, axis=-1) - 1.7),
    "cylinder": (
        lambda: js.Cylinder(CENTRE - 9 * AXIS, AXIS, 1.7, 18.0),
        lambda p: np.linalg.norm(_split(p)[1], axis=-1) - 1.7,
    ),
    "torus": (lambda: js.Torus(CENTRE, AXIS, 2.7, 0.8), _to_torus),
    "plane": (lambda: js.Plane(CENTRE, AXIS, 40.0), lambda p: _split(p)[0]),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_distances_have_closed_forms_and_signs(name):
    """Positive on the side of the normal: outside, or above."""
    make_shape, distance = CLOSED_FORMS[name]
    points = CENTRE + np.random.default_rng(8).uniform(-4, 4, (300, 3))
    foot = js.closest_point(make_shape(), points)
    expected = distance(points)
    assert np.any(expected > 0) and np.any(expected < 0)
    np.testing.assert_allclose(foot.distance, expected, rtol=0, atol=1e-12)


def test_distances_to_a_circle_have_a_closed_form():
    points = CENTRE + np.random.default_rng(8).uniform(-4, 4, (300, 3))
    height, flat = _split(points)
    foot = js.closest_point(js.Circle(CENTRE, AXIS, 1.7), points)
    expected = np.hypot(np.linalg.norm(flat, axis=-1) - 1.7, height)
    np.testing.assert_allclose(foot.distance, expected, rtol=0, atol=1e-12)


def test_points_at_the_centre_have_some_foot():
    """All of a sphere and of a circle is nearest then; distances stay right, derivatives finite."""
    sphere, circle = js.Sphere(CENTRE, 1.7), js.Circle(CENTRE, AXIS, 1.7)
    np.testing.assert_allclose(js.closest_point(sphere, CENTRE).distance, -1.7, rtol=1e-14)
    np.testing.assert_allclose(js.closest_point(circle, CENTRE).distance, 1.7, rtol=1e-14)
    np.testing.assert_allclose(js.closest_point(circle, CENTRE + 2 * AXIS).distance, np.hypot(1.7, 2), rtol=1e-14)
    for shape in (sphere, circle):
        foot = jax.jacfwd(lambda p, shape=shape: js.closest_point(shape, p))(jnp.asarray(CENTRE))
        assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(foot))


def test_poles_and_collapsed_sides_are_feet_like_others():
    """Along the axis of a sphere, and beyond the corner of a triangle."""
    pole = np.array([0, 0, 1.7])
    foot = js.closest_point(js.Sphere(CENTRE, 1.7), CENTRE + np.array([[1.5], [0.3], [-2.0]]) * pole)
    np.testing.assert_allclose(foot.distance, [0.85, -1.19, 1.7], rtol=0, atol=1e-12)
    shape = fan()
    corner, inner = np.asarray(shape(2.0, 3.0)), np.asarray(shape(2.4, 3.0))
    foot = js.closest_point(shape, corner - 0.5 * (inner - corner))
    np.testing.assert_allclose(foot.points, corner, rtol=0, atol=1e-12)


@pytest.mark.parametrize("batch", [(), (4,), (2, 3), (0,), (3, 0)])
@pytest.mark.parametrize("name", ["gentle sheet", "open curve"])
def test_feet_have_the_batch_shape_of_the_points(feet, name, batch):
    shape, points, foot = feet(name, "near")
    count = int(np.prod(batch))
    again = js.closest_point(shape, points[:count].reshape(*batch, 3))
    trailing = (2,) if name == "gentle sheet" else ()
    assert again.parameters.shape == (*batch, *trailing)
    assert again.points.shape == (*batch, 3) and again.distance.shape == batch
    np.testing.assert_allclose(again.distance.reshape(-1), foot.distance[:count], rtol=0, atol=1e-13)


def test_a_good_start_leads_to_the_same_foot(feet):
    shape, points, foot = feet("gentle sheet", "near")
    start = np.clip(foot.parameters + 0.02, 2, 5)
    again = js.closest_point(shape, points, start=start)
    np.testing.assert_allclose(again.distance, foot.distance, rtol=0, atol=1e-12)
    outside = js.closest_point(shape, points[0], start=foot.parameters[0] + np.array([9.0, 0.0]))
    assert np.all((outside.parameters >= 2) & (outside.parameters <= 5))


def test_more_candidates_are_never_worse(feet):
    shape, points, foot = feet("bumpy sheet", "far")
    one = js.closest_point(shape, points, candidates=1)
    assert np.all(np.abs(foot.distance) <= np.abs(one.distance) + 1e-12)
    assert np.any(np.abs(foot.distance) < np.abs(one.distance) - 1e-6)


@pytest.mark.parametrize("name", ["gentle sheet", "open curve"])
def test_eager_jit_and_vmap_agree(feet, name):
    shape, points, foot = feet(name, "near")
    some = jnp.asarray(points[:6])
    for way in (jax.jit(js.closest_point), jax.vmap(js.closest_point, in_axes=(None, 0))):
        again = way(shape, some)
        np.testing.assert_allclose(again.distance, foot.distance[:6], rtol=0, atol=1e-13)
        np.testing.assert_allclose(again.points, foot.points[:6], rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    "make_shape",
    [lambda t: sheet(8, 0.1, 1.0, t), lambda t: js.BSplineCurve(np.asarray(strand().control_points, t), strand().knots, 3)],
)
def test_single_precision_stays_single_and_near(make_shape):
    single, double = make_shape(np.float32), make_shape(np.float64)
    points = near(double, 200, 0.1)
    foot, exact = js.closest_point(single, points), js.closest_point(double, points)
    assert {leaf.dtype for leaf in jax.tree.leaves(foot)} == {np.dtype(np.float32)}
    np.testing.assert_allclose(foot.distance, exact.distance, rtol=0, atol=2e-6 * size(double))


@pytest.mark.parametrize("scale", [1e-9, 1e9, 1e-30])
def test_feet_scale_with_the_shape(scale):
    """Tolerances are relative: a millionth of a millimetre is as good a size as a thousand kilometres."""
    one, other = sheet(8, 0.2), sheet(8, 0.2, scale)
    points = np.concatenate([near(one, 100, 0.2), far(one, 100)])
    foot, scaled = js.closest_point(one, points), js.closest_point(other, scale * points)
    np.testing.assert_allclose(scaled.distance / scale, foot.distance, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scaled.points / scale, foot.points, rtol=0, atol=1e-10)


def test_feet_of_points_very_far_away_are_extreme_points():
    shape = sheet(8, 0.2)
    foot = js.closest_point(shape, 1e8 * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-1.0, -1.0, 0.0]]))
    height = np.asarray(shape.grid(np.linspace(2, 5, 300), np.linspace(2, 5, 300)))[..., 2]
    assert foot.points[0, 2] >= height.max() - 1e-6
    assert foot.points[1, 2] <= height.min() + 1e-6
    np.testing.assert_allclose(foot.parameters[2], 2, atol=1e-12)


def test_collapsed_shapes_have_feet():
    """A net that is one point, or one line, is a shape still."""
    knots = wave().knots_u, wave().knots_v
    dot = js.BSplineSurface(np.ones((6, 5, 3)), *knots, 3, 2)
    points = np.array([[4.0, 1, 1], [1, 1, 1], [1, 5, 4]])
    foot = js.closest_point(dot, points)
    np.testing.assert_allclose(np.abs(foot.distance), [3, 0, 5], atol=1e-14)
    net = np.zeros((6, 5, 3))
    net[..., 0] = np.linspace(0, 1, 6)[:, None]
    foot = js.closest_point(js.BSplineSurface(net, *knots, 3, 2), np.array([[0.3, 2, 0], [5.0, 3, 0]]))
    np.testing.assert_allclose(np.abs(foot.distance), [2, 5], atol=1e-12)
    for k in (0, 1):
        slope = jax.jacfwd(lambda p: js.closest_point(dot, p).distance)(jnp.asarray(points[k]))
        assert np.all(np.isfinite(slope))
    thread = js.BSplineCurve(np.ones((4, 3)), clamped(3), 3)
    np.testing.assert_allclose(js.closest_point(thread, points).distance, [3, 0, 5], atol=1e-14)


def test_a_point_that_is_no_number_stays_alone(feet):
    shape, points, foot = feet("gentle sheet", "near")
    spoilt = points[:6].copy()
    spoilt[2] = np.nan
    again = js.closest_point(shape, spoilt)
    assert np.isnan(again.distance[2])
    keep = [0, 1, 3, 4, 5]
    np.testing.assert_allclose(again.distance[np.array(keep)], foot.distance[np.array(keep)], rtol=0, atol=1e-13)


def test_lists_and_integers_are_points():
    plane = js.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 10.0)
    for points in ([[1, 2, 3]], np.array([[1, 2, 3]]), np.array([[1, 2, 3]], np.float32)):
        foot = js.closest_point(plane, points)
        assert foot.distance.dtype == jnp.float64
        np.testing.assert_allclose(foot.distance, [3], atol=1e-15)


def test_feet_in_a_plane_have_two_coordinates():
    square = js.BSplineCurve([[0.0, 0], [1, 0], [1, 1]], [2.0, 2, 3, 5, 5], 1)
    foot = js.closest_point(square, [[0.5, -1.0], [2.0, 0.5], [2.0, -1.0]])
    np.testing.assert_allclose(foot.points, [[0.5, 0], [1, 0.5], [1, 0]], atol=1e-12)
    np.testing.assert_allclose(foot.distance, [1, 1, np.sqrt(2)], atol=1e-12)


@pytest.mark.parametrize(
    "arguments, keywords, message",
    [
        ((wave, np.zeros((4, 2))), {}, r"`points` must have shape \(..., 3\), got \(4, 2\)"),
        ((wave, 1.0), {}, r"`points` must have shape \(..., 3\), got \(\)"),
        ((strand, np.zeros((4, 2))), {}, r"`points` must have shape \(..., 3\), got \(4, 2\)"),
        ((wave, np.zeros((4, 3), complex)), {}, "Expected real numbers, got an array of complex128"),
        ((wave, np.zeros((4, 3))), {"candidates": 0}, "`candidates` must be at least 1, got 0"),
        (
            (wave, np.zeros((4, 3))),
            {"start": np.zeros(4)},
            r"`start` must have shape \(4, 2\), one entry for each point, got \(4,\)",
        ),
        (
            (strand, np.zeros((2, 4, 3))),
            {"start": np.zeros((4, 2))},
            r"`start` must have shape \(2, 4\), one entry for each point, got \(4, 2\)",
        ),
    ],
)
def test_bad_input_is_refused(arguments, keywords, message):
    make_shape, points = arguments
    with pytest.raises(ValueError, match=message):
        js.closest_point(make_shape(), points, **keywords)
