"""Quick line drawings with axes."""

import os
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from .._errors import InputError, import_optional
from ..curve import AbstractCurve
from ..surface import AbstractSurface
from ._gather import as_list, checked_points, curve_line
from ._isolines import isolines
from ._scene import EDGE, STROKE, Colour
from ._sheet import check_request, finished, new_figure

CONTROL: Colour = (0.55, 0.57, 0.60)
POINT: Colour = (0.72, 0.16, 0.12)
FLAT = 1e-9  # of the size: what is thinner is drawn in a plane
Line = tuple[np.ndarray, dict[str, Any]]


def plot(
    shapes: Any = (),
    *,
    points: Any = None,
    control: bool = False,
    unit: str | None = None,
    title: str | None = None,
    path: str | os.PathLike | None = None,
    size: tuple[int, int] = (1200, 900),
) -> UInt8[np.ndarray, "h w 3"]:
    """A line drawing of curves, surfaces (their parameter lines) and points in axes of equal scale.

    What lies in a plane z = const is drawn in it, all else in space. `control`: control polygons and nets
    too; `points` (n, 3). Drawn by matplotlib, so that a `path` .svg or .pdf holds lines, not pixels; the
    result is (h, w, 3). Raises `InputError` on bad input, `MissingPackageError` without matplotlib.
    """
    size = check_request(path, size)
    import_optional("matplotlib", extra="plot", purpose="plots")
    lines = [line for i, shape in enumerate(as_list(shapes)) for line in _lines(shape, STROKE[i % len(STROKE)], control)]
    if points is not None:
        dots = {"ls": "", "marker": ".", "ms": 3.5, "color": POINT}
        lines.append((checked_points(points), dots))
    if not lines:
        raise InputError("There is nothing to show: give at least one shape or `points`.")
    figure = new_figure(size)
    every = np.concatenate([line for line, _ in lines])
    low, high = every.min(axis=0), every.max(axis=0)
    if high[2] - low[2] <= FLAT * float(np.linalg.norm(high - low)):
        axes = figure.add_subplot()
        for line, look in lines:
            axes.plot(line[:, 0], line[:, 1], **look)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(color="0.92", lw=0.8)
        axes.set_axisbelow(True)
        figure.subplots_adjust(left=0.09, right=0.975, bottom=0.085, top=0.92 if title else 0.975)
    else:
        axes = _axes_in_space(figure, low, high, bool(title))
        for line, look in lines:
            # A flat box is wider than the square of its axes, which would cut it off.
            axes.plot(line[:, 0], line[:, 1], line[:, 2], clip_on=False, **look)
    suffix = f" [{unit}]" if unit else ""
    axes.set(xlabel=f"x{suffix}", ylabel=f"y{suffix}")
    axes.tick_params(labelsize=9)
    if title:
        figure.suptitle(title, fontsize=13, fontweight="bold", color=EDGE)
    if hasattr(axes, "set_zlabel"):
        axes.set_zlabel(f"z{suffix}", labelpad=8)
    return finished(figure, path)


def _axes_in_space(figure: Any, low: np.ndarray, high: np.ndarray, titled: bool) -> Any:
    import_optional("mpl_toolkits.mplot3d", extra="plot", purpose="plots in space")  # registers the projection
    axes = figure.add_axes((0.02, 0.02, 0.94, 0.92 if titled else 0.96), projection="3d", proj_type="ortho")
    # A thin direction gets room for its ticks; its scale stays that of the others.
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.09 * (high - low).max()) * 1.03
    axes.set(
        xlim=(middle[0] - half[0], middle[0] + half[0]),
        ylim=(middle[1] - half[1], middle[1] + half[1]),
        zlim=(middle[2] - half[2], middle[2] + half[2]),
    )
    axes.set_box_aspect(half, zoom=0.9 + 0.22 * (1 - half[2] / half.max()))
    ticks = import_optional("matplotlib.ticker", extra="plot", purpose="plots")
    for axis, reach in zip((axes.xaxis, axes.yaxis, axes.zaxis), half / half.max(), strict=True):
        axis.set_pane_color((0.975, 0.98, 0.985))
        axis.set_major_locator(ticks.MaxNLocator(max(2, round(7 * float(reach)))))
    axes.xaxis.labelpad = axes.yaxis.labelpad = 14
    axes.view_init(elev=28, azim=-58)
    return axes


def _lines(shape: Any, colour: Colour, control: bool) -> list[Line]:
    net: list[Line] = []
    if control:
        polygon = {
            "color": CONTROL,
            "lw": 0.9,
            "ls": "--",
            "marker": "o",
            "ms": 3.5,
            "mfc": "white",
            "zorder": 1.5,
        }
        net = [(line, polygon) for line in _control_lines(shape)]
    if isinstance(shape, AbstractCurve):
        return [*net, (curve_line(shape), {"color": colour, "lw": 2.0})]
    if isinstance(shape, AbstractSurface):
        own = isolines(shape)
        inner: list[Line] = [(line, {"color": colour, "lw": 0.7, "alpha": 0.7}) for line in own.inner]
        return [*net, *inner, *((line, {"color": colour, "lw": 1.6}) for line in own.outline)]
    raise InputError(f"Only curves and surfaces can be plotted, got {type(shape).__name__}.")


def _control_lines(shape: Any) -> list[Float[np.ndarray, "_ 3"]]:
    held = getattr(shape, "control_points", None)
    if held is None:
        return []
    net = np.asarray(held, dtype=np.float64)
    net = np.pad(net, ((0, 0),) * (net.ndim - 1) + ((0, 3 - net.shape[-1]),))
    return [net] if net.ndim == 2 else [*net, *np.swapaxes(net, 0, 1)]
