"""The bytes of a file, or one sentence that says why they cannot be read."""

import mmap
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from .._errors import InputError

_T = TypeVar("_T")
_PACKED = {
    b"\x1f\x8b": "packed by gzip",
    b"BZh": "packed by bzip2",
    b"\xfd7zXZ": "packed by xz",
    b"7z\xbc\xaf": "packed by 7-Zip",
    b"\x28\xb5\x2f\xfd": "packed by zstd",
    b"Rar!": "packed by RAR",
}


def refusal(path: str | os.PathLike, sentence: str) -> InputError:
    """The error "Cannot read '{path}': {sentence}."; the caller raises it."""
    return InputError(f"Cannot read {str(path)!r}: {sentence}.")


def reason(error: BaseException) -> str:
    """The first line of another library's message, short enough to stand inside a sentence."""
    lines = str(error).strip().splitlines()
    return lines[0].strip(" .")[:120] if lines else type(error).__name__


def read_bytes(path: str | os.PathLike) -> bytes:
    """The whole file as bytes.

    Raises `InputError` when the file is missing, a folder, no ordinary file, empty, packed, a Git LFS
    pointer, or may not be read.
    """
    return _checked(Path(path), lambda path: path.read_bytes())


def map_bytes(path: str | os.PathLike) -> Any:
    """The file as memory that is read where it is looked at; checked, and refused, as by `read_bytes`."""

    def mapped(path: Path) -> Any:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if path.stat().st_size else b""

    return _checked(Path(path), mapped)


def _checked(path: Path, read: Callable[[Path], Any]) -> Any:
    try:
        if path.is_dir():
            raise refusal(path, "it is a folder; give the name of a file")
        if not path.exists():
            raise refusal(path, "the file does not exist; check the name")
        if not path.is_file():  # a pipe would wait for ever
            raise refusal(path, "it is no ordinary file; copy its content into one")
        data = read(path)
    except PermissionError as error:
        raise refusal(path, "permission denied; ask its owner for the right to read it") from error
    except OSError as error:
        raise refusal(path, f"the system says {error.strerror or reason(error)!r}") from error
    if not data:
        raise refusal(path, "the file is empty; export or copy it again")
    for magic, packed in _PACKED.items():
        if data[: len(magic)] == magic:
            raise refusal(path, f"it is {packed}; unpack it first")
    if data[:23] == b"version https://git-lfs":
        raise refusal(path, "it is a Git LFS pointer, not the data; fetch the data with `git lfs pull`")
    return data


def guarded(path: Path, kind: str, read: Callable[[], _T]) -> _T:
    """Whatever a foreign reader raises on a damaged file becomes one sentence; its warnings stay inside."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read()
    except (InputError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of a Rust library derives from BaseException
        raise refusal(
            path,
            f"its {kind} data cannot be read ({reason(error)}); the file is cut or damaged, copy it again",
        ) from error
