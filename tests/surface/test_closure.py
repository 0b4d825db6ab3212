"""The gap between the two ways of integration."""

import jax
import numpy as np
import pytest

import jaxsurf as js

RNG = np.random.default_rng(8)
DIRECTIONS = np.array([1.0, 0.4, -0.3]) + 0.4 * RNG.normal(size=(2, 4, 4, 3))


def surface(which=0, **options):
    spine = js.QICurve([1.0, 2.0, 3.0], 1.5, DIRECTIONS[which, 0], 3)
    return js.QISurface(spine, DIRECTIONS[which], [1.0, 1.4, 1.2, 1.9], **options)


def gauss(end, pieces=6):
    """Nodes and weights on [0, end]."""
    x, w = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(0, end, pieces + 1)
    half = np.diff(edges) / 2
    return (edges[:-1, None] + half[:, None] * (1 + x)).ravel(), (half[:, None] * w).ravel()


@pytest.mark.parametrize("across", [None, 1])
def test_the_integral_of_the_density_is_the_gap(across):
    field = None if across is None else surface(across)
    (u, by_u), (v, by_v) = gauss(0.7), gauss(0.45)
    density = js.closure_density(surface(), u[:, None], v[None, :], across=field)
    integral = np.einsum("ijx,i,j->x", density, by_u, by_v)
    gap = np.asarray(js.closure_gap(surface(), 0.7, 0.45, across=field))
    assert np.linalg.norm(gap) > 0.01
    np.testing.assert_allclose(integral, gap, rtol=0, atol=1e-11)


def test_it_is_the_difference_of_the_two_paths():
    u, v = RNG.uniform(size=(2, 20))
    gap = js.closure_gap(surface(), u, v)
    np.testing.assert_allclose(gap, surface()(u, v) - surface(path="u first")(u, v), rtol=0, atol=1e-12)
    np.testing.assert_allclose(js.closure_gap(surface(path="u first"), u, v), gap, rtol=0, atol=1e-12)


def test_no_gap_for_translation_surfaces():
    columns = np.repeat(DIRECTIONS[0, :, :1], 4, axis=1)
    spine = js.QICurve([1.0, 2.0, 3.0], 1.5, DIRECTIONS[1, 0], 3)
    whole = js.QISurface(spine, columns, np.full(4, 1.3))
    u, v = RNG.uniform(size=(2, 20))
    assert np.abs(np.asarray(js.closure_gap(whole, u, v))).max() < 1e-12
    assert np.abs(np.asarray(js.closure_density(whole, u, v))).max() < 1e-12


def test_no_gap_for_surfaces_of_revolution_with_matched_lengths():
    """A cone of meridians along u, by 90°, about z: circles of radius r(u) along v are a second field."""
    angle, slant, inner = np.pi / 2, 2.0, 1.0
    half = np.radians(30.0)  # between a meridian and the plane
    turns = angle * np.linspace(0, 1, 4)
    out = np.stack([np.cos(turns), np.sin(turns), 0 * turns], -1)
    around = np.stack([-np.sin(turns), np.cos(turns), 0 * turns], -1)
    meridians = np.cos(half) * out + np.sin(half) * np.array([0, 0, 1.0])
    # exact rotations about z need tangents on a great circle: the meridians of a disc, half = 0
    flat = np.repeat(out[None], 2, axis=0)
    circle = js.QICurve([inner, 0, 0], inner * angle, around, 1)
    disc = js.QISurface(circle, flat, np.full(4, slant), 1, 1)
    rim = [inner, inner + slant]
    across = js.QISurface(
        js.QICurve([inner, 0, 0], slant, flat[:, 0], 1), np.repeat(around[:, None], 2, axis=1), angle * np.array(rim), 1, 1
    )
    u, v = RNG.uniform(size=(2, 20))
    assert np.abs(np.asarray(js.closure_gap(disc, u, v, across=across))).max() < 1e-12
    assert np.abs(np.asarray(js.closure_density(disc, u, v, across=across))).max() < 1e-12
    assert np.abs(np.asarray(js.closure_gap(disc, u, v))).max() > 0.1
    tilted = js.QISurface(circle, np.repeat(meridians[None], 2, axis=0), np.full(4, slant), 1, 1)
    assert np.abs(np.asarray(js.closure_gap(tilted, u, v, across=across))).max() > 1e-3  # a cone's are not


def test_the_density_by_angular_velocities():
    """G = l' T + l W × T, W by differences of T; and gradients pass through."""
    s = surface()
    u, v, h = 0.3, 0.6, 1e-5
    along = lambda v: np.asarray(s.derivative(u, v))
    np.testing.assert_allclose(js.closure_density(s, u, v), (along(v + h) - along(v - h)) / (2 * h), rtol=0, atol=1e-7)
    slope = jax.grad(lambda s: (js.closure_gap(s, u, v) ** 2).sum())(s)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slope))


def test_fields_must_be_qi_surfaces():
    with pytest.raises(js.InputError, match="`across` must be a `QISurface`"):
        js.closure_gap(surface(), 0.5, 0.5, across=js.Plane((0, 0, 0), (0, 0, 1)))
