"""Surfaces bent to planes and curvatures along all four sides, on grids, next to the bare surface."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxsurf as js

from .harness import Figure, Row, Run

SIDE = 1000
COUNT = 12
SIDES = ("u0", "u1", "v0", "v1")


def rows() -> list[Row]:
    """An arched bicubic of 12 × 12 control points and a neighbour with its boundary curves and corners, double precision."""
    jax.config.update("jax_enable_x64", True)
    base, other = _sheet(0.0), _sheet(0.05)
    given: Any = {side: (other, side) for side in SIDES}
    bent = {
        "F on four sides": js.tangent_to(base, **given, operator="scaling"),
        "H on four sides": js.tangent_to(base, **given, operator="hermite"),
        "planes and curvatures on four sides": js.tangent_to(base, **given, order=2),
    }
    along, bare = jnp.linspace(0.0, 1.0, SIDE), "the bare surface"
    shapes = {**bent, bare: base}
    runs = {name: _jax(lambda s=s: s.grid(along, along)) for name, s in shapes.items()}
    figures = [Figure("faster", name, bare, 0.5) for name in list(bent)[:2]]
    return [
        Row(f"a grid of {SIDE} × {SIDE} points", runs, [*figures, Figure("first call", "F on four sides", None, 5.0)]),
    ]


def _sheet(lift: float) -> js.BSplineSurface:
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(*[np.linspace(0, 1, COUNT)] * 2, indexing="ij")
    z = 0.4 * (1 - 0.8 * (2 * x - 1) ** 2 - 0.6 * (2 * y - 1) ** 2)
    net = np.stack([x, y, z], axis=-1) + 0.005 * rng.normal(size=(COUNT, COUNT, 3))
    amid = lift * np.sin(np.pi * x) * np.sin(np.pi * y)
    amid[[1, 1, -2, -2], [1, -2, 1, -2]] = 0  # twists at corners stay
    net[1:-1, 1:-1, 2] += amid[1:-1, 1:-1]
    return js.BSplineSurface(net, *[js.clamped_knots(COUNT, 3)] * 2, 3, 3)


def _jax(call: Callable[[], Any]) -> Run:
    return Run(lambda: jax.block_until_ready(call()), SIDE * SIDE)
