"""Paper 004: quaternion integral surfaces, figure 2 (a) to (e)."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._safe import norm
from ..basis import greville
from ..curve import Line, QICurve
from ..report import Table
from ..surface import QISurface, closure_gap
from ..view import shade
from ._page import Page

_PLACES = 41  # per direction, where figures are measured


def make() -> Page:
    """The five surfaces of figure 2, each with its control tangents drawn at their Greville places."""
    surfaces = figure_2()
    pictures = [
        (name, f"({name}) {caption}", shade([surface, *_arrows(surface)], size=(900, 700), camera=(1.0, -1.6, 1.1)))
        for name, (caption, surface) in surfaces.items()
    ]
    columns = (
        "surface",
        "control tangents",
        "|S_u| off its length",
        "S(0, v) off the initial curve",
        "largest gap of the two ways",
        "length",
    )
    rows = [[name, _counts(surface), *_measured(surface)] for name, (_, surface) in surfaces.items()]
    return Page(
        "Quaternion integral surfaces (paper 004, figure 2)",
        pictures,
        [Table("Measured on the surfaces", columns, rows)],
        {name: surface for name, (_, surface) in surfaces.items()},
    )


def figure_2() -> dict[str, tuple[str, QISurface]]:
    """The surfaces by letter, with what is special about them; (c) is the one that the others are changes of."""
    convex, concave = _spine((38.0, 0.0, -38.0)), _spine((-38.0, 0.0, 38.0))
    arched = _rows([[32.0] * 3, [0.0] * 3, [-32.0] * 3])
    lifted = _rows([[32.0] * 3, [0.0] * 3, [40.0, 10.0, 40.0]])
    twisted = _rows([[32.0] * 3, [0.0] * 3, [-60.0, 35.0, -60.0]], aside=[[0.0] * 3, [0.0] * 3, [25.0, 0.0, -25.0]])
    waved = _rows(
        [[40.0, 30.0, 30.0, 40.0], [-20.0, 15.0, 15.0, -20.0], [20.0, -15.0, -15.0, 20.0], [-40.0, -30.0, -30.0, -40.0]]
    )
    lengths = [2.0] * 3
    surface = lambda spine, rows: QISurface(spine, rows, lengths, 2, 2)
    wave = _spine((40.0, -30.0, 30.0, -40.0), degree=3)
    return {
        "a": ("the initial curve turned from convex to concave", surface(concave, arched)),
        "b": ("the control tangents at u = 1 turned", surface(convex, lifted)),
        "c": ("3 control tangents of the initial curve, 3 × 3 of the surface", surface(convex, arched)),
        "d": ("initial curve and control tangents turned", surface(concave, twisted)),
        "e": ("4 control tangents of the initial curve, 4 × 4 of the surface", QISurface(wave, waved, [2.0] * 4)),
    }


def _spine(degrees: tuple[float, ...], degree: int = 2) -> QICurve:
    """The initial curve along y, its control tangents so many degrees above the horizontal."""
    angle = np.radians(degrees)
    tangents = np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], axis=-1)
    return QICurve([0.0, 0.0, 0.0], 2.0, tangents, degree)


def _rows(degrees: list[list[float]], aside: list[list[float]] | None = None) -> Float[np.ndarray, "n m 3"]:
    """Control tangents along x, so many degrees above the horizontal, and so many towards y."""
    up, side = np.radians(degrees), np.radians(np.zeros_like(degrees) if aside is None else aside)
    return np.stack([np.cos(up) * np.cos(side), np.cos(up) * np.sin(side), np.sin(up)], axis=-1)


def _arrows(surface: QISurface) -> list[Line]:
    """Short lines along the control tangents, where they count the most."""
    u, v = (greville(knots, d) for knots, d in ((surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v)))
    feet = np.asarray(surface.grid(u, v)).reshape(-1, 3)
    tips = feet + 0.25 * np.asarray(surface.tangents).reshape(-1, 3)
    spine = surface.spine
    on_spine = np.asarray(spine(greville(spine.knots, spine.degree)))
    feet, tips = np.concatenate([feet, on_spine]), np.concatenate([tips, on_spine + 0.25 * np.asarray(spine.tangents)])
    return [Line(foot, tip) for foot, tip in zip(feet, tips, strict=True)]


def _counts(surface: QISurface) -> str:
    n, m = surface.tangents.shape[:2]
    return f"{surface.spine.tangents.shape[0]} and {n} × {m}"


def _measured(surface: QISurface) -> list[float]:
    """Figures on a grid of places."""
    (a, b), (c, d) = surface.domain
    share = np.linspace(0, 1, _PLACES)
    u, v = (x.ravel() for x in np.meshgrid(a + (b - a) * share, c + (d - c) * share, indexing="ij"))
    speed = norm(surface.derivative(u, v))
    lengths = jax.vmap(surface.length)(jnp.asarray(v)) / (b - a)
    edge = norm(surface(jnp.full_like(v, a), v) - surface.spine(v))
    gap = norm(closure_gap(surface, u, v))
    return [_largest(jnp.abs(speed - lengths)), _largest(edge), _largest(gap), float(jnp.mean(lengths))]


def _largest(values: Array) -> float:
    return float(jnp.max(values))
