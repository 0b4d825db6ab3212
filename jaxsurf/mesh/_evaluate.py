"""Evaluation of shapes for numpy code that asks for many different numbers of points."""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from .._array import eps
from ..curve import AbstractCurve
from ..differential import normal, partials
from ..surface import AbstractSurface, breaks

CHUNK = 4096
PARALLEL = 1e-6  # partials with a smaller sine between them do not give a normal by themselves


def points_at(surface: AbstractSurface, parameters: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Points of the surface at pairs (u, v), as float64."""
    return _in_chunks(surface, parameters)


def grid_at(surface: AbstractSurface, u: Float[np.ndarray, "m"], v: Float[np.ndarray, "k"]) -> Float[np.ndarray, "m k 3"]:
    """Points of the surface on a grid, as float64."""
    pairs = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
    return points_at(surface, pairs.reshape(-1, 2)).reshape(len(u), len(v), 3)


def curve_at(curve: AbstractCurve, u: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n d"]:
    """Points of a curve, as float64."""
    return _in_chunks(curve, u[:, None])


def normals_at(surface: AbstractSurface, parameters: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Unit normals, at poles and collapsed edges the limit from inside the domain."""

    def both(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        first = partials(surface, u, v)
        return np.concatenate([first.u, first.v], axis=-1)

    along_u, along_v = np.split(_in_chunks(both, parameters), 2, axis=1)
    cross = np.cross(along_u, along_v)
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    largest = np.linalg.norm(along_u, axis=1).max(initial=0.0) * np.linalg.norm(along_v, axis=1).max(initial=0.0)
    missing = length[:, 0] <= PARALLEL * largest
    normals = cross / np.where(length > 0, length, 1.0)
    if missing.any():
        # The limits cost third derivatives, and seconds of compilation: only for surfaces that need them.
        normals[missing] = _in_chunks(lambda u, v: normal(surface, u, v), parameters[missing])
    return normals


def domain_corners(surface: AbstractSurface) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """(first u, first v) and (last u, last v) as numpy."""
    (u0, u1), (v0, v1) = surface.domain
    return np.array([float(u0), float(v0)]), np.array([float(u1), float(v1)])


def breaks_within(shape: Any, axis: int | None, first: float, last: float) -> Float[np.ndarray, "n"]:
    """The ends and, between them, the breaks of a curve (`axis=None`) or of a surface in one direction."""
    places = breaks(shape) if axis is None else breaks(shape)[axis]
    return np.unique(np.clip(np.asarray(places, dtype=np.float64), first, last))


def between_breaks(places: Float[np.ndarray, "n"], count: int) -> tuple[Float[np.ndarray, "m"], int]:
    """Parameters from first to last break, `count` steps at least, and the number of steps a span."""
    steps = max(1, -(-count // (len(places) - 1)))
    inner = [np.linspace(a, b, steps, endpoint=False) for a, b in zip(places[:-1], places[1:], strict=True)]
    return np.append(np.concatenate(inner), places[-1]), steps


def precision(surface: AbstractSurface, vertices: Float[np.ndarray, "n 3"]) -> float:
    """Round-off of the surface's points: below this length nothing can be told apart."""
    return 32 * eps(surface.dtype) * float(np.abs(vertices).max(initial=0.0))


def _in_chunks(function: Callable[..., Any], parameters: Float[np.ndarray, "n p"]) -> np.ndarray:
    # Every new number of points would be a new compilation, half a second each: one size serves all requests.
    count = len(parameters)
    padded = np.pad(parameters, ((0, -count % CHUNK), (0, 0)), mode="edge")
    parts = [function(*padded[start : start + CHUNK].T) for start in range(0, count, CHUNK)]
    return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])[:count]
