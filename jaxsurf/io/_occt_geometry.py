"""Spline arrays as OCCT geometry, and back."""

import numpy as np

from .._errors import InputError
from ._occt_session import occt
from ._spline_arrays import SplineArrays, standard_arrays

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
    return geom.Geom_BSplineSurface(poles, *rational, knots_u, knots_v, counts_u, counts_v, degree_u, degree_v)


def curve_arrays(curve) -> SplineArrays:
    """The arrays of a Geom_BSplineCurve or Geom2d_BSplineCurve."""
    numbers = range(1, curve.NbPoles() + 1)
    points = np.array([_coordinates(curve.Pole(i)) for i in numbers])
    weights = np.array([curve.Weight(i) for i in numbers]) if curve.IsRational() else None
    knots = [(curve.Knot(i), curve.Multiplicity(i)) for i in range(1, curve.NbKnots() + 1)]
    periodic = curve.IsPeriodic()
    return standard_arrays(points, weights, (_flat(knots, periodic),), (curve.Degree(),), (periodic,))


def surface_arrays(surface) -> SplineArrays:
    """The arrays of a Geom_BSplineSurface."""
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    points = np.array([[_coordinates(surface.Pole(i, j)) for j in columns] for i in rows])
    weights = None
    if surface.IsURational() or surface.IsVRational():
        weights = np.array([[surface.Weight(i, j) for j in columns] for i in rows])
    periodic = (surface.IsUPeriodic(), surface.IsVPeriodic())
    knots_u = [(surface.UKnot(i), surface.UMultiplicity(i)) for i in range(1, surface.NbUKnots() + 1)]
    knots_v = [(surface.VKnot(i), surface.VMultiplicity(i)) for i in range(1, surface.NbVKnots() + 1)]
    knots = (_flat(knots_u, periodic[0]), _flat(knots_v, periodic[1]))
    return standard_arrays(points, weights, knots, (surface.UDegree(), surface.VDegree()), periodic)


def _coordinates(point) -> tuple[float, ...]:
    return (point.X(), point.Y(), point.Z()) if hasattr(point, "Z") else (point.X(), point.Y())


def _flat(knots, periodic: bool) -> np.ndarray:
    """Knots with repetitions; periodic ones from the last repetition of the first knot on, one a pole."""
    values, counts = (np.array(column) for column in zip(*knots, strict=True))
    if not periodic:
        return np.repeat(values, counts)
    round_ = np.repeat(values[:-1], counts[:-1])
    start, period = counts[0] - 1, values[-1] - values[0]
    return np.concatenate([round_[start:], round_[: start + 1] + period])


def _knots_and_degree(arrays: SplineArrays, direction: int):
    """Distinct knots, how often each is repeated, and the degree: OCCT's description of one direction."""
    degree = arrays.degrees[direction]
    if degree > LARGEST_DEGREE:
        raise InputError(
            f"Degrees in a CAD file go up to {LARGEST_DEGREE}, got {degree}: lower it with `js.to_bspline(shape, tol)`."
        )
    knots, counts = np.unique(arrays.knots[direction], return_counts=True)
    close = np.flatnonzero(np.diff(knots) <= np.spacing(np.abs(knots[:-1])))
    if len(close):
        raise InputError(
            f"Distinct knots in a CAD file must differ by more than one rounding step, "
            f"got {knots[close[0]]} and {knots[close[0] + 1]}: make them equal."
        )
    collections = occt("collections")
    return _array(collections.Array1_double, knots), _array(collections.Array1_int, counts), degree


def _array(kind, values):
    array = kind(1, len(values))
    for i, value in enumerate(values.tolist(), start=1):
        array.SetValue(i, value)
    return array
