"""Ground truth: of all families a member is found again from noisy points as well as their noise allows.

σ √(n/N) is what N points of noise σ leave of n numbers that they determine. For a net of P control points n is often put
at P, the components along the normal; that holds for a fair sheet whose start differs from it in those only. Components
along the sheet, P of a curve and 2 P of a surface, are seen too, the more it is bent from one control point to the next and
the farther off they are at the start: n then lies between P and 3 P; `Truth.seen` finds it without any code of `fit`.
"""

import numpy as np
import pytest
from scipy.stats import chi2
from truths import NOISE, TRUTHS, Truth

import jaxsurf as js

SEEDS = range(20)
ROBUST = ["B-spline surface, 6 × 6", "sphere"]  # an open curve in space is held by fewer points, and may stray to outliers


def errors(truth: Truth, start, measured, seeds=SEEDS, **options) -> np.ndarray:
    """Rms distance of true points to the fitted shape for each seed; of the border only the last points know."""
    inside = np.asarray(truth.member(*truth.parameters(np.random.default_rng(99), 0.03, 500)))
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        points = measured(rng)
        fitted = js.fit(start(rng), points, free=truth.free, **options).shape
        found.append(np.sqrt(np.mean(np.asarray(js.closest_point(fitted, inside).distance) ** 2)))
    return np.array(found)


@pytest.mark.parametrize("name", TRUTHS)
def test_members_are_found_as_well_as_noise_allows(name):
    truth = TRUTHS[name]()
    numbers = truth.seen()
    reached = errors(truth, truth.start, truth.measured) / (NOISE * np.sqrt(numbers / truth.count))
    # of few numbers even a perfect estimate strays further: as one of a thousand such tests would
    worst = max(1.5, np.sqrt(chi2.isf(1e-3 / len(SEEDS), numbers) / numbers))
    assert reached.mean() <= 1.1, reached.mean()
    assert reached.max() <= worst, (reached.max(), worst)


@pytest.mark.parametrize("name", ["B-spline surface, 6 × 6", "B-spline surface, 8 × 8"])
def test_of_a_dented_net_one_number_is_paid_for_each_control_point(name):
    truth = TRUTHS[name]()
    law = NOISE * np.sqrt(truth.member.control_points[..., 0].size / truth.count)
    reached = errors(truth, lambda rng: truth.dented(rng, 0.3), truth.measured) / law
    assert reached.mean() <= 1.1, reached.mean()
    assert reached.max() <= 1.5, reached.max()


def spoiled(truth: Truth, sided: str):
    """Measurements of which three in ten lie 10 to 200 standard deviations off."""

    def measured(rng: np.random.Generator) -> np.ndarray:
        points = truth.measured(rng)
        far = rng.choice(truth.count, 3 * truth.count // 10, replace=False)
        lift = NOISE * rng.uniform(10, 200, len(far))
        points[far, 2] += lift if sided == "one side" else lift * rng.choice([-1, 1], len(far))
        return points

    return measured


@pytest.mark.parametrize("sided", ["one side", "two sides"])
@pytest.mark.parametrize("options", [{"loss": "tukey"}, {"trimmed": 0.35}], ids=["tukey", "trimmed"])
@pytest.mark.parametrize("name", ROBUST)
def test_thirty_percent_of_gross_outliers_do_not_matter(name, options, sided):
    truth = TRUTHS[name]()
    clean = errors(truth, truth.start, truth.measured)
    reached = errors(truth, truth.start, spoiled(truth, sided), **options)
    assert reached.mean() <= 2 * clean.mean()


@pytest.mark.parametrize("name", ["NURBS surface, free weights", "closed B-spline curve", "cylinder", "torus"])
def test_outliers_do_not_matter_to_others_either(name):
    truth, few = TRUTHS[name](), range(6)
    clean = errors(truth, truth.start, truth.measured, few)
    reached = errors(truth, truth.start, spoiled(truth, "one side"), few, loss="tukey")
    assert reached.mean() <= 2 * clean.mean()


def test_rational_weights_stay_positive():
    """Beside outliers they would become negative, and the surface would have poles."""
    truth = TRUTHS["NURBS surface, free weights"]()
    rng = np.random.default_rng(1)
    points, start = spoiled(truth, "one side")(rng), truth.start(rng)
    assert np.min(js.fit(start, points, free=truth.free, loss="tukey").shape.weights) > 0
