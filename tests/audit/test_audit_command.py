"""`jaxsurf audit` and `shared_edges`: all edges of models in files and in memory."""

import json

import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.cli import main

RNG = np.random.default_rng(5)
NET = np.stack(np.meshgrid(np.arange(8.0), np.arange(6.0), indexing="ij"), axis=-1) + [7.0, -3.0]
NET = np.concatenate([NET, 4 + 0.4 * RNG.normal(size=(8, 6, 1))], axis=-1)
WHOLE = js.BSplineSurface(NET, js.clamped_knots(8, 3, (2, 5)), js.clamped_knots(6, 3, (-1, 1)), 3, 3)
LEFT, RIGHT = js.split(WHOLE, 3.5, "u")
LOWER, UPPER = (
    js.insert_knots(half, knots, "v") for half, knots in zip(js.split(RIGHT, 0.0, "v"), ([-0.5], [0.5]), strict=True)
)
LIFTED = js.rotate(LOWER, (0, 1, 0), 0.02, LEFT.control_points[-1, 0])
SHEETS = [LEFT, LIFTED, UPPER]


def figures(edges):
    return {(e.first, e.second): e.continuity for e in edges}


@pytest.fixture
def model(tmp_path):
    js.io.write_step(tmp_path / "sheets.step", SHEETS)
    js.save(tmp_path / "sheets.jxs", {"sheets": SHEETS, "name": "a model"})
    return tmp_path


def test_a_step_file_gives_the_figures_of_its_surfaces(model, capsys):
    """Numbers in STEP are bit for bit those in memory; a turned face opens two edges and leaves one whole."""
    expected = figures(js.shared_edges(SHEETS))
    assert set(expected) == {(0, 1), (0, 2)}
    report = model / "report.json"
    assert main(["audit", str(model / "sheets.step"), "--json", str(report)]) == 0
    said = capsys.readouterr().out
    found = json.loads(report.read_text())
    assert found["faces"] == 3 and found["unit"] == "mm" and len(found["edges"]) == 2
    for row in found["edges"]:
        known = expected[tuple(row["faces"])]
        assert row["edges"] == [known.side_a, known.side_b]
        for name, value in (("g0", known.max_g0), ("g1", known.max_g1), ("g2", known.max_g2), ("length", known.length)):
            assert row[name] == pytest.approx(float(value), rel=1e-9, abs=1e-11)
        assert row["g1_degrees"] == pytest.approx(np.degrees(row["g1"]))
    by_faces = {tuple(row["faces"]): row for row in found["edges"]}
    assert by_faces[0, 2]["order"] == 2 and by_faces[0, 2]["g2_relative"] < 1e-10
    assert by_faces[0, 1]["order"] == -1 and found["worst"]["g1"] == by_faces[0, 1]["g1"] > 1e-3
    assert "3 faces, 2 shared edges (1 G2, 0 G1, 0 G0, 1 open); worst: open" in said
    assert said.splitlines()[0].split()[:3] == ["faces", "edges", "length"]
    assert any(line.startswith("0 - 2  u1 - u0") and line.endswith("G2") for line in said.splitlines())


def test_requirements_and_limits(model, capsys):
    path = str(model / "sheets.jxs")
    assert main(["audit", path, "--require", "g0"]) == 1
    loose = ["--gap", "0.1", "--angle", "0.1", "--curvature", "0.5"]
    assert main(["audit", path, *loose, "--require", "g1"]) == 0
    assert "limits: G0 0.1, G1 0.1 rad (5.73°), G2 0.5 relative" in capsys.readouterr().out
    assert main(["audit", path, "--tolerance", "1e-9", "--require", "g2", "--quiet"]) == 0  # the open edge is no longer one
    assert capsys.readouterr().out == ""


def test_trimmed_faces_meet_along_their_loops(tmp_path):
    """The plane parts of a box with a round hole by OCCT: right angles, and the hole's edge on both faces."""
    from jaxsurf.io._occt_session import occt

    gp, room = occt("gp"), occt("BRepPrimAPI")
    box = room.BRepPrimAPI_MakeBox(10.0, 8.0, 5.0).Shape()
    axis = gp.gp_Ax2(gp.gp_Pnt(5, 4, -1), gp.gp_Dir(0, 0, 1))
    drill = room.BRepPrimAPI_MakeCylinder(axis, 1.5, 10.0).Shape()
    part = occt("BRepAlgoAPI").BRepAlgoAPI_Cut(box, drill).Shape()
    control = occt("STEPControl")
    writer = control.STEPControl_Writer()
    writer.Transfer(part, control.STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(tmp_path / "box.step"))
    faces = js.io.read_step(tmp_path / "box.step")
    edges = js.shared_edges(faces)
    # twelve of the box, two of the hole and its own seam
    assert len(edges) == 15
    hole = [k for k, face in enumerate(faces) if isinstance(face, js.NURBSSurface)]
    round_ones = [e.continuity for e in edges if set(hole) & {e.first, e.second} and e.first != e.second]
    assert len(round_ones) == 2
    for found in round_ones:
        assert float(found.length) == pytest.approx(3 * np.pi, rel=1e-5)
    for edge in edges:
        assert float(edge.continuity.max_g0) < 1e-7
        seam = edge.first == edge.second
        np.testing.assert_allclose(edge.continuity.g1, 0 if seam else np.pi / 2, atol=1e-6)
        assert edge.continuity.order(gap=1e-6) == (2 if seam else 0)


def test_the_nearer_of_two_sides_wins():
    """A strip narrower than the tolerance: its far side is no edge of the plane that its near side meets."""
    knots = (0, 0, 1, 1)
    square = lambda x, y: js.BSplineSurface([[[x, 0, 0], [x, 9, 0]], [[y, 0, 0], [y, 9, 0.0]]], knots, knots, 1, 1)
    edges = js.shared_edges([square(0, 5), square(5, 5.004), square(5.004, 9)], tolerance=0.01)
    assert [(e.first, e.second, e.continuity.side_a, e.continuity.side_b) for e in edges] == [
        (0, 1, "u1", "u0"),
        (1, 2, "u1", "u0"),
    ]


def test_a_single_face(tmp_path, capsys):
    js.save(tmp_path / "one.jxs", LEFT)
    assert main(["audit", str(tmp_path / "one.jxs"), "--require", "g2"]) == 0
    assert "1 faces, no shared edges" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["part.iges"], "MODEL must end in one of .step, .stp, .jxs, got"),
        (["none.step"], "the file does not exist; check the name"),
        (["curve.jxs"], "holds no surfaces whose edges could be measured; export faces or solids, not curves"),
        (["one.jxs", "--json", "one.jxs"], "give the report a file of its own"),
        (["one.jxs", "--json", "nowhere/r.json"], "does not exist; create it first"),
        (["one.jxs", "--samples", "1"], "`--samples` must be at least 2, got 1"),
    ],
)
def test_bad_input_gets_one_sentence(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    js.save("one.jxs", LEFT)
    js.save("curve.jxs", [js.Line((0, 0, 0), (1, 0, 0))])
    assert main(["audit", *arguments]) == 2
    said = capsys.readouterr()
    assert message in said.err and said.err.count("\n") == 1 and not said.out


@pytest.mark.parametrize("value", ["0", "-1", "nan", "wide"])
def test_limits_are_above_0(capsys, value):
    with pytest.raises(SystemExit) as stopped:
        main(["audit", "part.step", "--angle", value])
    assert stopped.value.code == 2
    assert f"expected a number above 0, got '{value}'" in capsys.readouterr().err


def test_only_concrete_surfaces_are_searched():
    import jax

    with pytest.raises(js.InputError, match=r"`surfaces\[1\]` must be a surface, got a Line"):
        js.shared_edges([LEFT, js.Line((0, 0, 0), (1, 0, 0))])
    with pytest.raises(js.InputError, match="searches concrete surfaces"):
        jax.jit(lambda s: [e.continuity.g0 for e in js.shared_edges([s])])(LEFT)
