"""One array in numpy's .npy layout, checked before anything is allocated; and points from .npy and .npz."""

import io
import math
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ._rows import Rows
from ._source import reason, refusal

_HEADER = 1 << 17  # bytes, more than any header of an array of numbers has
_POINT_NAMES = ("points", "xyz", "vertices", "arr_0")


def array_from_npy(path: Path, data: Any, *, name: str = "the array") -> np.ndarray:
    """The array in the bytes of a .npy file, read-only.

    Pickled objects are refused, and so is a header that promises more or less data than there is.
    """
    stream = io.BytesIO(data[:_HEADER])
    try:
        version = np.lib.format.read_magic(stream)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read_header(stream)
    except Exception as error:  # a damaged header may raise nearly anything: it is parsed as Python
        raise refusal(
            path,
            f"expected {name} in numpy's .npy layout, got a damaged header ({reason(error)}); save it again",
        ) from error
    if dtype.hasobject:
        raise refusal(path, f"expected numbers in {name}, got Python objects; save it with a numeric dtype")
    promised, there = math.prod(shape) * dtype.itemsize, len(data) - stream.tell()
    if promised != there or any(extent < 0 for extent in shape):
        raise refusal(
            path,
            f"expected {promised} bytes of data in {name} for its shape {shape}, got {there}; "
            "the file is cut or damaged, copy or save it again",
        )
    if not promised:
        return np.empty(shape, dtype)
    flat = np.frombuffer(data, dtype=dtype, offset=stream.tell())
    return flat.reshape(shape, order="F" if fortran else "C")


def zip_entries(path: Path, data: bytes) -> dict[str, bytes]:
    """The content of every entry of an archive by name; each is checked against its checksum."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    except (
        zipfile.BadZipFile,
        zlib.error,
        OSError,
        EOFError,
        RuntimeError,
        ValueError,
        NotImplementedError,
    ) as error:
        raise refusal(path, f"the file is cut or damaged ({reason(error)}); copy it again from its source") from error


def read_npy(path: Path, data: Any) -> Rows:
    """The one array of a .npy file."""
    return _as_points(path, array_from_npy(path, data), "the array")


def read_npz(path: Path, data: bytes) -> Rows:
    """The array `points`, `xyz`, `vertices` or `arr_0`, the only array, or `x`, `y` and `z` together."""
    if not data.startswith(b"PK"):
        raise refusal(path, "expected numpy's .npz layout, got something else; save it with `numpy.savez`")
    entries = {name.removesuffix(".npy"): content for name, content in zip_entries(path, data).items()}
    chosen = next((name for name in _POINT_NAMES if name in entries), None)
    if chosen is None and len(entries) == 1:
        (chosen,) = entries
    if chosen is not None:
        label = f"the array `{chosen}`"
        return _as_points(path, array_from_npy(path, entries[chosen], name=label), label)
    if all(axis in entries for axis in "xyz"):
        axes = [array_from_npy(path, entries[axis], name=f"the array `{axis}`") for axis in "xyz"]
        if any(axis.ndim != 1 or axis.shape != axes[0].shape for axis in axes):
            shapes = ", ".join(str(axis.shape) for axis in axes)
            raise refusal(path, f"expected arrays `x`, `y` and `z` of one shape (N,), got {shapes}")
        return _as_points(path, np.stack(axes, axis=1), "the arrays `x`, `y` and `z`")
    raise refusal(
        path,
        f"expected an array called `points`, got {', '.join(sorted(entries)) or 'none'}; save it under that name",
    )


def _as_points(path: Path, array: np.ndarray, name: str) -> Rows:
    if array.dtype.names is not None:
        if not all(axis in array.dtype.names for axis in "xyz") or array.ndim != 1:
            raise refusal(path, f"expected the fields x, y and z in {name}, got {', '.join(array.dtype.names)}")
        array = np.stack([array[axis] for axis in "xyz"], axis=-1)
    if array.dtype.kind not in "fiu":
        raise refusal(path, f"expected real numbers in {name}, got the dtype {array.dtype}; save it as float64")
    if array.ndim != 2 or array.shape[1] < 3:
        raise refusal(path, f"expected the shape (N, 3) of {name}, got {array.shape}; save one point in a row")
    if array.shape[0] == 3 and array.shape[1] > 3:
        raise refusal(
            path,
            f"expected the shape (N, 3) of {name}, got {array.shape}; save its transpose",
        )
    return Rows(array[:, :3])
