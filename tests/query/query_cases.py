"""Shapes to look for feet on, clouds around them, and the nearest of very many samples."""

import jax.numpy as jnp
import numpy as np
from scipy.spatial import KDTree

import jaxsurf as js

PERIODIC = np.array([2.0, 2.5, 2.9, 3.6, 4.1, 4.5, 5.0])


def clamped(degree: int, *inner: float) -> np.ndarray:
    """Knots on [2, 5] with full ends."""
    return np.array([2.0] * (degree + 1) + list(inner) + [5.0] * (degree + 1))


def sheet(n: int, bump: float, scale: float = 1.0, dtype: type = np.float64) -> js.BSplineSurface:
    """A bicubic n × n net of heights drawn at random, `bump` times its side, off the origin."""
    rng = np.random.default_rng(n)
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    net = np.stack([x, y, bump * rng.normal(size=(n, n))], axis=-1) + np.array([0.4, -0.3, 0.7])
    inner = 2 + 3 * (np.arange(1, n - 3) / (n - 3)) ** 1.1
    return js.BSplineSurface((scale * net).astype(dtype), clamped(3, *inner), clamped(3, *inner), 3, 3)


def wave() -> js.BSplineSurface:
    """A gentle sheet, of different degrees and uneven knots."""
    rng = np.random.default_rng(2)
    x, y = np.meshgrid(np.linspace(0, 2, 6), np.linspace(0, 1, 5), indexing="ij")
    net = np.stack([x, y, 0.12 * rng.normal(size=(6, 5))], axis=-1) + np.array([1.0, -2.0, 3.0])
    return js.BSplineSurface(net, clamped(3, 2.7, 4.1), clamped(2, 3.1, 3.9), 3, 2)


def ring(count: int = 6, depth: int = 5) -> js.BSplineSurface:
    """A tube that closes in u."""
    rng = np.random.default_rng(5)
    angle, height = np.meshgrid(np.arange(count) * 2 * np.pi / count, np.linspace(0, 2, depth), indexing="ij")
    radius = 1 + 0.15 * rng.normal(size=angle.shape)
    net = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1) + 3.0
    return js.BSplineSurface(net, PERIODIC, clamped(2, 2.8, 4.4), 3, 2, periodic_u=True)


def loop() -> js.BSplineCurve:
    """A closed curve in space."""
    angle = np.arange(6) * np.pi / 3
    rng = np.random.default_rng(6)
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1) + 0.2 * rng.normal(size=(6, 3))
    return js.BSplineCurve(points + 2.0, PERIODIC, 3, periodic=True)


def strand() -> js.BSplineCurve:
    """An open curve in space."""
    points = np.cumsum(np.random.default_rng(7).normal(size=(8, 3)), axis=0)
    return js.BSplineCurve(points, clamped(3, 2.7, 3.1, 3.1, 4.4), 3)


def fan() -> js.BSplineSurface:
    """A triangle: one side of the net is a single point."""
    net = np.array(wave().control_points)
    net[0] = net[0, 0]
    return js.BSplineSurface(net, wave().knots_u, wave().knots_v, 3, 2)


def size(shape) -> float:
    """The longest side of the bounding box of a shape's control points."""
    return float(np.ptp(np.asarray(shape.control_points).reshape(-1, 3), axis=0).max())


def places(shape, count: int, seed: int = 0) -> tuple[jnp.ndarray, ...]:
    """Parameters drawn evenly from the domain [2, 5]."""
    rng = np.random.default_rng(seed)
    directions = 1 if isinstance(shape, js.BSplineCurve) else 2
    return tuple(jnp.asarray(rng.uniform(2, 5, count), shape.dtype) for _ in range(directions))


def near(shape, count: int, within: float) -> np.ndarray:
    """Points no further from the shape, in each coordinate, than `within` times its size."""
    rng = np.random.default_rng(1)
    points = np.asarray(shape(*places(shape, count)))
    return points + within * size(shape) * rng.uniform(-1, 1, points.shape)


def far(shape, count: int) -> np.ndarray:
    """Points drawn evenly from a cube of three times the size around the shape."""
    control = np.asarray(shape.control_points).reshape(-1, 3)
    middle = (control.min(axis=0) + control.max(axis=0)) / 2
    return middle + 1.5 * size(shape) * np.random.default_rng(3).uniform(-1, 1, (count, 3))


def least_distance(shape, points: np.ndarray, count: int = 300) -> np.ndarray:
    """To the nearest of count × count samples of a surface, or count² of a curve."""
    if isinstance(shape, js.BSplineCurve):
        samples = np.asarray(shape(np.linspace(2, 5, count * count)))
    else:
        samples = np.asarray(shape.grid(np.linspace(2, 5, count), np.linspace(2, 5, count)))
    return KDTree(samples.reshape(-1, 3)).query(points)[0]
