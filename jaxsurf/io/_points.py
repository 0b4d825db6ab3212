"""Reading measured points: one door for all formats."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from ._e57 import read_e57
from ._las import read_las
from ._npy import read_npy, read_npz
from ._obj import read_obj
from ._pcd import read_pcd
from ._ply import read_ply
from ._rows import Part, Rows, checked_points
from ._source import map_bytes, read_bytes, refusal
from ._stl import read_stl
from ._xyz import read_text

_READERS: dict[str, Callable[..., Rows]] = {
    ".xyz": read_text,
    ".txt": read_text,
    ".asc": read_text,
    ".pts": read_text,
    ".csv": read_text,
    ".npy": read_npy,
    ".npz": read_npz,
    ".ply": read_ply,
    ".stl": read_stl,
    ".obj": read_obj,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
    ".pcd": read_pcd,
}


# Readers that look only at a part of the file, or give rows that are read where they are looked at.
_IN_PARTS: dict[str, Any] = {
    suffix: reader for suffix, reader in _READERS.items() if reader in (read_text, read_ply, read_pcd)
}


def read_points(path: str | os.PathLike, *, shard: tuple[int, int] | None = None) -> np.ndarray:
    """Points of a file as a float64 array of shape (N, 3); the suffix of the name says the format.

    - `.xyz .txt .asc .pts .csv`: one point in a row, columns apart by white space, commas or semicolons; what
      stands behind `#` or `//` is a comment, a first row of names says which columns are x, y, z, a first row
      of one integer is the number of points.
    - `.npy .npz`: an array (N, 3 or more); in `.npz` the one called `points`, or the only one.
    - `.ply .stl .obj`: the vertices, text or binary, used by faces or not; of STL, equal ones are one point.
    - `.pcd`: text, binary or compressed (this one with the extra `scan`).
    - `.las .laz .e57`: with the extra `scan`; scale and offset are applied, the poses of scans too.

    Columns behind the third (normals, colours, intensity) are left aside. Equal points stay, in the file's
    order. The numbers are those of the file: no unit is known, nothing is moved or scaled.

    shard: (i, n) for the i-th, from 0, of n consecutive parts of the points, as equal as can be; one may be empty. Text,
    `.npy`, binary `.ply` and binary `.pcd` are then never held whole; the other formats are read, and a part kept.

    Raises `InputError` when the file is missing, empty, of an unknown format, cut (every count that the
    format has is compared with the data), or holds NaN or infinite coordinates; the message names the line or
    the point, counted from 1.
    """
    path = Path(path)
    part = None if shard is None else _part(shard)
    data = read_bytes(path) if part is None else map_bytes(path)
    suffix = path.suffix.lower()
    reader = _READERS.get(suffix)
    if reader is None:
        said = repr(path.suffix) if path.suffix else "no suffix"
        raise refusal(path, f"expected a suffix among {' '.join(_READERS)}, got {said}; rename or convert it")
    if part is None:
        return checked_points(path, reader(path, data))
    if suffix in _IN_PARTS:
        return checked_points(path, _IN_PARTS[suffix](path, data, part), part)
    rows = reader(path, data if suffix == ".npy" else data[:])
    return checked_points(path, rows._replace(points=rows.points[part.of(len(rows.points))]), part)


def _part(shard: tuple[int, int]) -> Part:
    if len(shard) != 2 or not 0 <= shard[0] < shard[1]:
        raise InputError(f"`shard` must be (i, n) with 0 ≤ i < n, such as (0, 4), got {shard!r}.")
    return Part(*shard)
