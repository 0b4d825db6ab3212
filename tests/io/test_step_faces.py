"""Faces of other systems: what OCCT's own solids become when their STEP files are read.

OCCT writes 13 digits, hence tolerances of 1e-11.
"""

import jax
import numpy as np
import pytest
from cad_shapes import TRIMMED, TRIMMED_RATIONAL
from scipy.interpolate import BSpline

from jaxsurf.io._occt import topology
from jaxsurf.io._occt_read import shapes_of
from jaxsurf.io._occt_session import occt, quiet_session
from jaxsurf.io._step import read_step
from jaxsurf.surface import TrimmedSurface

jax.config.update("jax_enable_x64", True)

PLACE = np.array([1.0, -2.0, 3.0])
AXIS = np.array([2.0, 1.0, 2.0]) / 3


def solid(kind: str, *sizes: float):
    """One of OCCT's solids at PLACE along AXIS."""
    gp = occt("gp")
    place = gp.gp_Ax2(gp.gp_Pnt(*PLACE.tolist()), gp.gp_Dir(*AXIS.tolist()))
    return getattr(occt("BRepPrimAPI"), f"BRepPrimAPI_Make{kind}")(place, *sizes).Shape()


def read_solid(path, shape) -> list:
    control = occt("STEPControl")
    with quiet_session({}):
        writer = control.STEPControl_Writer()
        writer.Transfer(shape, control.STEPControl_StepModelType.STEPControl_AsIs)
        writer.Write(str(path))
    return read_step(path)


def evaluate(surface, u, v) -> np.ndarray:
    """Points of a clamped spline surface by scipy, one in a row: quicker than compiling each shape."""
    weights = np.asarray(getattr(surface, "weights", np.ones(surface.control_points.shape[:2])))[..., None]
    net = np.concatenate([np.asarray(surface.control_points) * weights, weights], axis=-1)
    rows = BSpline(np.asarray(surface.knots_u), net, surface.degree_u)(np.ravel(u))
    columns = [BSpline(np.asarray(surface.knots_v), r, surface.degree_v)(y) for r, y in zip(rows, np.ravel(v), strict=True)]
    points = np.array(columns)
    return points[:, :3] / points[:, 3:]


def along(curve, count: int = 101) -> np.ndarray:
    """Points of a clamped spline curve, one in a row, by equal steps over its domain."""
    knots = np.asarray(curve.knots)
    return BSpline(knots, np.asarray(curve.control_points), curve.degree)(np.linspace(knots[0], knots[-1], count))


def box(shape) -> np.ndarray:
    """Smallest and largest (u, v) of what counts."""
    if isinstance(shape, TrimmedSurface):
        outline = np.asarray(shape.loops[0].control_points)
        return np.array([outline.min(0), outline.max(0)])
    return np.array([[shape.knots_u[0], shape.knots_v[0]], [shape.knots_u[-1], shape.knots_v[-1]]])


def middle(shape):
    """A point inside the outline, and the unit normal there."""
    (u, v), step = np.array([0.6, 0.4]) @ box(shape), 1e-5
    surface = shape.surface if isinstance(shape, TrimmedSurface) else shape
    a, b, c, d = evaluate(surface, [u - step, u + step, u, u], [v, v, v - step, v + step])
    normal = np.cross(b - a, d - c)
    return (a + b) / 2, normal / np.linalg.norm(normal)


def samples(shape) -> np.ndarray:
    (u0, v0), (u1, v1) = box(shape)
    u, v = np.meshgrid(np.linspace(u0, u1, 23), np.linspace(v0, v1, 17), indexing="ij")
    return evaluate(shape.surface if isinstance(shape, TrimmedSurface) else shape, u, v)


def axial(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height along the axis and distance from it."""
    height = (points - PLACE) @ AXIS
    return height, np.linalg.norm(points - PLACE - height[:, None] * AXIS, axis=-1)


def test_a_box_becomes_six_planes_that_look_outwards(tmp_path):
    shapes = read_solid(tmp_path / "a.step", solid("Box", 3.0, 4.0, 5.0))
    assert len(shapes) == 6
    center = np.mean([samples(shape).mean(0) for shape in shapes], axis=0)
    for shape in shapes:
        assert shape.control_points.shape == (2, 2, 3)
        point, normal = middle(shape)
        distance = (point - center) @ normal
        assert min(abs(distance - half) for half in (1.5, 2.0, 2.5)) < 1e-10


@pytest.mark.parametrize(
    ("kind", "sizes", "residual"),
    [
        ("Cylinder", (2.0, 5.0), lambda h, r: r - 2),
        ("Cylinder", (2.0, 5.0, 1.3), lambda h, r: r - 2),
        ("Cone", (2.0, 1.0, 5.0), lambda h, r: r - (2 - h / 5)),
        ("Cone", (2.0, 0.0, 5.0), lambda h, r: r - (2 - 2 * h / 5)),
        ("Sphere", (2.0,), lambda h, r: np.hypot(h, r) - 2),
        ("Torus", (5.0, 1.5), lambda h, r: np.hypot(r - 5, h) - 1.5),
        ("Torus", (5.0, 1.5, 2.1), lambda h, r: np.hypot(r - 5, h) - 1.5),
    ],
)
def test_elementary_faces_are_exact_and_look_outwards(tmp_path, kind, sizes, residual):
    shapes = read_solid(tmp_path / "a.step", solid(kind, *sizes))
    round_ = shapes[0]
    points = samples(round_)
    assert np.abs(residual(*axial(points))).max() < 1e-11
    point, normal = middle(round_)
    assert residual(*axial(np.array([point + 0.1 * normal]))) > 0.05
    if kind == "Cylinder" and len(sizes) == 2:
        assert np.ptp(axial(points)[0]) == pytest.approx(5, rel=1e-11)
    for cap in shapes[1:]:
        assert isinstance(cap, TrimmedSurface) or cap.control_points.shape == (2, 2, 3)


def area(loop) -> float:
    """Signed area inside a closed plane curve, by the trapezium rule."""
    points = along(loop, 20001)
    x, y = (points - points[0]).T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2)


def test_the_caps_of_a_cylinder_are_discs(tmp_path):
    _, *caps = read_solid(tmp_path / "a.step", solid("Cylinder", 2.0, 5.0))
    for cap in caps:
        (loop,) = cap.loops
        assert area(loop) == pytest.approx(4 * np.pi, rel=1e-7)
        height, radius = axial(evaluate(cap.surface, *along(loop).T))
        assert np.abs(radius - 2).max() < 1e-8
        assert abs(middle(cap)[1] @ AXIS) == pytest.approx(1, rel=1e-12)
        assert (height.mean() - 2.5) * (middle(cap)[1] @ AXIS) > 0


def test_the_caps_of_a_part_cylinder_join_lines_and_an_arc(tmp_path):
    shapes = read_solid(tmp_path / "a.step", solid("Cylinder", 2.0, 5.0, 1.3))
    caps = [shape for shape in shapes if isinstance(shape, TrimmedSurface)]
    assert len(caps) == 2
    for cap in caps:
        assert area(cap.loops[0]) == pytest.approx(0.5 * 4 * 1.3, rel=1e-6)


def test_a_drilled_box_has_holes_and_a_bore_that_looks_to_its_axis(tmp_path):
    drill = solid("Cylinder", 0.7, 9.0)
    shift = occt("gp").gp_Trsf()
    box = solid("Box", 3.0, 4.0, 5.0)
    local = occt("gp").gp_Ax2(occt("gp").gp_Pnt(*PLACE.tolist()), occt("gp").gp_Dir(*AXIS.tolist()))
    across = np.array([[local.XDirection().X(), local.XDirection().Y(), local.XDirection().Z()]])
    across = np.concatenate([across, np.cross(AXIS, across)])
    offset = 1.5 * across[0] + 2.0 * across[1] - AXIS
    shift.SetTranslation(occt("gp").gp_Vec(*offset.tolist()))
    drill = occt("BRepBuilderAPI").BRepBuilderAPI_Transform(drill, shift).Shape()
    shapes = read_solid(tmp_path / "a.step", occt("BRepAlgoAPI").BRepAlgoAPI_Cut(box, drill).Shape())
    holed = [shape for shape in shapes if isinstance(shape, TrimmedSurface)]
    assert len(shapes) == 7 and len(holed) == 2
    for shape in holed:
        assert len(shape.loops) == 2
        assert area(shape.loops[0]) + area(shape.loops[1]) == pytest.approx(12 - np.pi * 0.49, rel=1e-7)
    (bore,) = (shape for shape in shapes if len(shape.domain) == 2 and hasattr(shape, "weights"))
    point, normal = middle(bore)
    assert axial(np.array([point - offset]))[1] == pytest.approx(0.7, rel=1e-10)
    assert axial(np.array([point - offset + 0.1 * normal]))[1] == pytest.approx(0.6, rel=1e-10)


def test_a_cylinder_drilled_from_the_side_keeps_its_outline(tmp_path):
    gp, solids = occt("gp"), occt("BRepPrimAPI")
    drill = solids.BRepPrimAPI_MakeCylinder(gp.gp_Ax2(gp.gp_Pnt(-9, 0, 5), gp.gp_Dir(1, 0, 0)), 2.0, 9.0)
    body = solids.BRepPrimAPI_MakeCylinder(4.0, 10.0)
    cut = occt("BRepAlgoAPI").BRepAlgoAPI_Cut(body.Shape(), drill.Shape()).Shape()
    trimmed = [shape for shape in read_solid(tmp_path / "a.step", cut) if isinstance(shape, TrimmedSurface)]
    (side,) = (shape for shape in trimmed if len(shape.loops) == 2)
    outer, hole = side.loops
    assert area(outer) == pytest.approx(np.prod(np.ptp(box(side), axis=0)), rel=1e-6)
    x, y, z = evaluate(side.surface, *along(hole).T).T
    assert np.abs(np.hypot(x, y) - 4).max() < 1e-12
    assert np.abs(np.hypot(y, z - 5) - 2).max() < 1e-6


@pytest.mark.parametrize("trimmed", [TRIMMED, TRIMMED_RATIONAL])
def test_edges_in_space_keep_their_stated_tolerance(trimmed):
    face = topology(trimmed, function="test")
    explorer = occt("TopExp").TopExp_Explorer(face, occt("TopAbs").TopAbs_ShapeEnum.TopAbs_EDGE)
    number = 0
    while explorer.More():
        edge = occt("TopoDS").TopoDS.Edge(explorer.Current())
        plane, space = (
            occt("BRepAdaptor").BRepAdaptor_Curve2d(edge, face),
            occt("BRepAdaptor").BRepAdaptor_Curve(edge),
        )
        parameters = np.linspace(plane.FirstParameter(), plane.LastParameter(), 101).tolist()
        flat = np.array([[p.X(), p.Y()] for p in map(plane.Value, parameters)])
        points = np.array([[p.X(), p.Y(), p.Z()] for p in map(space.Value, parameters)])
        distance = np.linalg.norm(points - evaluate(trimmed.surface, *flat.T), axis=-1).max()
        assert distance <= occt("BRep").BRep_Tool.Tolerance_s(edge) < 1e-5
        number += 1
        explorer.Next()
    assert number == 5


def test_a_face_in_an_assembly_comes_back_in_its_place(tmp_path):
    gp, topods, control = occt("gp"), occt("TopoDS"), occt("STEPControl")
    move = gp.gp_Trsf()
    move.SetRotation(gp.gp_Ax1(gp.gp_Pnt(1, 2, 3), gp.gp_Dir(0, 0, 1)), np.pi / 2)
    face = topology(TRIMMED, function="test")
    builder, whole = occt("BRep").BRep_Builder(), topods.TopoDS_Compound()
    builder.MakeCompound(whole)
    builder.Add(whole, face)
    builder.Add(whole, face.Moved(occt("TopLoc").TopLoc_Location(move)))
    with quiet_session({"write.step.assembly": "On"}):
        writer = control.STEPControl_Writer()
        writer.Transfer(whole, control.STEPControl_StepModelType.STEPControl_AsIs)
        writer.Write(str(tmp_path / "a.step"))
    still, moved = read_step(tmp_path / "a.step")
    x, y, z = samples(still).T
    np.testing.assert_allclose(samples(moved), np.stack([3 - y, 1 + x, z], axis=-1), rtol=0, atol=1e-9)
    assert len(moved.loops) == 2


def test_lost_faces_are_counted():
    face = topology(TRIMMED, function="test")
    with pytest.warns(UserWarning, match="2 of the shapes in 'part.step' cannot be read and are left out: OCCT could"):
        assert len(shapes_of(face, source="part.step", faces=3)) == 1


def test_a_face_with_an_open_outline_is_left_out():
    whole = topology(TRIMMED, function="test")
    explorer = occt("TopExp").TopExp_Explorer(whole, occt("TopAbs").TopAbs_ShapeEnum.TopAbs_EDGE)
    builder, wire = occt("BRep").BRep_Builder(), occt("TopoDS").TopoDS_Wire()
    builder.MakeWire(wire)
    for _ in range(3):
        builder.Add(wire, explorer.Current())
        explorer.Next()
    surface = occt("BRep").BRep_Tool.Surface_s(whole)
    face = occt("BRepBuilderAPI").BRepBuilderAPI_MakeFace(surface, wire, False).Face()
    with pytest.warns(UserWarning, match="1 of the shapes in 'part.step' .* has a gap of 3 in the parameter plane"):
        assert shapes_of(face, source="part.step", faces=1) == []
