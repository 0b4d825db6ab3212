"""Moving shapes is moving their points."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from edit_cases import curve, points, surface
from scipy.spatial.transform import Rotation

from jaxsurf._errors import InputError
from jaxsurf.curve import BSplineCurve, CompositeCurve, Helix, Line
from jaxsurf.curve._breaks import breaks
from jaxsurf.edit import MappedCurve, MappedSurface, mirror, rotate, scale, transform, translate
from jaxsurf.surface import Sphere, TrimmedSurface

CLOSE = {"rtol": 0, "atol": 1e-12}
AXIS, CENTER = np.array([1.0, -2.0, 0.5]), np.array([0.3, 4.0, -1.0])


def loop():
    return BSplineCurve([[0, 0], [1, 0], [0, 1], [0, 0]], [0, 0, 1, 2, 3, 3], 1)


SHAPES = {
    "spline": lambda: curve("periodic"),
    "rational": lambda: surface("rational"),
    "line": lambda: Line([1, 2, 3], [2, 2, 5]),
    "helix": lambda: Helix([1, 2, 3], [0, 1, 1], 2, 0.5, 1.5),
    "mapped": lambda: translate(Helix([1, 2, 3], [0, 1, 1], 2, 0.5, 1.5), [1, 1, 1]),
    "composite": lambda: CompositeCurve([Line([1, 2, 3], [2, 2, 5]), Line([2, 2, 5], [0, 0, 0])]),
    "sphere": lambda: Sphere([1, 2, 3], 2),
    "trimmed": lambda: TrimmedSurface(Sphere([1, 2, 3], 2), [loop()]),
}


def places(shape):
    """A few points anywhere in the domain."""
    share = np.array([0.0, 0.21, 0.66, 1.0])
    if isinstance(shape.domain[0], tuple):
        (a, b), (c, d) = (tuple(float(end) for end in pair) for pair in shape.domain)
        return shape(a + (b - a) * share, c + (d - c) * share)
    a, b = (float(end) for end in shape.domain)
    return shape(a + (b - a) * share)


@pytest.mark.parametrize("name", SHAPES)
def test_points_move_with_their_shape(name):
    shape = SHAPES[name]()
    p = np.asarray(places(shape))
    turn = Rotation.from_rotvec(0.7 * AXIS / np.linalg.norm(AXIS))
    n = AXIS / np.linalg.norm(AXIS)
    expected = [
        (translate(shape, [1, 2, 3]), p + [1, 2, 3]),
        (rotate(shape, AXIS, 0.7, CENTER), turn.apply(p - CENTER) + CENTER),
        (scale(shape, 2.5, CENTER), 2.5 * (p - CENTER) + CENTER),
        (scale(shape, [1, 2, -3]), p * [1, 2, -3]),
        (mirror(shape, CENTER, AXIS), p - 2 * ((p - CENTER) @ n)[:, None] * n),
    ]
    for moved, where in expected:
        np.testing.assert_allclose(places(moved), where, **CLOSE)


def test_wrappers_are_not_nested():
    moved = rotate(translate(Sphere([1, 2, 3], 2), [1, 0, 0]), AXIS, 1.0)
    assert isinstance(moved, MappedSurface) and isinstance(moved.surface, Sphere)
    moved = rotate(translate(SHAPES["helix"](), [1, 0, 0]), AXIS, 1.0)
    assert isinstance(moved, MappedCurve) and isinstance(moved.curve, Helix)
    assert len(breaks(moved)) == 9


def test_grids_move_too():
    shape = Sphere([1, 2, 3], 2)
    u = v = np.linspace(0, 1, 3)
    np.testing.assert_allclose(
        translate(shape, [1, 2, 3]).grid(u, v), shape.grid(u, v) + np.array([1, 2, 3.0])[None, None], **CLOSE
    )
    assert [len(along) for along in breaks(translate(shape, [1, 2, 3]))] == [9, 9]


def test_a_mirror_turns_the_normal_inside():
    ball = Sphere([0, 0, 0], 2)
    image = mirror(ball, [0, 0, 0], [1, 0, 0])
    normal = np.cross(image.derivative(0.3, 0.4, (1, 0)), image.derivative(0.3, 0.4, (0, 1)))
    assert normal @ np.asarray(image(0.3, 0.4)) < 0


def test_curves_in_a_parameter_plane_move_in_it():
    np.testing.assert_allclose(translate(loop(), [1, 2]).control_points[1], [2, 2], **CLOSE)
    np.testing.assert_allclose(scale(loop(), [3, 1]).control_points[1], [3, 0], **CLOSE)
    with pytest.raises(InputError, match="`rotate` works in space; for a curve in a parameter plane"):
        rotate(loop(), [0, 0, 1], 1.0)


def test_transforms_are_differentiable_and_keep_single_precision():
    def height(angle, axis):
        return rotate(curve("periodic"), axis, angle).point(jnp.asarray(2.5))[2]

    slope = jax.jit(jax.grad(height, argnums=(0, 1)))(0.0, jnp.asarray(AXIS))
    p, n = points(curve("periodic"), [2.5])[0], AXIS / np.linalg.norm(AXIS)
    np.testing.assert_allclose(slope[0], np.cross(n, p)[2], **CLOSE)
    np.testing.assert_allclose(slope[1], 0, atol=1e-12)
    small = Sphere(np.ones(3, np.float32), 1)
    assert rotate(scale(small, 2), [1, 1, 0], 0.5)(0.1, 0.2).dtype == np.float32


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: translate(s, [1, 2]), r"`offset` must have shape \(3,\), got \(2,\)"),
        (lambda s: rotate(s, [0, 0, 0], 1.0), "`axis` must be a direction, got the zero vector"),
        (lambda s: rotate(s, AXIS, [1.0, 2.0]), r"`angle` must be one number, got shape \(2,\)"),
        (lambda s: scale(s, 0), r"`factor` must not be 0, got \[0.0, 0.0, 0.0\]"),
        (lambda s: scale(s, [1, 2]), r"`factor` must have shape \(3,\), got \(2,\)"),
        (lambda s: mirror(s, [0, 0, np.inf], AXIS), "`point` must be finite"),
        (lambda s: transform(s, np.eye(2), np.zeros(2)), "must have dimension 3, that of the shape, got 2"),
        (
            lambda s: transform(s, np.eye(4), np.zeros(3)),
            r"must have shapes \(3, 3\) and \(3,\), got",
        ),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(InputError, match=message):
        call(Sphere([0, 0, 0], 1))


def test_what_is_no_shape_is_refused_by_name():
    for call in (lambda: translate("ball", [0, 0, 0]), lambda: transform("ball", np.eye(3), np.zeros(3))):
        with pytest.raises(TypeError, match="transform is not defined for str"):
            call()
