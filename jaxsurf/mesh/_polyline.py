"""Polylines that stand for a curve."""

import numpy as np
from jaxtyping import Float

from .._errors import InputError
from ..curve import AbstractCurve
from ._chords import chord_indices
from ._evaluate import between_breaks, breaks_within, curve_at

MOST_POINTS = 8192
RELATIVE_TOLERANCE = 1e-3


def polyline(
    curve: AbstractCurve, *, tolerance: float | None = None, resolution: int | None = None
) -> Float[np.ndarray, "n d"]:
    """Points along a curve, ends included, whose chords stay within `tolerance` of it.

    `tolerance` (default: 1e-3 of the bounding box's diagonal) is a length; `resolution` is a number of
    points, evenly spaced in the parameter. At most 8193 points. Raises `InputError` if both are given or one
    is not positive.
    """
    return curve_at(curve, chord_parameters(curve, tolerance=tolerance, resolution=resolution))


def chord_parameters(
    curve: AbstractCurve, *, tolerance: float | None = None, resolution: int | None = None
) -> Float[np.ndarray, "n"]:
    """The parameters of `polyline`."""
    check_density(tolerance, resolution is not None)
    first, last = (float(end) for end in curve.domain)
    if resolution is not None:
        if resolution < 2:
            raise InputError(f"`resolution` must be at least 2, got {resolution}.")
        return np.linspace(first, last, resolution)
    places, steps = breaks_within(curve, None, first, last), 256
    while True:
        parameters, span = between_breaks(places, steps)
        points = curve_at(curve, parameters)
        wanted = RELATIVE_TOLERANCE * diagonal(points) if tolerance is None else tolerance
        chosen, proved = chord_indices(points[:, None, :], wanted, span)
        if proved or steps >= MOST_POINTS:
            return parameters[chosen]
        steps *= 4


def check_density(tolerance: float | None, resolution_given: bool) -> None:
    """Refuse a tolerance that is not a positive length, and two statements about the same thing."""
    if tolerance is not None and not tolerance > 0:
        raise InputError(f"`tolerance` must be a positive length, got {tolerance}.")
    if tolerance is not None and resolution_given:
        raise InputError("`tolerance` and `resolution` both fix the density of the mesh; give one of them.")


def diagonal(points: Float[np.ndarray, "*n d"]) -> float:
    """Diagonal of the points' bounding box."""
    flat = points.reshape(-1, points.shape[-1])
    return float(np.linalg.norm(flat.max(axis=0) - flat.min(axis=0)))
