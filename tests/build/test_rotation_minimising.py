"""Frames without twist: their closed forms, their order, and closed guides."""

import math
from typing import Any

import equinox as eqx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sweep_cases import OFF, STRAIGHT, clamped, close, guides, turns, unit, worst

import jaxsurf as js

ANY = js.Line(OFF, OFF + np.array([0.2, 1.7, 0.4]))


def knot() -> Any:
    """A closed curve in space."""
    t = np.linspace(0, 2 * math.pi, 12, endpoint=False)
    points = np.stack(
        [(2 + 0.6 * np.cos(3 * t)) * np.cos(t), (2 + 0.4 * np.cos(3 * t)) * np.sin(t), 0.7 * np.sin(2 * t + 0.3)], axis=1
    )
    return js.interpolate(points + OFF, closed=True)


@pytest.fixture(scope="module")
def closed_sweep():
    guide = knot()
    start = np.asarray(guide(guide.domain[0]))
    return js.sweep(js.Line(start, start + np.array([0.1, 0.2, 0.3])), guide, rotation="minimal")


def test_along_a_closed_guide_frames_without_twist_close(closed_sweep):
    """In place and turn, and their first derivative: the angle by which they miss each other is given back evenly."""
    surface = closed_sweep
    c, d = map(float, surface.domain[1])
    both = np.array([c, d])
    for pair, bound in (
        (turns(surface, both), 1e-12),
        (surface(1.0, both), 1e-12),
        (surface.derivative(1.0, both, (0, 1)), 1e-7),
    ):
        close(pair[0], pair[1], bound)
    open_kind = eqx.tree_at(lambda s: s.rotation, surface, js.RotationMinimising(None, 1e-9, 512, False))
    first, last = turns(open_kind, np.array([c, d]))
    missed = Rotation.from_matrix(last @ first.T).magnitude()
    assert missed > 0.1
    # how fast the two part is one number: they turn against each other about the tangent, evenly
    v = np.linspace(c, d, 9)
    between = Rotation.from_matrix(turns(surface, v) @ np.swapaxes(turns(open_kind, v), 1, 2)).magnitude()
    close(between, missed * np.linspace(0, 1, 9), 1e-8)


def test_frames_without_twist_along_a_helix_are_the_closed_form_and_err_with_the_fourth_order():
    """U = cos θ N − sin θ B turns against the Frenet frame by θ = τ s."""
    helix = js.Helix(OFF, (0.1, 1.0, 0.2), 1.7, 1.9, 1.1, (0.0, 0.2, -1.0))
    radius, rise = 1.7, 1.9 / (2 * math.pi)
    axis = unit(np.array([0.1, 1.0, 0.2]))
    x = unit(np.asarray(helix.start) - (np.asarray(helix.start) @ axis) * axis)
    y = np.cross(axis, x)
    v = np.linspace(0, 2.2 * math.pi, 14)
    c, s = np.cos(v)[:, None], np.sin(v)[:, None]
    t, n = unit(radius * (c * y - s * x) + rise * axis), -(c * x + s * y)
    b = np.cross(t, n)
    theta = v[:, None] * rise / math.hypot(radius, rise)
    frames = np.stack([t, np.cos(theta) * n - np.sin(theta) * b, np.sin(theta) * n + np.cos(theta) * b], axis=2)
    wanted = frames @ frames[0].T
    close(turns(js.sweep(ANY, helix, rotation="minimal"), v), wanted, 1e-9)
    errors = []
    for steps in (1, 2, 4, 8):
        errors.append(worst(turns(js.sweep(ANY, helix, rotation=js.RotationMinimising(steps=steps)), v), wanted))
    assert np.all(np.array(errors[:-1]) / errors[1:] > 14), errors


@pytest.mark.parametrize("steps", [1, 5])
def test_frames_without_twist_have_no_error_along_planar_guides(steps):
    angle = np.linspace(0, 2.9, 6)
    flat = np.stack([np.cos(angle), 1.4 * np.sin(angle), 0 * angle], axis=1)
    turn = Rotation.from_rotvec([0.4, -0.7, 0.3]).as_matrix()
    guide = js.BSplineCurve(OFF + flat @ turn.T, clamped(6, 3), 3)
    v = np.linspace(0, 1, 11)
    now = np.asarray(guide.derivative(v)) @ turn
    bend = np.arctan2(now[:, 1], now[:, 0]) - np.arctan2(now[0, 1], now[0, 0])
    wanted = [turn @ Rotation.from_rotvec([0, 0, b]).as_matrix() @ turn.T for b in bend]
    close(turns(js.sweep(ANY, guide, rotation=js.RotationMinimising(steps=steps)), v), wanted, 1e-14)


def test_frames_without_twist_along_a_line_and_an_arc_are_those_in_their_plane():
    guide = guides(STRAIGHT[1])[0]
    surface = js.sweep(ANY, guide, rotation="minimal")
    v = np.linspace(0, 2, 9)
    bend = np.maximum(v - 1, 0) * math.pi / 2
    close(turns(surface, v), Rotation.from_rotvec(np.array([0, -1.0, 0]) * bend[:, None]).as_matrix(), 1e-14)
