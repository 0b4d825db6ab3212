"""Maps of signed deviations on a surface."""

import os
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from .._errors import InputError, import_optional
from ..mesh import points_at, tessellate
from ..surface import AbstractSurface
from ._backend import Backend, choose_backend
from ._camera import ViewDirection
from ._gather import checked_points
from ._isolines import isolines
from ._scene import EDGE, GREY, PAPER, Dots, Facets, Scene, Strokes
from ._sheet import add_axes, add_scale_bar, add_triad, check_request, finished, new_figure, place_scene

QUANTILE = 0.98
MOST_DOTS = 5_000
RESOLUTION = 161
NEIGHBOURS = 8
# Quarters of these have at most two digits, so the bar's labels stay short.
ROUND_LIMITS = (1.0, 1.2, 1.6, 2.0, 2.4, 3.2, 4.0, 4.8, 6.0, 8.0, 10.0)


def deviation(
    surface: AbstractSurface,
    parameters: Any,
    signed: Any,
    points: Any = None,
    *,
    unit: str = "mm",
    limit: float | None = None,
    title: str = "Deviation from the surface",
    path: str | os.PathLike | None = None,
    size: tuple[int, int] = (1200, 900),
    camera: ViewDirection = None,
    backend: Backend = "auto",
) -> UInt8[np.ndarray, "h w 3"]:
    """The surface coloured by signed deviations: red above it (the normal's side), blue below, white on it.

    `parameters` (n, 2): the feet of the measured points; `signed` (n,): their deviations in `unit`; `points`
    (n, 3): drawn on top if given, at most 5000 of them. Between the feet the map is a mean of neighbours,
    grey where none is near. The colours end at ±`limit`, by default near the 98 % quantile of |deviation|;
    the bar says which. The result is (h, w, 3); with a `path` (.png .svg .pdf) it is also written there.
    Raises `InputError` on bad input.
    """
    size = check_request(path, size)
    program = choose_backend(backend)
    feet, values = _checked(parameters, signed)
    bound, note = _limit(values, limit, unit)
    mesh = tessellate(surface, resolution=(RESOLUTION, RESOLUTION))
    mapped = _mapped(mesh.vertices, points_at(surface, feet), values)
    outline = Strokes(tuple(isolines(surface).outline), EDGE, width=1.6, strength=0.9)
    facets = Facets(mesh.vertices, mesh.faces, mesh.normals, values=mapped)
    dots = ()
    if points is not None:
        measured = checked_points(points)
        every = -(-len(measured) // MOST_DOTS)
        dots = (Dots(measured[::every], colour=EDGE, size=2.2),)
        note += f"\n\ndots: measured points\n{f'(1 in {every})' if every > 1 else ''}"
    table = import_optional("matplotlib", extra="plot", purpose="pictures").colormaps["RdBu_r"](np.arange(256))[:, :3]
    scene = Scene((facets,), (outline,), dots, limits=(-bound, bound), table=table, sky=PAPER)

    figure = new_figure(size)
    head, side = round(figure.dpi * 0.78), round(figure.dpi * 1.75)
    box = (0, 0, size[0] - side, size[1] - head)
    view = place_scene(figure, scene, box, direction=camera, backend=program)
    add_triad(figure, view, box)
    add_scale_bar(figure, view, box, unit)
    left = figure.dpi * 0.28 / size[0]
    figure.text(left, 1 - 0.24 * figure.dpi / size[1], title, fontsize=14, fontweight="bold", va="center", color=EDGE)
    figure.text(left, 1 - 0.56 * figure.dpi / size[1], _summary(values, unit), fontsize=10, va="center", color=EDGE)
    _add_bar(figure, table, bound, unit, note, size, side, uncovered=bool(np.isnan(mapped).any()))
    return finished(figure, path)


def _checked(parameters: Any, signed: Any) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n"]]:
    feet, values = np.asarray(parameters, dtype=np.float64), np.asarray(signed, dtype=np.float64)
    if feet.ndim != 2 or feet.shape[1] != 2 or not len(feet):
        raise InputError(f"`parameters` must have shape (n, 2), n > 0, got {feet.shape}.")
    if values.shape != (len(feet),):
        raise InputError(f"`signed` must have shape ({len(feet)},) as `parameters` has rows, got {values.shape}.")
    bad = np.flatnonzero(~(np.isfinite(values) & np.isfinite(feet).all(axis=1)))
    if len(bad):
        raise InputError(f"`parameters` and `signed` must be finite; row {bad[0]} is not.")
    return feet, values


def _limit(values: np.ndarray, limit: float | None, unit: str) -> tuple[float, str]:
    if limit is not None:
        if not limit > 0:
            raise InputError(f"`limit` must be a positive length, got {limit}.")
        share = float((np.abs(values) <= limit).mean())
        return float(limit), f"{100 * share:.3g} % of points within\n±{limit:.3g} {unit}"
    reach = float(np.quantile(np.abs(values), QUANTILE))
    if reach == 0.0:
        reach = float(np.abs(values).max()) or 1.0
    power = 10.0 ** np.floor(np.log10(reach))
    bound = next(step for step in ROUND_LIMITS if step * power >= reach * (1 - 1e-9)) * power
    return float(bound), f"{100 * QUANTILE:.0f} % of points within\n±{reach:.3g} {unit}"


def _mapped(vertices: np.ndarray, feet: Float[np.ndarray, "n 3"], values: np.ndarray) -> Float[np.ndarray, "m"]:
    """At each vertex the weighted mean of the nearest feet's values; NaN where no foot is near."""
    from scipy.spatial import KDTree

    tree = KDTree(feet)
    count = min(NEIGHBOURS, len(feet))
    spacing = np.reshape(tree.query(feet[:: max(1, len(feet) // 5000)], k=count)[0], (-1, count))[:, -1]
    near = 1.6 * float(np.quantile(spacing, 0.95)) if len(feet) > 1 else np.inf
    distance, index = (np.reshape(a, (len(vertices), count)) for a in tree.query(vertices, k=count))
    width = np.maximum(distance[:, count // 2], 1e-12 + 0 * distance[:, 0])
    weight = np.exp(-((distance / width[:, None]) ** 2))
    mean = (weight * values[index]).sum(axis=1) / weight.sum(axis=1)
    return np.where(distance[:, 0] <= near, mean, np.nan)


def _summary(values: np.ndarray, unit: str) -> str:
    rms, mean = np.sqrt(np.mean(values**2)), values.mean()
    spread = f"from {values.min():+.3g} to {values.max():+.3g} {unit}"
    return f"{len(values):,} points, rms {rms:.3g} {unit}, mean {mean:+.2g} {unit}, {spread}".replace("-", "−")


def _add_bar(
    figure: Any,
    table: np.ndarray,
    bound: float,
    unit: str,
    note: str,
    size: tuple[int, int],
    side: int,
    *,
    uncovered: bool,
) -> None:
    colors = import_optional("matplotlib.colors", extra="plot", purpose="pictures")
    cm = import_optional("matplotlib.cm", extra="plot", purpose="pictures")
    dpi = figure.dpi
    left = size[0] - side + round(dpi * 0.3)
    axes = add_axes(figure, (left, round(size[1] * 0.30), round(dpi * 0.24), round(size[1] * 0.50)))
    mappable = cm.ScalarMappable(colors.Normalize(-bound, bound), colors.ListedColormap(table))
    bar = figure.colorbar(mappable, cax=axes, extend="both", ticks=np.linspace(-bound, bound, 9))
    bar.ax.set_yticklabels([tick_label(tick, bound) for tick in np.linspace(-bound, bound, 9)], fontsize=10)
    bar.outline.set_linewidth(0.6)
    x = left / size[0]
    figure.text(x, 0.80 + 0.46 * dpi / size[1], f"Deviation [{unit}]", fontsize=10.5, fontweight="bold", color=EDGE)
    figure.text(x, 0.30 - 0.46 * dpi / size[1], note, fontsize=8.5, va="top", color=EDGE, linespacing=1.35)
    if uncovered:
        swatch = add_axes(figure, (left, round(0.28 * dpi), round(0.16 * dpi), round(0.16 * dpi)))
        swatch.set(xticks=[], yticks=[], facecolor=GREY)
        figure.text(
            (left + 0.24 * dpi) / size[0],
            0.36 * dpi / size[1],
            "no point near",
            fontsize=8.5,
            va="center",
            color=EDGE,
        )


def tick_label(value: float, bound: float) -> str:
    """A signed label with as many decimals as quarters of `bound` need: "+0.05", "0", "−12"."""
    if abs(value) < 1e-9 * bound:
        return "0"
    if not 1e-4 <= bound < 1e5:
        return f"{value:+.1e}".replace("-", "−")
    decimals = max(0, 1 - int(np.floor(np.log10(bound / 4) + 1e-9)))
    text = f"{value:+.{decimals}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", "−")
