"""Sweeps against a second implementation in numpy and scipy, and frames without twist against their equation."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from sweep_cases import KNOTS, OFF, Path, Reference, characters, close, guides, spline_path, sweep, transported, turns

import jaxsurf as js

U, V = np.linspace(0, 1, 5), np.linspace(0, 1, 12)


def independent(curve):
    """A B-spline or NURBS character as a function of the share of its domain, by scipy."""
    points, knots, degree = np.asarray(curve.control_points), np.asarray(curve.knots), curve.degree
    a, b = knots[degree], knots[-degree - 1]
    weights = np.asarray(getattr(curve, "weights", np.ones(len(points))))
    whole = BSpline(knots, np.column_stack([points * weights[:, None], weights]), degree)

    def at(share):
        values = whole(a + (b - a) * share)
        return values[:, :3] / values[:, 3:]

    return at


def helix_path(helix, which):
    """From its definition."""
    center, axis = np.asarray(helix.center), np.asarray(helix.axis) / np.linalg.norm(helix.axis)
    x = np.asarray(helix.start) - (np.asarray(helix.start) @ axis) * axis
    x /= np.linalg.norm(x)
    y, r, rise = np.cross(axis, x), float(helix.radius), float(helix.pitch) / (2 * np.pi)

    def at(v):
        c, s = np.cos(v), np.sin(v)
        return [center + r * (c * x + s * y) + rise * v * axis, r * (c * y - s * x) + rise * axis, -r * (c * x + s * y)]

    return Path(at, (0.0, 2 * np.pi * float(helix.turns)))


PATHS = {
    "B-splines": lambda: [spline_path("first"), spline_path("second")],
    "helices": lambda: [helix_path(h, i) for i, h in enumerate(guides("helices"))],
}


def compare(case, paths, **options):
    surface = case.surface
    u, v = (a + (b - a) * x for x, (a, b) in zip((U, V), np.array(surface.domain, float), strict=True))
    wanted = Reference(paths, [independent(c) for c in case.characters], **options).points(U, V)
    close(surface.grid(u, v), wanted, 1e-12)


@pytest.mark.parametrize(
    ("name", "rotation", "count"),
    [
        ("B-splines", "fixed", 1),
        ("B-splines", "guide", 1),
        ("B-splines", "guide", 2),
        ("B-splines", "up", 2),
        ("helices", "guide", 2),
        ("helices", "frenet", 2),
        ("helices", "up", 1),
    ],
)
def test_sweeps_along_one_guide_are_those_of_the_second_implementation(name, rotation, count):
    compare(sweep(name, rotation, count=count), PATHS[name]()[:1], rotation=rotation)


@pytest.mark.parametrize("scale", [True, "chord"])
@pytest.mark.parametrize("rotation", ["chord", "chord+guide"])
@pytest.mark.parametrize(("name", "count"), [("B-splines", 2), ("helices", 1)])
def test_sweeps_along_two_guides_are_those_of_the_second_implementation(name, count, rotation, scale):
    compare(sweep(name, rotation, two=True, count=count, scale=scale), PATHS[name](), rotation=rotation, scale=scale)


def test_guide_with_two_guides_is_chord_and_guide():
    one, other = (sweep("helices", kind, two=True, scale="chord").surface for kind in ("guide", "chord+guide"))
    u, v = np.linspace(-3, 4, 5), np.linspace(0, 5, 7)
    close(one.grid(u, v), other.grid(u, v), 0)


def test_blends_of_the_users_are_those_of_the_second_implementation():
    blend = lambda t: t * t
    compare(sweep("B-splines", "guide", count=2, blend=blend), PATHS["B-splines"]()[:1], rotation="guide", blend=blend)


@pytest.mark.parametrize("two", [False, True])
def test_without_scale_and_turning_every_section_is_the_character_moved(two):
    """With two parallel guides too, along which nothing else serves."""
    pair = (js.Line(OFF, OFF + np.array([4.0, 0.3, 0.2])),)
    if two:
        pair = (*pair, js.translate(pair[0], (0.0, 2.0, 0.4)))
    (character,) = characters(pair, 1)
    u, v = np.linspace(-3, 4, 5), np.linspace(0, 1, 4)
    wanted = np.asarray(character(u))[:, None] + v[:, None] * np.array([4.0, 0.3, 0.2])
    for scale in (True, False):
        close(js.sweep(character, pair, rotation="fixed", scale=scale).grid(u, v), wanted, 1e-14)


@pytest.mark.parametrize("name", ["B-splines", "helices"])
def test_minimal_is_the_solution_of_its_differential_equation(name):
    """U' = −⟨U, T'⟩ T for three sides, DOP853 with 1e-13; to the tolerance of 1e-9 asked of the table by default."""
    path = PATHS[name]()[0]
    a, b = path.domain
    v = np.linspace(a, b, 17)
    edges = KNOTS["first"] if name == "B-splines" else np.linspace(a, b, 5)
    tangents = np.array([path.at(x)[1] for x in v])
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    sides = np.linalg.svd(tangents[:1])[2][1:]
    for tolerance, bound in ((1e-9, 2e-9), (1e-12, 2e-12)):
        surface = sweep(name, js.RotationMinimising(tolerance=tolerance)).surface
        rotations = turns(surface, v)
        close(rotations @ tangents[0], tangents, 1e-13, "the tangent is carried along")
        for side in sides:
            close(rotations @ side, transported(path, side, v, edges), bound, tolerance)
