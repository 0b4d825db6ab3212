"""Trimming loops as OCCT wires: curves in the parameter plane, edges in space, and the honest distance between them."""

import numpy as np

from ._occt_geometry import CONFUSION, plane_curve
from ._occt_session import occt
from ._spline_arrays import SplineArrays

# The edges in space are fitted this close to the surface, in multiples of the edge's size; 1e-9 needs twice the spans.
EDGE_TOLERANCE = 1e-8


def loop_wire(loop: SplineArrays, surface):
    """A closed wire on the Geom_Surface along a closed plane curve: one edge between each two corners.

    Every edge carries its plane curve, a curve in space and, as its tolerance, their measured distance.
    """
    pieces = [plane_curve(piece) for piece in smooth_pieces(loop)]
    shrunk = [_extent(piece, surface) < CONFUSION for piece in pieces]
    vertices = _vertices(pieces, shrunk, surface)
    builder, topods = occt("BRep").BRep_Builder(), occt("TopoDS")
    wire = topods.TopoDS_Wire()
    builder.MakeWire(wire)
    for i, piece in enumerate(pieces):
        builder.Add(
            wire, _edge(piece, surface, vertices[i], vertices[(i + 1) % len(pieces)], shrunk[i], builder)
        )
    wire.Closed(True)
    return wire


def smooth_pieces(loop: SplineArrays) -> list[SplineArrays]:
    """Split a curve where a knot is repeated `degree` times, so that no piece has a corner inside."""
    (knots,), (degree,) = loop.knots, loop.degrees
    inner, counts = np.unique(knots[degree + 1 : -degree - 1], return_counts=True)
    corners = np.searchsorted(knots, inner[counts >= degree], side="right") - degree - 1
    stops = [0, *corners.tolist(), len(loop.points) - 1]
    pieces = []
    for start, stop in zip(stops[:-1], stops[1:], strict=True):
        points = loop.points[start : stop + 1]
        if np.ptp(points, axis=0).max() > 0:
            inside = knots[start + 1 : stop + degree + 1]
            piece_knots = np.concatenate([inside[:1], inside, inside[-1:]])
            pieces.append(SplineArrays(points, None, (piece_knots,), loop.degrees))
    return pieces


def _vertices(pieces, shrunk, surface) -> list:
    """One vertex where each piece starts; the two ends of a piece that is a single point in space share theirs."""
    make = occt("BRepBuilderAPI").BRepBuilderAPI_MakeVertex
    vertices = [make(_on_surface(piece, piece.FirstParameter(), surface)).Vertex() for piece in pieces]
    for _ in range(2):  # twice round: the last piece may hand its vertex to the first
        for i, is_point in enumerate(shrunk):
            if is_point:
                vertices[(i + 1) % len(pieces)] = vertices[i]
    return vertices


def _edge(piece, surface, start, end, is_point, builder):
    first, last = piece.FirstParameter(), piece.LastParameter()
    if is_point:
        edge = occt("TopoDS").TopoDS_Edge()
        builder.MakeEdge(edge)
        builder.UpdateEdge(edge, piece, surface, occt("TopLoc").TopLoc_Location(), CONFUSION)
        builder.Add(edge, start.Oriented(occt("TopAbs").TopAbs_Orientation.TopAbs_FORWARD))
        builder.Add(edge, end.Oriented(occt("TopAbs").TopAbs_Orientation.TopAbs_REVERSED))
        builder.Range(edge, first, last)
        builder.Degenerated(edge, True)
        return edge
    edge = occt("BRepBuilderAPI").BRepBuilderAPI_MakeEdge(piece, surface, start, end, first, last).Edge()
    accuracy = max(CONFUSION, EDGE_TOLERANCE * _extent(piece, surface))
    occt("BRepLib").BRepLib.BuildCurve3d_s(edge, accuracy)
    distance = _distance(edge, piece, surface)
    builder.UpdateEdge(edge, max(CONFUSION, distance))
    for vertex in (start, end):
        builder.UpdateVertex(vertex, max(CONFUSION, distance))
    return edge


def _distance(edge, piece, surface) -> float:
    """The largest distance between the edge in space and its plane curve mapped to the surface, at equal parameters."""
    on_surface = occt("Adaptor3d").Adaptor3d_CurveOnSurface(
        occt("Geom2dAdaptor").Geom2dAdaptor_Curve(piece), occt("GeomAdaptor").GeomAdaptor_Surface(surface)
    )
    measure = occt("BRepLib").BRepLib_ValidateEdge(
        occt("BRepAdaptor").BRepAdaptor_Curve(edge), on_surface, True
    )
    measure.Process()
    return measure.GetMaxDistance()


def _extent(piece, surface) -> float:
    parameters = np.linspace(piece.FirstParameter(), piece.LastParameter(), 17).tolist()
    points = [_on_surface(piece, t, surface) for t in parameters]
    return float(np.ptp([(p.X(), p.Y(), p.Z()) for p in points], axis=0).max())


def _on_surface(piece, parameter: float, surface):
    place = piece.Value(parameter)
    return surface.Value(place.X(), place.Y())
