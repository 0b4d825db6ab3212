"""Evaluation of sweeps along two guides, scattered and on grids."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxsurf as js

from .harness import Figure, Row, Run

POINTS = 1_000_000
SIDE = 1000


def rows() -> list[Row]:
    """Cubic guides of 10 control points, one or two characters of 8, in double precision."""
    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(0)
    guides = [_wavy(rng, 10, (0.0, y, 0.0), (6.0, y, 0.0)) for y in (0.0, 3.0)]
    characters = [_wavy(rng, 8, guides[0](t), guides[1](t)) for t in (0.0, 1.0)]
    sweeps = {
        "one character, chord + guide + scale": js.sweep(characters[0], guides),
        "two characters, chord + guide + scale": js.sweep(characters, guides),
        "one character, chord + scale": js.sweep(characters[0], guides, rotation="chord"),
        "one guide, rotation-minimising": js.sweep(characters[0], guides[0], rotation="minimal"),
    }
    u, v = (jnp.asarray(x) for x in rng.uniform(size=(2, POINTS)))
    along = jnp.linspace(0.0, 1.0, SIDE)
    scattered = {name: _jax(lambda s=s: s(u, v)) for name, s in sweeps.items()}
    gridded = {name: _jax(lambda s=s: s.grid(along, along)) for name, s in sweeps.items()}
    two = list(sweeps)[:3]
    return [
        Row(f"{POINTS:.0e} scattered points of a sweep", scattered, [Figure("rate", name, None, 5.0) for name in two]),
        Row(f"a grid of {SIDE} × {SIDE} points of it", gridded, [Figure("rate", name, None, 50.0) for name in two]),
    ]


def _wavy(rng: np.random.Generator, count: int, start: Any, end: Any) -> js.BSplineCurve:
    """A cubic that waves between two points."""
    net = np.linspace(np.asarray(start), np.asarray(end), count)
    net[1:-1] += 0.3 * rng.normal(size=(count - 2, 3))
    return js.BSplineCurve(net, js.clamped_knots(count, 3), 3)


def _jax(call: Callable[[], Any]) -> Run:
    return Run(lambda: jax.block_until_ready(call()), POINTS)
