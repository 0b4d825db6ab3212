"""The sheet of a picture: the drawn scene, a triad, a scale bar, and the file it becomes."""

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from .._atomic import check_writable, replacing
from .._errors import InputError, import_optional
from ._camera import Camera, ViewDirection, fitted_camera
from ._paint import paint
from ._scene import EDGE, Scene
from ._vtk import render

SUFFIXES = (".png", ".svg", ".pdf")
SMALLEST = 64
TRIAD = ((0.80, 0.20, 0.18), (0.20, 0.55, 0.25), (0.16, 0.36, 0.75))
Box = tuple[int, int, int, int]  # left, bottom, width, height in pixels


def check_request(path: str | os.PathLike | None, size: tuple[int, int]) -> tuple[int, int]:
    """Refuse a picture that could not be made or written, before the work begins; the size as integers."""
    if path is not None:
        if Path(path).suffix.lower() not in SUFFIXES:
            raise InputError(f"`path` must end in {', '.join(SUFFIXES)}, got {str(path)!r}.")
        check_writable(path)
    width, height = (int(n) for n in size)
    if min(width, height) < SMALLEST:
        raise InputError(f"`size` must be (width, height) of at least {SMALLEST} pixels, got {tuple(size)}.")
    return width, height


def new_figure(size: tuple[int, int]) -> Any:
    """A matplotlib figure of exactly (width, height) pixels; its text grows with it; no global state."""
    figures = import_optional("matplotlib.figure", extra="plot", purpose="pictures")
    agg = import_optional("matplotlib.backends.backend_agg", extra="plot", purpose="pictures")
    # In small pictures text shrinks less than the picture, or it could not be read.
    area = size[0] * size[1] / (1200 * 900)
    dpi = 100 * area ** (0.5 if area > 1 else 0.3)
    # The canvas rounds down: a hundredth of a pixel more makes the size exact.
    figure = figures.Figure(figsize=((size[0] + 0.01) / dpi, (size[1] + 0.01) / dpi), dpi=dpi, facecolor="white")
    agg.FigureCanvasAgg(figure)
    return figure


def place_scene(figure: Any, scene: Scene, box: Box, *, direction: ViewDirection, backend: str) -> Camera:
    """Draw the scene into a box of the figure. Raises `InputError` if it shows nothing."""
    points = scene.all_points()
    if not len(points):
        raise InputError("There is nothing to show: give at least one shape or `points`.")
    camera = fitted_camera(points, scene.facets, direction, box[2] / box[3])
    draw = render if backend == "pyvista" else paint
    axes = add_axes(figure, box)
    axes.imshow(
        draw(scene, camera, (box[2], box[3])),
        aspect="auto",
        interpolation="none",
        extent=(0, box[2], 0, box[3]),
    )
    axes.set_axis_off()
    return camera


def add_axes(figure: Any, box: Box) -> Any:
    """Axes at a box given in pixels."""
    width, height = figure.bbox.size
    return figure.add_axes((box[0] / width, box[1] / height, box[2] / width, box[3] / height))


def add_triad(figure: Any, camera: Camera, box: Box) -> None:
    """The directions of x, y and z, lower left in the box."""
    length = figure.dpi * 0.42
    axes = _overlay(figure, box)
    origin = np.array([length * 1.75, length * 1.65])
    # From far to near, so that an arrow toward the eye lies over the others.
    for i in sorted(range(3), key=lambda i: camera.axes[2, i]):
        tip = camera.axes[:2, i] * length
        axes.annotate(
            "",
            xy=tuple(origin + tip),
            xytext=tuple(origin),
            arrowprops={"arrowstyle": "-|>", "color": TRIAD[i], "lw": 1.8, "shrinkA": 0, "shrinkB": 0},
        )
        reach = float(np.linalg.norm(tip))
        place = origin + tip * (1 + 0.26 * length / max(reach, 0.3 * length))
        axes.text(*place, "xyz"[i], color=TRIAD[i], ha="center", va="center", fontsize=9.5, fontweight="bold")


def add_scale_bar(figure: Any, camera: Camera, box: Box, unit: str | None) -> None:
    """A bar of a round length, lower right in the box; the projection is parallel, so it holds everywhere."""
    per_pixel = 2 * camera.half_height / box[3]
    length = round_length(0.2 * box[2] * per_pixel)
    pixels = length / per_pixel
    axes = _overlay(figure, box)
    right, bottom = box[2] - figure.dpi * 0.3, figure.dpi * 0.28
    axes.plot([right - pixels, right], [bottom, bottom], color=EDGE, lw=2.2, solid_capstyle="butt")
    text = f"{length:g} {unit}" if unit else f"{length:g}"
    axes.text(
        right - pixels / 2,
        bottom + figure.dpi * 0.07,
        text,
        color=EDGE,
        ha="center",
        va="bottom",
        fontsize=9.5,
    )


def round_length(at_most: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `at_most`."""
    power = 10.0 ** np.floor(np.log10(at_most))
    return float(max(step for step in (1, 2, 5) if step * power <= at_most * (1 + 1e-9)) * power)


def finished(figure: Any, path: str | os.PathLike | None) -> UInt8[np.ndarray, "h w 3"]:
    """The figure as an (h, w, 3) picture, also written to `path`: whole or not at all."""
    figure.canvas.draw()
    picture = np.array(figure.canvas.buffer_rgba())[..., :3].copy()
    if path is not None:
        kind = Path(path).suffix.lower()[1:]
        with replacing(path) as temporary:
            if kind == "png":
                temporary.write_bytes(png_bytes(picture))
            else:
                matplotlib = import_optional("matplotlib", extra="plot", purpose="pictures")
                # Text stays text, so that it can be searched and edited.
                with matplotlib.rc_context({"svg.fonttype": "none", "pdf.fonttype": 42}):
                    figure.savefig(temporary, format=kind)
    return picture


def png_bytes(picture: UInt8[np.ndarray, "h w 3"]) -> bytes:
    """A picture as the bytes of a PNG file."""
    image = import_optional("matplotlib.image", extra="plot", purpose="pictures")
    file = io.BytesIO()
    image.imsave(file, picture, format="png")
    return file.getvalue()


def _overlay(figure: Any, box: Box) -> Any:
    axes = add_axes(figure, box)
    axes.set_axis_off()
    axes.set(xlim=(0, box[2]), ylim=(0, box[3]))
    axes.patch.set_alpha(0.0)
    return axes
