"""Integrals over the domain of a shape, box by box between its breaks."""

from collections.abc import Callable
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, eps, is_concrete, map_points

NODES = 8
"""Gauss-Legendre nodes per box and direction."""
TRACED_SPLITS = {1: 8, 2: 2}  # boxes per span and direction under tracing, by dimension: 64 and 16 nodes
_ROUNDS = 40
_MOST = 20_000  # boxes; beyond them the integral is as good as it gets (a crease across the parameters)
_LEAST = 64  # boxes evaluated together, padded to a power of two from here on, so that few sizes are compiled


def integral(
    function: Callable[..., Array], shape: Any, edges: tuple[Any, ...], tolerance: float | None = None
) -> Float[Array, ""]:
    """∫ function(shape, *parameters) over the rectangle of the breaks `edges`, one array per parameter.

    On concrete data boxes are halved until halving changes their integrals, in sum, by less than `tolerance`
    times the integral of |function| (default eps^(2/3)). Under tracing each span is split into a fixed
    generous number of boxes, and the integral is differentiable in shape and edges. `function` is one of a
    module, since it is compiled by its identity.
    """
    if not is_concrete(shape, edges):
        low, high = _boxes(tuple(split_spans(edge, TRACED_SPLITS[len(edges)]) for edge in edges))
        return jnp.sum(box_integrals(function, shape, low, high))
    with jax.ensure_compile_time_eval():
        values, low, _ = _settle(function, shape, edges, tolerance)
        return jnp.asarray(np.sum(values), low.dtype)


def box_integrals(
    function: Callable[..., Array], shape: Any, low: Float[Array, "n d"], high: Float[Array, "n d"]
) -> Float[Array, "n"]:
    """Gauss-Legendre integrals over boxes from `low` to `high`; exact for polynomials of degree 15."""
    nodes, weights = gauss(low.dtype, low.shape[1])
    places = low[:, None] + (high - low)[:, None] * nodes[None]
    values = map_points(function, shape, *jnp.moveaxis(places, -1, 0))
    return (values @ weights) * jnp.prod(high - low, axis=1)


def gauss(dtype: Any, dimension: int = 1) -> tuple[Float[Array, "k d"], Float[Array, "k"]]:
    """Nodes and weights on the unit box."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    nodes = np.stack(np.meshgrid(*[(x + 1) / 2] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    weights = np.prod(np.stack(np.meshgrid(*[w / 2] * dimension, indexing="ij"), axis=-1), axis=-1)
    return jnp.asarray(nodes, dtype), jnp.asarray(weights.reshape(-1), dtype)


def settled_edges(function: Callable[..., Array], shape: Any, edge: Any, tolerance: float | None = None) -> np.ndarray:
    """Breaks of one parameter, refined until integrals between them are within `tolerance`; concrete data.

    The last one is repeated up to the next power of two, so that few sizes are compiled.
    """
    with jax.ensure_compile_time_eval():
        _, low, high = _settle(function, shape, (edge,), tolerance)
    ascending = np.concatenate([np.sort(low[:, 0]), high.max(keepdims=True)[0]])
    return np.pad(ascending, (0, (1 << (ascending.size - 1).bit_length()) - ascending.size), mode="edge")


def _settle(
    function: Callable[..., Array], shape: Any, edges: tuple[Any, ...], tolerance: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrals and corners of boxes whose integrals do not change when they are halved."""
    low, high = _boxes(tuple(concrete(edge) for edge in edges))
    tolerance = eps(low.dtype) ** (2 / 3) if tolerance is None else tolerance
    values = _concrete_integrals(function, shape, low, high)
    done = []
    for _ in range(_ROUNDS):
        parts_low, parts_high = _halved(low, high)
        corners = (p.reshape(-1, low.shape[1]) for p in (parts_low, parts_high))
        parts = _concrete_integrals(function, shape, *corners).reshape(len(low), -1)
        total = sum(np.sum(np.abs(value)) for value, _, _ in done) + np.sum(np.abs(parts))
        count = sum(len(value) for value, _, _ in done) + len(low)
        change = np.abs(np.sum(parts, axis=1) - values)
        noise = 16 * eps(low.dtype) * np.sum(np.abs(parts), axis=1)
        settled = (change <= np.maximum(tolerance * total / count, noise)) | (count > _MOST)
        done.append((np.sum(parts, axis=1)[settled], low[settled], high[settled]))
        if settled.all():
            break
        low, high = (p[~settled].reshape(-1, low.shape[1]) for p in (parts_low, parts_high))
        values = parts[~settled].reshape(-1)
    else:
        done.append((values, low, high))
    values, low, high = (np.concatenate(column) for column in zip(*done, strict=True))
    return values, low, high


def _concrete_integrals(function: Callable[..., Array], shape: Any, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    count = len(low)
    wanted = max(_LEAST if low.shape[1] == 1 else 1, 1 << (count - 1).bit_length())
    low, high = (np.pad(side, ((0, wanted - count), (0, 0)), mode="edge") for side in (low, high))
    return concrete(box_integrals(function, shape, jnp.asarray(low), jnp.asarray(high)))[:count]


def _halved(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All 2^d halves of each box, (n, 2^d, d)."""
    middle = (low + high) / 2
    corners = np.array(list(product((False, True), repeat=low.shape[1])))
    return np.where(corners, middle[:, None], low[:, None]), np.where(corners, high[:, None], middle[:, None])


def _boxes(edges: tuple[Any, ...]) -> tuple[Any, Any]:
    """Corners (n, d) of the boxes between the breaks of each parameter."""
    xp = np if is_concrete(edges) else jnp
    low = xp.stack([p.reshape(-1) for p in xp.meshgrid(*(e[:-1] for e in edges), indexing="ij")], axis=-1)
    high = xp.stack([p.reshape(-1) for p in xp.meshgrid(*(e[1:] for e in edges), indexing="ij")], axis=-1)
    return low, high


def split_spans(edge: Any, parts: int) -> Array:
    """Each span cut into equal parts."""
    edge = jnp.asarray(edge)
    share = jnp.arange(parts, dtype=edge.dtype) / parts
    inner = edge[:-1, None] + jnp.diff(edge)[:, None] * share[None]
    return jnp.concatenate([inner.reshape(-1), edge[-1:]])
