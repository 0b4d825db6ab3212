"""Rhino files (3DM) through rhino3dm."""

import functools
import os
from pathlib import Path
from typing import Any

from .._atomic import check_writable, replacing
from .._errors import InputError, import_optional
from ..curve import BSplineCurve, NURBSCurve
from ..surface import BSplineSurface, NURBSSurface, TrimmedSurface
from ._shape_list import each_shape
from ._spline_arrays import SplineArrays, spline_arrays
from ._units import check_unit

RHINO_UNITS = {"mm": "Millimeters", "cm": "Centimeters", "m": "Meters", "in": "Inches"}


def write_3dm(path: str | os.PathLike, shapes: Any, *, unit: str = "mm") -> None:
    """Write one shape or a list of shapes to a Rhino file, in their order.

    `shapes`: B-spline and NURBS curves in space and surfaces; periodic and unclamped ones are written
    clamped. Numbers in the file are the shapes' own; `unit` ("mm", "cm", "m" or "in") says what they mean.
    Raises `InputError` for other shapes, values that are not finite, unknown units and bad paths.
    """
    path = Path(path)
    unit = check_unit(unit)
    check_writable(path)
    rhino = _rhino()
    model = rhino.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino.UnitSystem, RHINO_UNITS[unit])
    for geometry in each_shape(shapes, _geometry, function="write_3dm"):
        model.Objects.Add(geometry)
    with replacing(path) as temporary:
        if not model.Write(str(temporary), 0):
            raise InputError(f"Cannot write {str(path)!r}: rhino3dm could not write the file; check the space on the disk.")


def _rhino():
    return import_optional("rhino3dm", extra="cad", purpose="Rhino files")


@functools.singledispatch
def _geometry(shape):
    """A shape as a rhino3dm object."""
    raise InputError(f"write_3dm cannot write a {type(shape).__name__}: convert it with `js.to_bspline(shape, tol)`.")


@_geometry.register
def _(shape: TrimmedSurface):
    raise InputError("write_3dm writes whole surfaces only, got a TrimmedSurface: write a STEP file (`js.io.write_step`).")


@_geometry.register(BSplineCurve)
@_geometry.register(NURBSCurve)
def _(shape):
    arrays = spline_arrays(shape)
    if arrays.points.shape[-1] != 3:
        raise InputError("write_3dm writes curves in space, got one with 2-D `control_points`: add a third column.")
    count, order = len(arrays.points), arrays.degrees[0] + 1
    curve = _rhino().NurbsCurve(3, arrays.weights is not None, order, count)
    for i, point in enumerate(_homogeneous_points(arrays)):
        curve.Points[i] = point
    _set_knots(curve.Knots, arrays, 0)
    return _checked(curve, shape)


@_geometry.register(BSplineSurface)
@_geometry.register(NURBSSurface)
def _(shape):
    arrays = spline_arrays(shape)
    rows, columns = arrays.points.shape[:2]
    orders = (degree + 1 for degree in arrays.degrees)
    surface = _rhino().NurbsSurface.Create(3, arrays.weights is not None, *orders, rows, columns)
    for i, point in enumerate(_homogeneous_points(arrays)):
        surface.Points[divmod(i, columns)] = point
    _set_knots(surface.KnotsU, arrays, 0)
    _set_knots(surface.KnotsV, arrays, 1)
    return _checked(surface, shape)


def _homogeneous_points(arrays: SplineArrays):
    make = _rhino().Point4d
    points = arrays.points.reshape(-1, 3)
    weights = [1.0] * len(points) if arrays.weights is None else arrays.weights.reshape(-1).tolist()
    for (x, y, z), w in zip(points.tolist(), weights, strict=True):
        yield make(x * w, y * w, z * w, w)


def _set_knots(target, arrays: SplineArrays, direction: int) -> None:
    # Rhino leaves out the first and the last knot, which no point of the shape depends on.
    for i, knot in enumerate(arrays.knots[direction][1:-1].tolist()):
        target[i] = knot


def _checked(geometry, shape):
    if not geometry.IsValid:
        raise InputError(
            f"write_3dm: Rhino refuses this {type(shape).__name__}; look for coinciding control points and tiny knot spans."
        )
    return geometry
