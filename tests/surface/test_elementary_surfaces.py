"""Planes and surfaces about an axis by their definitions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jaxsurf._errors import InputError
from jaxsurf.surface import Cone, Cylinder, Plane, Sphere, Torus, breaks

CLOSE = {"rtol": 0, "atol": 1e-12}
CENTER, AXIS = np.array([1.0, -2.0, 3.0]), np.array([1.0, 2.0, -0.5])
UNIT = AXIS / np.linalg.norm(AXIS)


def from_axis(place):
    """Distance from the axis and height along it."""
    arm = np.asarray(place) - CENTER
    height = arm @ UNIT
    return np.linalg.norm(arm - height[..., None] * UNIT, axis=-1), height


def plane_off(place, u, v):
    return (place - CENTER) @ UNIT


def sphere_off(place, u, v):
    return np.linalg.norm(place - CENTER, axis=-1) - 2.5


def cylinder_off(place, u, v):
    distance, height = from_axis(place)
    return np.maximum(abs(distance - 2), abs(height - v))


def cone_off(place, u, v):
    distance, height = from_axis(place)
    return np.maximum(abs(distance - (2 - v * np.tan(0.3))), abs(height - v))


def torus_off(place, u, v):
    distance, height = from_axis(place)
    return np.hypot(distance - 3, height) - 1


def evenly(ends, count):
    return np.linspace(ends[0], ends[1], count)


SURFACES = {
    "plane": (lambda: Plane(CENTER, AXIS, 4), plane_off, ((-2, 2), (-2, 2))),
    "sphere": (lambda: Sphere(CENTER, 2.5), sphere_off, ((0, 2 * np.pi), (-np.pi / 2, np.pi / 2))),
    "cylinder": (lambda: Cylinder(CENTER, AXIS, 2, 5), cylinder_off, ((0, 2 * np.pi), (0, 5))),
    "cone": (lambda: Cone(CENTER, AXIS, 2, -0.3, 5), cone_off, ((0, 2 * np.pi), (0, 5))),
    "torus": (lambda: Torus(CENTER, AXIS, 3, 1), torus_off, ((0, 2 * np.pi), (0, 2 * np.pi))),
}


@pytest.mark.parametrize("name", SURFACES)
def test_points_lie_on_the_surface_and_normals_point_outward(name):
    make, off, domain = SURFACES[name]
    shape = make()
    np.testing.assert_allclose(np.array(shape.domain, float), domain, rtol=0, atol=0)
    u, v = evenly(domain[0], 6)[:, None], evenly(domain[1], 5)[None, :]
    place = np.asarray(shape.grid(u[:, 0], v[0]))
    np.testing.assert_allclose(off(place, u, v), 0, **CLOSE)
    np.testing.assert_allclose(shape(u, v), place, **CLOSE)
    middle = v[:, 1:-1]
    normal = np.cross(shape.derivative(u, middle, (1, 0)), shape.derivative(u, middle, (0, 1)))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    outside = off(place[:, 1:-1] + 1e-6 * normal, u, middle) if name in ("plane", "sphere", "torus") else None
    if outside is not None:
        np.testing.assert_allclose(outside, 1e-6, rtol=1e-6)
    else:
        away, _ = from_axis(place[:, 1:-1] + 1e-6 * normal)
        assert np.all(away > from_axis(place[:, 1:-1])[0])
    assert [len(along) for along in breaks(shape)] == [9, 9]


def test_u_starts_where_it_is_told():
    for make in (
        lambda start: Cylinder([0, 0, 0], [0, 0, 2], 3, 1, start),
        lambda start: Cone([0, 0, 0], [0, 0, 2], 3, 0.1, 1, start),
        lambda start: Torus([0, 0, 0], [0, 0, 2], 2, 1, start),
    ):
        np.testing.assert_allclose(make(None)(0, 0), [3, 0, 0], **CLOSE)
    np.testing.assert_allclose(make([0, 5, 1])(0, 0), [0, 3, 0], **CLOSE)
    np.testing.assert_allclose(Plane([0, 0, 1], [0, 0, 1])(1, 2), [1, 2, 1], **CLOSE)
    np.testing.assert_allclose(Plane([0, 0, 1], [0, 0, 1], 4, [0, 1, 0])(1, 2), [-2, 1, 1], **CLOSE)


SINGULAR = {
    "pole of the sphere": (lambda c, a, r: Sphere(c, r), (0.7, np.pi / 2)),
    "apex of the cone": (lambda c, a, r: Cone(c, a, 0 * r, 0.4, r), (0.7, 0.0)),
    "tip of the other cone": (lambda c, a, r: Cone(c, a, r, -jnp.arctan(r / 5), 5), (0.7, 5.0)),
}


@pytest.mark.parametrize("name", SINGULAR)
def test_gradients_at_singular_points_are_those_of_finite_differences(name):
    make, (u, v) = SINGULAR[name]

    @jax.jit
    def place(center, axis, radius, u, v):
        return make(center, axis, radius).point(u, v) @ jnp.arange(1.0, 4.0)

    fields = (jnp.asarray(CENTER), jnp.asarray(AXIS), jnp.asarray(2.0), jnp.asarray(u), jnp.asarray(v))
    check_grads(place, fields, order=1, modes=["rev"], rtol=1e-6, atol=1e-6)


def test_single_precision_stays():
    center = np.zeros(3, np.float32)
    for shape in (Plane(center, AXIS), Sphere(center, 1), Torus(center, AXIS, 2, 1)):
        assert shape.grid([0.5], [0.5]).dtype == np.float32


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Plane(CENTER, [0, 0, 0]), "`normal` must be a direction, got the zero vector"),
        (lambda: Plane(CENTER, AXIS, 0), "`size` must be positive, got 0"),
        (lambda: Plane([0, 0], AXIS), r"`point` must have shape \(3,\), got \(2,\)"),
        (lambda: Plane(CENTER, AXIS, 1, AXIS), "`direction` must not be parallel to `normal`"),
        (lambda: Sphere(CENTER, -2), "`radius` must be positive, got -2"),
        (lambda: Cylinder(CENTER, AXIS, 1, 0), "`height` must be positive, got 0"),
        (lambda: Cone(CENTER, AXIS, 1, 2, 1), "`half_angle` must lie between -π/2 and π/2 radians, got 2"),
        (lambda: Cone(CENTER, AXIS, 1, -0.5, 2), "must end at its apex at the latest"),
        (lambda: Cone(CENTER, AXIS, -1, 0.5, 2), "must end at its apex at the latest"),
        (lambda: Cone(CENTER, AXIS, 0, 0, 2), "both 0: it would be a line"),
        (lambda: Torus(CENTER, AXIS, 0, 1), "`R` must be positive, got 0"),
        (lambda: Torus(CENTER, AXIS, 3, -1), "`r` must be positive, got -1"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(InputError, match=message):
        call()
