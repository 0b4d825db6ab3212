"""What sweeps refuse, each in one sentence that says which argument, what was expected, what came and what to do."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from sweep_cases import OFF, across, characters, ends, guides, spline

import jaxsurf as js

GUIDE, SECOND = spline("first"), spline("second")
CHARACTER = across(ends(GUIDE)[0], ends(SECOND)[0], "arc")
LINE = js.Line(OFF, OFF + np.array([4.0, 0, 0]))
BESIDE = js.translate(LINE, (0.0, 2.0, 0.4))
BETWEEN = js.Line(OFF, OFF + np.array([0, 2.0, 0.4]))
CORNER = js.BSplineCurve(OFF + np.array([[0, 0, 0], [1.0, 0, 0], [1, 1, 0.2]]), [0.0, 0, 0.4, 1, 1], 1)
WAVE = js.BSplineCurve(OFF + np.array([[0, 0, 0], [1.0, 1, 0], [2, -1, 0], [3.0, 0.0, 0]]), js.clamped_knots(4, 3), 3)
MEETING = js.Line(OFF + np.array([0, 2.0, 0.4]), OFF + np.array([4.0, 0, 0]))
FLAT = js.BSplineCurve([[0.0, 0], [1, 0]], [0.0, 0, 1, 1], 1)


def along(rotation: Any = "guide", guide: Any = GUIDE, character: Any = CHARACTER, **options: Any):
    return lambda: js.sweep(character, guide, rotation=rotation, **options)


def both(rotation: Any = "guide", pair: Any = (GUIDE, SECOND), character: Any = CHARACTER, **options: Any):
    return lambda: js.sweep(character, pair, rotation=rotation, **options)


def placed(places, given):
    return along(js.OrientationRotation(places, given))


TURNS = np.array([[1.0, 0, 0, 0], [0.9, 0.1, 0, 0]])
REFUSED = {
    "a rotation of no known name": (
        along("spin"),
        "`rotation` must be one of 'fixed', 'chord', .*'up' or an object, got 'spin'",
    ),
    "a rotation that is none": (along(3), "`rotation` must be a name, an object or a function of v, got int"),
    "chord with one guide": (
        along("chord"),
        "`rotation` 'chord' needs two guides, got one; take \"guide\", or give a second",
    ),
    "chord+guide with one guide": (
        along("chord+guide"),
        r"`rotation` 'chord\+guide' needs two guides, got one; take \"guide\"",
    ),
    "scale along the chord of one guide": (
        along(scale="chord"),
        '`scale="chord"` needs two guides, got one; give a second guide',
    ),
    "a scale that is none": (both(scale="height"), "`scale` must be True, False or \"chord\", got 'height'"),
    "a pairing that is none": (both(pairing="length"), '`pairing` must be "parameter" or "arc length", got \'length\''),
    "no guide": (both(pair=()), "`guides` must be one or two curves, got 0"),
    "three guides": (
        both(pair=(GUIDE, SECOND, GUIDE)),
        "`guides` must be one or two curves, got 3; `js.network` takes more",
    ),
    "three characters": (both(character=[CHARACTER] * 3), "`characters` must be one or two curves, got 3"),
    "a plane guide": (along(guide=FLAT), r"`guides\[0\]` must be a curve in space, got one in a parameter plane"),
    "a plane character": (
        along(character=FLAT),
        r"`characters\[0\]` must be a curve in space, got one in a parameter plane",
    ),
    "a corner that guide follows": (
        along(guide=CORNER),
        r"The section would jump by \d+(\.\d+)?° at v = 0.4, where a guide has a corner: split the guides there",
    ),
    "a corner that minimal follows": (along("minimal", CORNER), r"The section would jump by .*° at v = 0.4"),
    "up along the guide": (
        along(js.UpRotation((1.0, 0, 0)), LINE),
        '`rotation` is not defined at v = .*, where the guide runs along `up`; take rotation="minimal"',
    ),
    "an up that is none": (lambda: js.UpRotation((0.0, 0, 0)), "`up` must be a direction, got the zero vector"),
    "frenet along a line": (
        along("frenet", LINE),
        '`rotation` is not defined at v = .*, where the guide has an inflection or a straight part; take rotation="minimal"',
    ),
    "frenet past an inflection": (
        along("frenet", WAVE),
        "`rotation` is not defined at v = 0.5, where the guide has an inflection",
    ),
    "guides along their chord": (
        both(
            "chord+guide",
            (LINE, js.Line(OFF + np.array([5.0, 0, 0]), OFF + np.array([8.0, 0, 0]))),
            across(OFF, OFF + np.array([5.0, 0, 0]), "arc"),
        ),
        '`rotation` is not defined at v = .*, where the guides run along their chord; take rotation="chord"',
    ),
    "orientations off the domain": (
        placed([2.0, 4.9], TURNS),
        r"`parameters` of orientations must run over the guide's domain \[2.0, 5.0\], got \[2.0, 4.9\]",
    ),
    "orientations out of order": (
        lambda: js.OrientationRotation([2.0, 1.0], TURNS),
        r"`parameters` must ascend, got \[2.0, 1.0\]",
    ),
    "too few parameters": (
        lambda: js.OrientationRotation([2.0], TURNS),
        r"`parameters` must be one for each of 2 orientations, got \(1,\)",
    ),
    "orientations of no shape": (
        lambda: js.OrientationRotation([2.0, 3.0], np.ones((2, 3))),
        r"`orientations` must have shape \(k, 4\) or \(k, 3, 3\) with k ≥ 2, got \(2, 3\)",
    ),
    "one orientation": (lambda: js.OrientationRotation([2.0], TURNS[:1]), r"with k ≥ 2, got \(1, 4\)"),
    "steps that are none": (lambda: js.RotationMinimising(steps=0), "`steps` must be a whole number ≥ 1, or None, got 0"),
    "a tolerance that is none": (lambda: js.RotationMinimising(tolerance=0.0), "`tolerance` must be a number > 0, got 0.0"),
    "a function that gives no matrix": (
        along(lambda v: jnp.stack([v, v])),
        r"`rotation` must give a matrix \(3, 3\) or a unit quaternion \(4,\), got shape \(2,\)",
    ),
    "a function that shears": (
        along(lambda v: jnp.eye(3) + v * jnp.diag(jnp.ones(2), 1)),
        r"`rotation` must give rotations, orthonormal with determinant \+1, but at v = 2.* it is off by",
    ),
    "a function that mirrors": (
        along(lambda v: -jnp.eye(3) + 0 * v),
        r"`rotation` must give rotations, orthonormal with determinant \+1, but at v = 2.* it is off by 2",
    ),
    "guides that meet where the character is": (
        both(
            "chord",
            (js.reverse(LINE), js.reverse(MEETING)),
            js.Line(OFF + np.array([4.0, 0, 0]), OFF + np.array([4.0, 0, 0])),
        ),
        "The guides meet where the character is, so it cannot grow from there; reverse the guides",
    ),
    "a loop where the guides meet": (
        both("chord", (LINE, MEETING), [BETWEEN, js.Circle(OFF + np.array([4.0, 0, -1]), (1, 0, 0.0), 1.0, (0.0, 0, 1))]),
        r"`characters\[1\]` must be a point where the guides meet, .*; leave it out, or move the guides apart",
    ),
    "a closed character moved onto two guides": (
        both("chord", (LINE, BESIDE), js.Circle(OFF, (0, 0, 1.0), 1.0), move=True),
        r"`characters\[0\]` starts where it ends, so it cannot be moved onto two guides; give an open curve",
    ),
    "a character turned round": (
        both("chord", (LINE, BESIDE), js.reverse(BETWEEN)),
        r"`characters\[0\]` .* from where `guides\[.\]` starts; at most .* is allowed: turn it round with `js.reverse`",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_in_one_sentence(what):
    call, message = REFUSED[what]
    with pytest.raises(js.InputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value) and str(caught.value).endswith(".")


@pytest.mark.parametrize("rotation", ["fixed", "up", "guide"])
def test_a_surface_that_leaves_its_second_guide_is_refused_with_the_distance_and_the_place(rotation):
    call = both("guide", scale=False) if rotation == "guide" else both(rotation)
    with pytest.raises(
        js.InputError, match=r"The sweep leaves `guides\[1\]` by \d.* at v = \d.*rotation='.*scale=(True|False)"
    ) as caught:
        call()
    assert 'take "chord" or "chord+guide" with scale=True, or leave that guide out' in str(caught.value)


def test_a_guide_that_passes_by_the_opposite_direction_is_told_with_the_place_and_the_angle():
    """A circle that is lifted a little on half its way: 0.01 radians, 0.57°, from the opposite at v = 1/2."""
    t = np.linspace(0, 2 * math.pi, 41)
    lift = 0.01 * (1 - np.cos(t)) / 2
    points = np.stack([np.sin(t), 1 - np.cos(t), np.cumsum(lift) * (t[1] - t[0])], axis=1)
    guide = js.interpolate(OFF + points)
    character = js.Line(guide(0.0), np.asarray(guide(0.0)) + np.array([0.1, 0.2, 0.5]))
    with pytest.warns(
        js.GeometryWarning, match=r"The section is whipped round near v = 0.(49|50)\d*: .* within 0.5\d° of the opp"
    ) as told:
        js.sweep(character, guide)
    assert len(told) == 1 and 'rotation="minimal" does not turn it so' in str(told[0].message)
    js.sweep(character, guide, rotation="minimal")


def test_what_is_needed_for_the_refusals_is_fine_by_itself():
    js.sweep(CHARACTER, (GUIDE, SECOND))
    js.sweep(BETWEEN, (LINE, MEETING), rotation="chord")
    js.sweep(CHARACTER, CORNER, rotation="fixed")
    js.sweep(characters(guides("helices")[:1], 1), guides("helices")[0], rotation="frenet")
