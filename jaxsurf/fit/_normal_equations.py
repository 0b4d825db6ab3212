"""Normal equations, accumulated in chunks: the N × P matrix of derivatives never exists."""

from collections.abc import Callable
from functools import singledispatch
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._prepared import prepare
from ..basis import BSplineBasis
from ..surface import BSplineSurface
from ._problem import Linearised, Problem
from ._stand_in import NodeCells, derivatives_at_nodes, exact_gradient, stand_in_for

_BLOCKS = (8, 64)  # least and most points of one knot cell that are multiplied together
_GROUP = 4096  # points worked on at once; of a shape without structure
_CHUNK = 256


class Quadratic(NamedTuple):
    """Value, gradient and Gauss-Newton matrix of an objective at θ."""

    value: Float[Array, ""]
    gradient: Float[Array, "P"]
    matrix: Float[Array, "P P"]

    def __add__(self, other: "Quadratic") -> "Quadratic":  # type: ignore[override]
        return Quadratic(*(a + b for a, b in zip(self, other, strict=True)))


@singledispatch
def accumulate(
    shape: Any,
    problem: Problem,
    parameters: Float[Array, "N k"],
    lines: Linearised,
    weights: Float[Array, "N"],
) -> tuple[Float[Array, "P"], Float[Array, "P P"]]:
    """Σ w Jᵀ(S − p) and Σ w JᵀRᵀRJ, J = ∂S/∂θ at the feet, R of `linearise`.

    Any shape: by its stand-in, with the gradient exact, or from few points each with derivatives of its own.
    """
    theta = problem.unknowns(shape)
    cells = stand_in_for(shape, theta.size, parameters.shape[0])
    if cells is None:
        return _point_by_point(shape, problem, parameters, lines, weights)
    d, numbers = lines.offset.shape[1], _weighed_metrics(lines, weights)
    moved = derivatives_at_nodes(problem, theta, cells)
    matrix = _sums_by_cells(cells, parameters, numbers, d)[1]
    matrix = jnp.einsum("cxp,cxq->pq", moved, jnp.einsum("cxy,cyq->cxq", matrix, moved))
    return exact_gradient(problem, theta, parameters, numbers[:, -d:]), matrix


def _point_by_point(
    shape: Any, problem: Problem, parameters: Float[Array, "N k"], lines: Linearised, weights: Float[Array, "N"]
) -> tuple[Float[Array, "P"], Float[Array, "P P"]]:
    theta, count = problem.unknowns(shape), parameters.shape[0]
    jacobian_at = derivatives_by_unknowns(problem, theta, lambda member, *t: member.point(*t))
    groups = -(-count // _CHUNK)
    pad = lambda x: jnp.pad(x, [(0, groups * _CHUNK - count)] + [(0, 0)] * (x.ndim - 1), mode="edge")
    grouped = lambda x: pad(x).reshape(groups, _CHUNK, *x.shape[1:])
    counted = jnp.pad(weights, (0, groups * _CHUNK - count)).reshape(groups, _CHUNK)

    def add(sums: tuple[Array, Array], chunk: Any) -> tuple[tuple[Array, Array], None]:
        t, offset, root, w = chunk
        jacobian = jnp.sqrt(w)[:, None, None] * jnp.einsum(
            "nab,nbp->nap", root, jax.vmap(lambda row: jacobian_at(*row)[1])(t)
        )
        jacobian = jacobian.reshape(-1, theta.size)
        residual = (jnp.sqrt(w)[:, None] * offset).reshape(-1)
        return (sums[0] + residual @ jacobian, sums[1] + jacobian.T @ jacobian), None

    zero = (jnp.zeros_like(theta), jnp.zeros((theta.size, theta.size), theta.dtype))
    chunks = (grouped(parameters), grouped(lines.offset), grouped(lines.root), counted)
    return jax.lax.scan(add, zero, chunks)[0]


def derivatives_by_unknowns(
    problem: Problem, theta: Float[Array, "P"], function: Callable[..., Float[Array, "d"]]
) -> Callable[..., tuple[Float[Array, "d"], Float[Array, "d P"]]]:
    """A function of `rows` that gives `function(member, *rows)` and its derivatives by θ.

    A shape that has tables to build is derived with its tables, once, in forward mode; any other one row by row in reverse.
    """
    prepared_of = lambda x: prepare(problem.member(x))
    prepared = prepared_of(theta)
    if jax.tree.structure(prepared) == jax.tree.structure(problem.shape):
        value = lambda x, *rows: function(problem.member(x), *rows)
        return lambda *rows: (value(theta, *rows), jax.jacrev(value)(theta, *rows))
    moving = jax.jacfwd(prepared_of)(theta)

    def pushed(*rows: Any) -> tuple[Float[Array, "d"], Float[Array, "d P"]]:
        value, push = jax.linearize(lambda member: function(member, *rows), prepared)
        return value, jax.vmap(push, in_axes=-1, out_axes=-1)(moving)

    return pushed


@accumulate.register
def _(
    shape: BSplineSurface,
    problem: Problem,
    parameters: Float[Array, "N k"],
    lines: Linearised,
    weights: Float[Array, "N"],
) -> tuple[Float[Array, "P"], Float[Array, "P P"]]:
    """A B-spline net, whose knot cells have points of their own: nothing stands in."""
    if problem.free != (True, False, False):
        return accumulate.dispatch(object)(shape, problem, parameters, lines, weights)
    cells = KnotCells(shape)
    gradient, matrix = _sums_by_cells(cells, parameters, _weighed_metrics(lines, weights), 3)
    return cells.scatter(gradient, matrix)


def _weighed_metrics(lines: Linearised, weights: Float[Array, "N"]) -> Float[Array, "N numbers"]:
    """Of each point the symmetric metric w RᵀR, six numbers in space, and the pull w Rᵀ (S − p) on the place."""
    weighed = weights[:, None, None] * lines.root
    upper = np.triu_indices(lines.offset.shape[1])
    metric = [jnp.sum(lines.root[:, :, i] * weighed[:, :, j], axis=1) for i, j in zip(*upper, strict=True)]
    pull = jnp.sum(weighed * lines.offset[:, :, None], axis=1)
    return jnp.concatenate([jnp.stack(metric, axis=1), pull], axis=1)


def _sums_by_cells(
    cells: "KnotCells | NodeCells", parameters: Float[Array, "N k"], numbers: Float[Array, "N m"], d: int
) -> tuple[Float[Array, "cells td"], Float[Array, "cells td td"]]:
    """For each cell the gradient and the matrix by the d coordinates of its places, coordinates innermost, from
    `_weighed_metrics` of the points. Points are sorted by cell, and blocks of them are a batch of small products."""
    slots, block_cell = sort_into_blocks(jax.vmap(cells.index)(*parameters.T), cells.count)
    gather = lambda x: jnp.concatenate([x, jnp.zeros_like(x[:1])])[slots]
    terms, dtype, each = cells.terms, parameters.dtype, numbers.shape[1] - d

    def add(sums: tuple[Array, Array], chunk: Any) -> tuple[tuple[Array, Array], None]:
        t, numbers, cell = chunk  # (group, block, ...)
        values = jax.vmap(jax.vmap(cells.values))(*jnp.moveaxis(t, -1, 0))
        weighed = (values[..., None] * numbers[:, :, None, :each]).reshape(*values.shape[:2], -1)
        gradient, matrix = (jnp.einsum("gbt,gbx->gtx", values, x) for x in (numbers[..., each:], weighed))
        return (sums[0].at[cell].add(gradient), sums[1].at[cell].add(matrix)), None

    zero = (jnp.zeros((cells.count, terms, d), dtype), jnp.zeros((cells.count, terms, each * terms), dtype))
    gradient, matrix = jax.lax.scan(add, zero, (gather(parameters), gather(numbers), block_cell))[0]
    matrix = matrix.reshape(cells.count, terms, terms, each)[..., _where(d)]  # cell, i, j, a, b
    matrix = jnp.swapaxes(matrix, 2, 3).reshape(cells.count, d * terms, d * terms)
    return gradient.reshape(cells.count, -1), matrix


def _where(d: int) -> np.ndarray:
    """Where each entry of a symmetric matrix stands among those of its upper half."""
    table = np.zeros((d, d), int)
    table[np.triu_indices(d)] = np.arange(d * (d + 1) // 2)
    return np.maximum(table, table.T)


class KnotCells:
    """The knot cells of a B-spline surface: which control points each one depends on."""

    def __init__(self, shape: BSplineSurface):
        self.u, self.v = shape.basis_u, shape.basis_v
        self.count_u, self.count_v = (_spans(basis) for basis in (self.u, self.v))
        self.count = self.count_u * self.count_v
        self.terms = (self.u.degree + 1) * (self.v.degree + 1)
        self.unknowns = shape.control_points.size

    def index(self, u: Float[Array, ""], v: Float[Array, ""]) -> Int[Array, ""]:
        """The cell of (u, v)."""
        return self.u.span(u) * self.count_v + self.v.span(v)

    def values(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "terms"]:
        """Products of the basis values that do not vanish at (u, v), u-major."""
        _, along_u = self.u.local(u)
        _, along_v = self.v.local(v)
        return (jnp.stack(along_u)[:, None] * jnp.stack(along_v)[None, :]).reshape(-1)

    def control_points(self) -> Int[Array, "cells terms"]:
        """For each cell the flat indices of its control points."""
        index = lambda basis, n: basis.control_index(
            jnp.arange(n, dtype=jnp.int32)[:, None], jnp.arange(basis.degree + 1, dtype=jnp.int32)[None, :]
        )
        in_u, in_v = index(self.u, self.count_u), index(self.v, self.count_v)
        flat = in_u[:, None, :, None] * self.v.size + in_v[None, :, None, :]
        return flat.reshape(self.count, self.terms)

    def scatter(
        self, gradient: Float[Array, "cells q"], matrix: Float[Array, "cells q q"]
    ) -> tuple[Float[Array, "P"], Float[Array, "P P"]]:
        """Add the cells' blocks (control point-major, coordinate-minor) into the whole."""
        coordinate = jnp.arange(3, dtype=jnp.int32)[None, None, :]
        index = (self.control_points()[:, :, None] * 3 + coordinate).reshape(self.count, -1)
        whole = jnp.zeros(self.unknowns, gradient.dtype).at[index].add(gradient)
        square = jnp.zeros((self.unknowns, self.unknowns), matrix.dtype)
        return whole, square.at[index[:, :, None], index[:, None, :]].add(matrix)


def _spans(basis: BSplineBasis) -> int:
    """Number of first-function indices that can occur, empty spans counted."""
    return basis.size if basis.periodic else basis.size - basis.degree


def sort_into_blocks(
    cell: Int[Array, "N"], count: int, block: int | None = None
) -> tuple[Int[Array, "groups group block"], Int[Array, "groups group"]]:
    """Slots for the points, a block of them of one cell; empty slots hold N. And the cell of each block."""
    total = cell.shape[0]
    if block is None:  # half of one is empty in each cell
        block = int(np.clip(2 ** np.round(np.log2(max(total / count, 1) / 2)), *_BLOCKS))
    blocks = -(-(total + count * (block - 1)) // block)
    group = max(1, min(_GROUP // block, blocks))
    blocks = -(-blocks // group) * group
    order = jnp.argsort(cell).astype(jnp.int32)
    counts = jnp.zeros(count, jnp.int32).at[cell].add(1)
    reserved = (counts + block - 1) // block * block
    ordered = cell[order]
    rank = jnp.arange(total, dtype=jnp.int32) - (jnp.cumsum(counts) - counts)[ordered]
    slot = (jnp.cumsum(reserved) - reserved)[ordered] + rank
    slots = jnp.full(blocks * block, total, jnp.int32).at[slot].set(order)
    block_cell = jnp.zeros(blocks, jnp.int32).at[slot // block].set(ordered.astype(jnp.int32))
    return slots.reshape(-1, group, block), block_cell.reshape(-1, group)
