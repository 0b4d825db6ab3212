"""One builder per format of point files: points in, bytes out."""

import io
import struct
import tempfile
from pathlib import Path

import numpy as np


def rows(points, separator=" ", end="\n"):
    return "".join(separator.join(f"{x:.6f}" for x in point) + end for point in points)


def ply_header(kind, count, properties=("double x", "double y", "double z"), more=()):
    lines = [
        "ply",
        f"format {kind} 1.0",
        f"element vertex {count}",
        *(f"property {p}" for p in properties),
        *more,
    ]
    return ("\n".join([*lines, "end_header"]) + "\n").encode()


def binary_ply(points, order):
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    return ply_header(kind, len(points)) + points.astype(f"{order}f8").tobytes()


def ascii_stl(points):
    text = "solid cloud\n"
    for corners in points.reshape(-1, 3, 3):
        vertices = "".join(f"    vertex {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in corners)
        text += f"  facet normal 0 0 1\n   outer loop\n{vertices}   endloop\n  endfacet\n"
    return (text + "endsolid cloud\n").encode()


def binary_stl(points, header=b"solid, says this binary header"):
    facets = points.reshape(-1, 3, 3)
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *corners.ravel(), 0) for corners in facets)
    return header.ljust(80, b"\0") + struct.pack("<I", len(facets)) + body


def npy(points):
    stream = io.BytesIO()
    np.save(stream, points)
    return stream.getvalue()


def npz(points, **more):
    stream = io.BytesIO()
    np.savez_compressed(stream, points=points, **more)
    return stream.getvalue()


def las(points, suffix=".las"):
    import laspy

    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 1e-6), np.array([5.0, 0.0, 0.0])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    return _written(suffix, lambda path: cloud.write(str(path)))


def e57(points, **pose):
    import pye57

    def write(path):
        file = pye57.E57(str(path), mode="w")
        file.write_scan_raw({f"cartesian{axis}": points[:, i] for i, axis in enumerate("XYZ")}, **pose)
        file.close()

    return _written(".e57", write)


def pcd_header(points, encoding, size=4):
    return (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\n"
        f"SIZE {size} {size} {size}\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {encoding}\n"
    ).encode()


def compressed_pcd(points):
    # pypcd4 gives up on numbers that do not shrink; the format allows runs of 32 bytes as they are.
    plain = points.astype("<f4").T.tobytes()
    runs = [plain[at : at + 32] for at in range(0, len(plain), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    return pcd_header(points, "binary_compressed") + struct.pack("<II", len(packed), len(plain)) + packed


def _written(suffix, write):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"cloud{suffix}"
        write(path)
        return path.read_bytes()


def with_count(points):
    return f"{len(points)}\n{rows(points)}".encode()


# name -> (suffix, builder, relative exactness, True if every cut can be seen from a count or a checksum)
FORMATS = {
    "xyz": (".xyz", lambda p: rows(p).encode(), 1e-6, False),
    "txt": (".TXT", lambda p: rows(p, "\t").encode(), 1e-6, False),
    "asc": (".asc", lambda p: rows(p, ", ").encode(), 1e-6, False),
    "csv": (".csv", lambda p: ("x,y,z\n" + rows(p, ",")).encode(), 1e-6, False),
    "pts": (".pts", with_count, 1e-6, True),
    "npy": (".npy", npy, 0, True),
    "npz": (".npz", npz, 0, True),
    "ply text": (".ply", lambda p: ply_header("ascii", len(p)) + rows(p).encode(), 1e-6, True),
    "ply little": (".ply", lambda p: binary_ply(p, "<"), 0, True),
    "ply big": (".ply", lambda p: binary_ply(p, ">"), 0, True),
    "stl text": (".stl", ascii_stl, 1e-6, True),
    "stl binary": (".stl", binary_stl, 1e-6, True),
    "obj": (".obj", lambda p: "".join(f"v {line}\n" for line in rows(p).splitlines()).encode(), 1e-6, False),
    "las": (".las", las, 1e-6, True),
    "laz": (".laz", lambda p: las(p, ".laz"), 1e-6, True),
    "e57": (".e57", e57, 1e-6, True),
    "pcd text": (".pcd", lambda p: pcd_header(p, "ascii") + rows(p).encode(), 1e-6, True),
    "pcd binary": (".pcd", lambda p: pcd_header(p, "binary", 8) + p.tobytes(), 0, True),
    "pcd compressed": (".pcd", compressed_pcd, 1e-6, True),
}
