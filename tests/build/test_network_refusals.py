"""Networks: what is refused, each in one sentence that names the curves."""

import jax
import numpy as np
import pytest
from build.network_cases import character, guide, sheet

import jaxsurf as js

THREE = (0.0, 0.5, 1.0)


def _bent(y):
    return js.CompositeCurve([js.Line([0.0, y, 0], [1.0, y, 0]), js.Line([1.0, y, 0], [2.0, y, 1.0])])


def test_near_misses_within_the_tolerance_are_reported():
    network = js.network([guide(x) for x in THREE], [character(y, lift=0.003) for y in THREE], tolerance=0.01)
    assert len(network.gaps) == 9 and 0.001 < network.largest_gap < 0.0031
    worst = max(network.gaps, key=lambda gap: gap.distance)
    i, j = worst.guide, worst.character
    a, b = network.guides[i](worst.parameters[0]), network.characters[j](worst.parameters[1])
    assert float(np.linalg.norm(np.asarray(a) - np.asarray(b))) == pytest.approx(worst.distance, rel=1e-9)


@pytest.mark.parametrize(
    ("curves", "message"),
    [
        (
            lambda: ([guide(0), guide(1)], [character(0), character(1, 0, 0.95)]),
            r"`guides\[1\]` and `characters\[1\]` should cross .* 0\.05\d+ apart, more than the 0\.0015.* \(`tolerance`",
        ),
        (
            lambda: ([guide(x) for x in THREE], [character(0), character(0.5, lift=0.03), character(1)]),
            r"`characters\[1\]` crosses no guide: the nearest is `guides\[\d\]`, 0\.02\d+ away, .* larger `tolerance`",
        ),
        (
            lambda: ([guide(0), guide(1, lift=0.3)], [character(0), character(1)]),
            r"`guides\[1\]` crosses no character: the nearest is `characters\[\d\]`",
        ),
        (
            lambda: ([guide(0), guide(0.5, 0, 0.8), guide(1)], [character(y) for y in THREE]),
            r"`guides\[1\]` and `characters\[2\]` should cross to close .* cut off what sticks into the cell",
        ),
        (lambda: ([], [character(0)]), "`guides` must hold at least one curve, got none"),
        (lambda: ([guide(0)], 3), "`characters` must be curves, got int"),
        (lambda: ([guide(0), "x"], [character(0)]), r"`guides\[1\]` must be a curve, got str"),
        (lambda: ([js.Line([0.0, 0], [1.0, 1])], [character(0)]), r"`guides\[0\]` must be a curve in space"),
        (
            lambda: ([guide(0)], [character(0), js.Line([0.0, 0, 0], [0.0, 0, 0])]),
            r"`characters\[1\]` is a point; leave it out",
        ),
        (
            lambda: ([_bent(0.0), _bent(1.0)], [js.Line([x, 0, x / 2], [x, 1.0, x / 2]) for x in (0.0, 2.0)]),
            r"`guides\[0\]` has a corner of 45° at 1, inside a patch",
        ),
        (lambda: ([guide(0)], [guide(0)]), "run along each other"),
    ],
)
def test_curves_that_make_no_network(curves, message):
    with pytest.raises(js.InputError, match=message):
        js.network(*curves(), tolerance=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0}, "`tolerance` must be a number between 0 and 0.1"),
        ({"rotation": "twist"}, "`rotation` must be one of"),
        ({"scale": "big"}, "`scale` must be True, False"),
        ({"blend": 3}, "`blend` must be a function"),
        ({"rotation": "fixed", "scale": False}, "leaves its curves by .* take rotation"),
    ],
)
def test_options_that_are_refused(options, message):
    with pytest.raises(js.InputError, match=message):
        sheet(2, 2, **options)


def test_traced_curves_are_refused():
    with pytest.raises(js.InputError, match="decides on known values which curves cross"):
        jax.jit(lambda c: js.network([c], [character(0)]).grid([0.0], [0.0]))(guide(0))
