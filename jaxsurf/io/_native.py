"""The library's own file format: every shape, bit by bit.

A file is a zip archive, not compressed: `jaxsurf.json` with the format's name, its version and the tree, and
the arrays as `arrays/0.npy`, `arrays/1.npy`, ... The same shape gives the same bytes.
"""

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import check_writable, replacing
from .._errors import InputError
from ._decode import Decoder
from ._encode import encode
from ._npy import zip_entries
from ._source import read_bytes, refusal

_FORMAT = "jaxsurf"
_VERSION = 1
_HEADER = "jaxsurf.json"


def save(path: str | os.PathLike, shape: object) -> None:
    """Save a shape, or any tree of shapes, without loss; `load` gives it back. Usual suffix: `.jxs`.

    The tree may hold the library's classes, tuples, lists, dicts with strings as keys, None, arrays of jax
    and numpy of any dtype, numbers, strings and bools. The file appears whole or not at all.

    Raises `InputError` on the caller's own functions and classes (it says where in the tree), on traced
    arrays, and if the file cannot be written.
    """
    check_writable(path)
    arrays: list[np.ndarray] = []
    try:
        tree = encode(shape, "shape", arrays)
        header = json.dumps({"format": _FORMAT, "version": _VERSION, "tree": tree}, allow_nan=False)
    except RecursionError as error:
        raise InputError("Cannot save `shape`: it is nested too deeply, or holds itself; flatten it.") from error
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        archive.writestr(zipfile.ZipInfo(_HEADER), header)
        for number, array in enumerate(arrays):
            with archive.open(zipfile.ZipInfo(f"arrays/{number}.npy"), "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)


def load(path: str | os.PathLike) -> Any:
    """The tree that `save` wrote, with the same classes, dtypes and bits; nothing in the file is run.

    Raises `InputError` when the file is missing, foreign, cut, damaged, of a newer version, names a class or
    a field that is not known here, or holds 64-bit jax arrays while x64 is off.
    """
    path = Path(path)
    data = read_bytes(path)
    if not data.startswith(b"PK"):
        raise refusal(path, "expected a file written by `jaxsurf.save`, got another format; check its name")
    entries = zip_entries(path, data)
    foreign = refusal(path, "expected a file written by `jaxsurf.save`, got another zip archive; check its name")
    if _HEADER not in entries:
        raise foreign
    try:
        header = json.loads(entries[_HEADER])
    except (ValueError, RecursionError) as error:
        raise refusal(path, "its description is damaged; save the shape again") from error
    if not isinstance(header, dict) or header.get("format") != _FORMAT or type(header.get("version")) is not int:
        raise foreign
    if not 1 <= header["version"] <= _VERSION:
        raise refusal(
            path,
            f"it has the format version {header['version']}, and this jaxsurf reads up to {_VERSION}; "
            "upgrade jaxsurf with `pip install -U jaxsurf`",
        )
    if "tree" not in header:
        raise refusal(path, "its description has no tree; save the shape again")
    try:
        return Decoder(path, entries).decode(header["tree"], "shape")
    except RecursionError as error:
        raise refusal(path, "it is nested too deeply; save a flatter tree") from error
