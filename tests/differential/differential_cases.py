"""Shapes of which every curvature is known, and some that are awkward; off the origin, domains not [0, 1]."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxsurf.basis import clamped_knots
from jaxsurf.curve import BSplineCurve
from jaxsurf.surface import BSplineSurface

KNOTS = [2, 2, 2, 2, 2.7, 2.7, 4.1, 5, 5, 5, 5]


def bicubic(dtype: Any = np.float64):
    """A wavy cubic surface with uneven and repeated knots, on [2, 5] × [2, 5]."""
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(0, 3, 7), np.linspace(0, 2, 7), indexing="ij")
    net = np.stack([x + 1, y - 2, rng.uniform(-0.5, 0.5, x.shape)], axis=-1)
    return BSplineSurface(net.astype(dtype), KNOTS, KNOTS, 3, 3)


def cubic(dtype: Any = np.float64):
    """A cubic curve in space with uneven and repeated knots, on [2, 5]."""
    points = np.random.default_rng(1).normal(size=(7, 3)) + 1
    return BSplineCurve(points.astype(dtype), KNOTS, 3)


def triangle():
    """A patch whose edge v = 0 is shrunk to a point: S_u vanishes there."""
    net = np.array(
        [[[1, 0, 0], [0, 1, 0.2], [0, 2, 0]], [[1, 0, 0], [1, 1, 0], [1, 2, 0]], [[1, 0, 0], [2, 1, 0.3], [3, 2, 0]]]
    )
    knots = clamped_knots(3, 2, (1.0, 2.0))
    return BSplineSurface(net.astype(float), knots, knots, 2, 2)


def squared():
    """The plane z = 1 by (u², v²): at the corner (0, 0) both partial derivatives vanish, at (0, v) one."""
    net = np.zeros((3, 3, 3))
    net[2, :, 0], net[:, 2, 1], net[..., 2] = 1, 1, 1
    knots = clamped_knots(3, 2)
    return BSplineSurface(net, knots, knots, 2, 2)


def difference(f, x, step=1e-5):
    """Central difference."""
    return (f(x + step) - f(x - step)) / (2 * step)


def assert_close(a, b, tolerance=1e-12):
    np.testing.assert_allclose(jnp.asarray(a), jnp.asarray(b), rtol=0, atol=tolerance)
