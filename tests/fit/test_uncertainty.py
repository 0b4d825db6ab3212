"""Variances that a fit tells are those of many fits of clouds with noise of its own."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import points_on, sheet

import jaxsurf as js

RUNS, COUNT, NOISE = 1000, 400, 0.01
PLACES = np.random.default_rng(4).uniform([2.3, 0.1], [4.7, 0.9], size=(20, 2))
TRUTH = sheet()
EXACT = points_on(TRUTH, COUNT, seed=1)


@pytest.fixture(scope="module")
def one():
    return js.fit(TRUTH, EXACT + NOISE * np.random.default_rng(0).normal(size=EXACT.shape))


def spread_of(shapes, places):
    """Root mean square over the runs of the distance of places of the truth, one for each place."""
    measure = eqx.filter_jit(eqx.filter_vmap(lambda shape: js.closest_point(shape, places).distance))
    return np.sqrt(np.mean(np.asarray(measure(shapes)) ** 2, axis=0))


@pytest.mark.parametrize("loss", ["squared", "huber"])
def test_the_variance_of_places_is_that_of_a_thousand_fits(loss):
    rng = np.random.default_rng(7)
    clouds = EXACT[None] + NOISE * rng.normal(size=(RUNS, *EXACT.shape))
    found = js.fit_many(TRUTH, clouds, loss=loss)
    measured = spread_of(found.shape, np.asarray(TRUTH(*PLACES.T)))
    told = js.fit(TRUTH, clouds[0], loss=loss).uncertainty(noise=NOISE).deviation(*PLACES.T)
    # a standard deviation from a thousand runs is known to 2.2 % itself; the variance is to be right to 10 %
    np.testing.assert_allclose(np.mean(measured**2) / np.mean(np.asarray(told) ** 2), 1, atol=0.1)
    np.testing.assert_allclose(measured**2 / np.asarray(told) ** 2, 1, atol=0.25)


def test_the_noise_is_found_from_the_distances(one):
    told = one.uncertainty()
    np.testing.assert_allclose(told.noise, NOISE, rtol=0.1)
    assert 36 < told.numbers < 3 * 36
    known = one.uncertainty(noise=2 * NOISE)
    ratio = np.asarray(known.deviation(*PLACES.T) / told.deviation(*PLACES.T))
    np.testing.assert_allclose(ratio, 2 * NOISE / float(told.noise), rtol=1e-9)


def test_weights_are_inverse_variances():
    """Points of a quarter of the noise on one half of the sheet: the surface is known four times as well there."""
    quiet = EXACT[:, 0] < 25
    sigma = np.where(quiet, NOISE / 4, NOISE)
    points = EXACT + sigma[:, None] * np.random.default_rng(2).normal(size=EXACT.shape)
    told = js.fit(TRUTH, points, weights=1 / sigma**2).uncertainty(noise=1.0)
    at = lambda u: np.sqrt(np.mean(np.asarray(told.deviation(np.full(9, u), np.linspace(0.2, 0.8, 9))) ** 2))
    assert 3 < at(4.3) / at(2.7) < 5.3
    free = js.fit(TRUTH, points, weights=1 / sigma**2).uncertainty()
    np.testing.assert_allclose(free.noise, 1, rtol=0.1)


def test_what_is_fixed_has_no_variance():
    found = js.fit(TRUTH, EXACT, fixed=js.FixedEdge("u0"))
    told = found.uncertainty(noise=NOISE)
    on_edge, inside = told.deviation(np.full(5, 2.0), np.linspace(0, 1, 5)), told.deviation(3.0, 0.5)
    assert np.max(np.asarray(on_edge)) < 1e-3 * inside
    spread = told.covariance_at(3.0, 0.5)
    normal = js.normal(found.shape, 3.0, 0.5)
    np.testing.assert_allclose(np.sqrt(normal @ spread @ normal), inside, rtol=1e-6)


def test_the_band_of_a_curve_has_two_components():
    curve = js.interpolate([(0, 0, 0), (1, 1, 0.5), (2, 0, 1), (3, 1, 0)], 3)
    rng = np.random.default_rng(3)
    places = np.asarray(curve(rng.uniform(0, 1, 200)))
    clouds = places[None] + NOISE * rng.normal(size=(RUNS, 200, 3))
    found = js.fit_many(curve, clouds)
    u = np.linspace(0.1, 0.9, 15)
    measured = spread_of(found.shape, np.asarray(curve(u)))
    told = np.asarray(js.fit(curve, clouds[0]).uncertainty(noise=NOISE).deviation(u))
    np.testing.assert_allclose(np.mean(measured**2) / np.mean(told**2), 1, atol=0.1)


def test_outliers_are_flagged():
    points = EXACT + NOISE * np.random.default_rng(5).normal(size=EXACT.shape)
    points[[3, 77, 200]] += [0, 0, 0.5]
    found = js.fit(TRUTH, points, loss="tukey")
    assert set(np.flatnonzero(found.outliers)) == {3, 77, 200}
    clean = js.fit(TRUTH, EXACT + NOISE * np.random.default_rng(6).normal(size=EXACT.shape))
    assert np.sum(clean.outliers) <= 1


def test_parameters_of_another_number_are_refused(one):
    with pytest.raises(js.InputError, match="Expected 2 `parameters`, u, v, got 1"):
        one.uncertainty().deviation(0.5)
    assert jnp.isfinite(one.uncertainty().covariance).all()
