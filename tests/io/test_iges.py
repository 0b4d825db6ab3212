"""IGES files, read by a parser of our own and by gmsh."""

from pathlib import Path

import gmsh
import jax
import numpy as np
import pytest
from cad_shapes import CURVES, POLYNOMIAL, SURFACES, TRIMMED, parameters
from scipy.interpolate import BSpline

from jaxsurf._errors import InputError
from jaxsurf.io._iges import write_iges
from jaxsurf.io._occt import topology
from jaxsurf.io._occt_session import occt
from jaxsurf.surface import Plane

jax.config.update("jax_enable_x64", True)


def iges_entities(path: Path, kind: int) -> list[np.ndarray]:
    """The numbers after the entity number, for all entities of one kind."""
    lines = path.read_text(encoding="ascii").splitlines()
    assert all(len(line) == 80 for line in lines)
    text = "".join(line[:64].strip() for line in lines if line[72] == "P")
    records = [record.split(",") for record in text.split(";") if record]
    return [np.array(record[1:], dtype=float) for record in records if record[0] == str(kind)]


def iges_surface(data: np.ndarray):
    """Entity 128 as a function of two parameters."""
    n, m, p, q = data[:4].astype(int) + [1, 1, 0, 0]
    ends = np.cumsum([9, n + p + 1, m + q + 1, n * m, 3 * n * m])
    knots_u, knots_v, weights, points = (data[a:b] for a, b in zip(ends[:-1], ends[1:], strict=True))
    weights = weights.reshape(m, n, 1).swapaxes(0, 1)
    net = np.concatenate([points.reshape(m, n, 3).swapaxes(0, 1) * weights, weights], axis=-1)
    homogeneous = lambda u, v: BSpline(knots_v, BSpline(knots_u, net, p)(u), q)(v)
    return lambda u, v: homogeneous(u, v)[:3] / homogeneous(u, v)[3]


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("unit", ["mm", "in"])
def test_our_own_parser_finds_the_same_surface(tmp_path, name, unit):
    write_iges(tmp_path / "a.igs", SURFACES[name], unit=unit)
    surface = iges_surface(iges_entities(tmp_path / "a.igs", 128)[0])
    pairs = parameters(SURFACES[name])
    expected = SURFACES[name](*np.array(pairs).T)
    np.testing.assert_allclose([surface(*pair) for pair in pairs], expected, rtol=0, atol=1e-11)


def test_numbers_are_written_bit_for_bit(tmp_path):
    write_iges(tmp_path / "a.igs", POLYNOMIAL, unit="m")
    (data,) = iges_entities(tmp_path / "a.igs", 128)
    net = np.asarray(POLYNOMIAL.control_points)
    np.testing.assert_array_equal(data[-4 - net.size : -4], net.swapaxes(0, 1).ravel())


def test_a_list_keeps_its_order_and_the_header_its_manners(tmp_path):
    write_iges(tmp_path / "a.igs", [CURVES["rational"], TRIMMED, CURVES["polyline"]], unit="cm")
    lines = (tmp_path / "a.igs").read_text().splitlines()
    kinds = [line[:8].strip() for line in lines if line[72] == "D"][::2]
    assert kinds[0] == "126" and kinds[1] == "144" and kinds[-1] == "126"
    header = "".join(line[:72].rstrip() for line in lines if line[72] == "G")
    assert "5Ha.igs" in header and "2HCM" in header and "7Hjaxsurf" in header
    (curve, *_, polyline) = iges_entities(tmp_path / "a.igs", 126)
    assert curve[1] == 3 and polyline[1] == 1
    points = np.asarray(CURVES["polyline"].control_points)
    np.testing.assert_array_equal(polyline[-5 - points.size : -5], points.ravel())


@pytest.mark.parametrize("shape", [*SURFACES.values(), TRIMMED])
def test_gmsh_finds_a_face(tmp_path, shape):
    write_iges(tmp_path / "a.igs", shape)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        faces = [tag for dim, tag in gmsh.model.occ.importShapes(str(tmp_path / "a.igs")) if dim == 2]
        gmsh.model.occ.synchronize()
        area = sum(gmsh.model.occ.getMass(2, tag) for tag in faces)
    finally:
        gmsh.finalize()
    assert area == pytest.approx(occt_area(shape), rel=1e-6)


def occt_area(shape) -> float:
    properties = occt("GProp").GProp_GProps()
    occt("BRepGProp").BRepGProp.SurfaceProperties_s(topology(shape, function="test"), properties)
    return properties.Mass()


def test_writing_is_silent(tmp_path, capfd):
    write_iges(tmp_path / "a.igs", [POLYNOMIAL, TRIMMED, *CURVES.values()])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        (
            Plane([0, 0, 0], [0, 0, 1]),
            "write_iges cannot write a Plane: convert it first with `js.to_bspline",
        ),
        ([], "`shapes` of write_iges must hold at least one shape, got an empty list"),
        ([POLYNOMIAL, "x"], r"`shapes\[1\]`: write_iges cannot write a str"),
    ],
)
def test_shapes_that_cannot_be_written_leave_no_file(tmp_path, shapes, message):
    with pytest.raises(InputError, match=message):
        write_iges(tmp_path / "a.igs", shapes)
    assert not list(tmp_path.iterdir())


def test_a_translation_that_fails_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(occt("IGESControl").IGESControl_Writer, "AddShape", lambda *_: False)
    with pytest.raises(InputError, match="OCCT cannot translate one of these shapes to IGES"):
        write_iges(tmp_path / "a.igs", POLYNOMIAL)
    assert not list(tmp_path.iterdir())


def test_an_unknown_unit_and_a_bad_path_are_refused(tmp_path):
    with pytest.raises(InputError, match="`unit` must be one of 'mm', 'cm', 'm', 'in', got 'yd'"):
        write_iges(tmp_path / "a.igs", POLYNOMIAL, unit="yd")
    with pytest.raises(InputError, match="does not exist; create it first"):
        write_iges(tmp_path / "no" / "a.igs", POLYNOMIAL)
