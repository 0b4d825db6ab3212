"""How smooth a shape is at its breaks, measured from both sides."""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

Jets = Callable[[np.ndarray], list[np.ndarray]]
"""Parameters (m,) to the values and the derivatives of order 1, 2, ..., each (m, ..., d)."""


def multiplicities(
    jets: Jets, places: Float[np.ndarray, "n"], degree: int, tolerance: float, inset: float
) -> Int[np.ndarray, "n"]:
    """Knot multiplicity of each break: degree + 1 − k where the derivative of order k jumps first, else 1.

    A jump counts if what it does over the neighbouring spans, |jump| h^k / k!, exceeds a tenth of
    `tolerance`; a spline of full smoothness follows smaller ones. Both sides are looked at from a distance of
    `inset`. Points that jump (k = 0) give degree + 1.
    """
    times = np.ones(len(places), int)
    inner = places[1:-1]
    if len(inner) == 0:
        return times
    left, right = (jets(inner + shift) for shift in (-inset, inset))
    reach = np.minimum(np.diff(places)[:-1], np.diff(places)[1:])
    for order in reversed(range(len(left))):
        jump = _sizes(right[order] - left[order])
        if order + 1 < len(left):  # between the two sides the next derivative moves this one
            jump = jump - 4 * inset * np.maximum(_sizes(left[order + 1]), _sizes(right[order + 1]))
        rough = jump * reach**order / math.factorial(order) > 0.1 * tolerance
        times[1:-1] = np.where(rough, degree + 1 - order, times[1:-1])
    return times


def _sizes(values: np.ndarray) -> Float[np.ndarray, "m"]:
    """The largest vector for each parameter."""
    return np.linalg.norm(values, axis=-1).reshape(len(values), -1).max(axis=1)
