"""Evaluation of a surface for numpy code that asks for many different numbers of points."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

STEP = 5e-4  # of the domain: how far inside the normal of a pole is looked up


def points_at(surface: Any, parameters: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Points of the surface at pairs (u, v), as float64."""
    padded, count = _padded(parameters)
    return np.asarray(_points(surface, padded[:, 0], padded[:, 1]), dtype=np.float64)[:count]


def grid_at(
    surface: Any, u: Float[np.ndarray, "m"], v: Float[np.ndarray, "k"]
) -> Float[np.ndarray, "m k 3"]:
    """Points of the surface on a grid, as float64."""
    (u, rows), (v, columns) = _padded(u), _padded(v)
    return np.asarray(_grid(surface, u, v), dtype=np.float64)[:rows, :columns]


def curve_at(curve: Any, u: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n d"]:
    """Points of a curve, as float64."""
    padded, count = _padded(u)
    return np.asarray(_curve(curve, padded), dtype=np.float64)[:count]


def normals_at(surface: Any, parameters: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Unit normals; where a pole or a collapsed edge has none, the one a short step inside the domain."""
    padded, count = _padded(parameters)
    normals = np.array(_normals(surface, padded[:, 0], padded[:, 1]), dtype=np.float64)[:count]
    missing = ~(np.abs(np.linalg.norm(normals, axis=1) - 1.0) < 0.01)
    if missing.any():
        low, high = domain_corners(surface)
        middle = (low + high) / 2
        inside = parameters[missing] + STEP * (middle - parameters[missing])
        padded, count = _padded(inside)
        again = np.array(_normals(surface, padded[:, 0], padded[:, 1]), dtype=np.float64)[:count]
        length = np.linalg.norm(again, axis=1, keepdims=True)
        found = np.isfinite(length) & (length > 0.99)
        normals[missing] = np.where(found, again, [0.0, 0.0, 1.0])
    return normals


def domain_corners(surface: Any) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """(first u, first v) and (last u, last v) as numpy."""
    (u0, u1), (v0, v1) = surface.domain
    return np.array([float(u0), float(v0)]), np.array([float(u1), float(v1)])


def precision(array: np.ndarray, dtype: Any) -> float:
    """Round-off of coordinates computed in `dtype`: below this length nothing can be told apart."""
    return 32 * float(jnp.finfo(dtype).eps) * float(np.abs(array).max(initial=0.0))


def _padded(parameters: np.ndarray) -> tuple[np.ndarray, int]:
    # Every new number of points is a new compilation; the next power of two, reached by repeating the last
    # parameter, leaves a dozen of them.
    count = len(parameters)
    wanted = max(64, 1 << max(count - 1, 0).bit_length())
    widths = [(0, wanted - count)] + [(0, 0)] * (parameters.ndim - 1)
    return np.pad(parameters, widths, mode="edge"), count


@eqx.filter_jit
def _points(surface, u, v):
    return surface(u, v)


@eqx.filter_jit
def _grid(surface, u, v):
    return surface.grid(u, v)


@eqx.filter_jit
def _curve(curve, u):
    return curve(u)


@eqx.filter_jit
def _normals(surface, u, v):
    _, along_u = jax.jvp(lambda s: surface(s, v), (u,), (jnp.ones_like(u),))
    _, along_v = jax.jvp(lambda t: surface(u, t), (v,), (jnp.ones_like(v),))
    normal = jnp.cross(along_u, along_v)
    # Relative to the partials themselves, so that neither the unit nor the parametrisation matters.
    length = jnp.linalg.norm(normal, axis=-1, keepdims=True)
    size = jnp.linalg.norm(along_u, axis=-1, keepdims=True) * jnp.linalg.norm(along_v, axis=-1, keepdims=True)
    good = length > 1e-6 * jnp.max(size)
    return jnp.where(good, normal / jnp.where(good, length, 1.0), 0.0)
