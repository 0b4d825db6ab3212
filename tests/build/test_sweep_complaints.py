"""What users complain of in other systems' sweeps, each as a test."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sweep_cases import OFF, across, close, ends, sweep, turns, unit

import jaxsurf as js


def bezier(points):
    return js.BSplineCurve(points, js.clamped_knots(4, 3, (2, 5)), 3)


POINTS = OFF + np.array([[0, 0, 0], [1.2, 0.1, 0.9], [2.5, 0.5, 0.6], [4, 0.2, 0.1]])
SECOND = OFF + np.array([[0.1, 2, 0.3], [1.2, 2.1, 0.9], [2.5, 1.7, 0.2], [4.2, 2.2, 0.4]])
PAIR = bezier(POINTS), bezier(SECOND)
CHARACTERS = [across(ends(PAIR[0])[i], ends(PAIR[1])[i], kind) for i, kind in enumerate(("arc", "NURBS"))]
U, V = np.linspace(0, 1, 4), np.linspace(2, 5, 5)


def test_twist_sections_along_a_helix_turn_about_it_with_guide_and_frenet_but_not_with_minimal():
    """The rate of turning about the tangent, from R' Rᵀ: nothing with minimal, the torsion with Frenet."""
    helix = js.Helix(OFF, (0.0, 0, 1), 1.0, 1.5, 0.9, (1.0, 0, 0))
    character = js.Line(helix(0.0), np.asarray(helix(0.0)) + np.array([0.3, 0, 0]))
    v, h = np.linspace(0.5, 5.0, 6), 1e-4
    tangents = unit(np.asarray(helix.derivative(v)))
    rate = {}
    for kind in ("guide", "minimal", "frenet"):
        surface = js.sweep(character, helix, rotation=kind)
        step = turns(surface, v + h) @ np.swapaxes(turns(surface, v - h), 1, 2)
        rate[kind] = np.sum(Rotation.from_matrix(step).as_rotvec() * tangents, axis=1) / (2 * h)
    rise = 1.5 / (2 * math.pi)
    close(rate["minimal"], 0, 1e-6)
    close(rate["frenet"], rise / math.sqrt(1 + rise**2), 1e-6)
    assert np.max(np.abs(rate["guide"])) > 0.05


def test_flips_frenet_is_refused_where_it_would_flip_and_minimal_goes_through():
    wave = bezier(OFF + np.array([[0.0, 0, 0], [1, 1, 0], [2, -1, 0], [3, 0, 0]]))
    character = js.Line(OFF, OFF + np.array([0, 0, 0.5]))
    with pytest.raises(js.InputError, match="not defined at v = 3.5, where the guide has an inflection"):
        js.sweep(character, wave, rotation="frenet")
    found = turns(js.sweep(character, wave, rotation="minimal"), np.linspace(2, 5, 101))
    steps = Rotation.from_matrix(found[1:] @ np.swapaxes(found[:-1], 1, 2)).magnitude()
    assert steps.max() < 0.1


def test_loops_close_a_sweep_along_a_closed_guide_meets_itself():
    t = np.linspace(0, 2 * math.pi, 8, endpoint=False)
    guide = js.interpolate(OFF + np.stack([2 * np.cos(t), 1.5 * np.sin(t), 0.4 * np.sin(2 * t)], axis=1), closed=True)
    a, b = map(float, guide.domain)
    start = np.asarray(guide(a))
    surface = js.sweep(js.Line(start, start + np.array([0.3, 0.1, 0.4])), guide, rotation="minimal")
    u = np.linspace(0, 1, 3)
    close(surface(u, np.full(3, a)), surface(u, np.full(3, b)), 1e-12)


def test_curves_that_nearly_meet_are_accepted_within_the_tolerance_and_refused_beyond_with_the_distance():
    near = lambda d: js.translate(CHARACTERS[0], (0, 0, d))
    surface = js.sweep(near(1e-6), PAIR)
    close(surface(0.0, V), PAIR[0](V), 1e-13)
    with pytest.raises(
        js.InputError, match=r"`characters\[0\]` (starts|ends) 0.01 from where `guides\[.\]` starts; at most 4.*e-06"
    ) as told:
        js.sweep(near(0.01), PAIR)
    assert "(`tolerance` × size) is allowed: move it there, or pass `move=True`" in str(told.value)
    js.sweep(near(0.01), PAIR, tolerance=0.01)
    moved = js.sweep(near(0.01), PAIR, move=True)
    close(moved(U, 2.0), CHARACTERS[0](U), 1e-13)
    close(moved(1.0, V), PAIR[1](V), 1e-13)


def test_a_character_far_off_is_moved_turned_and_scaled_onto_the_guides():
    far = js.scale(js.rotate(js.translate(CHARACTERS[0], (5.0, 3, 2)), (1, 2, 3), 1.0), 3.0)
    surface = js.sweep(far, PAIR, move=True)
    close(surface([0.0, 1.0], 2.0), [PAIR[0](2.0), PAIR[1](2.0)], 1e-13)
    size = np.linalg.norm(ends(far)[1] - ends(far)[0]) / np.linalg.norm(ends(CHARACTERS[0])[1] - ends(CHARACTERS[0])[0])
    height = lambda c, a, b: np.linalg.norm(np.cross(np.asarray(c) - a, unit(b - a)))
    first, last = ends(far)
    close(height(surface(0.5, 2.0), *(np.asarray(g(2.0)) for g in PAIR)), height(far(0.5), first, last) / size, 1e-13)
    one = js.sweep(far, PAIR[0], move=True)
    close(one(0.0, V), PAIR[0](V), 1e-13)


def test_unequal_sections_of_other_degree_knots_and_domain_are_lofted():
    """From a cubic on [-3, 4] to a conic on [1, 2]: both are met, and u runs over the first one's domain."""
    case = sweep("B-splines", "guide", two=True, count=2)
    assert [float(x) for x in case.surface.domain[0]] == [-3, 4]
    u = np.linspace(-3, 4, 7)
    close(case.surface(u, np.full(7, 2.0)), case.characters[0](u), 1e-13)
    close(case.surface(u, np.full(7, 5.0)), case.characters[1](1 + (u + 3) / 7), 1e-13)


def test_guides_paired_badly_are_paired_by_arc_length_where_that_is_asked_for():
    """A line run through at uneven speed beside an even one: chords across it lean by parameter, and do not by length."""
    even = js.Line(OFF, OFF + np.array([4.0, 0, 0]))
    uneven = js.BSplineCurve(OFF + np.array([[0, 2.0, 0], [0.2, 2, 0], [4, 2, 0]]), js.clamped_knots(3, 2), 2)
    character = js.Line(OFF, OFF + np.array([0, 2.0, 0]))
    v, lean = np.linspace(0, 1, 9), {}
    for pairing in ("parameter", "arc length"):
        surface = js.sweep(character, (even, uneven), pairing=pairing)
        lean[pairing] = np.max(np.abs(np.asarray(surface(1.0, v) - surface(0.0, v))[:, 0]))
        close(np.asarray(surface(1.0, v))[:, 1], OFF[1] + 2, 1e-14)
    assert lean["parameter"] > 0.8 and lean["arc length"] < 1e-12
