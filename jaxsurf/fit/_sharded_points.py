"""A cloud in parts: each device holds some of the points, and no process all of them."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, is_concrete
from .._errors import InputError
from . import _processes as processes
from ._shard import mesh_of, point_mesh, spread


class ShardedPoints(eqx.Module):
    """Points whose rows lie spread over devices, or all on one.

    points: (M, 3), where every device has as many rows, the last ones of a process filled up with copies; counted: (M,),
    1 for points that were given, 0 for copies; counts: how many were given in each process; mesh: of the devices, `None`
    for points that lie on one.
    """

    points: Float[Array, "M d"]
    counted: Float[Array, "M"]
    counts: tuple[int, ...] = eqx.field(static=True)
    mesh: Any = eqx.field(static=True, default=None)

    @property
    def count(self) -> int:
        """How many points there are in all."""
        return sum(self.counts)

    @property
    def here(self) -> int:
        """How many of them this process has given."""
        return self.counts[self._process]

    @property
    def first(self) -> int:
        """The number of this process's first point."""
        return sum(self.counts[: self._process])

    @property
    def alone(self) -> bool:
        """Whether this process has all of the points."""
        return len(self.counts) == 1

    def rows(self, values: Any) -> np.ndarray:
        """This process's rows, without copies, of an array with a row for each point."""
        if mesh_of(values) is None:
            return np.asarray(values)
        pieces = sorted(values.addressable_shards, key=lambda piece: piece.index[0].start or 0)
        return np.concatenate([np.asarray(piece.data) for piece in pieces])[: self.here]

    def spread(self, rows: Any) -> Array:
        """The array over all devices of this process's rows, copies of the last one behind them; what lies spread already
        stays."""
        if self.mesh is None or mesh_of(rows) is not None:
            return jnp.asarray(rows)
        rows = np.asarray(rows)
        local = self.points.shape[0] // len(self.counts)
        return spread(_filled(rows, local), self.mesh)

    def home(self, tree: Any) -> Any:
        """Rows as plain arrays without copies where this process has all, else as they are."""
        if self.mesh is None or not self.alone:
            return tree
        return jax.tree.map(lambda rows: jnp.asarray(self.rows(rows)), tree)

    def picked(self, index: np.ndarray, values: Any = None) -> np.ndarray:
        """The points of some numbers, or their rows of another array, in every process."""
        mine = self.rows(self.points if values is None else values)
        if self.alone:
            return mine[index]
        inside = (index >= self.first) & (index < self.first + len(mine))
        whole = np.zeros((len(index), *mine.shape[1:]), mine.dtype)
        whole[inside] = mine[index[inside] - self.first]
        return processes.summed(whole)

    def summed(self, values: Any) -> np.ndarray:
        """The sum over the processes of what each has found in its rows."""
        return np.asarray(values) if self.alone else processes.summed(values)

    @property
    def _process(self) -> int:
        return 0 if self.alone else processes.process_index()


def shard_points(points: Numbers, *, devices: Any = None) -> ShardedPoints:
    """Spread points (N, 3) over devices, for fits to work on all of them at once: `fit(shape, shard_points(points))`.

    With several processes each one gives the points that it has read, such as `read_points(path, shard=(i, n))`, and all
    call this, and the fit, together. devices: by default all of all processes.
    Raises `InputError` where a process has no points.
    """
    points = np.asarray(as_float(points))
    if points.ndim != 2:
        raise InputError(f"`points` must have shape (N, 3), got {points.shape}.")
    mesh = point_mesh(devices)
    several = processes.process_count() > 1
    counts = tuple(int(n) for n in (processes.gathered(np.asarray(len(points))) if several else [len(points)]))
    if min(counts) == 0:
        raise InputError(f"`points` must hold at least one point in each of {len(counts)} processes; take fewer processes.")
    if mesh.size == 1:
        return whole_points(points)
    here = mesh.size // len(counts)
    rows = here * max(-(-count // here) for count in counts)
    counted = np.zeros(rows, points.dtype)
    counted[: len(points)] = 1
    return ShardedPoints(spread(_filled(points, rows), mesh), spread(counted, mesh), counts, mesh)


def whole_points(points: Any, dtype: Any = None) -> ShardedPoints:
    """Points as they come through the public door, in the floating type `dtype`: an array, one that lies spread over
    devices, or `ShardedPoints`."""
    if isinstance(points, ShardedPoints):
        if dtype is None or points.points.dtype == dtype:
            return points
        return jax.tree.map(lambda rows: rows.astype(dtype), points)
    points = as_float(points, dtype)
    if points.ndim != 2:
        raise InputError(f"`points` must have shape (N, 3), got {points.shape}.")
    mesh = mesh_of(points)
    if mesh is None:
        ones = np.ones(points.shape[0])
        return ShardedPoints(points, jnp.asarray(ones, points.dtype), (points.shape[0],))
    several = 1 if points.is_fully_addressable else processes.process_count()
    local = points.shape[0] // several
    return ShardedPoints(points, spread(np.ones(local, points.dtype), mesh), (local,) * several, mesh)


def check_finite(cloud: ShardedPoints) -> None:
    """Refuse points that are NaN or infinite."""
    if not is_concrete(cloud.points):
        return
    rows = cloud.rows(cloud.points)
    finite = np.all(np.isfinite(rows), axis=1)
    if not np.all(finite):
        row = int(np.argmin(finite))
        raise InputError(f"`points` must be finite, but point {cloud.first + row + 1} is {rows[row]}; remove it.")


def _filled(rows: np.ndarray, count: int) -> np.ndarray:
    return np.pad(rows, [(0, count - len(rows))] + [(0, 0)] * (rows.ndim - 1), mode="edge")
