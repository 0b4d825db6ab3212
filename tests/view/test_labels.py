"""Round numbers on bars."""

import numpy as np
import pytest

from jaxsurf.view._deviation import _limit, tick_label
from jaxsurf.view._sheet import round_length


@pytest.mark.parametrize(
    ("value", "bound", "text"),
    [
        (0.012, 0.048, "+0.012"),
        (-0.05, 0.2, "−0.05"),
        (0.0, 3.0, "0"),
        (30.0, 40.0, "+30"),
        (-1.5, 6.0, "−1.5"),
        (2e-6, 4e-6, "+2.0e-06".replace("-", "−")),
    ],
)
def test_ticks_are_signed_and_short(value, bound, text):
    assert tick_label(value, bound) == text


def test_the_limit_is_a_round_number_that_holds_the_quantile():
    values = np.linspace(-0.041, 0.041, 1001)
    bound, note = _limit(values, None, "mm")
    assert bound == pytest.approx(0.048) and "98 % of points within" in note and "mm" in note
    assert _limit(np.zeros(5), None, "mm")[0] == 1.0
    assert _limit(values, 0.0205, "mm")[1].startswith("50")


@pytest.mark.parametrize(("most", "length"), [(1.0, 1.0), (19.0, 10.0), (0.06, 0.05), (2.5, 2.0)])
def test_scale_bars_are_one_two_or_five(most, length):
    assert round_length(most) == pytest.approx(length)
