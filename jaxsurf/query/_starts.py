"""Where searches for feet begin: the few cells of a shape that may hold the foot, and the best place in each."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .. import _safe
from .._prepared import prepare
from ..curve import AbstractCurve
from ._cells import Cells, boxes, cut_into_cells, distances
from ._samples import periodic_directions, sample_parameters

_CHUNK = 128  # points worked on together
_ROUND = 2  # cells looked at before asking whether that is enough
_NONE = 1e30
_FAR = 300.0  # sizes of the shape; points further away are looked at from there


def sample_points(shape: Any) -> tuple[tuple[Float[Array, "_"], ...], Float[Array, "n m d"]]:
    """Parameters in each direction, and the points of a shape there; those of a curve are one row."""
    shape = prepare(shape)
    axes = sample_parameters(shape)
    points = shape(*axes)[None] if isinstance(shape, AbstractCurve) else shape.grid_points(*axes)
    return axes, jax.lax.stop_gradient(points)


@eqx.filter_jit
def choose_starts(
    shape: Any, points: Float[Array, "N d"], candidates: int
) -> tuple[Float[Array, "s k"], Int[Array, "N c"], Bool[Array, "N c"]]:
    """Parameters of the samples; for each point the numbers of the samples that may lead to the foot, and which of them
    are wanted.

    Cells (blocks of samples) are looked at in the order of the distances of their bounding boxes, as long as these are
    below the least distance found. In each the sample is taken whose distance falls lowest on the parabolas through it and
    its neighbours, which see minima between samples; where these lead out of the cell the minimum is the neighbour's.
    The `candidates` best are kept, and wanted if three times the fall would bring them below the least distance.
    """
    points = jax.lax.stop_gradient(points)
    axes, samples = sample_points(shape)
    closed = (False,) * (2 - len(axes)) + periodic_directions(shape)
    low, high = jnp.min(samples, axis=(0, 1)), jnp.max(samples, axis=(0, 1))
    centre, size = (low + high) / 2, _not_zero(jnp.max(high - low))
    # Single precision ranks samples well enough, in half the time.
    flat = ((samples - centre[None, None]) / size).astype(jnp.float32)
    single = tuple(axis.astype(jnp.float32) for axis in axes)
    cells = cut_into_cells(flat, single if len(axes) == 2 else (jnp.zeros(1, jnp.float32), *single), closed)
    middle, ends = boxes(cells)
    number = jnp.arange(cells.count, dtype=jnp.int32)[:, None]

    def nearest(p: Float[Array, "b d"]) -> tuple[Int[Array, "b c"], Bool[Array, "b c"]]:
        offset = (p - centre[None]) / size
        pulled = jnp.minimum(1, _safe.divide(jnp.full_like(offset[:, :1], _FAR), _safe.norm(offset, keepdims=True)))
        near = jnp.where(jnp.isfinite(offset), offset * pulled, 0).astype(jnp.float32)
        squared = jnp.sum(near * near, axis=1)
        slack = 1e-6 * (1 + squared)
        least, most = distances(middle, ends, near)

        def going(state: tuple[Array, Array, list[_Best]]) -> Bool[Array, ""]:
            left, lowest, _ = state
            return jnp.any(jnp.min(left, axis=0) <= lowest)

        def look(state: tuple[Array, Array, list[_Best]]) -> tuple[Array, Array, list[_Best]]:
            left, lowest, best = state
            for _ in range(_ROUND):
                low = jnp.min(left, axis=0)
                nearest = jnp.min(jnp.where(left <= low[None], number, cells.count - 1), axis=0)
                left = jnp.where(number == nearest[None], jnp.inf, left)
                found = _look(cells, nearest, near)
                found = found._replace(fall=jnp.where(low <= lowest, found.fall, -_NONE))
                lowest = jnp.minimum(lowest, 2 * found.value + squared + slack)
                best = _insert(best, found)
            return left, lowest, best

        none = jnp.full_like(squared, _NONE)
        best = [_Best(none, jnp.zeros_like(none), jnp.zeros(none.shape, jnp.int32))] * candidates
        _, lowest, best = jax.lax.while_loop(going, look, (least, jnp.min(most, axis=0) + slack, best))
        deepest = jnp.stack([found.value - 3 * found.fall for found in best], axis=1)
        wanted = 2 * deepest <= (lowest - squared)[:, None]
        return jnp.stack([found.sample for found in best], axis=1), wanted.at[:, 0].set(True)

    parameters = jnp.stack(jnp.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    numbers, wanted = _in_chunks(nearest, points, _CHUNK)
    return jax.lax.stop_gradient(parameters), numbers, wanted


@eqx.filter_jit
def nearest_samples(shape: Any, points: Float[Array, "N d"]) -> Float[Array, "N k"]:
    """Parameters of the sample nearest to each point: quick first feet of small clouds, without derivatives."""
    axes, samples = jax.lax.stop_gradient(sample_points(shape))
    parameters = jnp.stack(jnp.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    flat = samples.reshape(-1, samples.shape[-1])
    centre = jnp.mean(flat, axis=0)
    flat, half = flat - centre[None], 0.5 * jnp.sum((flat - centre[None]) ** 2, axis=1)

    def nearest(p: Float[Array, "b d"]) -> Float[Array, "b k"]:
        return parameters[jnp.argmin(half[None] - jnp.matmul(p - centre[None], flat.T), axis=1)]

    return _in_chunks(nearest, jax.lax.stop_gradient(points), _CHUNK)


class _Best(NamedTuple):
    """Of one cell: ½ d² − ½ p² at its best sample, how far it falls on the parabolas there (-1e30 in a cell that does not
    count), and the sample's number."""

    value: Float[Array, "b"]
    fall: Float[Array, "b"]
    sample: Int[Array, "b"]


def _look(cells: Cells, number: Int[Array, "b"], p: Float[Array, "b d"]) -> _Best:
    """The best sample of cell `number[i]` for point i."""
    rows, columns = cells.sides
    table = cells.samples[number]  # (b, d + 1, (rows + 2) (columns + 2))
    half = table[:, -1] - sum(p[:, k, None] * table[:, k] for k in range(p.shape[1]))
    half = half.reshape(-1, rows + 2, columns + 2)
    here = half[:, 1:-1, 1:-1]
    fall_u, step_u = _bottom(half[:, :-2, 1:-1], here, half[:, 2:, 1:-1], cells.along_u[number][..., None])
    fall_v, step_v = _bottom(half[:, 1:-1, :-2], here, half[:, 1:-1, 2:], cells.along_v[number][..., None, :])
    fall = fall_u + fall_v
    inside = _stays(step_u, cells.rim_u[number][..., None]) & _stays(step_v, cells.rim_v[number][..., None, :])
    value = jnp.where(inside, here - fall, _NONE).reshape(p.shape[0], -1)
    index = jnp.argmin(value, axis=1).astype(jnp.int32)
    pick = lambda x: jnp.take_along_axis(x.reshape(p.shape[0], -1), index[:, None], axis=1)[:, 0]
    return _Best(pick(here), jnp.where(pick(value) < _NONE, pick(fall), -_NONE), pick(cells.numbers[number]))


def _insert(best: list[_Best], found: _Best) -> list[_Best]:
    """The list in ascending order of the value after twice the fall, with `found` in its place and without the last."""
    sorted_in = []
    for kept in best:
        better = found.value - 2 * found.fall < kept.value - 2 * kept.fall
        pick = lambda a, b, better=better: jax.tree.map(lambda x, y: jnp.where(better, x, y), a, b)
        sorted_in.append(pick(found, kept))
        found = pick(kept, found)
    return sorted_in


def _bottom(
    before: Float[Array, "b r c"],
    here: Float[Array, "b r c"],
    after: Float[Array, "b r c"],
    spacing: Float[Array, "b 4 ..."],
) -> tuple[Float[Array, "b r c"], Float[Array, "b r c"]]:
    """How far the parabola through three samples falls within half-way to its neighbours, and the step there."""
    left, right, back, ahead = (spacing[:, i] for i in range(4))
    rise, drop = (after - here) / right, (here - before) / left
    slope = (left * rise + right * drop) / (left + right)
    bend = 2 * (rise - drop) / (left + right)
    downhill = jnp.where(slope > 0, -back, ahead)
    step = jnp.where(bend > 0, jnp.clip(-slope / jnp.where(bend > 0, bend, 1), -back, ahead), downhill)
    return jnp.maximum(-step * (slope + 0.5 * bend * step), 0), step


def _stays(step: Float[Array, "b r c"], rim: Float[Array, "b ..."]) -> Bool[Array, "b r c"]:
    """Whether a step from a sample does not lead out of its cell; rim: -1 and 1 at the cell's ends, unless nothing is
    beyond."""
    return step * rim <= 0


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
