"""The smallest rotation between two directions by half turns, also where they are opposite."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import eps
from .._safe import divide, norm, unit
from ._guides import value_and_slope

_NEAR = 1e-2  # |f₀ + f| below which the sum has lost digits that the path can give back
_AT = 1e-8  # and below which it has none


def smallest_rotation(first: Float[Array, "3"], half_way: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """The smallest rotation from a unit vector past a unit vector half way: two half turns, about the one and the other."""
    return _half_turn(half_way) @ _half_turn(first)


def _half_turn(axis: Float[Array, "3"]) -> Float[Array, "3 3"]:
    return 2 * axis[:, None] * axis[None, :] - jnp.eye(3, dtype=axis.dtype)


def half_way(
    first: Float[Array, "3"], direction: Callable[[Float[Array, ""]], Float[Array, "3"]], v: Float[Array, ""]
) -> Float[Array, "3"]:
    """unit(f₀ + f(v)), or its negative, also where f is opposite to f₀ and every axis across would serve.

    A path through the opposite direction takes its own axis, as the limit from both sides says: near it the sum is nearly a
    multiple of f' amid the way from there; the rest, if it is no more than rounding, is left out. The slope is that of the
    sum, and where that has no digits the slope of f'.
    """
    now, slope = value_and_slope(direction, v)
    whole = first + now
    since = divide(whole @ slope, slope @ slope)  # from the opposite direction until v
    near = norm(whole) < _NEAR
    amid = unit(value_and_slope(direction, v - jnp.where(near, since, 0) / 2)[1])
    along = (whole @ amid) * amid
    rest = whole - along
    size = norm(rest) / (8 * eps(rest.dtype))
    mended = along + divide(size**4, size**4 + 1) * rest
    at = norm(whole) < _AT
    total = whole + jax.lax.stop_gradient(jnp.where(near, mended - whole, 0))
    return jnp.where(at, amid, unit(jnp.where(at, first, total)))
