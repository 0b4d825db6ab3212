"""Any shape under an affine change of its parameters: restricted, reversed, on another domain, transposed."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._registry import register
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ..surface import AbstractSurface


@register
class ReparametrisedCurve(AbstractCurve):
    """C(u) = curve(t), where t runs evenly from ends[0] to ends[1] while u runs over `interval`, the domain.

    ends, interval: (2,). Descending `ends` reverse the curve, narrow ones restrict it.
    """

    curve: AbstractCurve
    ends: Float[Array, "2"]
    interval: Float[Array, "2"]

    def __init__(self, curve: AbstractCurve, ends: Numbers, interval: Numbers):
        self.curve = curve
        self.ends = as_pair(ends, "ends", curve.dtype)
        self.interval = as_pair(interval, "interval", curve.dtype)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.interval[0], self.interval[1]

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return self.curve.point(affine(u, self.interval, self.ends))


@register
class ReparametrisedSurface(AbstractSurface):
    """S(u, v) = surface(s, t), or surface(t, s) if `transposed`.

    s runs evenly over ends_u while u runs over interval_u, and t over ends_v while v runs over interval_v.
    ends_u, ends_v, interval_u, interval_v: (2,); the intervals are the domain. Descending ends reverse a
    direction and so, like transposing, the side of the normal.
    """

    surface: AbstractSurface
    ends_u: Float[Array, "2"]
    ends_v: Float[Array, "2"]
    interval_u: Float[Array, "2"]
    interval_v: Float[Array, "2"]
    transposed: bool = eqx.field(static=True)

    def __init__(
        self,
        surface: AbstractSurface,
        ends_u: Numbers,
        ends_v: Numbers,
        interval_u: Numbers,
        interval_v: Numbers,
        *,
        transposed: bool = False,
    ):
        self.surface = surface
        self.ends_u = as_pair(ends_u, "ends_u", surface.dtype)
        self.ends_v = as_pair(ends_v, "ends_v", surface.dtype)
        self.interval_u = as_pair(interval_u, "interval_u", surface.dtype)
        self.interval_v = as_pair(interval_v, "interval_v", surface.dtype)
        self.transposed = bool(transposed)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return (self.interval_u[0], self.interval_u[1]), (self.interval_v[0], self.interval_v[1])

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        s, t = affine(u, self.interval_u, self.ends_u), affine(v, self.interval_v, self.ends_v)
        return self.surface.point(t, s) if self.transposed else self.surface.point(s, t)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        s, t = affine(u, self.interval_u, self.ends_u), affine(v, self.interval_v, self.ends_v)
        if self.transposed:
            return jnp.swapaxes(self.surface.grid_points(t, s), 0, 1)
        return self.surface.grid_points(s, t)


@breaks.register(ReparametrisedCurve)
def _(shape: ReparametrisedCurve) -> Any:
    return _moved_breaks(breaks(shape.curve), shape.ends, shape.interval)


@breaks.register(ReparametrisedSurface)
def _(shape: ReparametrisedSurface) -> tuple[Any, Any]:
    along_u, along_v = breaks(shape.surface)
    if shape.transposed:
        along_u, along_v = along_v, along_u
    return (
        _moved_breaks(along_u, shape.ends_u, shape.interval_u),
        _moved_breaks(along_v, shape.ends_v, shape.interval_v),
    )


def _moved_breaks(places: Any, ends: Float[Array, "2"], interval: Float[Array, "2"]) -> Any:
    """Breaks in other parameters; those outside the interval fall on its ends."""
    moved = affine(jnp.asarray(places), ends, interval)
    moved = jnp.sort(jnp.clip(moved, interval[0], interval[1])).at[0].set(interval[0]).at[-1].set(interval[1])
    return np.unique(concrete(moved)) if is_concrete(moved) else moved


def affine(u: Float[Array, "*n"], interval: Float[Array, "2"], ends: Float[Array, "2"]) -> Float[Array, "*n"]:
    """The even map of `interval` to `ends`, exact at both ends."""
    share = (u - interval[0]) / (interval[1] - interval[0])
    return (1 - share) * ends[0] + share * ends[1]


def as_pair(values: Any, name: str, dtype: Any) -> Float[Array, "2"]:
    """Convert two numbers, given as an array or as a pair that may be traced."""
    if isinstance(values, tuple | list):
        values = jnp.stack([as_float(value, dtype) for value in values])
    pair = as_float(values, dtype)
    if pair.shape != (2,):
        raise InputError(f"`{name}` must be two numbers, got shape {pair.shape}.")
    return pair
