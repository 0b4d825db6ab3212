"""Spline arrays as OCCT geometry."""

import numpy as np

from .._errors import InputError
from ._occt_session import occt
from ._spline_arrays import SplineArrays

# OCCT's own limit, Geom_BSplineCurve::MaxDegree.
LARGEST_DEGREE = 25
# Precision::Confusion: below this length OCCT takes two points for one.
CONFUSION = 1e-7


def space_curve(arrays: SplineArrays):
    """A Geom_BSplineCurve."""
    collections, geom, point = occt("collections"), occt("Geom"), occt("gp").gp_Pnt
    poles = collections.Array1_gp_Pnt(1, len(arrays.points))
    for i, coordinates in enumerate(arrays.points.tolist(), start=1):
        poles.SetValue(i, point(*coordinates))
    weights = () if arrays.weights is None else (_array(collections.Array1_double, arrays.weights),)
    return geom.Geom_BSplineCurve(poles, *weights, *_knots_and_degree(arrays, 0))


def plane_curve(arrays: SplineArrays):
    """A Geom2d_BSplineCurve, always polynomial."""
    collections, point = occt("collections"), occt("gp").gp_Pnt2d
    poles = collections.Array1_gp_Pnt2d(1, len(arrays.points))
    for i, coordinates in enumerate(arrays.points.tolist(), start=1):
        poles.SetValue(i, point(*coordinates))
    return occt("Geom2d").Geom2d_BSplineCurve(poles, *_knots_and_degree(arrays, 0))


def geometric_surface(arrays: SplineArrays):
    """A Geom_BSplineSurface."""
    collections, geom, point = occt("collections"), occt("Geom"), occt("gp").gp_Pnt
    rows, columns = arrays.points.shape[:2]
    poles = collections.Array2_gp_Pnt(1, rows, 1, columns)
    for i, row in enumerate(arrays.points.tolist(), start=1):
        for j, coordinates in enumerate(row, start=1):
            poles.SetValue(i, j, point(*coordinates))
    rational = ()
    if arrays.weights is not None:
        weights = collections.Array2_double(1, rows, 1, columns)
        for i, row in enumerate(arrays.weights.tolist(), start=1):
            for j, weight in enumerate(row, start=1):
                weights.SetValue(i, j, weight)
        rational = (weights,)
    knots_u, counts_u, degree_u = _knots_and_degree(arrays, 0)
    knots_v, counts_v, degree_v = _knots_and_degree(arrays, 1)
    return geom.Geom_BSplineSurface(
        poles, *rational, knots_u, knots_v, counts_u, counts_v, degree_u, degree_v
    )


def _knots_and_degree(arrays: SplineArrays, direction: int):
    """Distinct knots, how often each is repeated, and the degree: OCCT's description of one direction."""
    degree = arrays.degrees[direction]
    if degree > LARGEST_DEGREE:
        raise InputError(
            f"CAD files go up to degree {LARGEST_DEGREE}, got {degree}: lower it with `js.to_bspline(shape, tol)`."
        )
    knots, counts = np.unique(arrays.knots[direction], return_counts=True)
    close = np.flatnonzero(np.diff(knots) <= np.spacing(np.abs(knots[:-1])))
    if len(close):
        raise InputError(
            f"Distinct knots in a CAD file must differ by more than one rounding step, got {knots[close[0]]!r} and "
            f"{knots[close[0] + 1]!r}: make them equal."
        )
    collections = occt("collections")
    return _array(collections.Array1_double, knots), _array(collections.Array1_int, counts), degree


def _array(kind, values):
    array = kind(1, len(values))
    for i, value in enumerate(values.tolist(), start=1):
        array.SetValue(i, value)
    return array
