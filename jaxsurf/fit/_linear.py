"""The net of least squares at known parameters: one linear system, accumulated cell by cell."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import eps
from ..surface import BSplineSurface
from ._normal_equations import KnotCells, sort_into_blocks
from ._shard import in_shards, total

_BLOCK = 64  # points of one knot cell that are multiplied together
_RIDGE = 1e-13  # of the mean of the diagonal, in double precision


def linear_fit(
    surface: BSplineSurface,
    points: Float[Array, "N 3"],
    parameters: Float[Array, "N 2"],
    weights: Float[Array, "N"],
    bending: Float[Array, "q q"],
    weight: Any,
    mesh: Any = None,
) -> Float[Array, "n m 3"]:
    """Control points that minimise Σ w |S(uᵢ, vᵢ) − pᵢ|² / Σ w + weight · cᵀ K c at fixed parameters.

    surface: whose knots and degrees; its control points do not matter. weights: (N,) ≥ 0; bending: K, as of
    `bending_of`. mesh: over which the rows lie spread, `None` for one device. The points of a knot cell are multiplied in
    blocks to a small Gram matrix, the same for x, y and z; the N × q matrix of basis values never exists.
    """
    return _compiled(surface, points, parameters, weights, bending, jnp.asarray(weight, points.dtype), mesh)


@eqx.filter_jit
def _compiled(
    surface: BSplineSurface, points: Array, parameters: Array, weights: Array, bending: Array, weight: Array, mesh: Any
) -> Float[Array, "n m 3"]:
    n, m = surface.control_points.shape[:2]
    if mesh is None:
        matrix, right, centre = _sums(surface, (points, parameters, weights), None)
    else:
        rows = points, parameters, weights
        matrix, right, centre = in_shards(
            mesh, lambda surface, rows: _sums(surface, rows, mesh), surface, rows, (False, False, False)
        )
    matrix = matrix + weight * bending
    ridge = max(_RIDGE, 16 * eps(matrix.dtype))
    matrix = matrix + jnp.eye(n * m, dtype=matrix.dtype) * (ridge * jnp.trace(matrix) / (n * m))
    net = jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(matrix, lower=True), right)
    return (net + centre[None, :]).reshape(n, m, 3)


def _sums(
    surface: BSplineSurface, rows: tuple[Array, Array, Array], mesh: Any
) -> tuple[Float[Array, "q q"], Float[Array, "q 3"], Float[Array, "3"]]:
    """Mean of the products of basis values, of basis values and points from their centre, and that centre."""
    points, parameters, weights = rows
    count = total(jnp.sum(weights), mesh)
    centre = total(weights @ points, mesh) / count
    cells = KnotCells(surface)
    slots, block_cell = sort_into_blocks(jax.vmap(cells.index)(*parameters.T), cells.count, _BLOCK)
    table = jnp.concatenate([parameters, points - centre[None, :], weights[:, None]], axis=1)
    table = jnp.concatenate([table, jnp.zeros_like(table[:1])])

    def add(sums: Array, chunk: Any) -> tuple[Array, None]:
        slots, cell = chunk
        row = table[slots]  # (group, block, 6)
        values = jax.vmap(jax.vmap(cells.values))(row[..., 0], row[..., 1])
        weighed = values * row[..., 5:]
        both = jnp.concatenate([values, row[..., 2:5]], axis=-1)
        return sums.at[cell].add(jnp.einsum("gki,gkj->gij", weighed, both)), None

    zero = jnp.zeros((cells.count, cells.terms, cells.terms + 3), points.dtype)
    blocks = total(jax.lax.scan(add, zero, (slots, block_cell))[0], mesh) / count
    index = cells.control_points()
    size = surface.control_points.shape[0] * surface.control_points.shape[1]
    right = jnp.zeros((size, 3), points.dtype).at[index].add(blocks[..., cells.terms :])
    matrix = jnp.zeros((size, size), points.dtype)
    return matrix.at[index[:, :, None], index[:, None, :]].add(blocks[..., : cells.terms]), right, centre
