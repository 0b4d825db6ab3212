"""How a result was made: machine, versions, input file."""

import datetime
import hashlib
import importlib.metadata
import os
import platform
import shlex
import sys
from collections.abc import Sequence

from .._errors import InputError

PACKAGES = ("jaxsurf", "jax", "jaxlib", "equinox", "optimistix", "lineax", "numpy", "scipy")
BLOCK = 1 << 20


def provenance(
    *, input_path: str | os.PathLike | None = None, command: Sequence[str] | None = None
) -> tuple[tuple[str, str], ...]:
    """Rows (label, text) for `Report.provenance`: command, date, machine, versions, input file, SHA-256.

    `command`: the words of the command line, by default those of this process. Raises `InputError` if the
    input file cannot be read.
    """
    words = list(sys.argv if command is None else command)
    rows = [("command", shlex.join([os.path.basename(words[0]), *words[1:]]) if words else "")]
    rows.append(("date", datetime.datetime.now().astimezone().isoformat(timespec="seconds")))
    if input_path is not None:
        rows.append(("input file", os.path.basename(os.fspath(input_path))))
        rows.append(("SHA-256 of the input", file_digest(input_path)))
    rows.append(("machine", f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors"))
    rows.append(("Python", platform.python_version()))
    rows += [(package, version) for package in PACKAGES if (version := _version(package))]
    return tuple(rows)


def file_digest(path: str | os.PathLike) -> str:
    """SHA-256 of a file, in hexadecimal. Raises `InputError` if it cannot be read."""
    digest = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            while block := file.read(BLOCK):
                digest.update(block)
    except OSError as error:
        raise InputError(f"Cannot read {os.fspath(path)!r}: {error.strerror or error}.") from error
    return digest.hexdigest()


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
