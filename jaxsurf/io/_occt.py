"""Our shapes as OCCT geometry and topology: edges for curves, faces for surfaces."""

import functools

from .._errors import InputError
from ..curve import BSplineCurve, NURBSCurve
from ..surface import BSplineSurface, NURBSSurface, TrimmedSurface
from ._occt_geometry import CONFUSION, geometric_surface, space_curve
from ._occt_session import occt, occt_errors
from ._occt_trim import loop_wire
from ._shape_list import each_shape
from ._spline_arrays import spline_arrays


def topologies(shapes, *, function: str) -> list:
    """One shape or a list of shapes as edges and faces; `function` names the caller in errors."""
    return each_shape(shapes, functools.partial(_accepted, function=function), function=function)


def _accepted(shape, *, function: str):
    try:
        return topology(shape, function=function)
    except occt_errors() as error:
        raise InputError(f"{function}: OCCT refuses this {type(shape).__name__} ({error}).") from error


@functools.singledispatch
def topology(shape, *, function: str):
    """The shape as an edge or a face; `function` is the name of the caller for the error messages.

    Raises `InputError` for types that no CAD file knows and flat curves, and OCCT's own errors.
    """
    raise InputError(f"{function} cannot write a {type(shape).__name__}: convert it first with `js.to_bspline(shape, tol)`.")


@topology.register(BSplineCurve)
@topology.register(NURBSCurve)
def _(shape, *, function: str):
    arrays = spline_arrays(shape)
    if arrays.points.shape[-1] != 3:
        raise InputError(f"{function} writes curves in space, got one with 2-D `control_points`: add a third column.")
    return occt("BRepBuilderAPI").BRepBuilderAPI_MakeEdge(space_curve(arrays)).Edge()


@topology.register(BSplineSurface)
@topology.register(NURBSSurface)
def _(shape, *, function: str):
    surface = geometric_surface(spline_arrays(shape))
    return occt("BRepBuilderAPI").BRepBuilderAPI_MakeFace(surface, CONFUSION).Face()


@topology.register
def _(shape: TrimmedSurface, *, function: str):
    if not isinstance(shape.surface, BSplineSurface | NURBSSurface):
        return topology(shape.surface, function=function)  # refuses it
    surface = geometric_surface(spline_arrays(shape.surface))
    outer, *holes = (loop_wire(spline_arrays(loop), surface) for loop in shape.loops)
    maker = occt("BRepBuilderAPI").BRepBuilderAPI_MakeFace(surface, outer, False)
    for hole in holes:
        maker.Add(hole)
    return maker.Face()
