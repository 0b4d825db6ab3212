"""`read_points`: what goes in comes out, and every bad file is refused with one sentence."""

import os
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloud_files import (
    FORMATS,
    ascii_stl,
    binary_ply,
    binary_stl,
    e57,
    las,
    npy,
    npz,
    pcd_header,
    ply_header,
    rows,
)

from jaxsurf._errors import InputError
from jaxsurf.io._points import read_points

POINTS = np.random.default_rng(7).uniform(-3.0, 3.0, (60, 3))
DATA = Path(__file__).parents[1] / "data"


@pytest.fixture
def write(tmp_path):
    def writer(name, content):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return writer


def save_arrays(path, arrays: dict[str, Any]):
    np.savez(path, **arrays)


def refused(path, match):
    with pytest.raises(InputError, match=match) as caught:
        read_points(path)
    message = str(caught.value)
    assert message.startswith(f"Cannot read {str(path)!r}: ") and message.endswith(".") and "\n" not in message


# --- good files


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_its_points_back(write, capfd, name):
    suffix, build, exactness, _ = FORMATS[name]
    points = read_points(write(f"cloud{suffix}", build(POINTS)))
    assert points.shape == (60, 3) and points.dtype == np.float64 and points.flags.writeable
    np.testing.assert_allclose(points, POINTS, rtol=0, atol=3 * exactness)
    assert capfd.readouterr() == ("", "")


def test_measured_points_of_the_tests():
    assert read_points(str(DATA / "bunny_ear.ply")).shape == (658, 3)


TEXTS = {
    "comments and blank lines": "# a\n\n// b\n1 2 3 # c\n4 5 6\n",
    "more columns": "1 2 3 0 0 1 red\n4 5 6 0 0 1 blue\n",
    "no last line end": "1 2 3\n4 5 6",
    "CRLF": "1 2 3\r\n4 5 6\r\n",
    "CR": "1 2 3\r4 5 6\r",
    "commas with spaces": "1, 2, 3\n4, 5, 6\n",
    "semicolons": "1;2;3\n4;5;6\n",
    "tabs": "1\t2\t3\n4\t5\t6\n",
    "indented": "  1  2   3\n\t4 5 6  \n",
    "header": "x,y,z\n1,2,3\n4,5,6\n",
    "header in another order": "id,Z,x,y\na,3,1,2\nb,6,4,5\n",
    "header with units": "X [mm]; Y [mm]; Z [mm]\n1;2;3\n4;5;6\n",
    "header with units and spaces": "X [mm] Y [mm] Z [mm]\n1 2 3\n4 5 6\n",
    "quotes": '"x","y","z"\n"1","2","3"\n"4","5","6"\n',
    "count": "2\n1 2 3 9\n4 5 6 9\n",
    "exponents": "1e0 2E+0 30.0e-1\n4 5. +6\n",
    "empty last column": "1,2,3,\n4,5,6,\n",
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_text_dialects(write, text, encoding):
    np.testing.assert_array_equal(read_points(write("c.csv", text.encode(encoding))), [[1, 2, 3], [4, 5, 6]])


def test_latin_1_comments(write):
    path = write("c.txt", "# Messung Gehäuse\n1 2 3\n".encode("latin-1"))
    np.testing.assert_array_equal(read_points(path), [[1, 2, 3]])


def test_equal_points_stay_except_in_stl(write):
    twice = np.concatenate([POINTS, POINTS])
    assert len(read_points(write("c.xyz", rows(twice)))) == 120
    assert len(read_points(write("c.npy", npy(twice)))) == 120
    kept = read_points(write("c.stl", binary_stl(twice.astype(np.float32))))
    np.testing.assert_array_equal(kept, POINTS.astype(np.float32))


FACE = ("element face 2", "property list uchar int vertex_indices")
Z_FIRST = ("uchar red", "float z", "double y", "short x")


@pytest.mark.parametrize("order", "<>")
def test_ply_layouts(write, order):
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    pack = lambda layout, *values: struct.pack(order + layout, *values)
    vertices = pack("Bfdh", 9, 3.0, 2.0, 1) + pack("Bfdh", 9, 6.0, 5.0, 4)
    faces = pack("B3i", 3, 0, 1, 0) + pack("B4i", 4, 0, 1, 0, 1)
    expected = [[1, 2, 3], [4, 5, 6]]
    behind = ply_header(kind, 2, Z_FIRST, FACE) + vertices + faces
    np.testing.assert_array_equal(read_points(write("a.ply", behind)), expected)
    lists = ply_header(kind, 2, ("list uchar int k", *Z_FIRST))
    lists += pack("B2i", 2, 0, 0) + vertices[:15] + pack("Bi", 1, 0) + vertices[15:]
    np.testing.assert_array_equal(read_points(write("b.ply", lists)), expected)
    before = ply_header(kind, 2, Z_FIRST).replace(b"element vertex", "\n".join([*FACE, "element vertex"]).encode())
    np.testing.assert_array_equal(read_points(write("c.ply", before + faces + vertices)), expected)


def test_text_ply_layouts(write):
    header = ply_header("ascii", 2, ("list uchar int k", "float z", "float y", "float x"), FACE)
    header = header.replace(b"\nelement vertex", "\ncomment Gehäuse\nelement vertex".encode("latin-1"))
    body = b"2 8 8 3 2 1\n0 6 5 4\n\n3 0 1 0\n4 0 1 0 1\n"
    for content in (
        header + body,
        (header + body).replace(b"\n", b"\r\n"),
        (header + body).replace(b"\n", b"\r"),
    ):
        np.testing.assert_array_equal(read_points(write("c.ply", content)), [[1, 2, 3], [4, 5, 6]])


def test_obj_vertices_come_as_they_are(write):
    text = "v 1 2 3 0 0 1\nv 1 2 3 0 0 1\nvn 0 0 1\nvt 0 0\nf 1/1/1 2//1 -1 \\\n 1\nv 4 5 6 1 1 1 # free\n"
    np.testing.assert_array_equal(read_points(write("c.obj", text)), [[1, 2, 3], [1, 2, 3], [4, 5, 6]])


def test_arrays_by_name(write):
    expected = np.arange(12.0).reshape(4, 3)
    x, y, z = expected.T
    assert (read_points(write("a.npz", npz(expected, other=np.ones(3)))) == expected).all()
    for content in (
        {"x": x, "y": y, "z": z},
        {"scan": expected.astype(">f4")},
        {"points": np.asfortranarray(expected)},
    ):
        path = write("b.npz", b"")
        save_arrays(path, content)
        np.testing.assert_array_equal(read_points(path), expected)
    fields = np.zeros(4, [("z", "f4"), ("x", "f8"), ("y", "f8")])
    fields["x"], fields["y"], fields["z"] = x, y, z
    np.testing.assert_array_equal(read_points(write("c.npy", npy(fields))), expected)
    np.testing.assert_array_equal(read_points(write("d.npy", npy(np.arange(12).reshape(2, 6)))), [[0, 1, 2], [6, 7, 8]])


def test_scans_are_moved_by_their_poses(write):
    pose = {"translation": np.array([1.0, 2.0, 3.0]), "rotation": np.array([0.0, 1.0, 0.0, 0.0])}
    moved = POINTS * [1, -1, -1] + [1, 2, 3]
    np.testing.assert_allclose(read_points(write("c.e57", e57(POINTS, **pose))), moved, atol=1e-5)


# --- bad files


def test_files_that_cannot_be_read(write, tmp_path, monkeypatch):
    refused(tmp_path / "none.xyz", "does not exist; check the name")
    refused(tmp_path, "it is a folder")
    os.mkfifo(tmp_path / "pipe.xyz")
    refused(tmp_path / "pipe.xyz", "no ordinary file")
    refused(tmp_path / ("a" * 300 + ".xyz"), "the system says 'File name too long'")
    path = write("c.xyz", rows(POINTS))

    def denied(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", denied)
    refused(path, "permission denied")


@pytest.mark.parametrize("name", FORMATS)
def test_empty_files(write, name):
    refused(write(f"cloud{FORMATS[name][0]}", b""), "the file is empty")


def test_files_of_another_kind(write):
    refused(write("c.foo", "1 2 3\n"), r"expected a suffix among .xyz .txt .* .pcd, got '.foo'")
    refused(write("c", "1 2 3\n"), "got no suffix")
    refused(write("c.xyz.gz", b"\x1f\x8b\x08\0"), "packed by gzip; unpack it first")
    refused(write("c.ply", b"version https://git-lfs.github.com/spec/v1\n"), "Git LFS pointer")
    refused(write("c.xyz", npy(POINTS)), "expected text, got binary data")
    for suffix, said in (
        (".ply", "begins with 'ply'"),
        (".npz", "expected numpy's .npz"),
        (".obj", "lines 'v x y z'"),
    ):
        refused(write(f"c{suffix}", rows(POINTS)), said)
    for suffix, said in (
        (".las", "begins with 'LASF'"),
        (".e57", "begins with 'ASTM-E57'"),
        (".pcd", "PCD header"),
    ):
        refused(write(f"c{suffix}", rows(POINTS)), said)
    refused(write("c.npy", rows(POINTS)), "a damaged header")
    refused(write("c.stl", rows(POINTS)), "its STL header|of its STL header|facets")


@pytest.mark.parametrize("name", FORMATS)
def test_no_points(write, name):
    suffix, build, _, _ = FORMATS[name]
    if suffix in (".e57", ".las", ".laz"):
        pytest.skip("its writer refuses to write no points")
    refused(
        write(f"c{suffix}", build(POINTS[:0]) or b"# nothing\n"),
        "holds no points|expected lines 'v x y z', got none",
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", FORMATS)
def test_the_first_point_that_is_not_finite_is_named(write, name, bad):
    suffix, build, _, _ = FORMATS[name]
    if suffix in (".las", ".laz", ".e57"):
        pytest.skip("its writer does not write such a point")
    points = POINTS.copy()
    points[[16, 40], 1] = bad
    where = {
        "csv": "line 18 ",
        "pts": "line 18 ",
        "ply text": "line 24 ",
        "stl text": "line 40 ",
        "pcd text": "line 28 ",
    }
    binary = "facet 6 " if name == "stl binary" else "point 17 "
    text = suffix.lower() in (".xyz", ".txt", ".asc", ".obj")
    expected = "line 17 " if text else where.get(name, binary)
    refused(
        write(f"c{suffix}", build(points)),
        f"expected finite coordinates, got .* in {expected}.*2 of 60 points",
    )


@pytest.mark.parametrize("name", FORMATS)
def test_cut_files(write, capfd, name):
    suffix, build, _, seen_everywhere = FORMATS[name]
    content = build(POINTS)
    end = len(content) - (len("endsolid cloud\n") if name == "stl text" else 2)
    cuts = [*range(1, len(content) - 100, max(1, len(content) // 60)), *range(len(content) - 60, end + 1)]
    for cut in cuts:
        path = write(f"c{suffix}", content[:cut])
        if seen_everywhere:
            refused(path, ".")
        elif cut > len(content) / 2:  # rows that are whole are a file; a row that is cut is refused
            try:
                assert len(read_points(path)) == content[: cut + 1].count(b"\n") - content.count(b"x,y,z")
            except InputError:
                assert not content[: cut + 1].endswith(b"\n")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_files_raise_nothing_else(write, capfd, name):
    suffix, build, _, _ = FORMATS[name]
    content, random = build(POINTS), np.random.default_rng(3)
    for _ in range(40):
        damaged = bytearray(content)
        for _ in range(random.integers(1, 4)):
            damaged[random.integers(min(len(damaged), 400))] = random.integers(256)
        try:
            points = read_points(write(f"c{suffix}", bytes(damaged)))
            assert points.shape[1] == 3 and np.isfinite(points).all()
        except InputError as error:
            assert "\n" not in str(error)
    assert capfd.readouterr() == ("", "")


TEXT_FAULTS = {
    "1 2\n3 4\n": "expected at least 3 columns .* in line 1, got 2",
    "1 2 3\n4 5\n": "expected 3 columns in line 2, got 2",
    "# c\n\n1 2 3\n4 5 6 7\n": "expected 3 columns in line 4, got 4",
    "1 2 3\n4 five 6\n": "expected numbers in line 2, got '4 five 6'",
    "1,5 2,5 3,5\n": "got decimal commas in line 1",
    "x;y;z\n1,5;2,5;3,5\n": "got decimal commas in line 2",
    '"1,5","2,5","3,5"\n': "got decimal commas in line 1",
    "a,b,c\n1,2,3\n": "expected columns named x, y and z .* in line 1, got 'a, b, c'",
    "x,y,z\n1,2\n": "expected 3 columns in line 2 as in the header, got 2",
    "5\n1 2 3\n": "expected 5 points as its first row says, got 1",
    "x y z\n": "holds no points",
    "1 2 3\n4 5 1e999\n": "in line 2",
    "1_0 2 3\n": "expected numbers in line 1",
}


@pytest.mark.parametrize("text", TEXT_FAULTS)
def test_faults_in_text(write, text):
    refused(write("c.txt", text), TEXT_FAULTS[text])


def test_a_last_row_cut_inside_its_number(write):
    whole = rows(POINTS)
    refused(write("c.xyz", whole[:-3]), "line 60, the last, stops inside a number: expected 6 decimals")
    assert len(read_points(write("c.xyz", "0 0 0.5\n0 1 0.5\n1 1 0"))) == 3  # a short file by hand


def test_faults_in_arrays(write):
    for array, said in (
        (POINTS[:, :2], r"expected the shape \(N, 3\) of the array, got \(60, 2\)"),
        (POINTS.T, r"got \(3, 60\); save its transpose"),
        (POINTS[0], r"got \(3,\)"),
        (POINTS + 1j, "expected real numbers in the array, got the dtype complex128"),
        (np.zeros(4, [("a", "f8")]), "expected the fields x, y and z in the array, got a"),
        (np.array([[None] * 3]), "got Python objects"),
    ):
        refused(write("c.npy", npy(array)), said)
    lie = npy(POINTS).replace(b"(60, 3), }", b"(9999999999999, 3), }")[: len(npy(POINTS))]
    refused(write("c.npy", lie), "expected 239999999999976 bytes of data|damaged header")
    refused(write("c.npy", npy(POINTS) + b"more"), "expected 1440 bytes of data .* got 1444")
    for content, said in (
        ({"a": POINTS, "b": POINTS}, "expected an array called `points`, got a, b"),
        ({"x": POINTS[:, 0], "y": POINTS[:, 1], "z": POINTS[:9, 2]}, "of one shape"),
    ):
        path = write("c.npz", b"")
        save_arrays(path, content)
        refused(path, said)


def test_faults_in_ply(write):
    text, binary = ply_header("ascii", 60), binary_ply(POINTS, "<")
    for content, said in (
        (
            text.replace(b"60", b"61") + rows(POINTS).encode(),
            "expected 61 rows after its PLY header .61 vertex., got 60",
        ),
        (text.replace(b"60", b"59") + rows(POINTS).encode(), "expected 59 rows"),
        (text.replace(b"60", b"99999999999999") + rows(POINTS).encode(), "expected 99999999999999 rows"),
        (
            binary.replace(b"60", b"61", 1),
            "expected at least 1464 more bytes for 61 rows of vertex data, got 1440",
        ),
        (binary.replace(b"60", b"59", 1), "got 24 more bytes"),
        (binary.replace(b"60", b"99999999999999", 1), "rows of vertex data, got 1440"),
        (binary.replace(b"60", b"-1", 1), "line 3 of its PLY header is not understood: 'element vertex -1'"),
        (binary.replace(b"double z", b"double w"), "expected the vertex properties x, y and z, got x, y, w"),
        (binary.replace(b"double z", b"quadruple z"), "line 6 of its PLY header is not understood"),
        (binary.replace(b"element vertex 60\n", b""), "line 3 of its PLY header"),
        (binary.replace(b"element vertex", b"element points"), "expected one element 'vertex'"),
        (binary.replace(b"format binary_little_endian 1.0\n", b""), "expected a line 'format ...'"),
        (binary.replace(b"end_header\n", b""), "expected the line 'end_header', got none"),
        # one vertex more and one face less: the sum is right
        (
            ply_header("ascii", 3, more=("element face 1", FACE[1])) + b"1 2 3\n4 5 6\n3 0 1 0\n3 0 1 0\n",
            "expected 3 columns in line 12, got 4",
        ),
        (
            ply_header("ascii", 1, more=("element face 1", FACE[1])) + b"1 2 3\n3 0 1\n",
            "face data .* in line 11, got '3 0 1'",
        ),
        (
            ply_header("binary_little_endian", 1, ("list char int k", *Z_FIRST)) + b"\xff" * 20,
            "has the length -1",
        ),
        (
            ply_header("binary_little_endian", 1, more=("element face 1", FACE[1])) + b"\0" * 24 + b"\x03\0\0\0",
            "more bytes for 1 rows of face data",
        ),
    ):
        refused(write("c.ply", content), said)


def test_faults_in_stl_and_obj(write):
    binary, text = binary_stl(POINTS), ascii_stl(POINTS)
    for content, said in (
        (binary[:-1], "expected 1084 bytes for the 20 facets of its STL header, got 1083"),
        (binary[:80] + struct.pack("<I", 4_000_000_000) + binary[84:], "4000000000 facets"),
        (binary[:80] + struct.pack("<I", 0) + binary[84:], "the 0 facets of its STL header, got 1084"),
        (binary[:50], "expected an STL header of 84 bytes, got 50"),
        (text[: text.rindex(b"  facet")], "expected the line 'endsolid' at its end, got 'endfacet'"),
        (
            text.replace(b"    vertex", b"    vortex", 1),
            "expected 3 corners in the facet that ends in line 8",
        ),
        (
            b"solid x\nfacet\nvertex 1 2\nvertex 1 2 3\nvertex 1 2 3\nendfacet\nendsolid",
            "3 columns in line 3, got 2",
        ),
    ):
        refused(write("c.stl", content), said)
    for content, said in (
        ("v 1 2\nv 3 4\n", "expected 3 coordinates in line 1"),
        ("v 1 2 3\nv 4 5\n", "expected 4 columns in line 2, got 3"),
        ("v 1 2 3\nv 4 5 z\n", "expected numbers in line 2"),
        ("v 1 2 3\nf 1/1 2/1 9/1\n", "its faces name vertex 9, but it has 1 vertices"),
        ("v 1 2 3\nf a b c\n", "expected vertex numbers in its faces"),
    ):
        refused(write("c.obj", content), said)


def test_faults_in_scans(write):
    content = las(POINTS)
    for at, layout, value, said in (
        (100, "<I", 2**31, "promises 2147483648 records"),
        (96, "<I", 2**31, "promises 0 records"),
        (107, "<I", 2**31, "for the 2147483648 points of its LAS header"),
    ):
        refused(
            write("c.las", content[:at] + struct.pack(layout, value) + content[at + struct.calcsize(layout) :]),
            said,
        )
    refused(write("c.las", content[:100]), "expected a LAS header of 227 bytes, got 100")
    packed = las(POINTS, ".laz")
    refused(
        write("c.laz", packed[:107] + struct.pack("<I", 2**31) + packed[111:]),
        "expected 2147483648 LAZ points",
    )
    refused(write("c.laz", packed[:-20]), "LAZ chunks|LAS data cannot be read")
    refused(write("c.e57", e57(POINTS)[:-1]), "bytes as its E57 header says")
    damaged = bytearray(e57(POINTS))
    damaged[1500] ^= 255
    refused(write("c.e57", damaged), "its E57 data cannot be read")


def test_faults_in_pcd(write):
    text, binary = pcd_header(POINTS, "ascii"), pcd_header(POINTS, "binary", 8) + POINTS.tobytes()
    compressed = FORMATS["pcd compressed"][1](POINTS)
    for content, said in (
        (text + rows(POINTS[:-1]).encode(), "expected 60 PCD points as its header says, got 59 rows"),
        (binary[:-1], "expected 1440 bytes for 60 PCD points, got 1439"),
        (binary.replace(b"POINTS 60", b"POINTS 61"), "promises 61 POINTS, but WIDTH x HEIGHT is 60"),
        (binary.replace(b"x y z", b"a b c"), "expected the PCD fields x, y and z, got a b c"),
        (binary.replace(b"DATA binary", b"DATA sixbit"), "DATA 'sixbit' is unknown"),
        (binary.replace(b"TYPE F F F\n", b""), "its PCD header is not complete"),
        (compressed[:-1], "packed into"),
    ):
        refused(write("c.pcd", content), said)


@pytest.mark.parametrize("name, package", [("las", "laspy"), ("e57", "pye57"), ("pcd compressed", "pypcd4")])
def test_a_missing_package_is_named(write, monkeypatch, name, package):
    suffix, build, _, _ = FORMATS[name]
    path = write(f"c{suffix}", build(POINTS))
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf"`{package}` is needed .* `pip install 'jaxsurf\[scan\]'"):
        read_points(path)


def test_a_pcd_file_that_was_really_compressed(tmp_path):
    from pypcd4.pypcd4 import Encoding, PointCloud

    path, cloud = tmp_path / "c.pcd", PointCloud.from_xyz_points(np.full((60, 3), 0.5, np.float32))
    cloud.save(str(path), encoding=Encoding.BINARY_COMPRESSED)
    assert b"DATA binary_compressed" in path.read_bytes()
    np.testing.assert_array_equal(read_points(path), np.full((60, 3), 0.5))


# --- parts of files


@pytest.mark.parametrize("name", FORMATS)
def test_the_parts_of_a_file_make_the_whole(write, name):
    suffix, build, _, _ = FORMATS[name]
    path = write(f"cloud{suffix}", build(POINTS))
    parts = [read_points(path, shard=(i, 7)) for i in range(7)]
    assert [len(part) for part in parts] == [9, 9, 9, 9, 8, 8, 8]
    np.testing.assert_array_equal(np.concatenate(parts), read_points(path))


@pytest.mark.parametrize("before", ["", "x y z\n", "60\n", "# why\n\nx y z  // names\n"])
def test_text_is_read_in_blocks(write, monkeypatch, before):
    monkeypatch.setattr("jaxsurf.io._xyz._BLOCK", 100)
    path = write("cloud.xyz", before + rows(POINTS[:30]) + "# half\n\n" + rows(POINTS[30:]))
    parts = [read_points(path, shard=(i, 4)) for i in range(4)]
    np.testing.assert_array_equal(np.concatenate(parts), read_points(path))
    bad = path.read_text().replace(f"{POINTS[40, 0]:.6f}", "nan")
    line = next(number for number, text in enumerate(bad.splitlines(), 1) if "nan" in text)
    write("cloud.xyz", bad)
    assert len(read_points(path, shard=(0, 2))) == 30
    with pytest.raises(InputError, match=rf"in line {line} \(1 of 30"):
        read_points(path, shard=(1, 2))


def test_a_point_in_a_part_has_the_number_that_it_has_in_the_file(write):
    points = POINTS.copy()
    points[50] = np.nan
    for name, content in (("c.npy", npy(points)), ("c.ply", binary_ply(points, "<"))):
        with pytest.raises(InputError, match=r"in point 51 \(1 of 30"):
            read_points(write(name, content), shard=(1, 2))


def test_parts_of_few_points_and_wrong_parts(write):
    path = write("c.xyz", "1 2 3\n4 5 6\n")
    assert [len(read_points(path, shard=(i, 3))) for i in range(3)] == [1, 1, 0]
    for shard in ((2, 2), (-1, 2), (0, 0)):
        with pytest.raises(InputError, match=r"`shard` must be \(i, n\)"):
            read_points(path, shard=shard)
    with pytest.raises(InputError, match="it holds no points"):
        read_points(write("c.npy", npy(POINTS[:0])), shard=(0, 2))
    with pytest.raises(InputError, match="the file is empty"):
        read_points(write("c.npy", b""), shard=(0, 2))
