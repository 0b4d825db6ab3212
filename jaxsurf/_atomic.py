"""Files that are whole or absent: write beside the target, then rename."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ._errors import InputError


@contextlib.contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """Give a temporary path in the target's folder (same suffix); move it over `path` when the block succeeds.

    A process killed inside the block leaves the old file, or none; after it, the new one. The temporary file is
    removed on errors. Raises `InputError` if the folder is missing or cannot be written.
    """
    path = Path(path)
    check_writable(path)
    temporary = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
        temporary.chmod(mode)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"Cannot write {str(path)!r}: {error.strerror or error}.") from error
        raise


def check_writable(path: str | os.PathLike) -> None:
    """Refuse a target that could not be written, before the work that makes its content begins."""
    path = Path(path)
    if path.is_dir():
        raise InputError(f"Cannot write {str(path)!r}: it is a folder; give the name of a file.")
    if not path.parent.is_dir():
        raise InputError(f"Cannot write {str(path)!r}: the folder {str(path.parent)!r} does not exist; create it first.")
    if not os.access(path.parent, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise InputError(f"Cannot write {str(path)!r}: permission denied; choose another place.")


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
