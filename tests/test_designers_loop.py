"""Figure 1 of paper 004 as a script: a plane, tangents turned and lengths changed until the designer is content."""

import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.view import shade

WANTED_HEIGHT, WANTED_SLOPE = 0.45, np.radians(20)
READY = 2 * (np.radians(70),)  # angles that all surfaces are made ready for, so that they share compiled programs


def display(surface):
    return shade([surface], size=(240, 180), camera=(1.0, -1.6, 1.1)).astype(float)


def height(surface):
    return float(np.ptp(np.asarray(surface.grid(np.linspace(0, 1, 21), np.linspace(0, 1, 21)))[..., 2]))


def slope_of_the_rim(surface):
    """Largest angle between the far side u = 1 and the horizontal."""
    v = np.linspace(0, 1, 21)
    along = np.asarray(surface.derivative(np.ones_like(v), v))
    return float(np.max(np.abs(np.arctan2(along[:, 2], np.hypot(along[:, 0], along[:, 1])))))


def changed(surface, **changes):
    return surface.replace(angles=READY, **changes)


def turned(surface, row, angle, column=slice(None)):
    """Control tangents of a row turned about y."""
    tangents = np.array(surface.tangents)
    x, y, z = np.moveaxis(tangents[row, column], -1, 0)
    tangents[row, column] = np.stack(
        [x * np.cos(angle) - z * np.sin(angle), y, x * np.sin(angle) + z * np.cos(angle)], axis=-1
    )
    return changed(surface, tangents=tangents)


@pytest.fixture(scope="module")
def session():
    """Surfaces and pictures, in the order of the designer's work."""
    steps = [("plane", changed(js.QISurface.plane((0, 0, 0), (2, 0, 0), (0, 1.5, 0), (3, 3))))]
    change = lambda name, surface: steps.append((name, surface))
    # the middle of the surface is to rise: the first row up, the last down, a little more until it is high enough
    while height(steps[-1][1]) < WANTED_HEIGHT:
        before = steps[-1][1]
        change("rows turned", turned(turned(before, 0, np.radians(8)), 2, np.radians(-8)))
        assert len(steps) < 20
    change("lengths", changed(steps[-1][1], lengths=[2.0, 2.6, 2.2]))
    spine = steps[-1][1].spine
    bent = np.array(spine.tangents) + np.array([[0, 0, 0.3], [0, 0, 0], [0, 0, -0.3]])
    change("initial curve", changed(steps[-1][1], spine=spine.replace(tangents=bent, length=1.8)))
    finer = js.insert_tangent(steps[-1][1], 0.75, "u")
    change("one more row", finer.shape)
    # with the new row the rim is flattened without touching what was made
    while slope_of_the_rim(steps[-1][1]) > WANTED_SLOPE:
        change("rim", turned(steps[-1][1], 3, np.radians(4)))
        assert len(steps) < 30
    return steps, float(finer.max_error)


def step(session, name):
    """The surface before the first step of a name, and after the last."""
    names = [n for n, _ in session[0]]
    first = names.index(name)
    last = len(names) - 1 - names[::-1].index(name)
    return session[0][first - 1][1], session[0][last][1]


def test_every_change_is_seen(session):
    pictures = [display(surface) for _, surface in session[0]]
    for i, (one, other) in enumerate(zip(pictures, pictures[1:], strict=False)):
        seen = np.mean(np.abs(one - other))
        name = session[0][i + 1][0]
        assert (seen > 0.2) == (name != "one more row"), (name, seen)


def test_turned_tangents_are_the_directions_of_the_surface(session):
    _, raised = step(session, "rows turned")
    v = np.linspace(0, 1, 7)
    for u, row in ((0.0, 0), (1.0, 2)):
        along = np.asarray(raised.derivative(np.full_like(v, u), v))
        np.testing.assert_allclose(along / 2.0, np.broadcast_to(raised.tangents[row, 0], along.shape), atol=1e-12)
    assert height(raised) >= WANTED_HEIGHT


def test_lengths_stretch_lines_and_keep_their_directions(session):
    before, after = step(session, "lengths")
    v = np.array([0.0, 1.0])
    for u in (0.2, 0.9):
        old, new = (np.asarray(s.derivative(np.full(2, u), v)) for s in (before, after))
        np.testing.assert_allclose(new, old * np.array([[1.0], [1.1]]), atol=1e-12)
    np.testing.assert_array_equal(after.spine(v), before.spine(v))


def test_the_initial_curve_carries_the_surface(session):
    before, after = step(session, "initial curve")
    u, v = np.linspace(0, 1, 5), np.full(5, 0.6)
    moved = np.asarray(after(u, v)) - np.asarray(before(u, v))
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-12)
    assert np.linalg.norm(moved[0]) > 0.05 and float(after.spine.length) == 1.8


def test_a_row_more_keeps_the_shape_as_far_as_it_says(session):
    before, after = step(session, "one more row")
    u, v = np.random.default_rng(0).uniform(size=(2, 50))
    off = np.max(np.linalg.norm(np.asarray(after(u, v)) - np.asarray(before(u, v)), axis=1))
    assert off <= 1.1 * session[1] < 0.01 and after.tangents.shape == (4, 3, 3)


def test_the_new_row_moves_the_end_alone(session):
    before, after = step(session, "rim")
    knot = float(before.knots_u[3])
    u, v = np.random.default_rng(1).uniform(size=(2, 50))
    np.testing.assert_allclose(after(knot * u, v), before(knot * u, v), atol=1e-12)
    assert slope_of_the_rim(after) <= WANTED_SLOPE < slope_of_the_rim(before)


def test_what_the_designer_accepts_goes_on(session, tmp_path):
    accepted = session[0][-1][1]
    js.save(tmp_path / "accepted.jxs", accepted)
    loaded = js.load(tmp_path / "accepted.jxs")
    np.testing.assert_array_equal(loaded(0.3, 0.7), accepted(0.3, 0.7))
    export = js.to_bspline(accepted, 1e-6)
    js.save(tmp_path / "accepted.step", export.shape)
    assert float(export.max_error) <= 1e-6 and (tmp_path / "accepted.step").stat().st_size > 1000
