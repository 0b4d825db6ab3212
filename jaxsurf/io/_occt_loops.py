"""Wires of an OCCT face as closed curves in its parameter plane."""

import numpy as np

from ._occt_geometry import curve_arrays
from ._occt_session import occt
from ._spline_arrays import SplineArrays

# Plane curves that are rational (circles) are approximated this closely, in multiples of their size, with
# this degree: 99 points for a circle. Degree 9 needs 27, but evaluating it takes long to compile.
LOOP_TOLERANCE = 1e-8
LOOP_DEGREE = 5
# Neighbouring edges of other systems' files meet in the parameter plane only so closely.
LOOP_GAP = 1e-3


class OpenLoopError(ValueError):
    """The edges of a wire do not meet in the parameter plane."""


def face_loops(face, *, converted: bool = False) -> list[SplineArrays]:
    """The loops of a forward face, the outer one first and counter-clockwise, holes clockwise, if any.

    `converted`: OCCT made the plane curves, so that high degrees among them may be lowered.
    """
    explorer = occt("TopExp").TopExp_Explorer(face, occt("TopAbs").TopAbs_ShapeEnum.TopAbs_WIRE)
    topods = occt("TopoDS").TopoDS
    wires = []
    while explorer.More():
        wires.append(topods.Wire(explorer.Current()))
        explorer.Next()
    outer = occt("BRepTools").BRepTools.OuterWire_s(face)
    wires.sort(key=lambda wire: not wire.IsSame(outer))  # stable: the holes keep their order
    loops = [_joined(_pieces(wire, face, converted)) for wire in wires]
    return [turned(loop) if (signed_area(loop) < 0) == (i == 0) else loop for i, loop in enumerate(loops)]


def signed_area(loop: SplineArrays) -> float:
    """The area inside the control polygon, positive if it runs counter-clockwise."""
    x, y = (loop.points - loop.points[0]).T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2)


def turned(curve: SplineArrays) -> SplineArrays:
    """The same curve run through from its end; the domain stays."""
    weights = None if curve.weights is None else curve.weights[::-1]
    knots = curve.knots[0][0] + curve.knots[0][-1] - curve.knots[0][::-1]
    return SplineArrays(curve.points[::-1], weights, (knots,), curve.degrees)


def _pieces(wire, face, converted) -> list:
    """The plane curves of a wire's edges in the order and sense of the wire, all polynomial."""
    explorer = occt("BRepTools").BRepTools_WireExplorer(wire, face)
    reversed_ = occt("TopAbs").TopAbs_Orientation.TopAbs_REVERSED
    pieces = []
    while explorer.More():
        edge = explorer.Current()
        piece = _plane_curve(occt("BRepAdaptor").BRepAdaptor_Curve2d(edge, face), converted)
        if edge.Orientation() == reversed_:
            piece.Reverse()
        pieces.append(piece)
        explorer.Next()
    return pieces


def _plane_curve(adaptor, converted):
    first, last = adaptor.FirstParameter(), adaptor.LastParameter()
    trimmed = occt("Geom2d").Geom2d_TrimmedCurve(adaptor.Curve(), first, last)
    convert = occt("Geom2dConvert")
    curve = convert.Geom2dConvert.CurveToBSplineCurve_s(trimmed)
    if curve.IsRational() or (converted and curve.Degree() > LOOP_DEGREE):
        ends = [curve.Value(t) for t in np.linspace(first, last, 9).tolist()]
        size = float(np.ptp([(end.X(), end.Y()) for end in ends], axis=0).max())
        smooth = occt("GeomAbs").GeomAbs_Shape.GeomAbs_C2
        shorter = convert.Geom2dConvert_ApproxCurve(trimmed, LOOP_TOLERANCE * size, smooth, 1000, LOOP_DEGREE)
        curve = shorter.Curve()
    return curve


def _joined(pieces) -> SplineArrays:
    """One closed curve of the highest degree among the pieces, with a corner at each joint."""
    degree = max(piece.Degree() for piece in pieces)
    points, knots = [], []
    end = pieces[0].FirstParameter()
    for piece in pieces:
        piece.IncreaseDegree(degree)
        arrays = curve_arrays(piece)
        inner = arrays.knots[0] + (end - arrays.knots[0][0])
        points.append(arrays.points[:-1])
        knots.append(inner[1 : -degree - 1])
        end = inner[-1]
    _check_closed(pieces)
    closed = np.concatenate([*points, points[0][:1]])
    return SplineArrays(closed, None, (np.concatenate([knots[0][:1], *knots, [end] * (degree + 1)]),), (degree,))


def _check_closed(pieces) -> None:
    ends = np.array([[(p.X(), p.Y()) for p in (piece.StartPoint(), piece.EndPoint())] for piece in pieces])
    gap = np.abs(ends[:, 1] - np.roll(ends[:, 0], -1, axis=0)).max()
    size = np.ptp(ends.reshape(-1, 2), axis=0).max()
    if gap > LOOP_GAP * size and len(pieces) > 1:
        raise OpenLoopError(f"its trimming loop has a gap of {gap:.2g} in the parameter plane")
