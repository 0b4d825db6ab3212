"""Derivatives through whole fits agree with differences of fits."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import dented, points_on, sheet

import jaxsurf as js

TRUTH = sheet()
POINTS = points_on(TRUTH, 300, seed=1) + 0.02 * np.random.default_rng(2).normal(size=(300, 3))
STEP = 1e-3
WAY = np.random.default_rng(3).normal(size=POINTS.shape)


def slope(height, x, way, step=STEP):
    """Difference quotient of fourth order."""
    at = lambda s: float(height(x + s * step * way))
    return (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step)


def sphere_of(points, **options):
    """Taken as far as rounding lets it."""
    return js.fit(js.Sphere([7.4, -2.5, 3.8], 2.0), points, rtol=0.0, max_steps=25, **options).shape


def on_sphere():
    rng = np.random.default_rng(2)
    u, v = rng.uniform(0, 2 * np.pi, 100), rng.uniform(-1, 1, 100)
    exact = [7, -3, 4] + 2.5 * np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], -1)
    return exact + 0.1 * rng.normal(size=exact.shape)


@pytest.mark.parametrize("loss", ["squared", "cauchy"])
def test_a_radius_by_the_points(loss):
    radius = lambda p: sphere_of(p, loss=loss).radius
    points = on_sphere()
    gradient = jax.grad(radius)(points)
    if loss == "squared":  # the scale of a robust loss is held, differences move it
        way = np.random.default_rng(1).normal(size=points.shape)
        np.testing.assert_allclose(np.sum(gradient * way), slope(radius, points, way, 3e-3), rtol=1e-7)
    # moving all points outwards from the centre by one grows the radius by one
    centre = np.asarray(sphere_of(points, loss=loss).center)
    outwards = (points - centre) / np.linalg.norm(points - centre, axis=1)[:, None]
    assert 0.8 < np.sum(gradient * outwards) < 1.2
    forwards = jax.jvp(radius, (jnp.asarray(points),), (jnp.asarray(outwards),))[1]
    np.testing.assert_allclose(forwards, np.sum(gradient * outwards), rtol=1e-9)


def test_a_radius_by_the_weights():
    points, weights = on_sphere(), np.random.default_rng(4).uniform(0.5, 2, 100)
    radius = lambda w: sphere_of(points, weights=w).radius
    gradient = jax.grad(radius)(weights)
    way = 0.5 * np.sign(gradient)
    np.testing.assert_allclose(np.sum(gradient * way), slope(radius, weights, way, 3e-3), rtol=1e-6)
    assert abs(np.sum(gradient * weights)) < 1e-12  # only their ratios count


def test_what_is_not_free_moves_the_rest():
    rng = np.random.default_rng(2)
    angle, height = rng.uniform(0, 2 * np.pi, 200), rng.uniform(1, 4, 200)
    points = np.stack([7 + 2.5 * np.cos(angle), -3 + 2.5 * np.sin(angle), height], -1) + 0.02 * rng.normal(size=(200, 3))

    def radius(tilt):
        start = js.Cylinder([7.2, -2.9, 0.0], jnp.stack([tilt, jnp.zeros_like(tilt), jnp.ones_like(tilt)]), 2.0, 5.0)
        return js.fit(start, points, free=lambda s: (s.center, s.radius), rtol=1e-15).shape.radius

    tilt = jnp.asarray(0.05)
    np.testing.assert_allclose(jax.grad(radius)(tilt), slope(radius, tilt, 1.0), rtol=1e-6)


def test_a_height_of_a_net_by_the_points():
    """With bending that determines the net, and feet on borders too."""
    start = dented(TRUTH, 3, depth=0.1)
    height = lambda p: js.fit(start, p, bending=1e-4, sliding=0.1, rtol=1e-14, max_steps=200).shape(3.1, 0.4)[2]
    gradient = jax.grad(height)(POINTS)
    np.testing.assert_allclose(np.sum(gradient * WAY), slope(height, POINTS, WAY), rtol=2e-4)


def test_a_fixed_point_moves_the_net():
    start = dented(TRUTH, 3, depth=0.1)

    def height(z):
        place = jnp.stack([jnp.full_like(z, 25.0), jnp.full_like(z, -5.0), z])
        fixed = [js.FixedPoint((3.3, 0.4), place), js.FixedEdge("u0")]
        return js.fit(start, POINTS, bending=1e-4, fixed=fixed, rtol=1e-14, max_steps=200).shape(3.6, 0.5)[2]

    at = jnp.asarray(5.5)
    found = jax.grad(height)(at)
    np.testing.assert_allclose(found, slope(height, at, 1.0), rtol=1e-4)
    assert 0.05 < abs(found) < 1


def test_fits_are_traced():
    points = on_sphere()
    quick = jax.jit(lambda p: sphere_of(p).radius)
    np.testing.assert_allclose(quick(points), sphere_of(points).radius, rtol=1e-9)
    many = eqx.filter_jit(eqx.filter_grad(lambda p: jnp.sum(js.fit_many(js.Sphere([7.0, -3, 4], 2.5), p).shape.radius)))
    both = many(jnp.stack([points, points[::-1]]))
    np.testing.assert_allclose(both[0], both[1][::-1], rtol=0, atol=1e-4)
