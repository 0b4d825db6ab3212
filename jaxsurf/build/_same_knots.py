"""Splines brought onto common knots and one degree, exactly."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, eps, is_concrete
from ..curve import BSplineCurve, Line, NURBSCurve
from ..edit import _knots
from ..edit._spline_axis import SplineAxis, spline_axis

_NEAR = 64  # roundings of the domain by which knots may differ and be the same


def as_axes(curves: tuple[Any, ...]) -> list[SplineAxis] | None:
    """The control data of curves that are polynomial splines on known knots, or None if one is not."""
    splines = [as_spline(curve) for curve in curves]
    if any(spline is None or not is_concrete(spline.knots) for spline in splines):
        return None
    return [spline_axis(spline) for spline in splines]


def as_spline(curve: Any) -> BSplineCurve | None:
    """B-splines, lines, and NURBS of equal weights as B-spline curves; None for what is none."""
    if isinstance(curve, BSplineCurve):
        return curve
    if isinstance(curve, Line):
        knots = early(lambda: jnp.asarray([0, 0, 1, 1], curve.dtype))
        return BSplineCurve(jnp.stack([curve.start, curve.end]), knots, 1)
    if isinstance(curve, NURBSCurve) and is_concrete(curve.weights):
        weights = concrete(curve.weights)
        return BSplineCurve(curve.control_points, curve.knots, curve.degree) if np.all(weights == weights[0]) else None
    return None


def same_knots(axes: list[SplineAxis], domain: tuple[Any, Any] | None = None) -> list[SplineAxis]:
    """The same splines on the union of their knots, each carried evenly to `domain`, known, or to that of the first.

    They stay periodic if all of them are, and of one degree. Source: The NURBS Book, §10.3 and §5.3, done by blossoms.
    """
    ends = axes[0].ends if domain is None else domain
    a, b = (float(end) for end in ends)
    if not (all(axis.periodic for axis in axes) and len({axis.degree for axis in axes}) == 1):
        axes = [_knots.clamped(axis, "clamp") for axis in axes]
        top = max(axis.degree for axis in axes)
        axes = [_knots.raised(axis, top, "elevate_degree") for axis in axes]
    dtype = axes[0].knots.dtype
    moved = [_carried(axis, a, b) for axis in axes]
    values = np.sort(np.concatenate(moved))
    starts = np.append(True, np.diff(values) > _NEAR * eps(dtype) * max(b - a, abs(a), abs(b)))
    distinct = values[starts]
    distinct[[0, -1]] = a, b
    edges = np.append(values[starts], np.inf)
    snapped = [np.searchsorted(edges, knots, side="right") - 1 for knots in moved]
    counts = np.max([np.bincount(index, minlength=distinct.size) for index in snapped], axis=0)
    union = early(lambda: jnp.asarray(np.repeat(distinct, counts), dtype))
    out = []
    for axis, index in zip(axes, snapped, strict=True):
        own = early(lambda index=index: jnp.asarray(distinct[index], dtype))
        placed = SplineAxis(axis.net, own, axis.degree, axis.periodic)
        same = own.shape == union.shape and np.array_equal(concrete(own), concrete(union))
        out.append(placed if same else _knots.on_knots(placed, union))
    return out


def _carried(axis: SplineAxis, a: float, b: float) -> Float[np.ndarray, "k"]:
    """Known knots carried evenly to the domain [a, b], whose ends are met exactly."""
    knots = concrete(axis.knots).astype(np.float64)
    first, last = (float(end) for end in axis.ends)
    if (first, last) == (a, b):
        return knots
    share = (knots - first) / (last - first)
    return (1 - share) * a + share * b


def product(matrix: Array, net: Array) -> Array:
    """The matrix applied to the first axis of a net."""
    return jnp.tensordot(matrix, net, axes=1, precision="highest")
