"""Where searches for feet begin: local minima of the distance on a grid of samples."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .. import _safe
from ..curve import AbstractCurve
from ._samples import periodic_directions, sample_parameters

_ENTRIES = 2**17  # of the distance table that is held at once: half a megabyte
_FAR = 1e30
_SEGMENT = 4  # neighbouring samples of which one may be chosen


def sample_points(shape: Any) -> tuple[tuple[Float[Array, "_"], ...], Float[Array, "n m d"]]:
    """Parameters in each direction, and the points of a shape there; those of a curve are one row."""
    axes = sample_parameters(shape)
    points = shape(*axes)[None] if isinstance(shape, AbstractCurve) else shape.grid_points(*axes)
    return axes, jax.lax.stop_gradient(points)


@eqx.filter_jit
def choose_starts(
    shape: Any, points: Float[Array, "N d"], candidates: int
) -> tuple[Float[Array, "s k"], Int[Array, "N c"], Bool[Array, "N c"]]:
    """Parameters of the samples; for each point the numbers of the nearest samples, and which of them may lead
    to the foot.

    Chosen are samples nearer than their neighbours in both directions; across a border there is no neighbour,
    and along a border or at a corner a sample need not be nearer than those inside. (On a very bumpy 8 × 8 net
    1 foot in 2000 is missed so; 1 in 200 if the neighbours across corners had to be further away as well.) A sample further
    than the nearest one by more than the way to its neighbours is not wanted.
    """
    axes, samples = sample_points(shape)
    closed = (False,) * (2 - len(axes)) + periodic_directions(shape)
    # the last sample of a closed direction is the first one again
    axes = tuple(axis[:-1] if loop else axis for axis, loop in zip(axes, closed[-len(axes) :], strict=True))
    samples = samples[: -1 if closed[0] else None, : -1 if closed[1] else None]
    rows, columns, d = samples.shape
    width = -(-columns // _SEGMENT) * _SEGMENT
    table, edges, inside = _ringed(samples, closed, width)
    low, high = jnp.min(samples, axis=(0, 1)), jnp.max(samples, axis=(0, 1))
    centre, size = (low + high) / 2, _not_zero(jnp.max(high - low))
    flat = (table[..., :d] - centre[None, None]) / size
    lift = jnp.where(table[..., d:] > 0, _FAR, 0.5 * jnp.sum(flat * flat, axis=-1, keepdims=True))
    # Single precision ranks samples well enough, in half the time.
    factors = jnp.concatenate([jnp.where(lift < _FAR, flat, 0), lift], -1).reshape(-1, d + 1).astype(jnp.float32)
    reach = _reach(samples, closed)
    number = np.minimum(np.arange(width), columns - 1) + columns * np.arange(rows)[:, None]
    number = jnp.asarray(number.reshape(rows, -1, _SEGMENT), jnp.int32)

    def nearest(p: Float[Array, "b d"]) -> tuple[Int[Array, "b c"], Bool[Array, "b c"]]:
        # Points run along the last axis: minima over samples are then taken for many points at once.
        offset = (p - centre[None]) / size
        shrink = 1 / jnp.maximum(1, jnp.max(jnp.abs(offset), axis=-1, keepdims=True))
        sides = jnp.concatenate([-offset * shrink, jnp.maximum(shrink, 1e-7)], -1).astype(jnp.float32)
        # d² / 2 − p² / 2, times `shrink` for points far away
        grid = jnp.matmul(factors, sides.T, precision=jax.lax.Precision.HIGHEST)
        grid = grid.reshape(rows + 2, -1, p.shape[0])
        here = grid[1:-1, 1 : width + 1]
        across = jnp.minimum(grid[:-2, 1 : width + 1], grid[2:, 1 : width + 1])
        along = jnp.minimum(grid[1:-1, :width], grid[1:-1, 2 : width + 2])
        minimal = inside & ((here <= across) | edges[0]) & ((here <= along) | edges[1])
        minima = jnp.where(minimal, here, _FAR).reshape(rows, -1, _SEGMENT, p.shape[0])
        value, which = minima[:, :, 0], jnp.broadcast_to(number[:, :, :1], minima[:, :, 0].shape)
        for i in range(1, _SEGMENT):
            lower = minima[:, :, i] < value
            value = jnp.where(lower, minima[:, :, i], value)
            which = jnp.where(lower, number[:, :, i, None], which)
        value, which = value.reshape(-1, p.shape[0]), which.reshape(-1, p.shape[0])
        chosen = _lowest(value, which, candidates)
        at = samples.reshape(-1, d)[jnp.stack([c for c, _ in chosen], axis=1)]
        distance = _safe.norm(p[:, None] - at)
        numbers = jnp.stack([c for c, _ in chosen], axis=1)
        wanted = jnp.stack([v < _FAR * 1e-10 for _, v in chosen], axis=1)
        wanted &= distance - reach.reshape(-1)[numbers] < jnp.min(distance, axis=1, keepdims=True)
        return numbers, wanted.at[:, 0].set(True)

    parameters = jnp.stack(jnp.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    numbers, wanted = _in_chunks(nearest, points, max(32, _ENTRIES // factors.shape[0]))
    return jax.lax.stop_gradient(parameters), numbers, wanted


def _ringed(
    samples: Float[Array, "n m d"], closed: tuple[bool, ...], width: int
) -> tuple[Float[Array, "n2 m2 d1"], tuple[np.ndarray, np.ndarray], np.ndarray]:
    """The samples with a ring of neighbours and filled up to `width` columns, a last number telling which are
    none; then which rows and columns are borders, and which columns are samples."""
    rows, columns, _ = samples.shape
    table = jnp.pad(samples, ((0, 0), (0, 0), (0, 1)))
    for axis, loop in enumerate(closed):
        ends = [(1, 1) if i == axis else (0, 0) for i in range(3)]
        table = jnp.pad(table, ends, mode="wrap") if loop else jnp.pad(table, ends, constant_values=1)
    table = jnp.pad(table, ((0, 0), (0, width - columns), (0, 0)), constant_values=1)
    row, column = np.arange(rows)[:, None, None], np.arange(width)[None, :, None]
    first_or_last = np.isin(row, (0, rows - 1)), np.isin(column, (0, columns - 1))
    return table, (first_or_last[0] & (not closed[0]), first_or_last[1] & (not closed[1])), column < columns


def _reach(samples: Float[Array, "n m d"], closed: tuple[bool, ...]) -> Float[Array, "n m"]:
    """The longest way from each sample to one of its eight neighbours."""
    rows, columns, _ = samples.shape
    around = samples
    for axis, loop in enumerate(closed):
        ends = [(1, 1) if i == axis else (0, 0) for i in range(3)]
        around = jnp.pad(around, ends, mode="wrap" if loop else "edge")
    shifts = [around[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return jnp.max(jnp.stack([_safe.norm(shifted - samples) for shifted in shifts]), axis=0)


def _lowest(
    value: Float[Array, "s b"], which: Int[Array, "s b"], count: int
) -> list[tuple[Int[Array, "b"], Float[Array, "b"]]]:
    """The `which` of the lowest values in ascending order, and these values."""
    found = []
    left = value
    for _ in range(count):
        low = jnp.min(left, axis=0)
        number = jnp.min(jnp.where(left <= low[None], which, jnp.iinfo(which.dtype).max), axis=0)
        found.append((jnp.minimum(number, jnp.max(which)), low))
        left = jnp.where((left <= low[None]) & (which == number[None]), _FAR, left)
    return found


def _in_chunks(function: Any, points: Float[Array, "N d"], chunk: int) -> Any:
    """Apply `function` to `points`, at most `chunk` of them at a time."""
    count = points.shape[0]
    chunks = -(-count // chunk)
    chunk = -(-count // chunks)
    padded = jnp.pad(points, ((0, chunks * chunk - count), (0, 0)), mode="edge")
    results = jax.lax.map(function, padded.reshape(chunks, chunk, -1))
    return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:count], results)


def _not_zero(x: Float[Array, ""]) -> Float[Array, ""]:
    return jnp.where(x > 0, x, 1)
