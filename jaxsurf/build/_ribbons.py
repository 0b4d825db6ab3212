"""Points and derivatives across the sides of a surface, as functions of the share along them."""

import abc
from functools import singledispatch
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..basis import SplinePieces, spline_pieces
from ..surface import AbstractSurface, BSplineSurface
from ._guides import carried, value_and_slope, with_two_slopes

SIDES = ("u0", "u1", "v0", "v1")
"""Sides u = first, u = last, v = first, v = last."""

CORNERS = tuple((i, j) for i in (0, 1) for j in (0, 1))

Ends = Float[Array, "2 3"]
Pair = tuple[Ends, Ends]


class AbstractRibbons(eqx.Module):
    """S over shares (s, t) in [0, 1]² near its four sides."""

    @abc.abstractmethod
    def at(self, axis: int, share: Float[Array, ""]) -> Pair:
        """Points and derivatives across on both sides across an axis: s = 0, 1 for axis 0, t = 0, 1 for axis 1."""

    @abc.abstractmethod
    def bends(self, axis: int, share: Float[Array, ""]) -> Ends:
        """Second derivatives across on both sides."""

    def sides(self, axis: int, share: Float[Array, ""]) -> tuple[Ends, Ends, Ends]:
        """Points, derivatives across and along."""
        (points, across), (along, _) = value_and_slope(lambda t: self.at(axis, t), share)
        return points, across, along

    def corners(self, dtype: Any) -> tuple[Float[Array, "2 2 2 3"], Float[Array, "2 2 2 2 3"]]:
        """First derivatives, and second ones, at the corners (i, j)."""
        ends = jnp.arange(2, dtype=dtype)
        once = lambda axis, t: value_and_slope(lambda x: self.at(axis, x), t)
        twice = lambda axis: jax.vmap(lambda end: value_and_slope(lambda t: once(axis, t), end))(ends)
        ((_, by_s), (by_t, by_st)), ((_, _), (by_tt, _)) = twice(0)
        _, ((_, _), (by_ss, _)) = twice(1)
        swap = lambda x: jnp.swapaxes(x, 0, 1)  # of (j, i), the other one is (i, j) already
        first = jnp.stack([swap(by_s), swap(by_t)], axis=2)
        mixed = swap(by_st)
        second = jnp.stack([jnp.stack([by_ss, mixed], axis=2), jnp.stack([mixed, swap(by_tt)], axis=2)], axis=2)
        return first, second


class AbstractRibbon(eqx.Module):
    """S over shares near one side."""

    @abc.abstractmethod
    def at(self, share: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """The point and the derivative across."""

    @abc.abstractmethod
    def bend(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        """The second derivative across."""


@singledispatch
def ribbons_of(surface: Any) -> AbstractRibbons:
    """The ribbons of a prepared surface."""
    return _Ribbons(surface)


@singledispatch
def ribbon_of(surface: Any, axis: int, end: int) -> AbstractRibbon:
    """The ribbon of one side of a prepared surface; those of sides alike have the same structure."""
    return _Ribbon(surface, jnp.asarray(float(end), surface.dtype), axis)


class _Ribbons(AbstractRibbons):
    """Of any surface, by forward mode."""

    surface: AbstractSurface

    def at(self, axis: int, share: Float[Array, ""]) -> Pair:
        return jax.vmap(lambda end: _Ribbon(self.surface, end, axis).at(share))(jnp.arange(2, dtype=share.dtype))

    def bends(self, axis: int, share: Float[Array, ""]) -> Ends:
        return jax.vmap(lambda end: _Ribbon(self.surface, end, axis).bend(share))(jnp.arange(2, dtype=share.dtype))


class _Ribbon(AbstractRibbon):
    """Of any surface, by forward mode."""

    surface: AbstractSurface
    end: Float[Array, ""]
    axis: int = eqx.field(static=True)

    def at(self, share: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        return value_and_slope(lambda x: self._point(x, share), self.end)

    def bend(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        return with_two_slopes(lambda x: self._point(x, share), self.end)[2]

    def _point(self, x: Float[Array, ""], share: Float[Array, ""]) -> Float[Array, "3"]:
        along_u, along_v = self.surface.domain
        s, t = (x, share) if self.axis == 0 else (share, x)
        return self.surface.point(carried(s, (0.0, 1.0), along_u), carried(t, (0.0, 1.0), along_v))


class _SplineRibbons(AbstractRibbons):
    """Of a B-spline surface: curves of points, derivatives across and second ones, on both sides."""

    rows: tuple["_SplineRows", "_SplineRows"]

    def at(self, axis: int, share: Float[Array, ""]) -> Pair:
        points, across = self.rows[axis].first.point(self.rows[axis].place(share)).reshape(2, 2, 3)
        return points, across

    def bends(self, axis: int, share: Float[Array, ""]) -> Ends:
        return self.rows[axis].second.point(self.rows[axis].place(share)).reshape(2, 3)


class _SplineRibbon(AbstractRibbon):
    """Of a B-spline surface: the same of one side."""

    rows: "_SplineRows"

    def at(self, share: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        point, across = self.rows.first.point(self.rows.place(share)).reshape(2, 3)
        return point, across

    def bend(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        return self.rows.second.point(self.rows.place(share))


class _SplineRows(eqx.Module):
    """Along sides: points with derivatives across, and second derivatives."""

    first: SplinePieces
    second: SplinePieces

    def place(self, share: Float[Array, ""]) -> Float[Array, ""]:
        """The parameter at a share."""
        return carried(share, (0.0, 1.0), self.first.basis.domain)


@ribbons_of.register
def _(surface: BSplineSurface) -> AbstractRibbons:
    return _SplineRibbons((_spline_rows(surface, 0, (0, 1)), _spline_rows(surface, 1, (0, 1))))


@ribbon_of.register
def _(surface: BSplineSurface, axis: int, end: int) -> AbstractRibbon:
    return _SplineRibbon(_spline_rows(surface, axis, (end,)))


def _spline_rows(surface: BSplineSurface, axis: int, ends: tuple[int, ...]) -> _SplineRows:
    net = surface.control_points if axis == 0 else jnp.swapaxes(surface.control_points, 0, 1)
    basis, along = (surface.basis_u, surface.basis_v)[:: 1 - 2 * axis]
    domain = [jnp.asarray(x, net.dtype) for x in basis.domain]
    first, values = jax.vmap(lambda u: basis.derivatives(u, 2))(jnp.stack([domain[end] for end in ends]))
    # of control points along the side, by end: points, derivatives across by the share, and second ones
    window = jax.vmap(lambda k: basis.unroll(net)[k + np.arange(basis.degree + 1, dtype=np.int32)])(first)
    scales = jnp.stack([jnp.ones_like(domain[0]), domain[1] - domain[0], (domain[1] - domain[0]) ** 2])
    rows = jnp.einsum("k,ekp,epjx->jkex", scales, values, window, precision="highest").reshape(net.shape[1], -1)
    pieces, split = spline_pieces(along, rows), 6 * len(ends)
    part = lambda columns: SplinePieces(along, pieces.places, [c[:, columns] for c in pieces.coefficients])
    return _SplineRows(part(np.s_[:split]), part(np.s_[split:]))


def hermite_weight(end: int, x: Any) -> Any:
    """The cubic with slope 1 at this end, and with value 0 at both ends and slope 0 at the other one."""
    return x * (1 - x) ** 2 if end == 0 else x * x * (x - 1)
