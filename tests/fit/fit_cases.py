"""Sheets to be found again, and points on them."""

import numpy as np

from jaxsurf.basis import clamped_knots
from jaxsurf.query import closest_point
from jaxsurf.surface import BSplineSurface

KNOTS = np.array([2.0] * 4 + [2.7, 3.9] + [5.0] * 4)


def sheet() -> BSplineSurface:
    """A bent and dented sheet of 6 × 6 control points, off the origin, 10 × 6, uneven knots on [2, 5] along u."""
    u, v = np.meshgrid(np.linspace(20, 30, 6), np.linspace(-8, -2, 6), indexing="ij")
    height = 5 - 0.06 * (u - 25) ** 2 + 0.4 * np.random.default_rng(0).normal(size=u.shape)
    return BSplineSurface(np.stack([u, v, height], -1), KNOTS, clamped_knots(6, 3), 3, 3)


def dented(surface: BSplineSurface, seed: int, depth: float = 0.3) -> BSplineSurface:
    """The surface with its control points moved up and down."""
    dents = np.zeros(surface.control_points.shape)
    dents[..., 2] = depth * np.random.default_rng(seed).normal(size=dents.shape[:2])
    net = np.asarray(surface.control_points) + dents
    return BSplineSurface(net, surface.knots_u, surface.knots_v, surface.degree_u, surface.degree_v)


def points_on(surface, count: int, seed: int, margin: float = 0.0) -> np.ndarray:
    """Random points of a surface, `margin` of the domain free at each border."""
    (a, b), (c, d) = surface.domain
    u, v = np.random.default_rng(seed).uniform(margin, 1 - margin, size=(2, count))
    return np.array(surface(a + (b - a) * u, c + (d - c) * v))


def rms_distance(surface, points) -> float:
    """Root mean square distance of points to a surface."""
    distance = np.asarray(closest_point(surface, points).distance)
    return float(np.sqrt(np.mean(distance**2)))
