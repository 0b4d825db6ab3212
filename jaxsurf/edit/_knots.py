"""Knot operations along one direction of a spline, as products with refinement matrices (blossoms)."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, is_concrete
from ..basis import elevated_knots, extend_periodic, inserted_knots, refinement_matrix
from ._blossom import known_elevation, known_refinement
from ._spline_axis import SplineAxis, concrete_knots


def inserted(axis: SplineAxis, new: Float[Array, "m"]) -> SplineAxis:
    """The same spline on more knots; the new ones lie inside the domain."""
    return on_knots(axis, early(inserted_knots, axis.knots, new))


def on_knots(axis: SplineAxis, finer: Float[Array, "k2"]) -> SplineAxis:
    """The same spline on knots that contain its own within the domain, as periodic as before.

    Outside the domain the knots may be any: a control point is the blossom at its own knots (Ramshaw,
    Blossoming).
    """
    matrix = early(finer_matrix, axis.knots, finer, axis.degree, axis.periodic)
    return SplineAxis(_product(matrix, axis.net), finer, axis.degree, axis.periodic)


def finer_matrix(knots: Float[Array, "k"], finer: Float[Array, "k2"], degree: int, periodic: bool) -> Float[Array, "n2 n"]:
    """From control points on `knots` to those on `finer`; of periodic splines, knots of one period."""
    if periodic:
        count, finer_count = knots.shape[0] - 1, finer.shape[0] - 1
        knots, finer = extend_periodic(knots, degree), extend_periodic(finer, degree)
    if is_concrete(knots, finer):
        known, known_finer = (concrete(each).astype(np.float64) for each in (knots, finer))
        matrix = jnp.asarray(known_refinement(known, known_finer, degree), knots.dtype)
    else:
        matrix = refinement_matrix(knots, finer, degree)
    if not periodic:
        return matrix
    folded = jnp.zeros((finer_count, count), matrix.dtype)
    return folded.at[:, np.arange(count + degree) % count].add(matrix[:finer_count])


def without(axis: SplineAxis, kept: np.ndarray) -> SplineAxis:
    """The nearest spline, in least squares of control points, on the known knots whose indices are `kept`."""
    coarse = early(lambda knots: knots[kept], axis.knots)
    matrix = early(finer_matrix, coarse, axis.knots, axis.degree, axis.periodic)
    inverse = jnp.asarray(np.linalg.pinv(concrete(matrix)), matrix.dtype)
    return SplineAxis(_product(inverse, axis.net), coarse, axis.degree, axis.periodic)


def elevated(axis: SplineAxis, function: str) -> SplineAxis:
    """The same spline one degree higher; a periodic one comes out ordinary: its seam knot would be double."""
    axis = unrolled(axis)
    values = concrete_knots(axis, function).astype(np.float64)
    knots = early(elevated_knots, axis.knots, axis.degree)
    matrix = known_elevation(values, concrete(knots).astype(np.float64), axis.degree)
    net = _product(jnp.asarray(matrix, axis.net.dtype), axis.net)
    return SplineAxis(net, knots, axis.degree + 1)


def raised(axis: SplineAxis, degree: int, function: str) -> SplineAxis:
    """The same spline of a degree that is not lower."""
    for _ in range(degree - axis.degree):
        axis = elevated(axis, function)
    return axis


def unrolled(axis: SplineAxis) -> SplineAxis:
    """An ordinary spline: the first `degree` control points repeated at the end, the knots continued."""
    if not axis.periodic:
        return axis
    count = axis.net.shape[0]
    net = axis.net[np.arange(count + axis.degree) % count]
    return SplineAxis(net, early(extend_periodic, axis.knots, axis.degree), axis.degree)


def clamped(axis: SplineAxis, function: str) -> SplineAxis:
    """An ordinary spline from its first control point to its last; a periodic one closes bit for bit."""
    closed, axis = axis.periodic, unrolled(axis)
    values = concrete_knots(axis, function)
    a, b = values[axis.degree], values[-axis.degree - 1]
    inner = values[(values > a) & (values < b)]
    wanted = np.concatenate([np.full(axis.degree + 1, a), inner, np.full(axis.degree + 1, b)])
    if np.array_equal(values, wanted):
        return axis
    result = on_knots(axis, early(jnp.asarray, wanted))
    if not closed:
        return result
    return SplineAxis(result.net.at[-1].set(result.net[0]), result.knots, result.degree)


def halves(axis: SplineAxis, at: np.ndarray, function: str) -> tuple[SplineAxis, SplineAxis]:
    """The parts before and after `at`, clamped there; a periodic spline is cut at its seam as well."""
    axis = unrolled(axis)
    values, degree = concrete_knots(axis, function), axis.degree
    before, after = values[values < at], values[values > at]
    knots = np.concatenate([before, np.full(degree + 1, at, values.dtype), after])
    whole = on_knots(axis, early(jnp.asarray, knots))
    first = before.size
    return (
        SplineAxis(whole.net[:first], early(jnp.asarray, knots[: first + degree + 1]), degree),
        SplineAxis(whole.net[first:], early(jnp.asarray, knots[first:]), degree),
    )


def _product(matrix: Float[Array, "n m"], net: Float[Array, "m *rest"]) -> Float[Array, "n *rest"]:
    return jnp.tensordot(matrix, net, axes=1, precision="highest")
