"""Normal equations of any shape by a stand-in: between breaks polynomials take the place of its derivatives by θ."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .. import _safe
from .._array import map_points
from .._prepared import point_of, prepare, roughen
from ..curve import AbstractCurve
from ..surface import breaks
from ._problem import Problem

_NODES = 5  # along each parameter of a cell: derivatives to 2·10⁻⁴ where tangents turn by 90° in one, 5·10⁻³ at 180°
_MOST = 3e7  # numbers that the derivatives at the nodes may take

_ROOTS = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
# values of the polynomials that are 1 at one node and 0 at the others, from Chebyshev polynomials
_TO_NODES = np.linalg.inv(np.polynomial.chebyshev.chebvander(_ROOTS, _NODES - 1))


class NodeCells:
    """The cells between a shape's breaks, with nodes in each at which polynomials are given by their values."""

    def __init__(self, shape: Any):
        found = breaks(shape)
        pair = (found,) if isinstance(shape, AbstractCurve) else found
        self.edges = [jax.lax.stop_gradient(jnp.asarray(edges, shape.dtype)) for edges in pair]
        self.counts = [edges.shape[0] - 1 for edges in self.edges]
        self.count = int(np.prod(self.counts))
        self.terms = _NODES ** len(self.edges)

    def nodes(self) -> list[Float[Array, "n"]]:
        """Parameters of the nodes along u, or along u and along v."""
        share = jnp.asarray(0.5 * (1 + _ROOTS), self.edges[0].dtype)
        return [(e[:-1, None] + jnp.diff(e)[:, None] * share[None, :]).reshape(-1) for e in self.edges]

    def by_cells(self, rows: Float[Array, "..."]) -> Float[Array, "cells terms *r"]:
        """What belongs to the nodes, an axis for each parameter in front, sorted by cells."""
        k = len(self.edges)
        rest = rows.shape[k:]
        split = rows.reshape(*[n for count in self.counts for n in (count, _NODES)], *rest)
        order = (*range(0, 2 * k, 2), *range(1, 2 * k, 2), *range(2 * k, split.ndim))
        return jnp.transpose(split, order).reshape(self.count, self.terms, *rest)

    def index(self, *parameters: Float[Array, ""]) -> Int[Array, ""]:
        """The number of the cell, in the order of `by_cells`."""
        flat = jnp.asarray(np.int32(0))
        for (at, _), count in zip(map(_place, self.edges, parameters), self.counts, strict=True):
            flat = flat * count + at
        return flat

    def values(self, *parameters: Float[Array, ""]) -> Float[Array, "terms"]:
        """Products of the polynomials of the nodes of the cell, in the order of `by_cells`."""
        product = jnp.ones(1, self.edges[0].dtype)
        for _, x in map(_place, self.edges, parameters):
            row = [jnp.ones_like(x), x]
            for _ in range(_NODES - 2):
                row.append(2 * x * row[-1] - row[-2])
            along = jnp.stack(row) @ jnp.asarray(_TO_NODES, x.dtype)
            product = (product[:, None] * along[None, :]).reshape(-1)
        return product


def _place(edges: Float[Array, "n"], t: Float[Array, ""]) -> tuple[Int[Array, ""], Float[Array, ""]]:
    """The span of a parameter, and where in it, from -1 to 1."""
    at = jnp.sum(t >= edges[1:-1], dtype=jnp.int32)
    start, end = edges[at], edges[at + 1]
    return at, _safe.divide(2 * t - start - end, end - start)


def stand_in_for(shape: Any, unknowns: int, points: int) -> NodeCells | None:
    """The cells, where their nodes are fewer than the points and their derivatives find room."""
    cells = NodeCells(shape)
    nodes = cells.count * cells.terms
    return cells if nodes < points and 3 * nodes * unknowns < _MOST else None


def derivatives_at_nodes(problem: Problem, theta: Float[Array, "P"], cells: NodeCells) -> Float[Array, "cells td P"]:
    """Derivatives by θ of the places of the nodes, the coordinates of a cell's nodes in one row."""

    def places(theta: Float[Array, "P"]) -> Float[Array, "..."]:
        member = prepare(roughen(problem.member(theta)))
        nodes = cells.nodes()
        return jax.vmap(member.point)(*nodes) if len(nodes) == 1 else member.grid_points(*nodes)

    moved = cells.by_cells(jax.jacfwd(places)(theta))
    return moved.reshape(cells.count, -1, theta.size)


def exact_gradient(
    problem: Problem, theta: Float[Array, "P"], parameters: Float[Array, "N k"], pull: Float[Array, "N d"]
) -> Float[Array, "P"]:
    """Σ pull · ∂S/∂θ in reverse, a chunk of points at a time."""

    def work(theta: Float[Array, "P"]) -> Float[Array, ""]:
        return jnp.sum(pull * map_points(point_of, problem.member(theta), *parameters.T))

    return jax.grad(work)(theta)
