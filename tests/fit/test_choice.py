"""`fit_best` compares families and sizes, and chooses the one that made the cloud."""

import numpy as np
import pytest

import jaxsurf as js

RNG = np.random.default_rng(1)
U, V = RNG.uniform([0, 0], [10, 6], size=(700, 2)).T
NOISE = 0.02


def cloud(height):
    return np.stack([U, V, height], -1) + NOISE * RNG.normal(size=(700, 3))


FAIR = cloud(0.05 * U**2 - 0.03 * U * V)
WAVY = cloud(0.4 * np.sin(1.6 * U) * np.cos(1.4 * V))


@pytest.mark.parametrize("points, best", [(FAIR, "bspline 1x1"), (WAVY, "bspline 5x4")], ids=["fair", "wavy"])
@pytest.mark.parametrize("criterion", ["bic", "holdout"])
def test_the_size_that_the_cloud_needs_is_chosen(points, best, criterion):
    found = js.fit_best(points, candidates=["bspline 1x1", "bspline 5x4", "bspline 60x60"], criterion=criterion)
    assert found.name == best and found.tried[0].name == best
    assert len(found.tried) == 2  # the third has more control points than there are points
    assert found.tried[0].criterion < found.tried[1].criterion
    assert found.deviation.rms < 2 * NOISE and found.deviation.rms == found.tried[0].rms
    assert (found.tried[0].holdout is None) == (criterion == "bic")
    assert best in str(found).splitlines()[1]


def test_progress_may_stop():
    found = js.fit_best(FAIR, candidates=["bspline 1x1", "bspline 5x4"], progress=lambda event: event.step == 2)
    assert found.stopped and len(found.tried) == 1


REFUSED = {
    "name": ({"candidates": ["spline 8x8"]}, "`candidates` must be 'sweep' or such as .* got 'spline 8x8'"),
    "no list": ({"candidates": "sweep"}, "`candidates` must be a list of names"),
    "none": ({"candidates": []}, "`candidates` must be a list of names"),
    "too large": ({"candidates": ["bspline 60x60"]}, "None of the `candidates` can be fitted to 700 points"),
    "criterion": ({"criterion": "best"}, "`criterion` must be 'bic', 'aic' or 'holdout', got 'best'"),
    "holdout": ({"criterion": "holdout", "holdout": 0.0}, "`holdout` must be a share in"),
}


@pytest.mark.parametrize("options, message", REFUSED.values(), ids=REFUSED)
def test_what_means_nothing_is_refused(options, message):
    with pytest.raises(js.InputError, match=message):
        js.fit_best(FAIR, **options)
