"""Evaluation of quaternion integral curves and surfaces, beside splines of the same kind of job."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxsurf as js

from .harness import Figure, Row, Run

POINTS = 1_000_000
COUNTS = (4, 12, 100, 1000)
ANGLE = np.radians(25.0)  # between neighbouring control tangents


def rows() -> list[Row]:
    """Curves and surfaces with few and many control tangents, to 1e-12 of the length, in double precision."""
    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(0)
    places = jnp.asarray(rng.uniform(size=(2, POINTS)))
    return [*(_curve(count, places[0], rng) for count in COUNTS), _surface(places, rng)]


def _curve(count: int, u: Any, rng: np.random.Generator) -> Row:
    curve = js.QICurve(np.zeros(3), 1.0, _chain(count, rng))
    spline = js.BSplineCurve(rng.normal(size=(count, 3)), js.clamped_knots(count, 3), 3)
    name = f"{count} control tangents"
    return Row(
        f"{POINTS:.0e} points of a QI curve, {name}",
        {name: _jax(lambda: curve(u)), "cubic B-spline, as many control points": _jax(lambda: spline(u))},
        [Figure("faster", name, "cubic B-spline, as many control points", 0.5)],
    )


def _surface(places: Any, rng: np.random.Generator) -> Row:
    few, many = (_qi_surface(count, rng) for count in (3, 12))
    converted = js.to_bspline(few, 1e-9).shape
    bicubic = js.BSplineSurface(rng.normal(size=(20, 20, 3)), *[js.clamped_knots(20, 3)] * 2, 3, 3)
    n, m = converted.control_points.shape[:2]
    spline = f"the first as a B-spline to 1e-9, {n} × {m} control points"
    other = "bicubic B-spline, 20 × 20 net"
    return Row(
        f"{POINTS:.0e} scattered points of a QI surface",
        {
            "3 × 3 control tangents": _jax(lambda: few(*places)),
            "12 × 12 control tangents": _jax(lambda: many(*places)),
            spline: _jax(lambda: converted(*places)),
            other: _jax(lambda: bicubic(*places)),
        },
        [
            Figure("faster", "3 × 3 control tangents", other, 0.125),
            Figure("faster", "12 × 12 control tangents", other, 0.125),
            Figure("faster", spline, other, 0.5),
            Figure("first call", "12 × 12 control tangents", None, 3.0),
        ],
    )


def _qi_surface(count: int, rng: np.random.Generator) -> js.QISurface:
    """Control tangents that turn by `ANGLE` along u, and by less along v, where they are disturbed."""
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    up, side = ANGLE * np.sin(0.9 * i + 0.4 * j), ANGLE * np.cos(0.7 * j)
    tangents = np.stack([np.cos(up) * np.cos(side), np.cos(up) * np.sin(side), np.sin(up)], axis=-1)
    degree = min(3, count - 1)
    spine = js.QICurve(np.zeros(3), 1.0, _chain(count, rng), degree)
    return js.QISurface(spine, tangents, rng.uniform(1, 2, count), degree, degree)


def _chain(count: int, rng: np.random.Generator) -> np.ndarray:
    """Directions, each `ANGLE` from the one before."""
    chain = [np.array([1.0, 0.0, 0.0])]
    for _ in range(count - 1):
        aside = np.cross(chain[-1], rng.normal(size=3))
        chain.append(np.cos(ANGLE) * chain[-1] + np.sin(ANGLE) * aside / np.linalg.norm(aside))
    return np.array(chain)


def _jax(call: Callable[[], Any]) -> Run:
    return Run(lambda: jax.block_until_ready(call()), POINTS)
