"""Splines through given points."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._safe import norm, unit
from ..basis import BSplineBasis, greville
from ..curve import BSplineCurve
from ..surface import BSplineSurface
from ._banded import band, solve_banded
from ._parameters import spaced_parameters


def interpolate(
    points: Numbers,
    degree: int | tuple[int, int] = 3,
    *,
    closed: bool | tuple[bool, bool] = False,
    parameters: str | Numbers | tuple[Any, Any] = "chord",
    end_tangents: tuple[Numbers, Numbers] | None = None,
) -> Any:
    """The B-spline curve through points (n, 3) or (n, 2), the B-spline surface through a grid (n, m, 3).

    parameters: the spacing "chord", "centripetal" or "uniform" on [0, 1], or ascending numbers (n,). closed:
    the last point leads back to the first and the curve is periodic, C^(degree−1); a last point equal to the
    first is dropped, and given numbers are n + 1, the last for the return. For surfaces degree, closed and
    parameters may be pairs (u, v). end_tangents: directions (3,) at both ends of an open curve; the speed
    there is that of the first and last chord. Knots are means of `degree` neighbouring parameters; closed
    curves have them at the parameters (odd degree) or midway. Differentiable in the points and the
    parameters. Raises `InputError` for too few points, for neighbours that coincide (by index) and for shapes
    that do not fit. Source: The NURBS Book, §9.2.
    """
    points = as_float(points)
    is_curve = points.ndim == 2 and points.shape[1] in (2, 3)
    if not is_curve and not (points.ndim == 3 and points.shape[2] == 3):
        raise InputError(f"`points` must have shape (n, 3), (n, 2) or (n, m, 3), got {points.shape}.")
    if is_concrete(points) and not np.all(np.isfinite(concrete(points))):
        where = np.argwhere(~np.isfinite(concrete(points)))[0].tolist()
        raise InputError(f"`points` must be finite, got {concrete(points)[tuple(where)]} at index {where}.")
    if is_curve:
        if not isinstance(degree, int) or not isinstance(closed, bool):
            raise InputError("`degree` and `closed` of a curve must be single; pairs are for grids.")
        points = _without_return(points) if closed else points
        _check_count(points.shape[0], degree, closed, end_tangents is not None)
        places = spaced_parameters(points, parameters, closed)
        slopes = None if end_tangents is None else _end_slopes(points, places, end_tangents)
        control, knots = _solve(points, places, degree, closed, slopes)
        return BSplineCurve(control, knots, degree, closed)
    if end_tangents is not None:
        raise InputError("`end_tangents` are for curves; a grid of points takes none.")
    return _surface(points, _pair(degree), _pair(closed), parameters)


def _surface(
    points: Float[Array, "n m 3"], degrees: tuple[int, int], closings: tuple[bool, bool], parameters: Any
) -> BSplineSurface:
    """All columns together, then all rows of the control points so found."""
    spacings = parameters if isinstance(parameters, tuple) else (parameters, parameters)
    if len(spacings) != 2:
        raise InputError(f"`parameters` of a surface must be one or a pair (u, v), got {len(spacings)}.")
    places = []
    for axis, name in enumerate("uv"):
        if closings[axis]:
            points = jnp.swapaxes(_without_return(jnp.swapaxes(points, 0, axis)), 0, axis)
        _check_count(points.shape[axis], degrees[axis], closings[axis], False, f" in {name}")
    for axis, name in enumerate("uv"):
        lines = jnp.swapaxes(points, 0, axis)
        places.append(spaced_parameters(lines, spacings[axis], closings[axis], f"parameters` in `{name}"))
    control, knots = points, []
    for axis in (0, 1):
        lines = jnp.swapaxes(control, 0, axis)
        solved, along = _solve(lines, places[axis], degrees[axis], closings[axis], None)
        control = jnp.swapaxes(solved, 0, axis)
        knots.append(along)
    return BSplineSurface(control, knots[0], knots[1], degrees[0], degrees[1], closings[0], closings[1])


@eqx.filter_jit
def _solve(
    points: Float[Array, "n *rows d"],
    places: Float[Array, "k"],
    degree: int,
    closed: bool,
    slopes: Float[Array, "2 d"] | None,
) -> tuple[Float[Array, "n2 *rows d"], Float[Array, "k2"]]:
    """Control points and knots of the spline that is at `points` at `places`, along the first axis.

    `slopes` are its derivatives at both ends, two equations more.
    """
    right = points.reshape(points.shape[0], -1)
    if closed:
        knots = places if degree % 2 else _midway(places)
        matrix = BSplineBasis(knots, degree, periodic=True).matrix(places[:-1])
        solved = jnp.linalg.solve(matrix, right)
        return solved.reshape(points.shape), knots
    doubled = places if slopes is None else jnp.concatenate([places[:1], places, places[-1:]])
    # the means of `averaged_knots` at once: thousands of points, one operation
    inner = greville(doubled, degree)
    knots = jnp.concatenate([jnp.repeat(places[:1], degree + 1), inner, jnp.repeat(places[-1:], degree + 1)])
    basis = BSplineBasis(knots, degree)
    first, values = jax.vmap(basis.local)(places)
    rows = jnp.stack(values, axis=1)
    if slopes is not None:
        ends = degree / jnp.stack([knots[degree + 1] - knots[1], knots[-2] - knots[-degree - 2]])
        row = jnp.zeros((2, degree + 1), rows.dtype)
        row = row.at[0, :2].set(jnp.stack([-ends[0], ends[0]])).at[1, -2:].set(jnp.stack([-ends[1], ends[1]]))
        rows = jnp.concatenate([rows[:1], row[:1], rows[1:-1], row[1:], rows[-1:]])
        first = jnp.concatenate([first[:1], first[:1], first[1:-1], first[-1:], first[-1:]])
        right = jnp.concatenate([right[:1], slopes[:1], right[1:-1], slopes[1:], right[-1:]])
    solved = solve_banded(band(first, rows, degree), right)
    return solved.reshape(-1, *points.shape[1:]), knots


def _midway(places: Float[Array, "k"]) -> Float[Array, "k"]:
    """Knots of a closed curve of even degree: with knots at the parameters the equations may be singular."""
    between = (places[:-1] + places[1:]) / 2
    return jnp.concatenate([between[-1:] - (places[-1] - places[0]), between])


def _end_slopes(
    points: Float[Array, "n d"], places: Float[Array, "n"], end_tangents: tuple[Numbers, Numbers]
) -> Float[Array, "2 d"]:
    directions = jnp.stack([as_float(tangent, points.dtype) for tangent in end_tangents])
    if directions.shape != (2, points.shape[1]):
        raise InputError(f"`end_tangents` must be two directions ({points.shape[1]},), got shape {directions.shape}.")
    if is_concrete(directions) and not np.all(np.any(concrete(directions) != 0, axis=1)):
        raise InputError("`end_tangents` must be directions, got a zero vector.")
    chords = jnp.stack([points[1] - points[0], points[-1] - points[-2]])
    steps = jnp.stack([places[1] - places[0], places[-1] - places[-2]])
    return unit(directions) * (norm(chords) / steps)[:, None]


def _without_return(points: Float[Array, "n *rows d"]) -> Float[Array, "n2 *rows d"]:
    """Closed points without the first repeated at the end; by value, so only concrete data lose it."""
    if is_concrete(points) and points.shape[0] > 1 and np.array_equal(concrete(points[0]), concrete(points[-1])):
        return points[:-1]
    return points


def _check_count(count: int, degree: int, closed: bool, tangents: bool, where: str = "") -> None:
    if degree < 1:
        raise InputError(f"`degree` must be at least 1, got {degree}.")
    if closed and tangents:
        raise InputError("`end_tangents` are for open curves; a closed one has no ends.")
    if closed and count < 3:
        raise InputError(f"`points` of a closed spline must be at least 3{where}, got {count} different ones.")
    needed = max(degree + 1 - 2 * tangents, 2)
    if not closed and count < needed:
        raise InputError(
            f"`points` must be at least {needed}{where} for degree {degree}, got {count}; "
            f"give more points or a lower `degree`."
        )


def _pair(value: Any) -> tuple[Any, Any]:
    return value if isinstance(value, tuple) else (value, value)
