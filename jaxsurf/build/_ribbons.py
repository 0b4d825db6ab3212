"""Points and derivatives across the sides of a surface, as functions of the share along them."""

import abc
from functools import singledispatch
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..basis import BSplineBasis
from ..curve._bspline import combine
from ..surface import AbstractSurface, BSplineSurface
from ._guides import carried, value_and_slope

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


class _Ribbon(AbstractRibbon):
    """Of any surface, by forward mode."""

    surface: AbstractSurface
    end: Float[Array, ""]
    axis: int = eqx.field(static=True)

    def at(self, share: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        along_u, along_v = self.surface.domain

        def point(x: Float[Array, ""]) -> Float[Array, "3"]:
            s, t = (x, share) if self.axis == 0 else (share, x)
            return self.surface.point(carried(s, (0.0, 1.0), along_u), carried(t, (0.0, 1.0), along_v))

        return value_and_slope(point, self.end)


class _SplineRibbons(AbstractRibbons):
    """Of a B-spline surface: curves of twelve coordinates."""

    bases: tuple[BSplineBasis, BSplineBasis]
    rows: tuple[Float[Array, "n 12"], Float[Array, "m 12"]]

    def at(self, axis: int, share: Float[Array, ""]) -> Pair:
        basis = self.bases[axis]
        points, across = combine(basis, self.rows[axis], carried(share, (0.0, 1.0), basis.domain)).reshape(2, 2, 3)
        return points, across


class _SplineRibbon(AbstractRibbon):
    """Of a B-spline surface: a curve of six coordinates."""

    basis: BSplineBasis
    rows: Float[Array, "n 6"]

    def at(self, share: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        point, across = combine(self.basis, self.rows, carried(share, (0.0, 1.0), self.basis.domain)).reshape(2, 3)
        return point, across


@ribbons_of.register
def _(surface: BSplineSurface) -> AbstractRibbons:
    rows = [_spline_rows(surface, axis, (0, 1)).reshape(-1, 12) for axis in (0, 1)]
    return _SplineRibbons((surface.basis_v, surface.basis_u), (rows[0], rows[1]))


@ribbon_of.register
def _(surface: BSplineSurface, axis: int, end: int) -> AbstractRibbon:
    along = (surface.basis_v, surface.basis_u)[axis]
    return _SplineRibbon(along, _spline_rows(surface, axis, (end,)).reshape(-1, 6))


def _spline_rows(surface: BSplineSurface, axis: int, ends: tuple[int, ...]) -> Float[Array, "n 2 e 3"]:
    """Control points, along a side, of the points on sides across an axis and of the derivatives there."""
    net = surface.control_points if axis == 0 else jnp.swapaxes(surface.control_points, 0, 1)
    basis = (surface.basis_u, surface.basis_v)[axis]
    first, last = (jnp.asarray(x, net.dtype) for x in basis.domain)
    values, slopes = jax.vmap(lambda u: value_and_slope(basis.row, u))(jnp.stack([(first, last)[end] for end in ends]))
    weights = jnp.stack([values, slopes * (last - first)])
    return jnp.einsum("aei,ijx->jaex", weights, net, precision="highest")


def hermite_weight(end: int, x: Any) -> Any:
    """The cubic with slope 1 at this end, and with value 0 at both ends and slope 0 at the other one."""
    return x * (1 - x) ** 2 if end == 0 else x * x * (x - 1)
