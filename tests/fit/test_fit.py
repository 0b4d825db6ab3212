"""`fit`: shapes are found again, noise averages out, outliers do not count, and what is not free stays."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from fit_cases import dented, points_on, rms_distance, sheet
from scipy.integrate import quad
from scipy.interpolate import BSpline

import jaxsurf as js
from jaxsurf.basis import periodic_knots
from jaxsurf.fit import Deviation
from jaxsurf.fit._losses import LOSSES, noise_scale

COUNT, NOISE = 600, 0.02
TRUTH = sheet()
EXACT = points_on(TRUTH, COUNT, seed=1)
INSIDE = points_on(TRUTH, 1000, seed=9, margin=0.04)  # the border itself is only known up to its last points
STIFF = 1e-5  # nets that are to see through outliers must not reach out for them


def noisy(seed):
    return EXACT + NOISE * np.random.default_rng(seed).normal(size=EXACT.shape)


def with_outliers(seed):
    """A fifth of the points lies 15 to 40 standard deviations above the sheet."""
    rng = np.random.default_rng(seed)
    points, far = noisy(seed), rng.choice(COUNT, COUNT // 5, replace=False)
    points[far, 2] += rng.uniform(0.3, 0.8, size=len(far))
    return points, far


# --- B-spline surfaces


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_member_is_found_again_from_exact_points(seed):
    found = js.fit(dented(TRUTH, seed), EXACT, bending=0.0, sliding=0.0, rtol=1e-12)
    assert found.deviation.max < 1e-12
    assert rms_distance(found.shape, INSIDE) < 1e-12
    # the background that holds what no point determines costs 2·10⁻⁵ of the size
    assert js.fit(dented(TRUTH, seed), EXACT).deviation.rms < 3e-5 * 12


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_noise_averages_out(seed):
    found = js.fit(dented(TRUTH, seed), noisy(seed))
    assert rms_distance(found.shape, INSIDE) < 2 * NOISE * np.sqrt(36 / COUNT)
    assert 0.8 * NOISE < found.deviation.rms < NOISE


@pytest.mark.parametrize("loss", ["huber", "cauchy", "tukey"])
def test_robust_losses_see_through_outliers(loss):
    for seed in (3, 4, 5):
        points, _ = with_outliers(seed)
        found = js.fit(dented(TRUTH, seed), points, loss=loss, bending=STIFF)
        squared = js.fit(dented(TRUTH, seed), points, bending=STIFF)
        assert rms_distance(found.shape, INSIDE) < 2.5 * NOISE
        assert rms_distance(squared.shape, INSIDE) > 5 * NOISE


def test_points_without_weight_do_not_count():
    points, far = with_outliers(3)
    weights = np.ones(COUNT)
    weights[far] = 0
    found = js.fit(dented(TRUTH, 3), points, weights=weights)
    elsewhere = points.copy()
    elsewhere[far, 2] += 0.25  # the box, and so the unit of the objective, grows a little
    again = js.fit(dented(TRUTH, 3), elsewhere, weights=weights)
    assert rms_distance(found.shape, INSIDE) < 0.8 * NOISE
    assert rms_distance(again.shape, np.asarray(found.foot.points)) < 0.1 * NOISE


def test_weights_are_relative():
    weights = np.random.default_rng(3).uniform(0.5, 2, COUNT)
    one, two = (js.fit(dented(TRUTH, 3), noisy(3), weights=s * weights, bending=STIFF) for s in (1, 1000))
    np.testing.assert_allclose(one.shape.control_points, two.shape.control_points, rtol=0, atol=1e-6)


def test_progress_shows_every_step_and_changes_nothing():
    seen = []
    watched = js.fit(dented(TRUTH, 3), noisy(3), bending=STIFF, progress=seen.append, phase="sheet")
    silent = js.fit(dented(TRUTH, 3), noisy(3), bending=STIFF)
    np.testing.assert_allclose(watched.shape.control_points, silent.shape.control_points, rtol=0, atol=1e-6 * NOISE)
    assert int(watched.steps) == int(silent.steps) == len(seen) and not watched.stopped
    assert watched.result == silent.result and watched.converged == silent.converged
    assert [event.step for event in seen] == list(range(1, len(seen) + 1))
    assert {(event.phase, event.steps) for event in seen} == {("sheet", 60)}
    assert np.all(np.diff([event.rms for event in seen]) <= 0)
    assert watched.deviation.rms <= seen[-1].rms < 2 * watched.deviation.rms  # the bending is in it too


def test_progress_may_stop():
    start, seen = dented(TRUTH, 3), []

    def progress(event):
        seen.append(event)
        return event.step == 9

    found = js.fit(start, noisy(3), bending=STIFF, progress=progress)
    assert found.stopped and int(found.steps) == len(seen) == 9
    assert found.deviation.rms < 0.5 * rms_distance(start, noisy(3))


def test_the_step_limit_is_told():
    found = js.fit(dented(TRUTH, 3), noisy(3), max_steps=2, progress=lambda event: False)
    assert int(found.steps) == 2 and not found.converged and not found.stopped


def test_the_deviation_is_measured_at_the_feet():
    points = noisy(3)
    found = js.fit(dented(TRUTH, 3), points, bending=STIFF, start=None)
    feet = js.closest_point(found.shape, points)
    np.testing.assert_allclose(found.deviation.signed, feet.distance, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.abs(found.deviation), np.linalg.norm(points - found.foot.points, axis=1))
    again = js.fit(found.shape, points, bending=STIFF, start=found.foot.parameters)
    assert again.deviation.rms < 1.001 * found.deviation.rms


# --- other shapes: the path without structure


def test_a_sphere_is_found_from_its_middle():
    rng = np.random.default_rng(2)
    u, v = rng.uniform(0, 2 * np.pi, 400), rng.uniform(-1, 1, 400)  # the seam is in it
    points = [7, -3, 4] + 2.5 * np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], -1)
    found = js.fit(js.Sphere([7.4, -2.5, 3.8], 2.0), points, rtol=1e-12)
    np.testing.assert_allclose(found.shape.center, [7, -3, 4], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.shape.radius, 2.5, rtol=1e-9)
    assert found.deviation.max < 1e-9


def test_only_what_is_free_moves():
    rng = np.random.default_rng(2)
    angle, height = rng.uniform(0, 2 * np.pi, 400), rng.uniform(1, 4, 400)
    points = np.stack([7 + 2.5 * np.cos(angle), -3 + 2.5 * np.sin(angle), height], -1)
    start = js.Cylinder([7.2, -2.9, 0.0], [0.0, 0.0, 1.0], 2.0, 5.0)
    found = js.fit(start, points, free=lambda s: (s.center, s.radius), rtol=1e-12).shape
    np.testing.assert_allclose(found.center[:2], [7, -3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.radius, 2.5, rtol=1e-8)
    for name in ("axis", "height", "start"):
        np.testing.assert_array_equal(getattr(found, name), getattr(start, name))


# --- curves


def closed_curve():
    angle = 2 * np.pi * np.arange(8) / 8
    net = np.stack([3 * np.cos(angle), 2 * np.sin(angle), 0.5 * np.cos(2 * angle)], -1) + [7, -3, 4]
    return js.BSplineCurve(net, [2.0, 2.3, 2.8, 3.0, 3.5, 3.9, 4.2, 4.7, 5.0], 3, periodic=True)


def test_a_closed_curve_is_found_again_from_exact_points():
    curve = closed_curve()
    points = np.asarray(curve(np.random.default_rng(1).uniform(2, 5, 300)))
    net = np.asarray(curve.control_points) * 1.05
    start = js.BSplineCurve(net, curve.knots, 3, periodic=True)
    found = js.fit(start, points, bending=0.0, sliding=0.0, rtol=1e-12)
    assert found.deviation.max < 1e-8
    assert js.closest_point(found.shape, curve(np.linspace(2, 5, 100))).distance.max() < 1e-8


@pytest.mark.parametrize("fairness", [1e-3, 1.0])
def test_smoothing_does_not_shrink_a_circle(fairness):
    rng = np.random.default_rng(1)
    angle, radius = 2 * np.pi * np.arange(12) / 12, 5.0
    ring = lambda t: np.stack([np.cos(t), np.sin(t), 0 * t], -1)
    points = radius * ring(rng.uniform(0, 2 * np.pi, 500)) + 0.01 * radius * rng.normal(size=(500, 3))
    start = js.BSplineCurve(6 * ring(angle) + 0.1 * rng.normal(size=(12, 3)), periodic_knots(12, 3), 3, periodic=True)
    found = js.fit(start, points, fairness=fairness)
    from_axis = np.linalg.norm(found.shape(np.linspace(0, 1, 200)), axis=1)
    measured = np.mean(np.linalg.norm(points[:, :2], axis=1))
    np.testing.assert_allclose(from_axis, measured, rtol=5e-3)
    assert abs(from_axis.mean() - radius) < 1e-3 * radius


# --- losses and figures


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_the_weight_of_a_loss_is_its_derivative(loss):
    z = jnp.asarray([1e-9, 0.1, 0.7, 0.999, 1.001, 2.0, 30.0])
    np.testing.assert_allclose(jax.vmap(jax.grad(loss.value))(z), loss.weight(z), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(loss.value(jnp.zeros(())), 0, atol=1e-15)
    np.testing.assert_allclose(loss.weight(jnp.zeros(())), 1)
    assert np.all(np.diff(loss.value(z)) >= 0) and np.all(np.diff(loss.weight(z)) <= 0)


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_the_scale_of_a_loss_is_95_percent_efficient(loss):
    """Asymptotic variance of the location estimate on Gaussian noise, E[ψ²] / E[ψ']², ψ(x) = x ρ'(x²/s²)."""
    s = loss.deviations
    psi = jax.jit(lambda x: x * loss.weight((x / s) ** 2))
    density = lambda x: np.exp(-0.5 * x * x) / np.sqrt(2 * np.pi)
    mean = lambda f: 2 * sum(quad(lambda x: float(f(x)) * density(x), *ends)[0] for ends in ((0, s), (s, 12)))
    slope = mean(lambda x: x * psi(x))  # E[ψ'] by parts
    efficiency = slope**2 / mean(lambda x: psi(x) ** 2)
    np.testing.assert_allclose(efficiency, 1 if loss.name == "squared" else 0.95, rtol=2e-3)


def test_the_noise_scale_is_that_of_the_majority():
    rng = np.random.default_rng(1)
    distance = jnp.asarray(np.concatenate([0.02 * rng.normal(size=4000), np.full(1000, 50.0)]))
    everyone = noise_scale(distance, jnp.ones(5000))
    counted = noise_scale(distance, jnp.asarray(np.arange(5000) < 4000, float))
    np.testing.assert_allclose(counted, 0.02, rtol=0.05)
    np.testing.assert_allclose(everyone, 0.02, rtol=0.05)  # what is far off is left out


def test_figures_of_deviations():
    signed = np.random.default_rng(1).normal(0.3, 1, 501)
    deviation = Deviation(jnp.asarray(signed))
    magnitude = np.abs(signed)
    expected = [np.sqrt(np.mean(signed**2)), magnitude.max(), signed.mean()]
    expected += [np.quantile(magnitude, q) for q in (0.5, 0.9, 0.95, 0.99)]
    figures = lambda d: [d.rms, d.max, d.mean, *d.quantiles.values()]
    np.testing.assert_allclose(figures(deviation), expected, rtol=1e-14)
    np.testing.assert_allclose(jax.jit(lambda x: figures(Deviation(x)))(signed), expected, rtol=1e-14)
    assert list(deviation.quantiles) == [0.5, 0.9, 0.95, 0.99]
    np.testing.assert_array_equal(np.asarray(deviation), signed)
    assert np.asarray(deviation, np.float32).dtype == np.float32


# --- refusals

SPOILED = EXACT.copy()
SPOILED[[16, 40], 1] = np.nan

REFUSED = {
    "flat points": (
        {"points": EXACT[0]},
        r"`points` must have shape \(N, 3\), got \(3,\)|`points` must have shape",
    ),
    "plane points": ({"points": EXACT[:, :2]}, r"`points` must have shape"),
    "NaN": ({"points": SPOILED}, r"`points` must be finite, but point 17 is \[.*nan.*\]; remove it"),
    "few": ({"points": EXACT[:35]}, r"at least as many as the 36 control points \(6 × 6\), got 35"),
    "loss": ({"loss": "hubert"}, "`loss` must be one of 'squared', 'huber', 'cauchy', 'tukey', got 'hubert'"),
    "fairness": ({"fairness": -1.0}, "`fairness` and `bending` must be ≥ 0, got -1.0 and None"),
    "bending": ({"bending": -1e-9}, "`fairness` and `bending` must be ≥ 0, got 0.0 and -1e-09"),
    "short weights": (
        {"weights": np.ones(5)},
        r"`weights` must have shape \(600,\), one for each point, got \(5,\)",
    ),
    "negative weights": ({"weights": np.full(COUNT, -1.0)}, "`weights` must be ≥ 0 and not all 0"),
    "no weights": ({"weights": np.zeros(COUNT)}, "`weights` must be ≥ 0 and not all 0"),
    "nothing free": ({"free": lambda s: ()}, "`free` leaves nothing to fit"),
}


@pytest.mark.parametrize("options, message", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_fitted_is_refused(options, message):
    options = {"points": EXACT, **options}
    with pytest.raises(js.InputError, match=message):
        js.fit(TRUTH, options.pop("points"), **options)


# --- points of known parameters


def test_points_of_known_parameters_need_one_linear_solve():
    rng = np.random.default_rng(5)
    u, v = rng.uniform(2, 5, 900), rng.uniform(0, 1, 900)
    points = np.asarray(TRUTH(u, v)) + NOISE * rng.normal(size=(900, 3))
    uv = np.stack([u, v], -1)
    found = js.fit(dented(TRUTH, 3, depth=2.0), points, parameters=uv, bending=0.0)
    assert int(found.steps) == 1 and found.converged
    basis = [BSpline.design_matrix(t, np.asarray(k), 3).toarray() for t, k in ((u, TRUTH.knots_u), (v, TRUTH.knots_v))]
    rows = np.einsum("ni,nj->nij", *basis).reshape(900, 36)
    expected = np.linalg.lstsq(rows, points, rcond=None)[0]
    np.testing.assert_allclose(found.shape.control_points.reshape(36, 3), expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.abs(found.deviation), np.linalg.norm(points - rows @ expected, axis=1), rtol=0, atol=1e-8)
    robust = js.fit(TRUTH, points, parameters=uv, loss="huber", bending=0.0)  # step by step
    np.testing.assert_allclose(robust.shape.control_points, found.shape.control_points, rtol=0, atol=0.03)


def test_another_minimiser_finds_the_same():
    rng = np.random.default_rng(2)
    direction = rng.normal(size=(200, 3))
    points = [1, 2, 3] + 2 * direction / np.linalg.norm(direction, axis=1)[:, None] + 0.05 * rng.normal(size=(200, 3))
    start = js.Sphere([1.1, 2.1, 2.9], 1.8)
    ours, theirs = (js.fit(start, points, solver=s, rtol=1e-12, max_steps=200) for s in (None, optx.BFGS(1e-10, 1e-12)))
    np.testing.assert_allclose(theirs.shape.radius, ours.shape.radius, rtol=1e-7)
    np.testing.assert_allclose(theirs.shape.center, ours.shape.center, rtol=0, atol=1e-7)
    with pytest.raises(js.InputError, match="`solver` works with neither `fixed` nor"):
        js.fit(start, points, solver=optx.BFGS(1e-10, 1e-12), fixed=js.FixedPoint((0.0, 0.0)))
