"""Curvature, torsion and frames of curves."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differential_cases import assert_close, cubic, difference

from jaxsurf._errors import InputError
from jaxsurf.curve import BSplineCurve, Circle, Helix, Line
from jaxsurf.differential import curve_curvature, frenet_frame, torsion

U = np.linspace(2, 5, 7)


@pytest.mark.parametrize("pitch", [3.0, -3.0])
def test_a_helix_has_constant_curvature_and_torsion(pitch):
    helix, rise = Helix([1.0, 2, 3], [0.0, 1, 1], 2.0, pitch, 2.0), pitch / (2 * math.pi)
    square = 4 + rise**2
    assert_close(curve_curvature(helix, U), np.full(7, 2 / square))
    assert_close(torsion(helix, U), np.full(7, rise / square))


def test_the_frame_follows_its_equations():
    curve, u = cubic(), 3.3
    frame = frenet_frame(curve, u)
    matrix = jnp.stack([frame.tangent, frame.normal, frame.binormal])
    assert_close(matrix @ matrix.T, np.eye(3))
    assert_close(jnp.linalg.det(matrix), 1)
    speed = jnp.linalg.norm(curve.derivative(u))
    turn = lambda name: difference(lambda t: getattr(frenet_frame(curve, t), name), u) / speed
    assert_close(turn("tangent"), frame.curvature * frame.normal, 1e-6)
    assert_close(turn("binormal"), -frame.torsion * frame.normal, 1e-6)
    assert_close(frame.curvature, curve_curvature(curve, u))


def test_straight_lines_have_frames_and_finite_gradients():
    for end in ([4.0, 2, 3], [1.0, 5, 3], [2.0, 3, 4.1]):
        line = Line([1.0, 2, 3], end)
        frame = frenet_frame(line, [0, 0.3, 1])
        assert_close(frame.curvature, 0)
        assert_close(frame.torsion, 0)
        assert_close(jnp.linalg.det(jnp.stack([frame.tangent, frame.normal, frame.binormal], axis=1)), 1)
        gradient = jax.jacrev(lambda end: frenet_frame(Line([1.0, 2, 3], end), 0.3))(jnp.asarray(end))
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient))
    spline = BSplineCurve(np.linspace([0, 1, 2], [3, 3, 3.0], 4), [0, 0, 0, 0, 1, 1, 1, 1], 3)
    assert_close(frenet_frame(spline, U / 5).torsion, 0)
    assert_close(jax.jacrev(lambda p: curve_curvature(BSplineCurve(p, spline.knots, 3), 0.3))(spline.control_points), 0)


def test_plane_curves_have_signed_curvature():
    parabola = lambda sign: BSplineCurve([[-1, sign], [0, -sign], [1, sign]], [-1, -1, -1, 1, 1, 1], 2)
    assert_close(curve_curvature(parabola(1.0), 0.0), 2)
    assert_close(curve_curvature(parabola(-1.0), 0.0), -2)
    with pytest.raises(InputError, match="`curve` must be a curve in space for a Frenet frame"):
        frenet_frame(parabola(1.0), 0.0)


def test_a_stationary_point_is_finite():
    cusp = BSplineCurve([[0, 0, 0], [0, 0, 0], [1, 1, 0], [2, 0, 0.0]], [0, 0, 0, 0, 1, 1, 1, 1], 3)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(frenet_frame(cusp, 0.0)))
    assert_close(curve_curvature(cusp, 0.0), 0)


def test_single_precision():
    circle = Circle(np.array([1, 2, 3], np.float32), [0, 1, 1], 2.0)
    found = frenet_frame(circle, U)
    assert found.curvature.dtype == np.float32
    assert_close(found.curvature, np.full(7, 0.5, np.float32), 1e-6)
    assert_close(found.torsion, np.zeros(7, np.float32), 1e-6)
