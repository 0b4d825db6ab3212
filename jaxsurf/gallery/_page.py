"""Pages of the gallery: figures of the papers, rebuilt and measured."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import replacing
from .._errors import InputError
from ..report import Report, Table, provenance, write_report
from ..view import png_bytes

_PAGES = {"joins": "_joins", "quaternion-integrals": "_quaternion_integrals", "sweeps": "_sweeps"}
"""By name: the file that makes the page, with a function `make` of no arguments."""


@dataclass(frozen=True)
class Page:
    """What a page shows.

    title: the heading; pictures: (file name without suffix, caption, pixels (h, w, 3)); measured: tables of what was
    measured on the shapes in the pictures; shapes: the shapes themselves by the file name of their picture.
    """

    title: str
    pictures: Sequence[tuple[str, str, np.ndarray]]
    measured: Sequence[Table]
    shapes: dict[str, Any]


def names() -> tuple[str, ...]:
    """The names of all pages."""
    return tuple(_PAGES)


def page(name: str) -> Page:
    """Make the page called `name`: its shapes, pictures and figures. Raises `InputError` for names that are not there."""
    if name not in _PAGES:
        raise InputError(f"There is no gallery page {name!r}; there are {', '.join(_PAGES)}.")
    make: Callable[[], Page] = import_module(f".{_PAGES[name]}", __package__).make
    return make()


def write_page(folder: str | os.PathLike, name: str) -> list[Path]:
    """Write the page as NAME.html and its pictures as .png files into `folder`, which is made; returns what was written."""
    made = page(name)
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        raise InputError(f"Cannot make the folder {str(target)!r}: {failure.strerror}.") from None
    pictures = [(file, caption, png_bytes(pixels)) for file, caption, pixels in made.pictures]
    written = []
    for file, _, png in pictures:
        written.append(target / f"{name}-{file}.png")
        with replacing(written[-1]) as temporary:
            temporary.write_bytes(png)
    written.append(target / f"{name}.html")
    report = Report(
        title=made.title,
        pictures=[(caption, png) for _, caption, png in pictures],
        tables=made.measured,
        provenance=provenance(),
    )
    write_report(written[-1], report)
    return written
