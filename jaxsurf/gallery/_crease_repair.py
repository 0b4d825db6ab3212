"""Paper 000, figure 11: what the operator does to the creased surface of figure 5, with the angle over its crease."""

from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from ..build import Sweep, smooth_creases, split_at_creases
from ..differential import partials
from ..report import Table
from ..surface import AbstractSurface
from ..view import shade
from ..view._sheet import finished, new_figure

_CAMERA = (-1.6, -0.8, 1.6)  # from where the whole crease is seen
_SIZE = (900, 700)
_STRIP = (900, 300)
_COUNT = 201  # places along the crease
_GRID = 41


def crease_repair(surface: Sweep, tables: list[Table]) -> list[tuple]:
    """Names, captions, pictures and shapes of figures 11 (a) and (b)."""
    before, after = split_at_creases(surface), smooth_creases(surface)
    gaps = [_angles(*parts) for parts in (before, after)]
    changes = [_changes(surface, *pair) for pair in zip(before, after, strict=True)]
    moved, off = (max(found) for found in zip(*changes, strict=True))
    rows = [["11a", "(a) with its crease", float(gaps[0].max()), 0.0, 0.0]]
    rows.append(["11b", "(b) both parts bent to one field of planes", float(gaps[1].max()), moved, off])
    columns = ("figure", "surface", "largest angle over the crease [rad]", "moved by at most", "off the guides")
    tables.append(Table("Figure 11: the crease of figure 5, repaired", columns, rows))
    made = []
    for name, caption, parts, angles in zip("ab", (row[1] for row in rows), (before, after), gaps, strict=True):
        drawn: list[Any] = [*parts, *surface.guides.curves, *surface.characters]
        picture = np.concatenate([shade(drawn, size=_SIZE, camera=_CAMERA), _strip(angles, float(gaps[0].max()))])
        made.append(
            (f"11{name}", f"figure 11 {caption}; below, the angle between the normals over the crease", picture, parts)
        )
    return made


def _angles(first: AbstractSurface, second: AbstractSurface) -> Float[np.ndarray, "n"]:
    """Angles between the normals of two parts along their crease, radians."""
    u = _even(first.domain[0], _COUNT)
    ends = (first.domain[1][1], second.domain[1][0])
    a, b = (np.asarray(partials(s, u, np.full(_COUNT, float(v))).normal) for s, v in zip((first, second), ends, strict=True))
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def _changes(surface: Sweep, part: AbstractSurface, bent: AbstractSurface) -> tuple[float, float]:
    """How far the points of a part have moved, and how far its sides are from the guides at equal parameters."""
    u, v = (_even(along, _GRID) for along in part.domain)
    grid = np.asarray(bent.grid(u, v))
    rims = zip(grid[[0, -1]], surface.guides.curves, strict=True)
    return _largest(grid - np.asarray(part.grid(u, v))), max(_largest(rim - np.asarray(guide(v))) for rim, guide in rims)


def _even(along: tuple[Any, Any], count: int) -> Float[np.ndarray, "n"]:
    return np.linspace(float(along[0]), float(along[1]), count)


def _largest(vectors: Float[np.ndarray, "*n 3"]) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


def _strip(angles: Float[np.ndarray, "n"], top: float) -> UInt8[np.ndarray, "h w 3"]:
    """A plot of angles along the crease, in degrees; both figures have the same axes."""
    figure = new_figure(_STRIP)
    axes = figure.add_axes((0.085, 0.23, 0.875, 0.7))
    share = np.linspace(0, 1, len(angles))
    degrees = np.degrees(angles)
    axes.plot(share, degrees, color=(0.72, 0.16, 0.12), lw=2, clip_on=False)
    largest = f"{degrees.max():.0f}°" if degrees.max() > 1 else f"{degrees.max():.0e}°"
    axes.set(xlim=(0, 1), ylim=(0, 1.15 * np.degrees(top)))
    axes.set_xlabel("along the crease, from the first guide to the second", fontsize=13)
    axes.set_ylabel("angle [°]", fontsize=13)
    axes.tick_params(labelsize=12)
    axes.text(0.985, 0.86, f"largest {largest}", transform=axes.transAxes, ha="right", fontsize=13)
    axes.grid(color="0.92", lw=0.8)
    axes.set_axisbelow(True)
    return finished(figure, None)
