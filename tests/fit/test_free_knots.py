"""Knots move to where they belong, and fits with them are better than with as many even ones."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.basis import periodic_knots
from jaxsurf.fit._problem import free_leaves

INNER = np.array([0.2, 0.3, 0.75])


def clamped(inner, degree=3):
    return np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])


def bent_curve():
    net = np.stack([np.linspace(0, 10, 7), [0, 2, -1, 1.5, 0, -1, 1], [0, 1, 1, -1, 0, 1, 0]], -1)
    return js.BSplineCurve(net, clamped(INNER), 3)


def bent_surface():
    u, v = np.meshgrid(np.linspace(0, 10, 7), np.linspace(0, 6, 5), indexing="ij")
    height = np.array([0, 2, -1, 1.5, 0, -1, 1])[:, None] + 0.5 * np.cos(np.arange(5))[None, :]
    return js.BSplineSurface(np.stack([u, v, height], -1), clamped(INNER), clamped([0.5]), 3, 3)


def with_knots(curve, inner):
    """The curve of least squares on other knots."""
    u = np.linspace(0, 1, 400)
    start = js.BSplineCurve(np.asarray(curve(np.linspace(0, 1, 7))), clamped(inner), 3)
    return js.fit(start, curve(u), start=u, bending=0.0).shape


def spacing_ratio(knots):
    return (knots[5] - knots[4]) / (knots[6] - knots[5])


def test_it_is_the_same_shape():
    curve, surface = bent_curve(), bent_surface()
    u, v = np.random.default_rng(1).uniform(size=(2, 40))
    np.testing.assert_allclose(js.free_knots(curve)(u), curve(u), rtol=0, atol=1e-13)
    np.testing.assert_allclose(js.free_knots(surface)(u, v), surface(u, v), rtol=0, atol=1e-13)
    np.testing.assert_allclose(js.free_knots(surface).spline().knots_u, surface.knots_u, rtol=0, atol=1e-15)
    assert js.to_bspline(js.free_knots(curve), 1e-9).max_error == 0
    kept = js.free_knots(js.BSplineCurve(np.zeros((8, 3)), clamped([0.2, 0.5, 0.5, 0.7]), 3)).spline()
    np.testing.assert_allclose(kept.knots, clamped([0.2, 0.5, 0.5, 0.7]), rtol=0, atol=1e-15)


def test_all_but_the_ends_may_move():
    shape = js.free_knots(bent_surface())
    free = jax.tree.map(lambda x, moves: x.size * moves, jax.tree.leaves(shape), list(free_leaves(shape, None)))
    assert sum(free) == 7 * 5 * 3 + 3 + 1


def test_derivatives_by_the_knots():
    shape = js.free_knots(bent_curve())
    at = lambda r: js.free_knots(bent_curve()).__class__(shape.control_points, shape.along.__class__(r, *others))(0.42)
    others = (shape.along.end_knots, 3, shape.along.multiplicities)
    ratios, h = shape.along.ratios, 1e-6
    for i in range(3):
        way = h * jnp.eye(3)[i]
        np.testing.assert_allclose(jax.jacfwd(at)(ratios)[:, i], (at(ratios + way) - at(ratios - way)) / (2 * h), atol=1e-8)


def test_the_knots_of_a_curve_are_found():
    truth = bent_curve()
    rng = np.random.default_rng(2)
    points = np.asarray(truth(np.append(rng.uniform(size=598), [0, 1])))
    start = with_knots(truth, [0.25, 0.4, 0.65])
    even = js.fit(start, points, bending=0.0, rtol=1e-8)
    found = js.fit(js.free_knots(start), points, rtol=1e-10, sliding=0.01, max_steps=200)
    assert even.rms > 5e-3 and found.rms < 1e-6
    spline = found.shape.spline()  # which may go on beyond the last points, with the knots at the same places
    np.testing.assert_allclose(spline(spline.knots[4:7]), truth(INNER), rtol=0, atol=1e-3)
    np.testing.assert_allclose(spacing_ratio(spline.knots), spacing_ratio(truth.knots), rtol=1e-3)


def test_the_knots_of_a_surface_are_found_in_noise():
    truth, noise = bent_surface(), 1e-3
    rng = np.random.default_rng(3)
    u, v = rng.uniform(size=(2, 2000))
    points = np.asarray(truth(u, v)) + noise * rng.normal(size=(2000, 3))
    start = js.BSplineSurface(truth.control_points, clamped([0.25, 0.4, 0.7]), clamped([0.4]), 3, 3)
    even = js.fit(start, points)
    found = js.fit(js.free_knots(even.shape), points, max_steps=200)
    assert even.rms > 3 * noise and found.rms < 1.05 * noise
    np.testing.assert_allclose(spacing_ratio(found.shape.spline().knots_u), spacing_ratio(truth.knots_u), rtol=0.02)


REFUSED = {
    "periodic": (js.BSplineCurve(np.eye(5)[:, :3], periodic_knots(5, 3), 3, periodic=True), "clamped curve, got a periodic"),
    "no inner knot": (js.BSplineCurve(np.zeros((4, 3)), clamped([]), 3), "at least one inner knot, got none"),
    "not clamped": (js.BSplineCurve(np.zeros((5, 3)), np.arange(9.0), 3), "must repeat its ends 4 times, got 1 and 1"),
    "close": (js.BSplineCurve(np.zeros((6, 3)), clamped([0.5, 0.502]), 3), "has 0.5 and 0.502; take one of them out"),
    "a sphere": (js.Sphere([0.0, 0, 0], 1.0), "a `BSplineCurve` or a `BSplineSurface`, got Sphere"),
}


@pytest.mark.parametrize("shape, message", REFUSED.values(), ids=REFUSED)
def test_what_has_no_free_knots_is_refused(shape, message):
    with pytest.raises(js.InputError, match=message):
        js.free_knots(shape)
