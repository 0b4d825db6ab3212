"""`write_mesh`: what trimesh and `read_points` read back, and every refusal."""

import json
import signal
import subprocess
import sys
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf.io._mesh import write_mesh
from jaxsurf.io._points import read_points

VERTICES = np.random.default_rng(5).uniform(-40.0, 90.0, (5, 3))  # the last one is in no face
FACES = np.array([[0, 1, 2], [2, 1, 3]])
NORMALS = np.random.default_rng(6).normal(size=(5, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
COLOURS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 8, 7], [1, 2, 3]], np.uint8)


def read_mesh(path) -> Any:
    import trimesh

    return trimesh.load(path, process=False, force="mesh")


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".glb", ".STL"])
@pytest.mark.parametrize("array", [np.asarray, jnp.asarray, np.ndarray.tolist])
def test_triangles_come_back(tmp_path, capfd, suffix, array):
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, array(VERTICES), array(FACES))
    mesh = read_mesh(path)
    expected = VERTICES[FACES]
    np.testing.assert_allclose(mesh.triangles, expected, rtol=1e-6, atol=1e-5)
    assert capfd.readouterr() == ("", "")
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_vertices_keep_their_order_and_number(tmp_path, suffix):
    write_mesh(tmp_path / f"mesh{suffix}", VERTICES, FACES)
    np.testing.assert_allclose(read_points(tmp_path / f"mesh{suffix}"), VERTICES, atol=1e-5)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_obj_is_exact_to_its_size(tmp_path, scale):
    write_mesh(tmp_path / "mesh.obj", VERTICES * scale, FACES)
    np.testing.assert_allclose(read_points(tmp_path / "mesh.obj"), VERTICES * scale, rtol=0, atol=1e-6 * scale)


def ply_normals(content):
    names = [line.split()[1:] for line in content.split(b"end_header")[0].splitlines() if b"property" in line]
    kinds = {b"float": "<f4", b"uchar": "u1"}
    layout = np.dtype([(name.decode(), kinds[kind]) for kind, name in (n for n in names if len(n) == 2)])
    vertices = np.frombuffer(content.split(b"end_header\n", 1)[1], layout, count=4)
    return np.stack([vertices[name] for name in ("nx", "ny", "nz")], axis=1)


def obj_normals(content):
    return np.array([line.split()[1:] for line in content.splitlines() if line.startswith(b"vn ")], dtype=float)


def glb_normals(content):
    length = int.from_bytes(content[12:16], "little")
    tree = json.loads(content[20 : 20 + length])
    accessor = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]]
    at = 28 + length + tree["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(content, "<f4", count=12, offset=at).reshape(4, 3)


@pytest.mark.parametrize("scale", [1.0, 1e6])
@pytest.mark.parametrize("suffix, normals", [(".obj", obj_normals), (".ply", ply_normals), (".glb", glb_normals)])
def test_normals_and_colours_are_written(tmp_path, suffix, normals, scale):
    path, points = tmp_path / f"mesh{suffix}", VERTICES[:4] * scale
    for colours in (COLOURS, COLOURS.astype(np.float32) / 255, np.insert(COLOURS, 3, 255, axis=1)):
        for written in (NORMALS[:4], np.tile([0.0, 0.0, 1.0], (4, 1))):
            write_mesh(path, points, FACES, normals=written, colours=colours[:4])
            np.testing.assert_allclose(normals(path.read_bytes()), written, atol=1e-7)
            mesh = read_mesh(path)  # which computes normals anew
            np.testing.assert_allclose(mesh.vertices, points, rtol=1e-6)
            np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], COLOURS[:4])


def test_triangles_without_area_are_written(tmp_path):
    for suffix in (".stl", ".obj", ".ply", ".glb"):
        path = tmp_path / f"mesh{suffix}"
        write_mesh(path, np.zeros((3, 3)), [[0, 1, 2], [1, 1, 1]])
        assert len(read_mesh(path).faces) == 2


@pytest.mark.parametrize(
    "vertices, faces, more, match",
    [
        (VERTICES[:, :2], FACES, {}, r"`vertices` must have the shape \(n, 3\), got \(5, 2\)"),
        (VERTICES[:0], FACES, {}, "`vertices` must hold at least one row"),
        (VERTICES + 1j, FACES, {}, "`vertices` must be real numbers, got the dtype complex128"),
        (np.where(FACES[1, 0] == np.arange(5)[:, None], np.nan, VERTICES), FACES, {}, r"got .* in row 2\."),
        (VERTICES * 1e38, FACES, {}, "`vertices` must be finite and at most 3.4e.38"),
        (VERTICES, FACES[0], {}, r"`faces` must have the shape \(m, 3\), got \(3,\)"),
        (VERTICES, FACES[:0], {}, "`faces` must hold at least one triangle"),
        (VERTICES, FACES * 1.0, {}, "`faces` must be integers, got the dtype float64"),
        (VERTICES, FACES + 2, {}, r"`faces` must be indices from 0 to 4, got \[4, 3, 5\] in row 1"),
        (VERTICES, FACES - 1, {}, r"got \[-1, 0, 1\] in row 0"),
        (
            VERTICES,
            FACES,
            {"normals": NORMALS[1:]},
            r"`normals` must have the shape \(5, 3\) as `vertices`, got \(4, 3\)",
        ),
        (
            VERTICES,
            FACES,
            {"colours": COLOURS[1:]},
            r"`colours` must have the shape \(5, 3\) or \(5, 4\), got \(4, 3\)",
        ),
        (VERTICES, FACES, {"colours": COLOURS > 3}, "`colours` must be real numbers, got the dtype bool"),
        (VERTICES, FACES, {"colours": COLOURS * 1.0}, r"between 0 and 1, got \[255.0, 0.0, 0.0\] in row 0"),
        (VERTICES, FACES, {"colours": COLOURS.astype(int) * 2}, "of dtype int64 must lie between 0 and 255"),
    ],
)
def test_wrong_arguments(tmp_path, vertices, faces, more, match):
    with pytest.raises(InputError, match=match):
        write_mesh(tmp_path / "mesh.ply", vertices, faces, **more)
    assert not list(tmp_path.iterdir())


def test_wrong_files(tmp_path):
    with pytest.raises(InputError, match="expected a suffix among .stl .obj .ply .glb, got .step"):
        write_mesh(tmp_path / "mesh.step", VERTICES, FACES)
    with pytest.raises(InputError, match="got no suffix"):
        write_mesh(tmp_path / "mesh", VERTICES, FACES)
    with pytest.raises(InputError, match="folder .* does not exist"):
        write_mesh(tmp_path / "none" / "mesh.stl", VERTICES, FACES)
    with pytest.raises(InputError, match="`colours` have no place in STL files"):
        write_mesh(tmp_path / "mesh.stl", VERTICES, FACES, colours=COLOURS)


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(InputError, match=r"`trimesh` is needed .* `pip install 'jaxsurf\[mesh\]'`"):
        write_mesh(tmp_path / "mesh.stl", VERTICES, FACES)


KILLED = """
import os, pathlib, signal, sys
from jaxsurf.io._mesh import write_mesh

def write_half(path, content):
    with open(path, "wb") as file:
        file.write(content[: len(content) // 2])
    os.kill(os.getpid(), signal.SIGKILL)

pathlib.Path.write_bytes = write_half
write_mesh(sys.argv[1], [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
"""


def test_a_killed_process_leaves_the_old_file(tmp_path):
    path = tmp_path / "mesh.stl"
    write_mesh(path, VERTICES, FACES)
    before = path.read_bytes()
    assert subprocess.run([sys.executable, "-c", KILLED, str(path)]).returncode == -signal.SIGKILL
    assert path.read_bytes() == before
