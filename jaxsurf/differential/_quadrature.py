"""Integrals over the domain of a shape, box by box between its breaks."""

from collections.abc import Callable
from itertools import product
from typing import Any

import equinox as eqx
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
_BLOCK = 64  # boxes evaluated together


def integral(
    function: Callable[..., Array], shape: Any, edges: tuple[Any, ...], tolerance: float | None = None
) -> Float[Array, ""]:
    """∫ function(shape, *parameters) over the rectangle of the breaks `edges`, one array per parameter.

    On concrete data boxes are halved until halving changes their integrals, in sum, by less than `tolerance`
    times the integral of |function| (default eps^(2/3)). Under tracing each span is split into a fixed
    generous number of boxes, and the integral is differentiable in shape and edges. A function that cancels
    gives a pair, its value and the size of what cancels. `function` is one of a module: it is compiled by its identity.
    """
    if not is_concrete(shape, edges):
        low, high = _boxes(tuple(split_spans(edge, TRACED_SPLITS[len(edges)]) for edge in edges))
        parts = box_integrals(function, shape, jnp.asarray(low), jnp.asarray(high))
        return jnp.sum(parts.reshape(len(low), -1)[:, 0])
    with jax.ensure_compile_time_eval():
        values, low, _ = _settle(function, shape, edges, tolerance)
        return jnp.asarray(np.sum(values), low.dtype)


@eqx.filter_jit
def box_integrals(
    function: Callable[..., Array], shape: Any, low: Float[Array, "n d"], high: Float[Array, "n d"]
) -> Float[Array, "n ..."]:
    """Gauss-Legendre integrals over boxes from `low` to `high`; exact for polynomials of degree 15."""
    nodes, weights = gauss(low.dtype, low.shape[1])
    places = low[:, None] + (high - low)[:, None] * nodes[None]
    values = map_points(function, shape, *jnp.moveaxis(places, -1, 0))
    sizes = jnp.prod(high - low, axis=1)
    return jnp.einsum("nk...,k,n->n...", values, weights, sizes)


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
    values = _concrete_integrals(function, shape, low, high)[:, 0]
    done, dimension = [], low.shape[1]
    total, count = 0.0, 0
    for _ in range(_ROUNDS):
        parts_low, parts_high = _halved(low, high)
        corners = (p.reshape(-1, dimension) for p in (parts_low, parts_high))
        parts = _concrete_integrals(function, shape, *corners).reshape(len(low), -1, 2)
        sums, sizes = np.sum(parts[..., 0], axis=1), np.sum(parts[..., 1], axis=1)
        allowed = np.maximum(tolerance * (total + sizes.sum()) / (count + len(low)), 16 * eps(low.dtype) * sizes)
        settled = (np.abs(sums - values) <= allowed) | (len(low) > _MOST)
        done.append((sums[settled], low[settled], high[settled]))
        total, count = total + sizes[settled].sum(), count + settled.sum()
        if settled.all():
            break
        low, high = (p[~settled].reshape(-1, dimension) for p in (parts_low, parts_high))
        values = parts[~settled, :, 0].reshape(-1)
    else:
        done.append((values, low, high))
    values, low, high = (np.concatenate(column) for column in zip(*done, strict=True))
    return values, low, high


def _concrete_integrals(
    function: Callable[..., Array], shape: Any, low: np.ndarray, high: np.ndarray
) -> Float[np.ndarray, "n 2"]:
    """Integrals of the function and of its size, always as many boxes at once, so that one size is compiled."""
    blocks = []
    for start in range(0, len(low), _BLOCK):
        sides = [side[start : start + _BLOCK] for side in (low, high)]
        count = len(sides[0])
        padded = (np.pad(side, ((0, _BLOCK - count), (0, 0)), mode="edge") for side in sides)
        blocks.append(concrete(box_integrals(function, shape, *map(jnp.asarray, padded)))[:count])
    parts = np.concatenate(blocks)
    return parts if parts.ndim == 2 else np.stack([parts, np.abs(parts)], axis=1)


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
