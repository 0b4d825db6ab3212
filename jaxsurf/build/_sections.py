"""Sections of a loft: how they run beside each other."""

import warnings
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from .._array import eps
from .._errors import GeometryWarning, InputError
from ..curve import AbstractCurve
from ..edit import reverse
from ._placing import places_on

_PLACES = 65
_SHIFT = 0.125  # of a turn, from which on a closed section that starts elsewhere is told of
_BETTER = 0.25  # the share of the squared distances that a shift has to leave at most, to be meant
_OPPOSITE = -0.9  # the cosine between areas below which one is turned over; a loft round a bend has less than that a step
_BESIDE = 0.5  # and above which it can be said where they start


def aligned(curves: tuple[AbstractCurve, ...], *, turn: bool, closed: bool) -> tuple[AbstractCurve, ...]:
    """Known sections, those that run against the one before turned round, or only told of; closed ones that start elsewhere
    are told of."""
    points = [places_on(curve, _PLACES).astype(np.float64) for curve in curves]
    size = float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))
    _refuse_equal(points, max(1e-9, 64 * eps(curves[0].dtype)) * size, closed)
    out = list(curves)
    for i in range(1, len(out)):
        if not against(points[i - 1], points[i]):
            continue
        if turn:
            out[i], points[i] = reverse(out[i]), points[i][::-1]
        else:
            _warn(f"`curves[{i}]` runs against `curves[{i - 1}]`: the loft is twisted; turn it with `js.reverse`.")
    if closed and against(points[-1], points[0]):
        _warn(f"`curves[0]` runs against `curves[{len(out) - 1}]`, where the loft closes: it is twisted there.")
    for i in range(1, len(out)):
        share = shifted(points[i - 1], points[i])
        if share:
            a, b = (float(end) for end in out[i].domain)
            _warn(
                f"The closed `curves[{i}]` starts elsewhere on its way round than `curves[{i - 1}]`: the loft is twisted; "
                f"let it start at its parameter {a + share * (b - a):.6g}, with `js.split` and `js.CompositeCurve`."
            )
    return tuple(out)


def against(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "n 3"]) -> bool:
    """Whether two sections run in opposite directions: ends of open ones crossed, areas of closed ones opposite."""
    if is_round(one) and is_round(other):
        return _lean(one, other) < _OPPOSITE
    straight = np.sum((one[[0, -1]] - other[[0, -1]]) ** 2)
    crossed = np.sum((one[[0, -1]] - other[[-1, 0]]) ** 2)
    return bool(crossed < (1 - 1e-6) * straight)


def shifted(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "n 3"]) -> float:
    """By what share of a turn the second closed section should start later to lie beside the first; 0 if it does well."""
    if not (is_round(one) and is_round(other) and _lean(one, other) > _BESIDE):
        return 0.0
    a, b = (points[:-1] - points[:-1].mean(axis=0) for points in (one, other))
    b = b * np.linalg.norm(a) / np.linalg.norm(b)  # of one size: only where they start is asked
    costs = np.array([np.sum((a - np.roll(b, -k, axis=0)) ** 2) for k in range(len(a))])
    best = int(np.argmin(costs))
    share = best / len(a)
    told = min(share, 1 - share) >= _SHIFT and costs[best] < _BETTER * costs[0]
    return share if told else 0.0


def is_round(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, ""] | bool:
    """Whether a section is closed and encloses something."""
    size = np.linalg.norm(np.ptp(points, axis=0))
    return bool(size > 0 and np.linalg.norm(points[-1] - points[0]) <= 1e-6 * size)


def _lean(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "n 3"]) -> float:
    """The cosine of the angle between the vector areas of closed sections; 0 where one has none."""
    first, second = _area(one), _area(other)
    size = np.linalg.norm(first) * np.linalg.norm(second)
    return float(first @ second / size) if size > 0 else 0.0


def _area(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """The vector area of a closed polygon."""
    arms = points - points[0]
    return np.cross(arms[:-1], arms[1:]).sum(axis=0) / 2


def _refuse_equal(points: list[np.ndarray], allowed: float, closed: bool) -> None:
    pairs = list(zip(points[:-1], points[1:], strict=True)) + ([(points[-1], points[0])] if closed else [])
    for i, (one, other) in enumerate(pairs):
        if np.abs(one - other).max() <= allowed:
            after = (i + 1) % len(points)
            more = "; a closed loft returns to the first section by itself" if after == 0 else ""
            raise InputError(f"`curves[{i}]` and `curves[{after}]` are the same curve: leave one of them out{more}.")


def _warn(message: Any) -> None:
    warnings.warn(message, GeometryWarning, stacklevel=4)
