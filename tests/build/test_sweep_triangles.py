"""Triangles, surfaces of revolution, pipes: sweeps whose sections shrink to a point or turn about an axis."""

import math

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sweep_cases import OFF, clamped, close, unit

import jaxsurf as js

APEX = OFF + np.array([3.0, 1.2, 0.5])


def guide(start, bend):
    """A cubic from a place to the apex."""
    points = np.array([start, start + np.array([1.0, 0.1, bend]), APEX - np.array([1.0, 0.3 * bend, 0.1]), APEX])
    return js.BSplineCurve(points, clamped(4, 3, 2.0, 5.0), 3)


GUIDES = guide(OFF, 0.4), guide(OFF + np.array([0.0, 2.0, 0.3]), -0.3)
CHARACTER = js.Arc.through(OFF, OFF + np.array([0.2, 1.0, 0.9]), OFF + np.array([0.0, 2.0, 0.3]))
POINT = js.Line(APEX, APEX)


def one_sided(f, v, h):
    """f'(v) from values before v, to the fourth order."""
    values = [np.asarray(f(v - k * h)) for k in range(5)]
    return sum(c * x for c, x in zip((25, -48, 36, -16, 3), values, strict=True)) / (12 * h)


@pytest.mark.parametrize(
    ("characters", "scale"),
    [(CHARACTER, True), (CHARACTER, "chord"), ([CHARACTER, POINT], True)],
    ids=["one", "chord", "and a point"],
)
def test_guides_that_meet_make_a_triangle(characters, scale):
    surface = js.sweep(characters, GUIDES, scale=scale)
    u = np.linspace(0, 1, 5)
    if scale is True:  # keeping the height, the section does not shrink to a point
        close(surface(u, 5.0), np.broadcast_to(APEX, (5, 3)), 2e-15 * 8)
    for i, row in ((0, 0.0), (1, 1.0)):
        v = np.linspace(2, 5, 9)
        close(surface(np.full(9, row), v), GUIDES[i](v), 1e-13)
    slopes = np.asarray(surface.derivative(u, np.full(5, 5.0), (0, 1)))
    close(slopes, one_sided(lambda v: surface(u, np.full(5, v)), 5.0, 1e-3), 1e-8)
    cross = np.asarray(surface.derivative(u, np.full(5, 5.0), (1, 1)))
    close(cross, one_sided(lambda v: surface.derivative(u, np.full(5, v), (1, 0)), 5.0, 1e-3), 1e-8)
    close(slopes[[0, -1]], [g.derivative(5.0) for g in GUIDES], 1e-12)
    gradient = jax.grad(lambda s: jax.numpy.sum(jax.numpy.sin(s(u, np.full(5, 5.0)))))(surface)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(gradient))


def test_guides_that_start_in_a_point_grow_from_it():
    turned = [js.reparametrise(js.reverse(g), (2, 5)) for g in GUIDES]
    surface = js.sweep([POINT, CHARACTER], turned)
    forwards = js.sweep(CHARACTER, GUIDES)
    u, v = np.linspace(0, 1, 5), np.linspace(2, 5, 7)
    close(surface.grid(u, v), forwards.grid(u, v[::-1]), 1e-13)
    close(surface.derivative(u, np.full(5, 2.0), (0, 1)), -forwards.derivative(u, np.full(5, 5.0), (0, 1)), 1e-11)


def test_a_character_that_is_a_point_with_one_guide_makes_a_triangle():
    """A leaf: from a section to the point at the end of the guide."""
    surface = js.sweep([CHARACTER, POINT], GUIDES[0])
    u = np.linspace(0, 1, 5)
    close(surface(u, 5.0), np.broadcast_to(APEX, (5, 3)), 1e-15)
    close(surface(u, 2.0), CHARACTER(u), 2e-15)
    slopes = surface.derivative(u, np.full(5, 5.0), (0, 1))
    close(slopes, one_sided(lambda v: surface(u, np.full(5, v)), 5.0, 1e-3), 1e-8)
    gradient = jax.grad(lambda s: jax.numpy.sum(jax.numpy.sin(s(u, np.full(5, 5.0)))))(surface)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(gradient))


@pytest.mark.parametrize("rotation", ["guide", "minimal", "frenet", "up"])
def test_a_sweep_along_a_circle_is_a_surface_of_revolution(rotation):
    """Of a profile that need not touch the circle."""
    center, axis = OFF + np.array([1.0, 0, 0]), np.array([0.0, 0, 1.0])
    circle = js.Circle(center, axis, 1.5, (1.0, 0.3, 0))
    start = unit(np.array([1.0, 0.3, 0]))
    profile = js.Arc.through(center + 2 * start, center + 1.4 * start + [0, 0, 0.7], center + 0.8 * start + [0, 0, 1.1])
    surface = js.sweep(profile, circle, rotation=rotation)
    u, v = np.linspace(0, 1, 5), np.linspace(0, 2 * math.pi, 13)
    section = np.asarray(profile(u)) - center
    wanted = np.stack([center + section @ Rotation.from_rotvec(t * axis).as_matrix().T for t in v], axis=1)
    close(surface.grid(u, v), wanted, 1e-13)


def test_a_pipe_has_its_radius_everywhere():
    """A circle across a guide in space, without twist: every point is 0.3 from the guide, across it."""
    spine = js.Helix(OFF, (0.1, 1.0, 0.2), 1.7, 1.9, 1.1, (0.0, 0.2, -1.0))
    start, along = np.asarray(spine(0.0)), np.asarray(spine.derivative(0.0))
    surface = js.sweep(js.Circle(start, along, 0.3), spine, rotation="minimal")
    u, v = np.linspace(0, 2 * math.pi, 7), np.linspace(0, 2.2 * math.pi, 9)
    arms = np.asarray(surface.grid(u, v)) - np.asarray(spine(v))
    close(np.linalg.norm(arms, axis=-1), 0.3, 1e-14)
    close(np.sum(arms * np.asarray(spine.derivative(v)), axis=-1), 0, 1e-14)
