"""Our shapes as OCCT geometry and topology: edges for curves, faces for surfaces."""

import functools

from .._errors import InputError
from ..curve import BSplineCurve, NURBSCurve
from ..surface import BSplineSurface, NURBSSurface, TrimmedSurface
from ._occt_geometry import CONFUSION, geometric_surface, space_curve
from ._occt_session import occt
from ._occt_trim import loop_wire
from ._spline_arrays import spline_arrays


@functools.singledispatch
def topology(shape, *, function: str):
    """The shape as an edge or a face; `function` is the name of the caller for the error messages.

    Raises `InputError` for types that no CAD file knows, flat curves and geometry that OCCT refuses.
    """
    raise InputError(
        f"{function} cannot write a {type(shape).__name__}: convert it first with `js.to_bspline(shape, tol)`."
    )


@topology.register(BSplineCurve)
@topology.register(NURBSCurve)
def _(shape, *, function: str):
    arrays = spline_arrays(shape)
    if arrays.points.shape[-1] != 3:
        raise InputError(
            f"{function} writes curves in space, got one with 2-D `control_points`: add a third column."
        )
    maker = occt("BRepBuilderAPI").BRepBuilderAPI_MakeEdge(space_curve(arrays))
    if not maker.IsDone():
        raise InputError(
            f"{function} cannot make an edge of a {type(shape).__name__} ({maker.Error().name}): is its length zero?"
        )
    return maker.Edge()


@topology.register(BSplineSurface)
@topology.register(NURBSSurface)
def _(shape, *, function: str):
    maker = occt("BRepBuilderAPI").BRepBuilderAPI_MakeFace(geometric_surface(spline_arrays(shape)), CONFUSION)
    if not maker.IsDone():
        raise InputError(
            f"{function} cannot make a face of a {type(shape).__name__} ({maker.Error().name}): is its area zero?"
        )
    return maker.Face()


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
