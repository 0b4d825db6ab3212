"""Shaded pictures."""

import os
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import UInt8

from ._backend import Backend, choose_backend
from ._camera import ViewDirection
from ._gather import checked_points, gathered
from ._scene import Dots
from ._sheet import add_scale_bar, add_triad, check_request, finished, new_figure, place_scene


def shade(
    shapes: Any,
    *,
    path: str | os.PathLike | None = None,
    size: tuple[int, int] = (1200, 900),
    camera: ViewDirection = None,
    points: Any = None,
    edges: bool = True,
    unit: str | None = None,
    backend: Backend = "auto",
) -> UInt8[np.ndarray, "h w 3"]:
    """A shaded picture of one or several surfaces, curves and meshes, drawn off screen.

    `camera`: "iso" "top" "bottom" "front" "back" "left" "right", a vector from the shapes to the eye, or
    `None`: obliquely at a sheet's front side. `points` (n, 3): measured points on top; `edges`: outlines and
    parameter lines (a B-spline's knot lines); `unit`: written at the scale bar. Backs of surfaces are sand
    coloured. The result is (h, w, 3); with a `path` (.png .svg .pdf) it is also written there. Raises
    `InputError` on bad input, `MissingPackageError` without matplotlib and pyvista.
    """
    size = check_request(path, size)
    program = choose_backend(backend)
    scene = gathered(shapes, edges=edges)
    if points is not None:
        scene = replace(scene, dots=(Dots(checked_points(points), colour=(0.72, 0.16, 0.12), size=3.6),))
    figure = new_figure(size)
    box = (0, 0, *size)
    view = place_scene(figure, scene, box, direction=camera, backend=program)
    add_triad(figure, view, box)
    add_scale_bar(figure, view, box, unit)
    return finished(figure, path)
