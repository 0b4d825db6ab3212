"""Pictures of point clouds."""

import os
from typing import Any

import numpy as np
from jaxtyping import UInt8

from .._errors import InputError, import_optional
from ._backend import Backend, choose_backend
from ._camera import ViewDirection
from ._gather import checked_points
from ._scene import EDGE, PAPER, Dots, Scene, stroke_scale
from ._sheet import add_axes, add_scale_bar, add_triad, check_request, finished, new_figure, place_scene

MOST_DOTS = 400_000


def cloud(
    points: Any,
    *,
    values: Any = None,
    label: str = "z",
    unit: str = "mm",
    path: str | os.PathLike | None = None,
    size: tuple[int, int] = (1200, 900),
    camera: ViewDirection = None,
    backend: Backend = "auto",
) -> UInt8[np.ndarray, "h w 3"]:
    """A point cloud coloured by height, or by `values` (n,) named by `label`, with a colour bar in `unit`.

    Of more than 400,000 points evenly chosen ones are drawn, and the picture says so. The result is (h, w,
    3); with a `path` (.png .svg .pdf) it is also written there. Raises `InputError` on bad input.
    """
    size = check_request(path, size)
    program = choose_backend(backend)
    cleaned = checked_points(points)
    heights = cleaned[:, 2] if values is None else np.asarray(values, dtype=np.float64)
    if heights.shape != (len(cleaned),):
        raise InputError(f"`values` must have shape ({len(cleaned)},) as `points` has rows, got {heights.shape}.")
    known = heights[np.isfinite(heights)]
    low, high = np.quantile(known, [0.005, 0.995]) if len(known) else (0.0, 1.0)
    every = -(-len(cleaned) // MOST_DOTS)
    table = import_optional("matplotlib", extra="plot", purpose="pictures").colormaps["viridis"](np.arange(256))[:, :3]
    dots = Dots(cleaned[::every], values=heights[::every], size=_dot_size(len(cleaned[::every]), size))
    scene = Scene(dots=(dots,), limits=(float(low), float(high)), table=table, sky=PAPER)

    figure = new_figure(size)
    side = round(figure.dpi * 1.45)
    box = (0, 0, size[0] - side, size[1])
    view = place_scene(figure, scene, box, direction=camera, backend=program)
    add_triad(figure, view, box)
    add_scale_bar(figure, view, box, unit)
    shown = f"{len(cleaned):,} points" + (f", 1 in {every} drawn" if every > 1 else "")
    figure.text(
        0.28 * figure.dpi / size[0],
        1 - 0.28 * figure.dpi / size[1],
        shown,
        fontsize=10.5,
        va="center",
        color=EDGE,
    )
    _add_bar(figure, scene, f"{label} [{unit}]" if unit else label, size, side)
    return finished(figure, path)


def _dot_size(count: int, size: tuple[int, int]) -> float:
    # Dots that close up if the cloud covers a third of the picture, so that its near side hides the far one.
    return float(np.clip(1.9 * (0.33 * size[0] * size[1] / count) ** 0.5 / stroke_scale(size[0]), 2.0, 8.0))


def _add_bar(figure: Any, scene: Scene, label: str, size: tuple[int, int], side: int) -> None:
    colors = import_optional("matplotlib.colors", extra="plot", purpose="pictures")
    cm = import_optional("matplotlib.cm", extra="plot", purpose="pictures")
    left = size[0] - side + round(figure.dpi * 0.3)
    axes = add_axes(figure, (left, round(size[1] * 0.25), round(figure.dpi * 0.22), round(size[1] * 0.5)))
    mappable = cm.ScalarMappable(colors.Normalize(*scene.limits), colors.ListedColormap(scene.table))
    bar = figure.colorbar(mappable, cax=axes, extend="both")
    bar.ax.tick_params(labelsize=10)
    bar.outline.set_linewidth(0.6)
    figure.text(
        left / size[0],
        0.75 + 0.42 * figure.dpi / size[1],
        label,
        fontsize=10.5,
        fontweight="bold",
        color=EDGE,
    )
