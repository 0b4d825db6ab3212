"""A sheet and neighbours with the same boundary curves, for the tests of tangent planes."""

from typing import Any

import numpy as np

import jaxsurf as js

SIDES = ("u0", "u1", "v0", "v1")
KNOTS = js.clamped_knots(5, 3)
INSIDE = np.linspace(0, 1, 9)


def surface(seed=0, arch=0.4):
    """A bicubic sheet, arched so that no line is straight."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    z = arch * (1 - (2 * x - 1) ** 2 * 0.8 - (2 * y - 1) ** 2 * 0.6)
    return js.BSplineSurface(np.stack([x, y, z], -1) + 0.02 * rng.normal(size=(5, 5, 3)), KNOTS, KNOTS, 3, 3)


def tilted(seed=0, size=0.1, twisted=False):
    """A neighbour with the same boundary curves and corners: its normals on the sides are tilted amid them.

    twisted: with twists of its own, and so with slopes of the normals at corners.
    """
    base = surface(seed)
    net = np.array(base.control_points)
    rng = np.random.default_rng(seed + 100)
    lift = size * rng.uniform(0.5, 1, (3, 3))
    if not twisted:
        lift[::2, ::2] = 0
    net[1:-1, 1:-1, 2] += lift
    return js.BSplineSurface(net, KNOTS, KNOTS, 3, 3)


def to(target, *sides) -> Any:
    """The planes of a neighbour on sides."""
    return {side: (target, side) for side in sides}


def at_odds(seed=0):
    """Planes whose slopes at the corners belong to two different surfaces."""
    return {**to(tilted(seed, twisted=True), "u0", "u1"), **to(tilted(seed), "v0", "v1")}


def boundary_error(bent, base):
    """On the outline of a grid of points."""
    off = np.abs(np.asarray(bent.grid(INSIDE, INSIDE)) - np.asarray(base.grid(INSIDE, INSIDE)))
    return max(off[[0, -1]].max(), off[:, [0, -1]].max())


def report(base, **given) -> Any:
    """`js.tangency_report` of either order."""
    return js.tangency_report(base, **given)
