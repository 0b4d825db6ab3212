"""The plain arrays of a spline curve or surface, in the one form that every CAD file understands."""

import dataclasses
import functools

import numpy as np

from .._errors import InputError
from ..curve import BSplineCurve, NURBSCurve
from ..surface import BSplineSurface, NURBSSurface


@dataclasses.dataclass(frozen=True)
class SplineArrays:
    """Control data in float64 numpy: clamped at both ends, not periodic, weights only if the shape has them.

    `points`: (*counts, d), one count for a curve and two for a surface; `weights`: (*counts) or None;
    `knots` and `degrees`: one entry per direction, knots with their repetitions (count + degree + 1).
    """

    points: np.ndarray
    weights: np.ndarray | None
    knots: tuple[np.ndarray, ...]
    degrees: tuple[int, ...]


@functools.singledispatch
def spline_arrays(shape) -> SplineArrays:
    """The arrays of a B-spline or NURBS shape, unrolled and clamped where needed, checked to be finite.

    The points of the shape do not move (1e-15 of its size); clamped data come out bit for bit.
    Raises `InputError` for control data that are not finite or a single point, `TypeError` for other shapes.
    """
    raise TypeError(f"spline_arrays is not defined for {type(shape).__name__}.")


@spline_arrays.register
def _(shape: BSplineCurve) -> SplineArrays:
    return _standard(shape, None, ("knots",), (shape.degree,), (shape.periodic,))


@spline_arrays.register
def _(shape: NURBSCurve) -> SplineArrays:
    return _standard(shape, shape.weights, ("knots",), (shape.degree,), (False,))


@spline_arrays.register
def _(shape: BSplineSurface) -> SplineArrays:
    periodic = (shape.periodic_u, shape.periodic_v)
    return _standard(shape, None, ("knots_u", "knots_v"), (shape.degree_u, shape.degree_v), periodic)


@spline_arrays.register
def _(shape: NURBSSurface) -> SplineArrays:
    degrees = (shape.degree_u, shape.degree_v)
    return _standard(shape, shape.weights, ("knots_u", "knots_v"), degrees, (False, False))


def _standard(shape, weights, knot_names, degrees, periodic) -> SplineArrays:
    points = _finite(shape, "control_points", shape.control_points)
    if not np.any(points != points.reshape(-1, points.shape[-1])[0]):
        raise InputError(f"`control_points` of a {type(shape).__name__} are all the same point: leave the shape out.")
    knots = [_finite(shape, name, getattr(shape, name)) for name in knot_names]
    if weights is not None:
        weights = _finite(shape, "weights", weights)
    return standard_arrays(points, weights, knots, degrees, periodic)


def standard_arrays(points, weights, knots, degrees, periodic) -> SplineArrays:
    """Unroll and clamp control data; knots in the library's form, degrees and periodicity per direction."""
    net, knots = points, list(knots)
    if weights is not None:
        net = np.concatenate([points * weights[..., None], weights[..., None]], axis=-1)
    changed = False
    for axis, degree in enumerate(degrees):
        if periodic[axis]:
            net, knots[axis] = _unrolled(net, knots[axis], degree, axis)
        if periodic[axis] or not _is_clamped(knots[axis], degree):
            net, knots[axis] = _clamped(net, knots[axis], degree, axis)
            changed = True
        if periodic[axis]:
            # The seam must close exactly: readers compare the two ends.
            net = np.concatenate([net[_at(axis, slice(0, -1))], net[_at(axis, slice(0, 1))]], axis=axis)
    if weights is None:
        points = net
    elif changed:
        weights = net[..., -1]
        points = net[..., :-1] / weights[..., None]
    return SplineArrays(points, weights, tuple(knots), tuple(int(degree) for degree in degrees))


def _finite(shape, name, values) -> np.ndarray:
    values = np.asarray(values, dtype=np.float64)
    if not np.all(np.isfinite(values)):
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise InputError(
            f"`{name}` of a {type(shape).__name__} must be finite to be written to a file, "
            f"got {values[index]} at index {index}: mend the shape first."
        )
    return values


def _at(axis, index) -> tuple:
    return (slice(None),) * axis + (index,)


def _unrolled(net, knots, degree, axis):
    """Repeat the first `degree` points at the end and continue the knots by one period on each side."""
    count = len(knots) - 1
    net = np.take(net, np.arange(count + degree) % count, axis=axis)
    turns, places = np.divmod(np.arange(-degree, count + degree + 1), count)
    unrolled = knots[places] + turns * (knots[-1] - knots[0])
    # The domain's ends keep their own values; the sum above may differ in the last bit.
    unrolled[degree : degree + count + 1] = knots
    return net, unrolled


def _is_clamped(knots, degree) -> bool:
    return bool(knots[0] == knots[degree] and knots[-1] == knots[-degree - 1])


def _clamped(net, knots, degree, axis):
    """Insert the domain's ends until the end points lie on the shape; drop what lies outside."""
    net = np.moveaxis(net, axis, 0)
    for _ in range(2):  # the start, then the end as the start of the reversed spline
        net, knots = _clamped_start(net, knots, degree)
        net, knots = net[::-1], -knots[::-1]
    return np.moveaxis(net, 0, axis), knots


def _clamped_start(net, knots, degree):
    start = knots[degree]
    while np.count_nonzero(knots == start) < degree:
        net, knots = _inserted(net, knots, degree, start)
    first = np.searchsorted(knots, start, side="right") - degree
    return net[first - 1 :], np.concatenate([[start], knots[first:]])


def _inserted(net, knots, degree, value):
    """Boehm's knot insertion (Boehm 1980) along the first axis."""
    span = np.searchsorted(knots, value, side="right") - 1
    moved = np.arange(span - degree + 1, span + 1)
    ratio = (value - knots[moved]) / (knots[moved + degree] - knots[moved])
    ratio = ratio.reshape(-1, *[1] * (net.ndim - 1))
    blended = (1 - ratio) * net[moved - 1] + ratio * net[moved]
    net = np.concatenate([net[: span - degree + 1], blended, net[span:]])
    return net, np.insert(knots, span + 1, value)
