"""A grid of samples cut into cells: blocks of neighbouring samples with their surroundings and their bounding boxes."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .. import _safe

_WIDTH = 4  # intervals between samples that a cell spans


class Cells(NamedTuple):
    """Blocks of rows × columns samples; neighbours share the samples at their ends.

    samples: (cells, d + 1, (rows + 2)(columns + 2)), coordinates and ½ |s|² with a ring of neighbours around; numbers:
    of the samples in the grid; along_u, along_v: (cells, 4, rows or columns), the spacings to both neighbours, and how far
    one may go towards each; rim_u, rim_v: -1 and 1 at the first and last sample where there is something beyond, else 0.
    """

    samples: Float[Array, "cells d1 ring"]
    numbers: Int[Array, "cells block"]
    along_u: Float[Array, "cells 4 rows"]
    along_v: Float[Array, "cells 4 columns"]
    rim_u: Float[Array, "cells rows"]
    rim_v: Float[Array, "cells columns"]
    sides: tuple[int, int]

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.samples.shape[0]


def cut_into_cells(samples: Float[Array, "n m d"], axes: tuple[Float[Array, "_"], ...], closed: tuple[bool, ...]) -> Cells:
    """Cut a grid of samples at parameters `axes`; a direction of one sample (of a curve) is not cut."""
    rows, columns, d = samples.shape
    ringed = _ringed(_ringed(samples, closed[0]).swapaxes(0, 1), closed[1]).swapaxes(0, 1)
    starts_u, starts_v = _starts(rows), _starts(columns)
    sides = tuple(min(_WIDTH + 1, n) for n in (rows, columns))
    pairs = np.stack(np.meshgrid(starts_u, starts_v, indexing="ij"), -1).reshape(-1, 2)
    block = lambda start, side, more: start[:, None] + np.arange(side + more)
    at_u, at_v = block(pairs[:, 0], sides[0], 2), block(pairs[:, 1], sides[1], 2)
    gathered = ringed[at_u[:, :, None], at_v[:, None, :]].reshape(len(pairs), -1, d)
    squared = 0.5 * jnp.sum(gathered * gathered, axis=-1, keepdims=True)
    table = jnp.concatenate([gathered, squared], axis=-1).swapaxes(1, 2)
    in_u, in_v = block(pairs[:, 0], sides[0], 0), block(pairs[:, 1], sides[1], 0)
    numbers = (in_u[:, :, None] * columns + in_v[:, None, :]).reshape(len(pairs), -1)
    along_u, along_v = (_spacings(axis, loop) for axis, loop in zip(axes, closed, strict=True))
    return Cells(
        table,
        jnp.asarray(numbers, jnp.int32),
        along_u[:, in_u].swapaxes(0, 1),
        along_v[:, in_v].swapaxes(0, 1),
        _rim(in_u, rows, closed[0]),
        _rim(in_v, columns, closed[1]),
        (sides[0], sides[1]),
    )


def boxes(cells: Cells) -> tuple[Float[Array, "d cells d1"], Float[Array, "d cells 2"]]:
    """Bounding boxes in frames along the cells: coordinates (vector, offset) from the middle sample, and their ends.

    Between samples a surface leaves the box of the samples by about a sixteenth of its height; the box is made so much
    larger.
    """
    rows, columns = cells.sides
    d = cells.samples.shape[1] - 1
    grid = cells.samples[:, :d].reshape(-1, d, rows + 2, columns + 2)[:, :, 1:-1, 1:-1]
    middle = grid[:, :, rows // 2, columns // 2]
    first = _safe.unit(grid[:, :, rows // 2, -1] - grid[:, :, rows // 2, 0])
    second = grid[:, :, -1, columns // 2] - grid[:, :, 0, columns // 2]
    frame = _orthonormal(first, second)
    points = grid.reshape(-1, d, rows * columns) - middle[:, :, None]
    inside = jnp.einsum("ckx,cxn->ckn", frame, points)
    low, high = jnp.min(inside, axis=-1), jnp.max(inside, axis=-1)
    room = (high - low) / 16
    offset = -jnp.sum(frame * middle[:, None, :], axis=-1, keepdims=True)
    ends = jnp.stack([low - room, high + room], axis=-1)
    return jnp.concatenate([frame, offset], axis=-1).swapaxes(0, 1), ends.swapaxes(0, 1)


def distances(
    middle: Float[Array, "d cells d1"], ends: Float[Array, "d cells 2"], p: Float[Array, "b d"]
) -> tuple[Float[Array, "cells b"], Float[Array, "cells b"]]:
    """Squared distances of points to all boxes, and to the middle samples in them.

    Points run along the last axis: minima over cells are then taken for many points at once.
    """
    lifted = jnp.concatenate([p, jnp.ones_like(p[:, :1])], axis=1).T
    least = most = jnp.zeros((middle.shape[1], p.shape[0]), p.dtype)
    for k in range(p.shape[1]):
        along = jnp.matmul(middle[k], lifted, precision="highest")
        beyond = jnp.maximum(jnp.maximum(along - ends[k, :, 1:], ends[k, :, :1] - along), 0)
        least, most = least + beyond * beyond, most + along * along
    return least, most


def _orthonormal(first: Float[Array, "c d"], second: Float[Array, "c d"]) -> Float[Array, "c d d"]:
    """Frames whose first vectors are `first` and `second` made orthogonal to it; where these are short, any."""
    d = first.shape[1]
    basis = [first]
    for candidate in [second, *jnp.broadcast_to(jnp.eye(d, dtype=first.dtype)[:, None], (d, *first.shape))]:
        rest = candidate
        for axis in basis:
            rest = rest - jnp.sum(rest * axis, axis=1, keepdims=True) * axis
        length = _safe.norm(rest, keepdims=True)
        # enough left of it, and still room for one more vector
        used = sum(jnp.sum(axis * axis, axis=1, keepdims=True) for axis in basis)
        good = (length > 1e-3 * _safe.norm(candidate, keepdims=True)) & (used < d - 0.5)
        basis.append(jnp.where(good, _safe.unit(rest), 0))
    stacked = jnp.stack(basis, axis=1)
    # of the candidates d are not zero: bring these to the front
    order = jnp.argsort(-jnp.sum(stacked * stacked, axis=2), axis=1, stable=True)[:, :d]
    return jnp.take_along_axis(stacked, order[:, :, None], axis=1)


def _starts(count: int) -> np.ndarray:
    """First samples of the cells along one direction; the last cell may overlap the one before."""
    width = min(_WIDTH, count - 1)
    if width == 0:
        return np.zeros(1, int)
    return np.minimum(np.arange(0, count - 1, width), count - 1 - width)


def _ringed(samples: Float[Array, "n m d"], closed: bool) -> Float[Array, "n2 m d"]:
    """One more sample before and after the first direction: across the seam, or on the parabola through the last three."""
    count = samples.shape[0]
    if count == 1:
        return jnp.concatenate([samples] * 3)
    if closed:
        return jnp.concatenate([samples[-2:-1], samples, samples[1:2]])
    beyond = lambda a, b, c: 3 * a - 3 * b + c if count > 2 else 2 * a - b
    pick = lambda i: samples[i % count][None]
    return jnp.concatenate([beyond(pick(0), pick(1), pick(2)), samples, beyond(pick(-1), pick(-2), pick(-3))])


def _spacings(axis: Float[Array, "n"], closed: bool) -> Float[Array, "4 n"]:
    """Spacings to the parameter before and after, and half of them, 0 across an open end."""
    if axis.shape[0] == 1:
        return jnp.stack([jnp.ones(1, axis.dtype)] * 2 + [jnp.zeros(1, axis.dtype)] * 2)
    steps = jnp.maximum(jnp.diff(axis), 1e-6 * (axis[-1] - axis[0]))  # at repeated knots samples are repeated
    ends = (steps[-1:], steps[:1]) if closed else (steps[:1], steps[-1:])
    left, right = jnp.concatenate([ends[0], steps]), jnp.concatenate([steps, ends[1]])
    back, ahead = left / 2, right / 2
    if not closed:
        back, ahead = back.at[0].set(0), ahead.at[-1].set(0)
    return jnp.stack([left, right, back, ahead])


def _rim(index: Int[np.ndarray, "cells side"], count: int, closed: bool) -> Float[Array, "cells side"]:
    rim = np.zeros(index.shape, np.float32)
    if index.shape[1] > 1:
        rim[:, 0] = np.where((index[:, 0] > 0) | closed, -1, 0)
        rim[:, -1] = np.where((index[:, -1] < count - 1) | closed, 1, 0)
    return jnp.asarray(rim)
