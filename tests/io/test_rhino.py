"""Rhino files, read by rhino3dm itself."""

import jax
import numpy as np
import pytest
import rhino3dm
from cad_shapes import CURVES, POLYNOMIAL, SQUARE, SURFACES, TRIMMED, parameters

from jaxsurf._errors import InputError
from jaxsurf.io._rhino import write_3dm
from jaxsurf.surface import BSplineSurface, Plane

jax.config.update("jax_enable_x64", True)


def objects(model) -> list:
    return [model.Objects[i] for i in range(len(model.Objects))]


def read(path) -> list:
    return [thing.Geometry for thing in objects(rhino3dm.File3dm.Read(str(path)))]


@pytest.mark.parametrize("shape", [*SURFACES.values(), *CURVES.values()])
def test_round_trip_keeps_the_points(tmp_path, shape):
    write_3dm(tmp_path / "a.3dm", shape)
    (found,) = read(tmp_path / "a.3dm")
    assert found.IsValid
    points = [found.PointAt(*place) for place in parameters(shape)]
    expected = shape(*np.array(parameters(shape)).T)
    np.testing.assert_allclose([(p.X, p.Y, p.Z) for p in points], expected, rtol=0, atol=1e-11)


def test_control_points_are_kept_bit_for_bit(tmp_path):
    write_3dm(tmp_path / "a.3dm", POLYNOMIAL)
    (found,) = read(tmp_path / "a.3dm")
    net = [[(p.X, p.Y, p.Z) for p in (found.Points[i, j] for j in range(5))] for i in range(7)]
    np.testing.assert_array_equal(net, POLYNOMIAL.control_points)
    np.testing.assert_array_equal(list(found.KnotsU), POLYNOMIAL.knots_u[1:-1])


@pytest.mark.parametrize(
    ("unit", "expected"),
    [("mm", "Millimeters"), ("cm", "Centimeters"), ("m", "Meters"), ("in", "Inches"), ("inch", "Inches")],
)
def test_the_unit_is_stated_and_no_number_changes(tmp_path, unit, expected):
    write_3dm(tmp_path / "a.3dm", [CURVES["rational"], POLYNOMIAL], unit=unit)
    model = rhino3dm.File3dm.Read(str(tmp_path / "a.3dm"))
    assert model.Settings.ModelUnitSystem == getattr(rhino3dm.UnitSystem, expected)
    curve, surface = (thing.Geometry for thing in objects(model))
    end = curve.PointAtEnd
    np.testing.assert_allclose((end.X, end.Y, end.Z), CURVES["rational"].control_points[-1], rtol=1e-15)
    assert surface.OrderU == 4


NOT_FINITE = np.array(POLYNOMIAL.control_points)
NOT_FINITE[0, 3, 2] = np.inf
REFUSED = {
    "trimmed": (TRIMMED, r"writes whole surfaces only, got a TrimmedSurface: write a STEP file"),
    "other type": (
        Plane([0, 0, 0], [0, 0, 1]),
        "write_3dm cannot write a Plane: convert it with `js.to_bspline",
    ),
    "in a list": ([POLYNOMIAL, 3], r"`shapes\[1\]`: write_3dm cannot write a int"),
    "none": ((), "`shapes` of write_3dm must hold at least one shape, got an empty tuple"),
    "flat": (SQUARE, "write_3dm writes curves in space, got one with 2-D `control_points`"),
    "not finite": (
        BSplineSurface(NOT_FINITE, POLYNOMIAL.knots_u, POLYNOMIAL.knots_v, 3, 2),
        r"must be finite .* got inf at index \(0, 3, 2\)",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_shapes_that_cannot_be_written_leave_no_file(tmp_path, case):
    shapes, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        write_3dm(tmp_path / "a.3dm", shapes)
    assert not list(tmp_path.iterdir())


def test_a_shape_that_rhino_refuses_is_reported(tmp_path):
    tiny = BSplineSurface(POLYNOMIAL.control_points, [2, 2, 2, 2, 2.5, 3, 3, 5, 5, 5, 5], POLYNOMIAL.knots_v, 3, 2)
    object.__setattr__(tiny, "knots_u", np.array([2, 2, 2, 2, 2.5, 2.4, 3, 5, 5, 5, 5]))
    with pytest.raises(InputError, match="Rhino refuses this BSplineSurface"):
        write_3dm(tmp_path / "a.3dm", tiny)


def test_a_failing_write_is_reported_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setattr(rhino3dm.File3dm, "Write", lambda *_: False)
    with pytest.raises(InputError, match="rhino3dm could not write the file"):
        write_3dm(tmp_path / "a.3dm", POLYNOMIAL)
    assert not list(tmp_path.iterdir())


def test_an_unknown_unit_and_a_bad_path_are_refused(tmp_path):
    with pytest.raises(InputError, match="`unit` must be one of 'mm', 'cm', 'm', 'in', got 'yd'"):
        write_3dm(tmp_path / "a.3dm", POLYNOMIAL, unit="yd")
    with pytest.raises(InputError, match="does not exist; create it first"):
        write_3dm(tmp_path / "no" / "a.3dm", POLYNOMIAL)
