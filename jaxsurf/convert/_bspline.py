"""Any shape as a B-spline within a tolerance."""

from functools import singledispatch
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import as_float, concrete, eps, is_concrete
from .._errors import InputError
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve, breaks
from ..surface import AbstractSurface, BSplineSurface, NURBSSurface, TrimmedSurface
from ._adaptive import (
    SAFETY,
    Sample,
    Unreachable,
    adapted,
    amid,
    clamped,
    dense_parts,
    interpolation,
    largest_errors,
    sites,
)
from ._sample import BLOCK, curve_jets, curve_values, grid_values, spline_values, surface_jets
from ._smoothness import Jets, multiplicities

_MOST = {1: 100_000, 2: 3_000}  # control points per direction, of curves and of surfaces
_JETS = 3  # derivatives looked at in judging how smooth a break is


class Conversion(eqx.Module):
    """A B-spline in place of another shape, and the largest distance measured at equal parameters."""

    shape: Any
    max_error: Float[Array, ""]


@singledispatch
def to_bspline(shape: Any, tol: float, *, degree: int = 3) -> Conversion:
    """A B-spline with the domain and parameters of `shape`, nowhere further from it than `tol` (a length).

    B-splines are returned as they are, NURBS of equal weights with their knots, trimmed surfaces with their
    loops. All else is interpolated at Greville abscissae on knots that are refined until the error, measured
    between the sites at equal parameters, at least three times as densely, is within `tol`; it falls with the
    power degree + 1 of the spacing. Between breaks the spline is C^(degree−1), at breaks as smooth as the
    shape. degree: at least 2, of all directions. Raises `InputError` for a tolerance that the floating type
    or the shape does not allow, with the error reached, for a shape that jumps, and under tracing. A class
    gives its own rule by `@to_bspline.register`. Source: The NURBS Book, §9.2; de Boor, A Practical Guide to
    Splines, ch. XII and XIII.
    """
    raise TypeError(f"`to_bspline` expects a curve or a surface, got {type(shape).__name__}.")


@to_bspline.register
def _(shape: AbstractCurve, tol: float, *, degree: int = 3) -> Conversion:
    _check(shape, tol, degree)
    places = np.asarray(breaks(shape), np.float64)
    dtype = shape.dtype
    sample = lambda u: curve_values(shape, u)
    noise, inset = _noise(sample(places), dtype), _inset(places, dtype)
    jets = lambda u: curve_jets(shape, u, min(degree - 1, _JETS))
    times = _multiplicities(sample, jets, places, degree, max(tol, noise), inset)
    _refuse_jumps(shape, places, times, degree, "u")

    def attempt(tolerance: float) -> tuple[BSplineCurve, float]:
        found = adapted(sample, places, times.copy(), degree, tolerance, noise, _MOST[1])
        knots = clamped(found[0], found[1], degree)
        control = interpolation(knots, degree, sample(sites(knots, degree)))
        spline = BSplineCurve(as_float(control, dtype), knots, degree)
        # other places than the refinement looked at, and four times as many
        where = amid(found[0], 4 * dense_parts(len(control), len(found[0]) - 1) + 1)
        where = np.concatenate([where, found[0]])  # of even degree the error peaks at the knots
        return spline, float(np.linalg.norm(curve_values(spline, where) - sample(where), axis=-1).max())

    return _within(attempt, shape, tol)


@to_bspline.register
def _(shape: AbstractSurface, tol: float, *, degree: int = 3) -> Conversion:
    _check(shape, tol, degree)
    places = [np.asarray(along, np.float64) for along in breaks(shape)]
    dtype = shape.dtype
    # One direction at a time, on lines that run through every span of the other.
    lines = [np.unique(np.concatenate([amid(along, degree + 2), along])) for along in places]
    noise = _noise(grid_values(shape, places[0], places[1]), dtype)
    samples = (
        lambda u: grid_values(shape, u, lines[1]),
        lambda v: np.swapaxes(grid_values(shape, lines[0], v), 0, 1),
    )
    times = []
    for axis, name in enumerate("uv"):
        jets = lambda t, axis=axis: surface_jets(shape, t, lines[1 - axis], axis, min(degree - 1, _JETS))
        inset = _inset(places[axis], dtype)
        times.append(_multiplicities(samples[axis], jets, places[axis], degree, max(tol, noise), inset))
        _refuse_jumps(shape, places[axis], times[axis], degree, name)

    def attempt(tolerance: float) -> tuple[BSplineSurface, float]:
        found, knots = [], []
        for sample, start, multiplicity in zip(samples, places, times, strict=True):
            # each direction adds its own error
            found.append(adapted(sample, start, multiplicity.copy(), degree, tolerance / 2, noise, _MOST[2]))
            knots.append(clamped(found[-1][0], found[-1][1], degree))
        values = grid_values(shape, sites(knots[0], degree), sites(knots[1], degree))
        control = interpolation(knots[0], degree, values)
        control = np.swapaxes(interpolation(knots[1], degree, np.swapaxes(control, 0, 1)), 0, 1)
        spline = BSplineSurface(as_float(control, dtype), knots[0], knots[1], degree, degree)
        counts = [len(along) - degree - 1 for along in knots]
        where = [
            np.concatenate([amid(f[0], dense_parts(n, len(f[0]) - 1) + 2), f[0]]) for f, n in zip(found, counts, strict=True)
        ]
        return spline, _grid_error(shape, spline, where[0], where[1])

    return _within(attempt, shape, tol)


@to_bspline.register(BSplineCurve)
@to_bspline.register(BSplineSurface)
def _(shape: BSplineCurve | BSplineSurface, tol: float, *, degree: int = 3) -> Conversion:
    return Conversion(shape, jnp.zeros((), shape.dtype))


@to_bspline.register
def _(shape: NURBSCurve, tol: float, *, degree: int = 3) -> Conversion:
    if not _equal_weights(shape.weights):
        return to_bspline.dispatch(AbstractCurve)(shape, tol, degree=degree)
    spline = BSplineCurve(shape.control_points, shape.knots, shape.degree)
    return Conversion(spline, jnp.zeros((), shape.dtype))


@to_bspline.register
def _(shape: NURBSSurface, tol: float, *, degree: int = 3) -> Conversion:
    if not _equal_weights(shape.weights):
        return to_bspline.dispatch(AbstractSurface)(shape, tol, degree=degree)
    spline = BSplineSurface(shape.control_points, shape.knots_u, shape.knots_v, shape.degree_u, shape.degree_v)
    return Conversion(spline, jnp.zeros((), shape.dtype))


@to_bspline.register
def _(shape: TrimmedSurface, tol: float, *, degree: int = 3) -> Conversion:
    whole = to_bspline(shape.surface, tol, degree=degree)
    return Conversion(TrimmedSurface(whole.shape, shape.loops), whole.max_error)


def _equal_weights(weights: Float[Array, "..."]) -> bool:
    return is_concrete(weights) and bool(np.all(concrete(weights) == concrete(weights).flat[0]))


def _within(attempt: Any, shape: Any, tol: float) -> Conversion:
    """Attempts at ever smaller tolerances, until the error measured afterwards is within `tol`."""
    aim, reached = tol, np.inf
    name = type(shape).__name__
    for _ in range(4):
        try:
            spline, error = attempt(aim)
        except Unreachable as failure:
            raise InputError(
                f"`tol` = {tol:g} cannot be reached for this {name} in {shape.dtype}: with {failure.count} "
                f"control points a direction the error is still {min(failure.error, reached):.2g}; allow more"
                + (" or use double precision." if shape.dtype == jnp.float32 else ".")
            ) from None
        if error <= tol:
            return Conversion(spline, jnp.asarray(error, shape.dtype))
        reached = min(reached, error)
        aim = 0.7 * aim * tol / error
    raise InputError(
        f"`tol` = {tol:g} cannot be reached for this {name} in {shape.dtype}: the best error measured was {reached:.2g}."
    )


def _grid_error(
    shape: AbstractSurface, spline: BSplineSurface, u: Float[np.ndarray, "m"], v: Float[np.ndarray, "k"]
) -> float:
    """Largest distance on a grid, a block of rows at a time: the whole may not fit in memory."""
    worst = 0.0
    for start in range(0, len(u), BLOCK):
        rows = u[start : start + BLOCK]
        off = spline_values(spline, rows, v) - grid_values(shape, rows, v)
        worst = max(worst, float(np.sqrt(np.max(np.sum(off * off, axis=-1)))))
    return worst


def _check(shape: Any, tol: float, degree: int) -> None:
    if not is_concrete(shape):
        raise InputError(
            "`to_bspline` places knots by measured errors and needs concrete numbers; call it outside `jit` and `grad`."
        )
    if not tol > 0:
        raise InputError(f"`tol` must be a positive length, got {tol}.")
    if degree < 2:
        raise InputError(f"`degree` must be at least 2, got {degree}.")


def _multiplicities(
    sample: Sample, jets: Jets, places: np.ndarray, degree: int, tolerance: float, inset: float
) -> np.ndarray:
    """The knot multiplicities of the breaks, all 1 if one polynomial does for the whole domain."""
    ones = np.ones(2, int)
    if largest_errors(sample, places[[0, -1]], ones, degree, places).max() <= SAFETY * tolerance / 2:
        return np.ones(len(places), int)
    return multiplicities(jets, places, degree, tolerance, inset)


def _refuse_jumps(shape: Any, places: np.ndarray, times: np.ndarray, degree: int, name: str) -> None:
    jumps = np.flatnonzero(times[1:-1] > degree)
    if jumps.size:
        raise InputError(
            f"A {type(shape).__name__} that jumps at {name} = {places[jumps[0] + 1]:g} is no B-spline; split it there."
        )


def _noise(points: np.ndarray, dtype: Any) -> float:
    """Round-off of points of this size."""
    return 16 * eps(dtype) * float(np.abs(points).max())


def _inset(places: np.ndarray, dtype: Any) -> float:
    """How far from a break its two sides are told apart by the floating type."""
    return 8 * eps(dtype) * float(np.abs(places).max())
