"""Pictures: sizes, contents, colours, files, and which program draws them."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from view_cases import SIZE, coloured, sheet

from jaxsurf._errors import InputError, MissingPackageError
from jaxsurf.basis import clamped_knots
from jaxsurf.curve import BSplineCurve
from jaxsurf.mesh import normals_at, points_at, tessellate
from jaxsurf.view import _backend, cloud, deviation, plot, shade

SHEET = sheet()
BACKENDS = [
    "matplotlib",
    pytest.param("pyvista", marks=pytest.mark.skipif("_backend.opengl_window() is None")),
]


@pytest.fixture
def no_pyvista(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_shaded_sheet_fills_its_picture(backend, tmp_path):
    path = tmp_path / "sheet.png"
    picture = shade(SHEET, path=path, size=SIZE, backend=backend, unit="mm")
    assert picture.shape == (SIZE[1], SIZE[0], 3) and picture.dtype == np.uint8
    from PIL import Image

    with Image.open(path) as file:
        np.testing.assert_array_equal(np.asarray(file.convert("RGB")), picture)
    blue = picture[..., 2].astype(int) - picture[..., 0] > 25
    columns, rows = np.flatnonzero(blue.any(axis=0)), np.flatnonzero(blue.any(axis=1))
    # The sheet reaches across, and its frame leaves room on both sides.
    assert columns[-1] - columns[0] > 0.75 * SIZE[0]
    assert columns[0] > 3 and columns[-1] < SIZE[0] - 4 and rows[0] > 3 and rows[-1] < SIZE[1] - 4


@pytest.mark.parametrize("backend", BACKENDS)
def test_backs_are_sand_coloured(backend):
    front = shade(SHEET, size=SIZE, camera="top", edges=False, backend=backend).astype(int)
    back = shade(SHEET, size=SIZE, camera="bottom", edges=False, backend=backend).astype(int)
    middle = (SIZE[1] // 2, SIZE[0] // 2)
    assert front[middle][2] - front[middle][0] > 25 and back[middle][0] - back[middle][2] > 25


def test_both_programs_frame_alike():
    if _backend.opengl_window() is None:
        pytest.skip("no OpenGL here")
    masks = []
    for backend in ("matplotlib", "pyvista"):
        picture = shade(SHEET, size=SIZE, backend=backend, edges=False).astype(int)
        masks.append(picture[..., 2] - picture[..., 0] > 20)
    assert (masks[0] != masks[1]).mean() < 0.02


@pytest.mark.parametrize("backend", BACKENDS)
def test_red_is_above_the_surface_and_blue_below(backend):
    rng = np.random.default_rng(5)
    feet = rng.uniform((2.0, 0.0), (5.0, 1.0), (3000, 2))
    picture = deviation(SHEET, feet, np.full(3000, 0.02), limit=0.02, size=SIZE, backend=backend)
    left = picture[:, : SIZE[0] // 2]
    assert coloured(left, above=True).mean() > 0.08 and coloured(left, above=False).mean() < 0.01
    lower_u = np.where(feet[:, 0] < 3.5, -0.03, 0.03)
    picture = deviation(SHEET, feet, lower_u, size=SIZE, camera="top", backend=backend)
    inside = picture[40:150, : int(SIZE[0] * 0.6)]
    blue, red = (np.nonzero(coloured(inside, above=a))[1] for a in (False, True))
    # Low u is low x, and x runs to the right seen from the top.
    assert len(blue) > 100 and len(red) > 100 and blue.max() < red.min() + 4


def test_measured_points_lie_on_the_map_and_bare_places_are_grey():
    rng = np.random.default_rng(6)
    feet = rng.uniform((2.0, 0.0), (3.4, 1.0), (2000, 2))
    points = points_at(SHEET, feet) + 0.01 * normals_at(SHEET, feet)
    pale: dict[str, Any] = {"limit": 0.08, "size": SIZE, "backend": "matplotlib", "camera": "top"}
    bare = deviation(SHEET, feet, np.full(2000, 0.01), **pale)
    dotted = deviation(SHEET, feet, np.full(2000, 0.01), points, **pale)
    assert (np.abs(bare.astype(int) - dotted).max(axis=-1) > 25).mean() > 0.02
    colours = bare.reshape(-1, 3).astype(int)
    assert ((np.ptp(colours, axis=1) < 14) & (np.abs(colours.mean(axis=1) - 155) < 30)).mean() > 0.05


def test_the_bar_states_unit_and_limits(tmp_path):
    rng = np.random.default_rng(7)
    feet = rng.uniform((2.0, 0.0), (5.0, 1.0), (500, 2))
    signed = rng.uniform(-0.04, 0.04, 500)
    path = tmp_path / "map.svg"
    deviation(SHEET, feet, signed, unit="inch", path=path, size=SIZE, backend="matplotlib")
    text = path.read_text()
    assert "Deviation [inch]" in text and "98 % of points within" in text and "+0.04" in text and "−0.04" in text
    assert "500 points, rms" in text


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_cloud_is_coloured_by_height(backend, tmp_path):
    x, y = np.meshgrid(np.linspace(0, 10, 40), np.linspace(0, 10, 40))
    points = np.stack([x.ravel(), y.ravel(), 0.3 * x.ravel()], axis=1)
    picture = cloud(points, size=SIZE, camera="top", unit="cm", backend=backend)
    left, right = picture[60:120, 60].astype(int), picture[60:120, 140].astype(int)
    assert (left[:, 2] - left[:, 1]).max() > 20 and (right[:, 1] - right[:, 2]).max() > 20


def test_meshes_curves_and_points_can_be_shown_together():
    curve = BSplineCurve(np.array([[24.0, -14, 9], [30, -10, 12], [36, -6, 9]]), clamped_knots(3, 2), 2)
    shapes = [tessellate(SHEET, resolution=(5, 5)), curve]
    points = points_at(SHEET, np.random.default_rng(0).uniform((2, 0), (5, 1), (50, 2)))
    picture = shade(shapes, points=points, size=SIZE, camera=(0.3, -1.0, 0.8), backend="matplotlib").astype(int)
    assert ((picture[..., 2] - picture[..., 0] > 80) & (picture[..., 0] < 80)).any()  # the curve's blue
    assert (picture[..., 0] - picture[..., 1] > 60).any()  # the points' red


@pytest.mark.parametrize("name", ["flat.svg", "space.pdf", "space.png"])
def test_plots_have_axes_with_units(name, tmp_path):
    net = np.array([[0.0, 0, 1], [2, 3, 1], [5, -1, 1], [7, 1, 1]])
    shapes = [BSplineCurve(net, clamped_knots(4, 3), 3)] if name == "flat.svg" else [SHEET]
    picture = plot(shapes, points=net, control=True, unit="mm", title="A plot", path=tmp_path / name, size=SIZE)
    assert picture.shape == (SIZE[1], SIZE[0], 3) and picture.std() > 5
    content = (tmp_path / name).read_bytes()
    if name == "flat.svg":
        assert b"x [mm]" in content and b"A plot" in content
    assert content[:4] in (b"<?xm", b"%PDF", b"\x89PNG")


def test_without_pyvista_matplotlib_draws(no_pyvista):
    assert _backend.choose_backend("auto") == "matplotlib"
    with pytest.raises(MissingPackageError, match=r"pip install 'jaxsurf\[render\]'"):
        _backend.choose_backend("pyvista")


def test_without_both_the_error_names_the_packages(no_pyvista, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'jaxsurf\[plot\]'"):
        shade(SHEET)
    with pytest.raises(MissingPackageError, match=r"matplotlib` is needed for plots"):
        plot(SHEET)


def test_a_machine_without_opengl_falls_back_and_says_why(monkeypatch):
    monkeypatch.setattr(_backend, "opengl_window", lambda: None)
    assert _backend.choose_backend("auto") == "matplotlib"
    with pytest.raises(InputError, match="apt-get install libegl1 libgl1-mesa-dri"):
        _backend.choose_backend("pyvista")


def test_a_window_class_that_does_not_exist_does_not_render_and_leaves_the_process_alive(monkeypatch):
    monkeypatch.setenv(_backend.WINDOW_VARIABLE, "vtkNoSuchWindow")
    assert _backend.opengl_window() is None


def test_importing_the_room_imports_no_drawing_program():
    programs = ("matplotlib", "pyvista", "vtkmodules")
    code = f"import sys, jaxsurf.view; sys.exit(any(m in sys.modules for m in {programs}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_bad_requests_are_refused(tmp_path):
    feet, signed = np.full((3, 2), 0.5), np.zeros(3)
    unknown: Any = "svg"
    for call, message in [
        (lambda: shade(SHEET, path=tmp_path / "a.jpg"), "`path` must end in .png, .svg, .pdf"),
        (lambda: shade(SHEET, path=tmp_path / "no" / "a.png"), "does not exist; create it first"),
        (lambda: shade(SHEET, size=(10, 900)), "at least 64 pixels"),
        (
            lambda: shade(SHEET, backend=unknown),
            "`backend` must be one of auto, pyvista, matplotlib, got 'svg'",
        ),
        (lambda: shade([], backend="matplotlib"), "nothing to show"),
        (lambda: shade([3], backend="matplotlib"), "Only surfaces, curves and meshes can be shown, got int"),
        (lambda: shade(SHEET, camera="above", backend="matplotlib"), "`camera` must be one of iso, top"),
        (lambda: shade(SHEET, camera=(0, 0, 0), backend="matplotlib"), "not all 0"),
        (lambda: shade(SHEET, points=[[0, 0, np.nan]], backend="matplotlib"), "must be finite; row 0"),
        (lambda: plot([]), "nothing to show"),
        (lambda: plot(["a"]), "Only curves and surfaces can be plotted, got str"),
        (lambda: cloud(np.zeros((4, 2))), r"`points` must have shape \(n, 3\), n > 0, got \(4, 2\)"),
        (lambda: cloud(np.zeros((4, 3)), values=[1.0]), r"`values` must have shape \(4,\)"),
        (lambda: deviation(SHEET, feet[:, :1], signed), r"`parameters` must have shape \(n, 2\)"),
        (lambda: deviation(SHEET, feet, signed[:2]), r"`signed` must have shape \(3,\)"),
        (lambda: deviation(SHEET, feet, signed + np.inf), "must be finite; row 0 is not"),
        (lambda: deviation(SHEET, feet, signed, limit=0.0), "`limit` must be a positive length, got 0.0"),
    ]:
        with pytest.raises(InputError, match=message):
            call()
    assert list(tmp_path.iterdir()) == []
