"""Lines, arcs, circles and helices by their definitions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jaxsurf._errors import InputError
from jaxsurf._frame import frame, perpendicular
from jaxsurf.curve import Arc, Circle, Helix, Line

CLOSE = {"rtol": 0, "atol": 1e-12}
CENTER, NORMAL = np.array([1.0, -2.0, 3.0]), np.array([1.0, 2.0, -0.5])
UNIT = NORMAL / np.linalg.norm(NORMAL)


def ends(curve):
    return [float(end) for end in curve.domain]


def test_a_line_meets_its_ends_exactly():
    line = Line([0.1, 0.2, 0.3], [7.7, -1e-3, 1 / 3])
    assert ends(line) == [0, 1]
    np.testing.assert_array_equal(line([0, 1]), [line.start, line.end])
    np.testing.assert_allclose(line.derivative(0.3), line.end - line.start, **CLOSE)
    np.testing.assert_allclose(Line([1, 2], [3, 6])(0.5), [2, 4], **CLOSE)


def test_a_line_without_length_has_gradients():
    def energy(end):
        return jnp.sum(Line([1.0, 2, 3], end).point(jnp.asarray(0.25)) ** 2)

    np.testing.assert_allclose(jax.jit(jax.grad(energy))(jnp.asarray([1.0, 2, 3])), [0.5, 1, 1.5], **CLOSE)


POINTS = {
    "short": ([1, 2, 3], [2, 2.5, 3], [3, 2.4, 3.5]),
    "more than half a turn": ([1, 0, 2], [-1, 0.1, 2], [1, 0.5, 2]),
    "nearly straight": ([0, 0, 0], [0.3, 1e-6, 0], [1, 0, 0]),
}


@pytest.mark.parametrize("name", POINTS)
def test_an_arc_passes_its_points_in_order(name):
    p = np.array(POINTS[name], float)
    arc = Arc.through(*p)
    assert ends(arc) == [0, 1]
    u = np.linspace(0, 1, 2001)
    place = np.asarray(arc(u))
    np.testing.assert_allclose(place[[0, -1]], p[[0, 2]], **CLOSE)
    nearest = np.linalg.norm(place - p[1], axis=1)
    step = np.linalg.norm(place[1] - place[0])
    assert nearest.min() < 0.51 * step and 0 < nearest.argmin() < 2000
    radii = np.linalg.norm(place - np.asarray(arc.center), axis=1)
    np.testing.assert_allclose(radii, arc.radius, rtol=1e-12)
    speed = np.linalg.norm(arc.derivative(u[::200]), axis=1)
    np.testing.assert_allclose(speed, float(arc.angle * arc.radius), rtol=1e-9)


def test_an_arc_by_its_fields():
    arc = Arc([0, 0, 1], [2, 0, 1], [0, 1, 5], np.pi / 2)  # the normal is made perpendicular: (0, 1, 5)
    n = np.array([0, 1, 5]) / np.sqrt(26)
    np.testing.assert_allclose(arc(1), [0, 0, 1] + 2 * np.cross(n, [1, 0, 0]), **CLOSE)


def test_arcs_are_differentiable_in_their_points_and_finite_on_a_line():
    @jax.jit
    def place(p):
        return Arc.through(*p).point(jnp.asarray(0.4)) @ jnp.arange(1.0, 4.0)

    check_grads(place, (jnp.asarray(POINTS["short"], float),), order=1, modes=["rev"], rtol=1e-6)
    straight = jnp.asarray([[0, 0, 0], [1, 1, 1], [2, 2, 2.0]])
    assert np.all(np.isfinite(jax.jit(jax.grad(place))(straight)))


def test_a_circle_is_round_and_right_handed():
    circle = Circle(CENTER, NORMAL, 2.5)
    u = np.linspace(0, 2 * np.pi, 13)
    assert ends(circle) == [0, 2 * np.pi]
    arm = np.asarray(circle(u)) - CENTER
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 2.5, **CLOSE)
    np.testing.assert_allclose(np.cross(arm, circle.derivative(u)), 2.5**2 * np.tile(UNIT, (13, 1)), **CLOSE)


def test_a_circle_starts_where_it_is_told():
    np.testing.assert_allclose(Circle([0, 0, 0], [0, 0, 2], 3)(0), [3, 0, 0], **CLOSE)
    np.testing.assert_allclose(Circle([0, 0, 0], [0, 0, -2], 3)(0), [3, 0, 0], **CLOSE)
    np.testing.assert_allclose(Circle([0, 0, 0], [0, 0, 2], 3, start=[1, 1, 9])(0), np.array([3, 3, 0]) / 2**0.5)


def test_a_helix_climbs_its_pitch():
    helix = Helix(CENTER, NORMAL, 2, -0.7, 1.5)
    assert ends(helix) == [0, 3 * np.pi]
    u = np.linspace(0, 3 * np.pi, 9)
    arm = np.asarray(helix(u)) - CENTER
    np.testing.assert_allclose(arm @ UNIT, -0.7 * u / (2 * np.pi), **CLOSE)
    np.testing.assert_allclose(np.linalg.norm(arm - np.outer(arm @ UNIT, UNIT), axis=1), 2, **CLOSE)
    assert np.all(np.cross(arm, helix.derivative(u)) @ UNIT > 0)


def test_circles_are_differentiable_in_every_field():
    @jax.jit
    def place(center, normal, radius, start):
        return Circle(center, normal, radius, start).point(jnp.asarray(0.4)) @ jnp.arange(1.0, 4.0)

    fields = (jnp.asarray(CENTER), jnp.asarray(NORMAL), jnp.asarray(2.0), jnp.asarray([0.0, 1, 1]))
    check_grads(place, fields, order=1, rtol=1e-6)


@jax.jit
@jax.vmap
def _frames(normals):
    x = perpendicular(normals)
    return jnp.stack(frame(normals, x)), x


def test_default_frames_are_orthonormal_everywhere_and_smooth_at_usual_normals():
    rng = np.random.default_rng(0)
    grid = np.array([[i, j, k] for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if i or j or k], float)
    axes, start = _frames(np.concatenate([grid, rng.normal(size=(200, 3))]))
    np.testing.assert_allclose(np.einsum("nia,nja->nij", axes, axes), np.tile(np.eye(3), (226, 1, 1)), **CLOSE)
    np.testing.assert_allclose(np.linalg.det(axes), 1, **CLOSE)
    np.testing.assert_allclose(axes[:, 0], start, **CLOSE)
    moved, _ = _frames(np.concatenate([grid + 1e-6 * rng.normal(size=grid.shape), np.zeros((200, 3))]))
    np.testing.assert_allclose(moved[:26], axes[:26], rtol=0, atol=1e-5)
    np.testing.assert_array_equal(moved[26:, 2], 0)  # no direction at all: zeros, not NaN


def test_single_precision_stays():
    center = np.zeros(3, np.float32)
    for curve in (
        Line(center, [1, 2, 3]),
        Arc.through(center, [1, 2, 0], [3, 0, 0.0]),
        Circle(center, NORMAL, 1),
    ):
        assert curve(0.5).dtype == np.float32


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Line([0, 0, 0, 0], [1, 0, 0]), r"`start` must have shape \(2,\) or \(3,\), got \(4,\)"),
        (lambda: Line([0, 0, 0], [1, 0]), r"`end` must have shape \(3,\), got \(2,\)"),
        (lambda: Line([0, 0, np.nan], [1, 0, 0]), "`start` must be finite"),
        (lambda: Arc.through([0, 0, 0], [1, 1, 1], [3, 3, 3]), "`p0`, `p1` and `p2` lie on one line"),
        (lambda: Arc.through([1, 0, 0], [1, 1, 1], [1, 0, 0]), "`p0`, `p1` and `p2` lie on one line"),
        (lambda: Arc(CENTER, CENTER, NORMAL, 1), "`start` of an arc must differ from its `center`"),
        (
            lambda: Arc(CENTER, CENTER + NORMAL, NORMAL, 1),
            "`start - center` must not be parallel to `normal`",
        ),
        (lambda: Arc(CENTER, [0, 0, 0], NORMAL, 7), "`angle` of an arc must be at most 2π, got 7"),
        (lambda: Circle(CENTER, [0, 0, 0], 1), "`normal` must be a direction, got the zero vector"),
        (lambda: Circle(CENTER, NORMAL, -1), "`radius` must be positive, got -1"),
        (lambda: Circle(CENTER, NORMAL, 1, 2 * NORMAL), "`start` must not be parallel to `normal`"),
        (lambda: Circle(CENTER, NORMAL, [1, 2]), r"`radius` must be one number, got shape \(2,\)"),
        (lambda: Helix(CENTER, NORMAL, 1, 1, 0), "`turns` must be positive, got 0"),
        (lambda: Helix(CENTER, NORMAL, 1, np.inf, 2), "`pitch` must be finite, got inf"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(InputError, match=message):
        call()
