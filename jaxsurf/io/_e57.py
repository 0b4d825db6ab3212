"""Points from .e57 files, through pye57."""

import os
from pathlib import Path
from types import ModuleType

import numpy as np

from .._errors import import_optional
from ._rows import Rows
from ._source import guarded, refusal

_CUT = "the file is cut or damaged, copy or export it again"


def read_e57(path: Path, data: bytes) -> Rows:
    """All scans of an .e57 file one after the other, each moved by its pose; invalid points are left out."""
    pye57 = import_optional("pye57", extra="scan", purpose="reading .e57 files")
    if not data.startswith(b"ASTM-E57"):
        raise refusal(path, f"expected an E57 file, which begins with 'ASTM-E57', got {data[:12]!r}; check its suffix")
    size = int.from_bytes(data[16:24], "little")
    if size != len(data):
        raise refusal(path, f"expected {size} bytes as its E57 header says, got {len(data)}; {_CUT}")
    return Rows(guarded(path, "E57", lambda: _scans(pye57, path)))


def _scans(pye57: ModuleType, path: Path) -> np.ndarray:
    file = pye57.E57(os.fspath(path))
    try:
        scans = [np.empty((0, 3))]
        for index in range(file.scan_count):
            scan = file.read_scan(index, ignore_missing_fields=True)
            scans.append(np.stack([scan[name] for name in ("cartesianX", "cartesianY", "cartesianZ")], axis=1))
        return np.concatenate(scans)
    finally:
        file.close()
