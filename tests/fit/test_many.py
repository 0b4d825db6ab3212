"""`fit_many` gives what `fit` gives, cloud by cloud."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import dented, points_on, rms_distance, sheet

import jaxsurf as js

TRUTH = sheet()
KINDS = 5


def cloud(seed, count=200):
    surface = dented(TRUTH, 10 + seed, depth=0.2)
    return points_on(surface, count, seed) + 0.01 * np.random.default_rng(seed).normal(size=(count, 3))


def member(shapes, k):
    return jax.tree.map(lambda x: x[k], shapes)


@pytest.mark.parametrize("options", [{}, {"loss": "tukey"}, {"trimmed": 0.1}], ids=str)
def test_each_cloud_is_fitted_as_if_alone(options):
    clouds = np.stack([cloud(k) for k in range(KINDS)])
    found = js.fit_many(TRUTH, clouds, **options)
    assert found.rms.shape == (KINDS,) and found.converged.all()
    for k in (0, 3):
        alone = js.fit(TRUTH, clouds[k], **options)
        assert rms_distance(member(found.shape, k), np.asarray(alone.foot.points)) < 2e-3
        np.testing.assert_allclose(found.rms[k], alone.rms, rtol=0.02)
        np.testing.assert_allclose(member(found.foot, k).points, alone.foot.points, atol=0.02)


def test_clouds_of_different_size():
    clouds = [cloud(k, 150 + 30 * k) for k in range(3)]
    found = js.fit_many(TRUTH, clouds, weights=[np.full(len(c), 2.0) for c in clouds])
    assert found.deviation.signed.shape == (3, 210)
    np.testing.assert_array_equal(found.deviation.signed[0, 150:], 0)
    alone = js.fit(TRUTH, clouds[1])
    assert rms_distance(member(found.shape, 1), np.asarray(alone.foot.points)) < 2e-3
    np.testing.assert_allclose(found.rms[1], alone.rms, rtol=0.02)


def test_more_clouds_than_are_worked_on_at_once_and_starts_of_their_own():
    """Fifty spheres; the second half of the clouds is harder and takes more steps."""
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(50, 400, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    centre, radius = rng.normal(size=(50, 1, 3)), rng.uniform(1, 3, size=(50, 1, 1))
    clouds = centre + radius * direction
    lift = np.where(np.arange(50) < 25, 0.01, 0.4)[:, None]
    starts = eqx.filter_vmap(js.Sphere)(jnp.asarray(centre[:, 0] + lift), jnp.asarray(radius[:, 0, 0] * 1.2))
    found = js.fit_many(starts, clouds, stacked=True, rtol=1e-12)
    np.testing.assert_allclose(found.shape.radius, radius[:, 0, 0], rtol=1e-7)
    np.testing.assert_allclose(found.shape.center, centre[:, 0], rtol=0, atol=1e-7)
    assert found.converged.all() and found.steps.min() < found.steps.max()


def test_the_step_limit_is_told():
    found = js.fit_many(TRUTH, np.stack([cloud(0), cloud(1)]), max_steps=1)
    assert not found.converged.any() and list(found.steps) == [1, 1]


def test_curves_too():
    curve = js.interpolate([(0, 0, 0), (1, 1, 0.5), (2, 0, 1), (3, 1, 0)], 3)
    u = np.random.default_rng(1).uniform(size=(4, 80))
    clouds = np.asarray(curve(u)) + 0.3 * np.arange(4)[:, None, None]
    found = js.fit_many(curve, clouds, bending=0.0, rtol=1e-10)
    np.testing.assert_allclose(found.rms, 0, atol=1e-4)


REFUSED = {
    "one cloud": ({"clouds": cloud(0)}, r"`clouds` must have shape \(K, N, 3\).*got \(200, 3\)"),
    "none": ({"clouds": []}, "`clouds` must hold at least one cloud, got none"),
    "an empty one": ({"clouds": [cloud(0), np.zeros((0, 3))]}, r"but number 2 is \(0, 3\)"),
    "NaN": ({"clouds": [cloud(0), np.full((5, 3), np.nan)]}, "`clouds` must be finite, but number 2 is not"),
    "weights": ({"weights": np.ones((2, 3))}, r"`weights` must have shape \(2, 200\)"),
    "loss": ({"loss": "hubert"}, "`loss` must be one of"),
    "trimmed": ({"trimmed": 1.5}, r"`trimmed` must be a share in \[0, 1\), got 1.5"),
    "stacked": ({"stacked": True}, "With `stacked=True` every array of `shape` must have 2 entries"),
}


@pytest.mark.parametrize("options, message", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_fitted_is_refused(options, message):
    options = {"clouds": np.stack([cloud(0), cloud(1)]), **options}
    with pytest.raises(js.InputError, match=message):
        js.fit_many(TRUTH, options.pop("clouds"), **options)
