"""Reading measured points: one door for all formats."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ._e57 import read_e57
from ._las import read_las
from ._npy import read_npy, read_npz
from ._obj import read_obj
from ._pcd import read_pcd
from ._ply import read_ply
from ._rows import Rows, checked_points
from ._source import read_bytes, refusal
from ._stl import read_stl
from ._xyz import read_text

_READERS: dict[str, Callable[[Path, bytes], Rows]] = {
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


def read_points(path: str | os.PathLike) -> np.ndarray:
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

    Raises `InputError` when the file is missing, empty, of an unknown format, cut (every count that the
    format has is compared with the data), or holds NaN or infinite coordinates; the message names the line or
    the point, counted from 1.
    """
    path = Path(path)
    data = read_bytes(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        suffix = repr(path.suffix) if path.suffix else "no suffix"
        raise refusal(path, f"expected a suffix among {' '.join(_READERS)}, got {suffix}; rename or convert it")
    return checked_points(path, reader(path, data))
