"""STEP files: round trips, readers that are not ours, and errors."""

import re
import subprocess
import sys

import cad_shapes
import gmsh
import jax
import numpy as np
import pytest
import step_parser
from cad_shapes import CURVES, SURFACES, difference, parameters

from jaxsurf._errors import InputError
from jaxsurf.curve import BSplineCurve, Circle, NURBSCurve
from jaxsurf.io._occt_session import occt, quiet_session
from jaxsurf.io._step import read_step, step_unit, write_step
from jaxsurf.surface import BSplineSurface, Plane, TrimmedSurface

jax.config.update("jax_enable_x64", True)

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}


@pytest.fixture
def model():
    """A gmsh model without reports."""
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh.model
    gmsh.finalize()


@pytest.mark.parametrize("name", SURFACES)
def test_round_trip_keeps_a_surface(tmp_path, name):
    write_step(tmp_path / "a.step", SURFACES[name])
    (read,) = read_step(tmp_path / "a.step")
    assert type(read) is type(SURFACES[name])
    assert difference(read, SURFACES[name]) < 1e-12 * 200


@pytest.mark.parametrize("name", CURVES)
def test_round_trip_keeps_a_curve(tmp_path, name):
    write_step(tmp_path / "a.step", CURVES[name])
    (read,) = read_step(tmp_path / "a.step")
    assert type(read) is type(CURVES[name])
    assert difference(read, CURVES[name]) < 1e-12 * 200


@pytest.mark.parametrize("shape", [SURFACES["polynomial"], SURFACES["rational"], CURVES["rational"]])
@pytest.mark.parametrize("unit", UNITS)
def test_round_trip_of_clamped_data_is_bit_for_bit_in_every_unit(tmp_path, shape, unit):
    write_step(tmp_path / "a.step", shape, unit=unit)
    (read,) = read_step(tmp_path / "a.step")
    assert step_unit(tmp_path / "a.step") == unit
    jax.tree.map(np.testing.assert_array_equal, read, shape)


def test_reading_in_another_unit_scales(tmp_path):
    write_step(tmp_path / "a.step", SURFACES["polynomial"], unit="inch")
    (read,) = read_step(tmp_path / "a.step", unit="cm")
    expected = 2.54 * np.asarray(SURFACES["polynomial"].control_points)
    np.testing.assert_allclose(read.control_points, expected, rtol=1e-14)


def test_an_uncommon_unit_is_named_by_its_length(tmp_path):
    write_step(tmp_path / "a.step", SURFACES["polynomial"])
    text = (tmp_path / "a.step").read_text().replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT(.DECI.,.METRE.)")
    (tmp_path / "a.step").write_text(text)
    assert step_unit(tmp_path / "a.step") == "100 mm"
    assert difference(read_step(tmp_path / "a.step")[0], SURFACES["polynomial"]) == 0


def test_a_list_comes_back_surfaces_first(tmp_path):
    write_step(tmp_path / "a.step", [*CURVES.values(), *SURFACES.values()])
    read = read_step(tmp_path / "a.step")
    for shape, expected in zip(read, [*SURFACES.values(), *CURVES.values()], strict=True):
        assert difference(shape, expected) < 1e-12 * 200


@pytest.mark.parametrize("name", SURFACES)
def test_our_own_parser_and_scipy_find_the_same_points(tmp_path, name):
    write_step(tmp_path / "a.step", SURFACES[name])
    (surface,) = step_parser.surfaces(tmp_path / "a.step")
    expected = SURFACES[name](*np.array(parameters(SURFACES[name])).T)
    found = [surface(u, v) for u, v in parameters(SURFACES[name])]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", SURFACES)
def test_gmsh_finds_the_same_points(tmp_path, model, name):
    write_step(tmp_path / "a.step", SURFACES[name])
    faces = [entity for entity in model.occ.importShapes(str(tmp_path / "a.step")) if entity[0] == 2]
    model.occ.synchronize()
    assert len(faces) == 1
    pairs = np.array(parameters(SURFACES[name]))
    found = model.getValue(2, faces[0][1], pairs.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(found, SURFACES[name](*pairs.T), rtol=0, atol=1e-9)


def test_gmsh_finds_the_area_of_a_polygon_with_holes(tmp_path, model):
    plane = BSplineSurface([[[0, 0, 0], [0, 3, 4]], [[10, 0, 0], [10, 3, 4.0]]], [2, 2, 4, 4], [0, 0, 5, 5], 1, 1)
    corners = np.array([[2.1, 0.5], [3.9, 0.2], [3.5, 4.5], [2.4, 4.0]])
    hole = np.array([[2.8, 1.0], [2.8, 2.0], [3.2, 2.0]])
    loops = [BSplineCurve(np.concatenate([p, p[:1]]), [0, 0, *range(1, len(p)), len(p), len(p)], 1) for p in (corners, hole)]
    write_step(tmp_path / "a.step", TrimmedSurface(plane, loops))
    faces = model.occ.importShapes(str(tmp_path / "a.step"))
    assert [entity[0] for entity in faces] == [2]
    area = 5 * (shoelace(corners) + shoelace(hole))  # u runs 5 times as fast as its parameter, v as fast
    assert model.occ.getMass(2, faces[0][1]) == pytest.approx(area, rel=1e-12)


def shoelace(corners: np.ndarray) -> float:
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


@pytest.mark.parametrize("trimmed", [cad_shapes.TRIMMED, cad_shapes.TRIMMED_RATIONAL])
def test_round_trip_keeps_trimming_loops(tmp_path, trimmed):
    write_step(tmp_path / "a.step", trimmed)
    (read,) = read_step(tmp_path / "a.step")
    jax.tree.map(np.testing.assert_array_equal, read.surface, trimmed.surface)
    jax.tree.map(np.testing.assert_array_equal, read.loops[0], trimmed.loops[0])
    assert difference(read.loops[1], trimmed.loops[1]) < 1e-14


@pytest.mark.parametrize("name", ["periodic", "collapsed"])
def test_loops_along_the_border_of_closed_and_collapsed_surfaces(tmp_path, model, name):
    (a, b), (c, d) = np.asarray(SURFACES[name].domain).tolist()
    corners = [[a, c], [b, c], [b, d], [3.5, 1.5], [a, d], [a, c]]
    trimmed = TrimmedSurface(SURFACES[name], (BSplineCurve(corners, [0, 0, 1, 2, 3, 4, 5, 5], 1),))
    write_step(tmp_path / "a.step", trimmed)
    (read,) = read_step(tmp_path / "a.step")
    # The reader may begin the loop at another corner.
    found = sorted(np.round(read.loops[0].control_points[:-1], 12).tolist())
    assert found == sorted(corners[:-1])
    faces = model.occ.importShapes(str(tmp_path / "a.step"))
    assert 0 < model.occ.getMass(2, faces[0][1]) < area_of(model, SURFACES[name], tmp_path / "b.step")


def area_of(model, shape, path) -> float:
    write_step(path, shape)
    return model.occ.getMass(2, model.occ.importShapes(str(path))[0][1])


def test_the_file_is_plain_ascii_with_schema_unit_and_name(tmp_path):
    write_step(tmp_path / "a.step", SURFACES["polynomial"], unit="in", name="Fläche 'α' 🙂\\")
    text = (tmp_path / "a.step").read_text(encoding="ascii")
    assert "FILE_SCHEMA((\n'AP242_MANAGED_MODEL_BASED_3D_ENGINEERING" in text
    assert "CONVERSION_BASED_UNIT('INCH'" in text
    name = r"Fl\X4\000000E4\X0\che ''\X4\000003B1\X0\'' \X4\0001F642\X0\\"
    assert f"PRODUCT('{name}" in text.replace("\n  ", "")
    write_step(tmp_path / "part.step", SURFACES["polynomial"])
    assert "PRODUCT('part','part'" in (tmp_path / "part.step").read_text()
    write_step(tmp_path / "a.step", SURFACES["polynomial"], name="Fläche")
    assert r"PRODUCT('Fl\X2\00E4\X0\che'" in (tmp_path / "a.step").read_text()


def test_writing_and_reading_are_silent_and_leave_the_settings_of_others(tmp_path, capfd):
    with quiet_session({}):
        pass  # starts the translators, which fills in the settings
    table = occt("Interface").Interface_Static
    messenger = occt("Message").Message.DefaultMessenger_s()
    before = {key.ToCString(): table.CVal_s(key.ToCString()) for key in table.Items_s()}
    printers = messenger.Printers().Size()
    write_step(tmp_path / "a.step", [cad_shapes.TRIMMED, *CURVES.values()], unit="m")
    read_step(tmp_path / "a.step")
    with pytest.raises(InputError):
        write_step(tmp_path / "a.step", 3)
    assert capfd.readouterr() == ("", "")
    assert {key.ToCString(): table.CVal_s(key.ToCString()) for key in table.Items_s()} == before
    assert messenger.Printers().Size() == printers > 0


def test_a_wrong_setting_is_a_bug():
    with (
        pytest.raises(RuntimeError, match="OCCT does not accept write.step.unit = ell"),
        quiet_session({"write.step.unit": "ell"}),
    ):
        pass


def test_occt_is_imported_only_when_used():
    code = "import sys, jaxsurf.io, jaxsurf.io._step; sys.exit(any(m.startswith('OCP') for m in sys.modules))"
    subprocess.run([sys.executable, "-c", code], check=True)


CUTS = [20, 500, 3000, -1000, -30]


@pytest.mark.parametrize("cut", CUTS)
def test_a_cut_file_is_refused(tmp_path, cut):
    write_step(tmp_path / "a.step", cad_shapes.TRIMMED)
    (tmp_path / "b.step").write_bytes((tmp_path / "a.step").read_bytes()[:cut])
    with pytest.raises(InputError, match="END-ISO-10303-21 is missing, so the STEP file is cut"):
        read_step(tmp_path / "b.step")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "the file does not exist"),
        ("", "the file is empty"),
        ("x y z\n1 2 3\n", "does not begin with ISO-10303-21, so it is no STEP file"),
        (
            "ISO-10303-21;\nDATA;\n#1=POINT('',(0.,\nENDSEC;\nEND-ISO-10303-21;\n",
            "cannot make out its content",
        ),
        (
            "ISO-10303-21;\nDATA;\n#1=LINE('',#2,#3);\nENDSEC;\nEND-ISO-10303-21;\n",
            "refers to #2, which is missing",
        ),
    ],
)
def test_a_bad_file_is_refused(tmp_path, content, message):
    if content is not None:
        (tmp_path / "a.step").write_text(content)
    with pytest.raises(InputError, match=message):
        read_step(tmp_path / "a.step")
    with pytest.raises(InputError, match=message):
        step_unit(tmp_path / "a.step")


def test_a_damaged_entity_is_refused(tmp_path):
    write_step(tmp_path / "a.step", CURVES["rational"])
    text = (tmp_path / "a.step").read_text()
    (tmp_path / "a.step").write_text(re.sub(r"VERTEX_POINT|CARTESIAN_POINT", "DIRECTION", text))
    with pytest.raises(InputError, match="OCCT says of a .* the STEP file is damaged"):
        read_step(tmp_path / "a.step")


def test_a_file_without_shapes_is_refused(tmp_path):
    write_step(tmp_path / "a.step", CURVES["polynomial"])
    text = (tmp_path / "a.step").read_text()
    (tmp_path / "a.step").write_text(re.sub(r"(REPRESENTATION\('',\(#\d+),#\d+\)", r"\1)", text))
    with pytest.raises(InputError, match="holds no faces and no curves"):
        read_step(tmp_path / "a.step")


NOT_FINITE = np.array(cad_shapes.POLYNOMIAL.control_points)
NOT_FINITE[4, 2, 1] = np.nan
LINE = [[0, 0, 0], [1, 0, 0.0]]
REFUSED = {
    "other type": (
        Plane([0, 0, 0], [0, 0, 1]),
        "write_step cannot write a Plane: convert it first with `js.to_bspline",
    ),
    "other curve": (Circle([0, 0, 0], [0, 0, 1], 2.0), "write_step cannot write a Circle: convert it first"),
    "trimmed other type": (
        TrimmedSurface(
            Plane([0, 0, 0], [0, 0, 1]),
            [BSplineCurve([[0, 0], [1, 0], [1, 1], [0, 0.0]], [0, 0, 1, 2, 3, 3], 1)],
        ),
        "write_step cannot write a Plane",
    ),
    "no shape": ("part", "write_step cannot write a str"),
    "none": ([], "`shapes` of write_step must hold at least one shape, got an empty list"),
    "in a list": ([cad_shapes.POLYNOMIAL, 3], r"`shapes\[1\]`: write_step cannot write a int"),
    "not finite": (
        BSplineSurface(NOT_FINITE, cad_shapes.KNOTS_U, cad_shapes.KNOTS_V, 3, 2),
        r"`control_points` of a BSplineSurface must be finite .* got nan at index \(4, 2, 1\)",
    ),
    "flat curve": (cad_shapes.SQUARE, "writes curves in space, got one with 2-D `control_points`"),
    "no length": (BSplineCurve([[1, 2, 3], [1, 2, 3.0]], [0, 0, 1, 1], 1), "are all the same point: leave"),
    "weights": (
        NURBSCurve(LINE, [1, 1e-320], [0, 0, 1, 1], 1),
        "write_step: OCCT refuses this NURBSCurve",
    ),
    "high degree": (
        BSplineCurve(np.arange(81.0).reshape(27, 3), [0] * 27 + [1] * 27, 26),
        "go up to 25, got 26",
    ),
    "close knots": (
        BSplineCurve([*LINE, [2, 1, 0], [3, 0, 1]], [0, 0, 1, np.nextafter(1, 2), 2, 2], 1),
        "Distinct knots in a CAD file must differ by more than one rounding step",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_shapes_that_cannot_be_written_leave_no_file(tmp_path, case):
    shapes, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        write_step(tmp_path / "a.step", shapes)
    assert not list(tmp_path.iterdir())


def test_a_translation_that_fails_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxsurf.io._step._done", lambda: "never")
    with pytest.raises(InputError, match="OCCT cannot translate these shapes to STEP"):
        write_step(tmp_path / "a.step", SURFACES["polynomial"])
    assert not list(tmp_path.iterdir())


def test_an_unknown_unit_and_a_bad_path_are_refused(tmp_path):
    with pytest.raises(InputError, match="`unit` must be one of 'mm', 'cm', 'm', 'in', got 'furlong'"):
        write_step(tmp_path / "a.step", SURFACES["polynomial"], unit="furlong")
    with pytest.raises(InputError, match="`unit` must be one of"):
        read_step(tmp_path / "a.step", unit="furlong")
    with pytest.raises(InputError, match="does not exist; create it first"):
        write_step(tmp_path / "no" / "a.step", SURFACES["polynomial"])
    assert not list(tmp_path.iterdir())
