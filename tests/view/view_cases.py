"""Shapes that are looked at."""

import numpy as np

from jaxsurf.basis import clamped_knots
from jaxsurf.surface import BSplineSurface

SIZE = (240, 180)


def sheet() -> BSplineSurface:
    """A gently bent sheet, front side up, 12 x 8 about (30, -10, 5)."""
    u, v = np.meshgrid(np.linspace(24, 36, 5), np.linspace(-14, -6, 4), indexing="ij")
    net = np.stack([u, v, 5 + 0.1 * (u - 30) ** 2 / 4], axis=-1)
    return BSplineSurface(net, clamped_knots(5, 3, (2.0, 5.0)), clamped_knots(4, 3), 3, 3)


def coloured(picture: np.ndarray, above: bool) -> np.ndarray:
    """Pixels that are clearly red (`above`) or clearly blue."""
    red, blue = picture[..., 0].astype(int), picture[..., 2].astype(int)
    return red - blue > 60 if above else blue - red > 60
