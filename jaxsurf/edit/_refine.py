"""The same spline with more or fewer knots, a higher degree, or other ends."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from .._arguments import early
from .._array import Numbers, as_float, concrete, eps, is_concrete
from .._errors import InputError
from ..curve import NURBSCurve
from ..surface import NURBSSurface
from . import _knots
from ._spline_axis import (
    SPLINES,
    SplineAxis,
    check_direction,
    concrete_knots,
    directions,
    spline_axis,
    with_axis,
)


def insert_knots(shape: Any, knots: Numbers, direction: str | None = None) -> Any:
    """The same B-spline or NURBS shape with further `knots`, (m,), inside its domain.

    A number repeated is inserted repeatedly. For surfaces `direction` is "u" or "v". Periodic shapes stay
    periodic. Differentiable in everything.
    Raises `InputError` for knots outside the domain, and where a knot would occur more than `degree` times.
    Source: Boehm's insertion (The NURBS Book, §5.2), done by blossoms.
    """
    axis = _axis(shape, direction, "insert_knots")
    new = early(lambda values: jnp.atleast_1d(as_float(values, axis.knots.dtype)), knots)
    if new.ndim != 1:
        raise InputError(f"`knots` must have shape (m,), got {new.shape}.")
    if is_concrete(new, axis.knots):
        a, b = (float(end) for end in axis.ends)
        outside = concrete(new)[~((concrete(new) > a) & (concrete(new) < b))]
        if outside.size:
            raise InputError(f"`knots` must lie inside the domain ({a:g}, {b:g}), got {outside[0]:g}.")
    return with_axis(shape, _knots.inserted(axis, new), direction)


def remove_knots(shape: Any, knots: Numbers, direction: str | None = None, *, tolerance: float | None = None) -> Any:
    """The nearest B-spline or NURBS shape without the inner `knots`, (m,).

    A number repeated is removed repeatedly. Least squares on control points through the refinement matrix:
    what was inserted comes out to round-off. `tolerance`, a length (default: 10⁴ roundings of the
    coordinates), bounds the distance between old and new at equal parameters, measured on the control points
    of the difference. Periodic shapes stay periodic.
    Raises `InputError` with that measure if it is above `tolerance` (not under tracing), and if a knot is not
    there.
    """
    axis = _axis(shape, direction, "remove_knots")
    kept = _kept(axis, np.atleast_1d(np.asarray(knots, axis.knots.dtype)))
    coarse = _knots.without(axis, kept)
    if is_concrete(axis, coarse):
        rational = isinstance(shape, NURBSCurve | NURBSSurface)
        back = _knots.on_knots(coarse, axis.knots)
        change, size = _change(concrete(axis.net), concrete(back.net), rational)
        allowed = 1e4 * eps(axis.net.dtype) * size if tolerance is None else tolerance
        if not change <= allowed:
            raise InputError(
                f"`remove_knots` would move the shape by up to {change:.3g}, more than `tolerance` = "
                f"{allowed:.3g}; remove fewer knots or allow more."
            )
    return with_axis(shape, coarse, direction)


def elevate_degree(shape: Any, by: int = 1, direction: str | None = None) -> Any:
    """The same B-spline or NURBS shape with its degree raised `by`, each knot repeated as often more.

    For surfaces `direction` is "u" or "v". A periodic shape comes out ordinary there: its seam would need a
    double knot.
    Raises `InputError` if the knots are traced: how many control points come out depends on them.
    Source: The NURBS Book, §5.5, done by blossoms.
    """
    axis = _axis(shape, direction, "elevate_degree")
    if by < 0 or by != int(by):
        raise InputError(f"`by` must be a whole number ≥ 0, got {by}.")
    return with_axis(shape, _knots.raised(axis, axis.degree + int(by), "elevate_degree"), direction)


def unrolled(shape: Any, direction: str | None = None) -> Any:
    """The same B-spline shape, ordinary instead of periodic, its knots continued beyond the seam.

    For surfaces `direction` is "u" or "v", or None for both. Shapes that are not periodic come back as they
    are.
    """
    for each in _chosen(shape, direction, "unrolled"):
        axis = spline_axis(shape, each)
        if axis.periodic:
            shape = with_axis(shape, _knots.unrolled(axis), each)
    return shape


def clamp(shape: Any, direction: str | None = None) -> Any:
    """The same B-spline or NURBS shape on knots repeated `degree + 1` times at both ends.

    There it meets its control points; this is what CAD files want. Periodic shapes are unrolled, and close
    bit for bit. For surfaces `direction` is "u" or "v", or None for both. Raises `InputError` if the knots
    are traced.
    """
    for each in _chosen(shape, direction, "clamp"):
        axis = spline_axis(shape, each)
        changed = _knots.clamped(axis, "clamp")
        if changed is not axis:
            shape = with_axis(shape, changed, each)
    return shape


def _axis(shape: Any, direction: str | None, function: str) -> SplineAxis:
    _check_spline(shape, function)
    check_direction(shape, direction, function)
    return spline_axis(shape, direction)


def _chosen(shape: Any, direction: str | None, function: str) -> tuple[str | None, ...]:
    _check_spline(shape, function)
    if direction is None:
        return directions(shape)
    check_direction(shape, direction, function)
    return (direction,)


def _check_spline(shape: Any, function: str) -> None:
    if not isinstance(shape, SPLINES):
        raise TypeError(f"{function} is not defined for {type(shape).__name__}; `js.to_bspline` converts any shape.")


def _kept(axis: SplineAxis, removed: np.ndarray) -> np.ndarray:
    """Indices of the knots that stay; each removed number takes the nearest inner knot, up to roundings."""
    values = concrete_knots(axis, "remove_knots")
    a, b = (float(concrete(end)) for end in axis.ends)
    left = np.flatnonzero((values > a) & (values < b)).tolist()
    near = 16 * eps(values.dtype) * max(abs(a), abs(b), b - a)
    for value in removed:
        distances = np.abs(values[left] - value)
        if not distances.size or not np.min(distances) <= near:
            inner = ", ".join(f"{values[i]:g}" for i in left) or "none"
            raise InputError(f"`knots` to remove must be inner knots; {value:g} is not among those left: {inner}.")
        left.pop(int(np.argmin(distances)))
    outer = np.flatnonzero((values <= a) | (values >= b))
    return np.sort(np.concatenate([outer, np.asarray(left, dtype=outer.dtype)]))


def _change(old: np.ndarray, new: np.ndarray, rational: bool) -> tuple[float, float]:
    """A bound of the distance between two shapes on the same knots at equal parameters, and their size.

    |Σ B ΔP| ≤ max |ΔP|. For rational shapes, about a centre c with |P - c| ≤ R: ΔC = (Σ B ΔA - C Σ B Δw) / w,
    hence at most max(|ΔA| + R |Δw|) / min w, A the weighted points.
    """
    if not rational:
        return float(np.max(np.linalg.norm(new - old, axis=-1))), float(np.max(np.abs(old)))
    points = old[..., :-1] / old[..., -1:]
    flat = points.reshape(-1, points.shape[-1])
    center = flat.mean(axis=0)
    radius = np.max(np.linalg.norm(flat - center, axis=-1))
    moved = new - old
    about = np.linalg.norm(moved[..., :-1] - moved[..., -1:] * center, axis=-1)
    lightest = np.min(new[..., -1])
    bound = np.max(about + radius * np.abs(moved[..., -1])) / lightest if lightest > 0 else np.inf
    return float(bound), float(np.max(np.abs(flat)))
