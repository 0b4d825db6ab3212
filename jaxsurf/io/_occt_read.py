"""OCCT topology as our shapes: faces as surfaces, free edges as curves."""

import warnings
from typing import Any

import numpy as np

from .._errors import InputError
from ..curve import BSplineCurve, NURBSCurve
from ..surface import BSplineSurface, NURBSSurface, TrimmedSurface
from ._occt_geometry import curve_arrays, surface_arrays
from ._occt_loops import OpenLoopError, face_loops, signed_area, turned
from ._occt_session import occt, occt_errors
from ._spline_arrays import SplineArrays

# How closely, in multiples of the parameter box, a face's outline must follow the box to count as untrimmed.
BOX_TOLERANCE = 1e-7


def shapes_of(topology, *, source: str, faces: int = 0) -> list[Any]:
    """Every face and every free edge of an OCCT shape, in its order; what has no usable outline is left out.

    A warning counts what was left out; `source`: the file's name for it, `faces`: how many the file promises.
    """
    shapes, found, troubles = [], 0, []
    for part in _leaves(topology):
        is_edge = _is(part, "EDGE")
        found += not is_edge
        try:
            shapes.append(_curve(part) if is_edge else _surface(part))
        except (OpenLoopError, InputError, *occt_errors()) as error:
            troubles.append(str(error).rstrip("."))
    lost = max(faces - found, 0) + len(troubles)
    if lost:
        reason = troubles[0] if troubles else "OCCT could not translate them"
        warnings.warn(f"{lost} of the shapes in {source!r} cannot be read and are left out: {reason}.", stacklevel=3)
    return shapes


def _is(part, kind: str) -> bool:
    return part.ShapeType() == getattr(occt("TopAbs").TopAbs_ShapeEnum, f"TopAbs_{kind}")


def _is_reversed(part) -> bool:
    return part.Orientation() == occt("TopAbs").TopAbs_Orientation.TopAbs_REVERSED


def _leaves(part):
    topods = occt("TopoDS")
    if _is(part, "FACE"):
        yield topods.TopoDS.Face(part)
    elif _is(part, "EDGE"):
        edge = topods.TopoDS.Edge(part)
        if not occt("BRep").BRep_Tool.Degenerated_s(edge):
            yield edge
    else:
        iterator = topods.TopoDS_Iterator(part)
        while iterator.More():
            yield from _leaves(iterator.Value())
            iterator.Next()


def _curve(edge):
    adaptor = occt("BRepAdaptor").BRepAdaptor_Curve(edge)
    first, last = adaptor.FirstParameter(), adaptor.LastParameter()
    geometry = occt("BRep").BRep_Tool.Curve_s(edge, first, last)
    trimmed = occt("Geom").Geom_TrimmedCurve(geometry, first, last)
    arrays = curve_arrays(occt("GeomConvert").GeomConvert.CurveToBSplineCurve_s(trimmed))
    if _is_reversed(edge):
        arrays = turned(arrays)
    (knots,), (degree,) = arrays.knots, arrays.degrees
    if arrays.weights is None:
        return BSplineCurve(arrays.points, knots, degree)
    return NURBSCurve(arrays.points, arrays.weights, knots, degree)


def _surface(face):
    """A face as a surface; S_u x S_v points to the face's outer side."""
    topods, tool = occt("TopoDS").TopoDS, occt("BRep").BRep_Tool
    forward = topods.Face(face.Oriented(occt("TopAbs").TopAbs_Orientation.TopAbs_FORWARD))
    geometry = tool.Surface_s(forward)
    loops = face_loops(forward)
    box = _box(loops, geometry)
    spline, plane = occt("Geom").Geom_BSplineSurface, occt("Geom").Geom_Plane
    if _fills(loops, box):
        arrays, loops = surface_arrays(_restricted(geometry, box)), []
    elif isinstance(geometry, spline):
        arrays = surface_arrays(geometry)
    elif isinstance(geometry, plane):
        arrays = _parallelogram(loops, geometry)
        loops = loops if arrays is None else []
        arrays = arrays or surface_arrays(_restricted(geometry, box))
    else:
        # The NURBS form has other parameters than angles: OCCT carries the outline over.
        forward = topods.Face(occt("BRepBuilderAPI").BRepBuilderAPI_NurbsConvert(forward, True).Shape())
        arrays, loops = surface_arrays(tool.Surface_s(forward)), face_loops(forward, converted=True)
    if _is_reversed(face):
        arrays, loops = _flipped(arrays, loops)
    surface = _spline_surface(arrays)
    if not loops:
        return surface
    return TrimmedSurface(surface, tuple(BSplineCurve(loop.points, loop.knots[0], loop.degrees[0]) for loop in loops))


def _box(loops: list[SplineArrays], geometry) -> np.ndarray:
    """The smallest and the largest (u, v) of the outline, of the whole surface if the face has no wires."""
    if not loops:
        u0, u1, v0, v1 = geometry.Bounds()
        return np.array([[u0, v0], [u1, v1]])
    return np.array([loops[0].points.min(axis=0), loops[0].points.max(axis=0)])


def _fills(loops: list[SplineArrays], box: np.ndarray) -> bool:
    """Whether the only loop is the border of its box."""
    if not loops:
        return True
    width = box[1] - box[0]
    on_border = np.minimum(loops[0].points - box[0], box[1] - loops[0].points) <= BOX_TOLERANCE * width
    same_area = abs(signed_area(loops[0]) - width[0] * width[1]) <= 4 * BOX_TOLERANCE * width[0] * width[1]
    return len(loops) == 1 and bool(np.all(np.any(on_border, axis=1))) and bool(same_area)


def _parallelogram(loops: list[SplineArrays], geometry) -> SplineArrays | None:
    """The bilinear patch on the four corners of a plane face; None if its outline is anything else."""
    outline = loops[0]
    if len(loops) > 1 or outline.points.shape[0] != 5 or outline.degrees != (1,):
        return None
    a, b, c, d, _ = outline.points
    size = np.ptp(outline.points, axis=0).max()
    if np.abs(a - b + c - d).max() > BOX_TOLERANCE * size:
        return None
    corners = [geometry.Value(*place) for place in (a.tolist(), d.tolist(), b.tolist(), c.tolist())]
    points = np.array([(corner.X(), corner.Y(), corner.Z()) for corner in corners]).reshape(2, 2, 3)
    lengths = (float(np.linalg.norm(b - a)), float(np.linalg.norm(d - a)))
    return SplineArrays(points, None, tuple(np.array([0, 0, end, end]) for end in lengths), (1, 1))


def _restricted(geometry, box: np.ndarray):
    """A Geom_BSplineSurface over the box, exact for all surfaces of STEP but offset ones."""
    u0, u1, v0, v1 = geometry.Bounds()
    whole = np.array([[u0, v0], [u1, v1]])
    close = np.abs(box - whole) <= BOX_TOLERANCE * (box[1] - box[0])
    around = np.array([geometry.IsUPeriodic(), geometry.IsVPeriodic()])
    # A box once round a closed surface may start anywhere, but OCCT stumbles unless it starts at the seam.
    around &= box[1] - box[0] >= (1 - BOX_TOLERANCE) * (whole[1] - whole[0])
    (u0, v0), (u1, v1) = np.where(close | around, whole, box).tolist()
    full_u, full_v = np.all(close | around, axis=0).tolist()
    if isinstance(geometry, occt("Geom").Geom_BSplineSurface):
        spline = geometry.Copy()
        if not (full_u and full_v):
            spline.CheckAndSegment(u0, u1, v0, v1)
        return spline
    trimmed = occt("Geom").Geom_RectangularTrimmedSurface
    if not full_u and not full_v:
        geometry = trimmed(geometry, u0, u1, v0, v1)
    elif not full_u:
        geometry = trimmed(geometry, u0, u1, True)
    elif not full_v:
        geometry = trimmed(geometry, v0, v1, False)
    return occt("GeomConvert").GeomConvert.SurfaceToBSplineSurface_s(geometry)


def _flipped(arrays: SplineArrays, loops: list[SplineArrays]) -> tuple[SplineArrays, list[SplineArrays]]:
    """Run u backwards, so that the normal turns round; loops keep their sense."""
    knots_u, knots_v = arrays.knots
    both = knots_u[arrays.degrees[0]] + knots_u[-arrays.degrees[0] - 1]
    weights = None if arrays.weights is None else arrays.weights[::-1]
    flipped = SplineArrays(arrays.points[::-1], weights, (both - knots_u[::-1], knots_v), arrays.degrees)
    mirror, shift = np.array([-1.0, 1.0]), np.array([both, 0.0])
    return flipped, [turned(SplineArrays(loop.points * mirror + shift, None, loop.knots, loop.degrees)) for loop in loops]


def _spline_surface(arrays: SplineArrays) -> BSplineSurface | NURBSSurface:
    (knots_u, knots_v), (degree_u, degree_v) = arrays.knots, arrays.degrees
    if arrays.weights is None:
        return BSplineSurface(arrays.points, knots_u, knots_v, degree_u, degree_v)
    return NURBSSurface(arrays.points, arrays.weights, knots_u, knots_v, degree_u, degree_v)
