"""Rooms that `import jaxsurf` leaves for their first use: files, triangles, pictures and reports."""

import importlib
import sys
from typing import Any

_ROOMS = ("io", "mesh", "report", "view")
_NAMES = {"save": "io", "load": "io", "tessellate": "mesh", "Mesh": "mesh"}


def __getattr__(name: str) -> Any:
    """The module-level `__getattr__` of the package (PEP 562)."""
    if name in _ROOMS:
        return importlib.import_module(f"jaxsurf.{name}")
    if name in _NAMES:
        return getattr(importlib.import_module(f"jaxsurf.{_NAMES[name]}"), name)
    raise AttributeError(f"module 'jaxsurf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*vars(sys.modules["jaxsurf"]), *_ROOMS, *_NAMES})
