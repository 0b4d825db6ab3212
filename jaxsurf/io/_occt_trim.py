"""Trimming loops as OCCT wires: plane curves, edges in space and the honest distance between them."""

import numpy as np

from ._occt_geometry import CONFUSION, plane_curve
from ._occt_session import occt
from ._spline_arrays import SplineArrays

# The edges in space are fitted this close to the surface, in multiples of the edge's size.
EDGE_TOLERANCE = 1e-8


def loop_wire(loop: SplineArrays, surface):
    """A closed wire on the Geom_Surface along a closed plane curve: one edge between each two corners.

    Every edge carries its plane curve, a curve in space and, as its tolerance, their measured distance. Two
    straight pieces on both sides of the seam of a closed surface become one edge, used twice.
    """
    pieces = smooth_pieces(loop)
    curves = [plane_curve(piece) for piece in pieces]
    vertices = _vertices(curves, surface)
    builder, topods = occt("BRep").BRep_Builder(), occt("TopoDS")
    wire, edges = topods.TopoDS_Wire(), []
    builder.MakeWire(wire)
    for i, curve in enumerate(curves):
        start, end = vertices[i], vertices[(i + 1) % len(curves)]
        across = [k for k in range(i) if _lie_across_a_seam(pieces[k], pieces[i], surface)]
        if across:
            k = across[0]
            back = SplineArrays(pieces[i].points[::-1], None, pieces[k].knots, pieces[k].degrees)
            place = occt("TopLoc").TopLoc_Location()
            builder.UpdateEdge(edges[k], curves[k], plane_curve(back), surface, place, CONFUSION)
            edges.append(edges[k].Reversed())
        elif _extent(curve, surface) < CONFUSION:
            edges.append(_point_edge(curve, surface, start, builder))
        else:
            edges.append(_edge(curve, surface, start, end, builder))
        builder.Add(wire, edges[-1])
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


def _vertices(curves, surface) -> list:
    """One vertex where each curve starts, the same one wherever the loop comes back to a point in space."""
    points = [_on_surface(curve, curve.FirstParameter(), surface) for curve in curves]
    vertices = []
    for point in points:
        known = [vertices[k] for k in range(len(vertices)) if points[k].Distance(point) < CONFUSION]
        made = known[:1] or [occt("BRepBuilderAPI").BRepBuilderAPI_MakeVertex(point).Vertex()]
        vertices.append(made[0])
    return vertices


def _lie_across_a_seam(one: SplineArrays, other: SplineArrays, surface) -> bool:
    """Whether two straight pieces are the same line in space, run through in opposite senses."""
    if len(one.points) != 2 or len(other.points) != 2 or np.allclose(one.points, other.points[::-1], atol=0):
        return False
    fractions = np.linspace(0, 1, 9)[:, None]
    places = one.points[0] + fractions * (one.points[1] - one.points[0])
    across = other.points[1] + fractions * (other.points[0] - other.points[1])
    return all(
        surface.Value(*place).Distance(surface.Value(*mirror)) < CONFUSION
        for place, mirror in zip(places.tolist(), across.tolist(), strict=True)
    )


def _point_edge(curve, surface, vertex, builder):
    """The edge along a side of the surface that is a single point in space."""
    edge, orientation = occt("TopoDS").TopoDS_Edge(), occt("TopAbs").TopAbs_Orientation
    builder.MakeEdge(edge)
    builder.UpdateEdge(edge, curve, surface, occt("TopLoc").TopLoc_Location(), CONFUSION)
    builder.Add(edge, vertex.Oriented(orientation.TopAbs_FORWARD))
    builder.Add(edge, vertex.Oriented(orientation.TopAbs_REVERSED))
    builder.Range(edge, curve.FirstParameter(), curve.LastParameter())
    builder.Degenerated(edge, True)
    return edge


def _edge(curve, surface, start, end, builder):
    first, last = curve.FirstParameter(), curve.LastParameter()
    edge = occt("BRepBuilderAPI").BRepBuilderAPI_MakeEdge(curve, surface, start, end, first, last).Edge()
    accuracy = max(CONFUSION, EDGE_TOLERANCE * _extent(curve, surface))
    occt("BRepLib").BRepLib.BuildCurve3d_s(edge, accuracy)
    distance = _distance(edge, curve, surface)
    builder.UpdateEdge(edge, max(CONFUSION, distance))
    for vertex in (start, end):
        builder.UpdateVertex(vertex, max(CONFUSION, distance))
    return edge


def _distance(edge, curve, surface) -> float:
    """The largest distance between the edge in space and its plane curve on the surface."""
    on_surface = occt("Adaptor3d").Adaptor3d_CurveOnSurface(
        occt("Geom2dAdaptor").Geom2dAdaptor_Curve(curve), occt("GeomAdaptor").GeomAdaptor_Surface(surface)
    )
    measure = occt("BRepLib").BRepLib_ValidateEdge(occt("BRepAdaptor").BRepAdaptor_Curve(edge), on_surface, True)
    measure.Process()
    return measure.GetMaxDistance()


def _extent(curve, surface) -> float:
    parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), 17).tolist()
    points = [_on_surface(curve, t, surface) for t in parameters]
    return float(np.ptp([(p.X(), p.Y(), p.Z()) for p in points], axis=0).max())


def _on_surface(curve, parameter: float, surface):
    place = curve.Value(parameter)
    return surface.Value(place.X(), place.Y())
