"""Concrete values of shapes for numpy code that asks for many different numbers of points."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import map_points
from .._derivative import PartialDerivative
from .._prepared import point_of
from ..curve import AbstractCurve
from ..surface import AbstractSurface, BSplineSurface

BLOCK = 256
"""Rows of a grid evaluated together."""
_TILE = 64  # of a grid, its square of a curve: one size, so that a shape is compiled once


class _Jet(eqx.Module):
    """Value and derivatives up to `order` by parameter `axis` of `count`."""

    function: Any = eqx.field(static=True)
    axis: int = eqx.field(static=True)
    count: int = eqx.field(static=True)
    order: int = eqx.field(static=True)

    def __call__(self, shape: Any, *parameters: Array) -> list[Array]:
        orders = [tuple(k * (i == self.axis) for i in range(self.count)) for k in range(self.order + 1)]
        return [PartialDerivative(self.function, order)(shape, *parameters) for order in orders]


def curve_values(curve: AbstractCurve, u: Float[np.ndarray, "m"]) -> Float[np.ndarray, "m d"]:
    """Points of a curve in double precision."""
    blocks = []
    with jax.ensure_compile_time_eval():
        for start in range(0, len(u), _TILE**2):
            block, count = _filled(u[start : start + _TILE**2], _TILE**2)
            blocks.append(np.asarray(curve(block), np.float64)[:count])
    return np.concatenate(blocks)


def grid_values(
    surface: AbstractSurface, u: Float[np.ndarray, "m"], v: Float[np.ndarray, "k"]
) -> Float[np.ndarray, "m k 3"]:
    """Points of a surface on a grid in double precision, tile by tile."""
    values = np.empty((len(u), len(v), 3))
    with jax.ensure_compile_time_eval():
        for i in range(0, len(u), _TILE):
            rows, height = _filled(u[i : i + _TILE], _TILE)
            for j in range(0, len(v), _TILE):
                columns, width = _filled(v[j : j + _TILE], _TILE)
                values[i : i + height, j : j + width] = surface.grid(rows, columns)[:height, :width]
    return values


def spline_values(
    spline: BSplineSurface, u: Float[np.ndarray, "m"], v: Float[np.ndarray, "k"]
) -> Float[np.ndarray, "m k 3"]:
    """Points of a B-spline surface on a grid of up to `BLOCK` rows, in double precision."""
    rows, height = _filled(u, BLOCK)
    columns, width = _padded(v)
    with jax.ensure_compile_time_eval():
        return np.asarray(spline.grid(rows, columns), np.float64)[:height, :width]


def curve_jets(curve: AbstractCurve, u: Float[np.ndarray, "m"], order: int) -> list[np.ndarray]:
    """Points and derivatives of a curve up to `order`, each (m, d)."""
    padded, count = _padded(u)
    jet = _Jet(point_of, 0, 1, order)
    with jax.ensure_compile_time_eval():
        values = map_points(jet, curve, jnp.asarray(padded, curve.dtype))
    return [np.asarray(value, np.float64)[:count] for value in values]


def surface_jets(
    surface: AbstractSurface,
    along: Float[np.ndarray, "m"],
    across: Float[np.ndarray, "k"],
    axis: int,
    order: int,
) -> list[np.ndarray]:
    """Points and derivatives by parameter `axis` up to `order` at (along, across), each (m, k, 3)."""
    (rows, count), (columns, width) = _padded(along), _padded(across)
    jet = _Jet(point_of, axis, 2, order)
    grid = (jnp.asarray(rows, surface.dtype)[:, None], jnp.asarray(columns, surface.dtype)[None, :])
    with jax.ensure_compile_time_eval():
        values = map_points(jet, surface, *(grid if axis == 0 else grid[::-1]))
    return [np.asarray(value, np.float64)[:count, :width] for value in values]


def _padded(parameters: np.ndarray) -> tuple[np.ndarray, int]:
    # Every new number of points is a new compilation; powers of two leave a dozen of them.
    return _filled(parameters, max(32, 1 << max(len(parameters) - 1, 0).bit_length()))


def _filled(parameters: np.ndarray, wanted: int) -> tuple[np.ndarray, int]:
    return np.pad(parameters, (0, wanted - len(parameters)), mode="edge"), len(parameters)
