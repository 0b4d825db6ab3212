"""Writing triangle meshes through trimesh."""

import os
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from .._atomic import check_writable, replacing
from .._errors import InputError, import_optional

_SUFFIXES = (".stl", ".obj", ".ply", ".glb")
_DIGITS = 9  # of the largest coordinate in OBJ text, where normals and colours have at least eight decimals


def write_mesh(
    path: str | os.PathLike,
    vertices: ArrayLike,  # no shapes here: the checks below say it in a sentence
    faces: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    colours: ArrayLike | None = None,
) -> None:
    """Write triangles as binary STL, OBJ, binary PLY or GLB; the suffix of `path` says which.

    `faces` are indices into `vertices`, counted from 0 and counter-clockwise seen from outside. `normals` are
    one unit vector per vertex (STL has no place for them and leaves them out). `colours` are one RGB or RGBA
    per vertex, integers from 0 to 255 or floats from 0 to 1 (refused for STL). No unit is written. STL, PLY
    and GLB hold 32-bit floats, relative error 6e-8; OBJ holds at least nine digits of the largest coordinate.

    The file appears whole or not at all. Raises `InputError` on a wrong suffix, shape, index or value.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise InputError(
            f"Cannot write {str(path)!r}: expected a suffix among {' '.join(_SUFFIXES)}, "
            f"got {path.suffix or 'no suffix'}; rename it."
        )
    check_writable(path)
    vertices = _rows("vertices", vertices)
    faces = _faces(faces, len(vertices))
    if normals is not None:
        normals = _rows("normals", normals, count=len(vertices))
    if colours is not None:
        if suffix == ".stl":
            raise InputError("`colours` have no place in STL files; leave them out or write .ply, .obj or .glb.")
        colours = _colours(colours, len(vertices))
    trimesh = import_optional("trimesh", extra="mesh", purpose="writing meshes")
    content = _encoded(trimesh, suffix, vertices, faces, normals, colours)
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _encoded(
    trimesh: ModuleType,
    suffix: str,
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray | None,
    colours: np.ndarray | None,
) -> bytes:
    with np.errstate(all="ignore"):  # normals of triangles without area; they come out as zeros
        # validate=False: nothing is merged, dropped or turned
        mesh = trimesh.Trimesh(vertices, faces, vertex_normals=normals, vertex_colors=colours, process=False, validate=False)
        if suffix == ".stl":
            return mesh.export(file_type="stl")
        if suffix == ".obj":
            decimals = max(8, _DIGITS - 1 - int(np.floor(np.log10(max(np.abs(vertices).max(), 1e-300)))))
            text = mesh.export(file_type="obj", include_normals=normals is not None, digits=decimals, header=None)
            return text.encode()
        if suffix == ".ply":
            return mesh.export(file_type="ply", vertex_normal=normals is not None)
        return mesh.export(file_type="glb", include_normals=normals is not None)


def _rows(name: str, values: ArrayLike, *, count: int | None = None) -> np.ndarray:
    array = np.asarray(values)
    expected = "(n, 3)" if count is None else f"({count}, 3) as `vertices`"
    if array.ndim != 2 or array.shape[1] != 3 or (count is not None and len(array) != count):
        raise InputError(f"`{name}` must have the shape {expected}, got {array.shape}.")
    if array.dtype.kind not in "fiu":
        raise InputError(f"`{name}` must be real numbers, got the dtype {array.dtype}.")
    if not len(array):
        raise InputError(f"`{name}` must hold at least one row, got none; tessellate the shape first.")
    array = array.astype(np.float64)
    largest = np.finfo(np.float32).max
    bad = ~(np.abs(array) <= largest).all(axis=1)  # NaN compares false
    if bad.any():
        first = int(bad.argmax())
        raise InputError(f"`{name}` must be finite and at most {largest:.3g}, got {array[first].tolist()} in row {first}.")
    return array


def _faces(faces: ArrayLike, count: int) -> np.ndarray:
    array = np.asarray(faces)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"`faces` must have the shape (m, 3), got {array.shape}.")
    if array.dtype.kind not in "iu":
        raise InputError(f"`faces` must be integers, got the dtype {array.dtype}.")
    if not len(array):
        raise InputError("`faces` must hold at least one triangle, got none; tessellate the shape first.")
    bad = ((array < 0) | (array >= count)).any(axis=1)
    if bad.any():
        first = int(bad.argmax())
        raise InputError(f"`faces` must be indices from 0 to {count - 1}, got {array[first].tolist()} in row {first}.")
    return array.astype(np.int64)


def _colours(colours: ArrayLike, count: int) -> np.ndarray:
    array = np.asarray(colours)
    if array.ndim != 2 or array.shape[0] != count or array.shape[1] not in (3, 4):
        raise InputError(f"`colours` must have the shape ({count}, 3) or ({count}, 4), got {array.shape}.")
    if array.dtype.kind not in "fiu":
        raise InputError(f"`colours` must be real numbers, got the dtype {array.dtype}.")
    highest = 1 if array.dtype.kind == "f" else 255
    bad = ~((array >= 0) & (array <= highest)).all(axis=1)
    if bad.any():
        first = int(bad.argmax())
        raise InputError(
            f"`colours` of dtype {array.dtype} must lie between 0 and {highest}, got {array[first].tolist()} in row {first}."
        )
    return array.astype(np.uint8) if highest == 255 else np.round(array * 255).astype(np.uint8)
