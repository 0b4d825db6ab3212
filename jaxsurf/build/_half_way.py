"""The smallest rotation between two directions by half turns, also where they are opposite."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import eps
from .._safe import divide, norm, unit
from ._guides import value_and_slope

_NEAR = 3e-2  # |f₀ + f| below which the sum has lost digits that the path can give back
_AT = 0.4  # the power of rounding below which its derivatives by data, of size 1 / |f₀ + f|, are left out
_STEPS = 4  # of Newton's method, from `_NEAR` to round-off
_NODES = 3  # of Gauss-Legendre; their error is a share of 2e-6 _NEAR⁶ / 4 of the mean of f'

Direction = Callable[[Float[Array, ""]], Float[Array, "3"]]


def smallest_rotation(first: Float[Array, "3"], half_way: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """The smallest rotation from a unit vector past a unit vector half way: two half turns, about the one and the other."""
    return _half_turn(half_way) @ _half_turn(first)


def _half_turn(axis: Float[Array, "3"]) -> Float[Array, "3 3"]:
    return 2 * axis[:, None] * axis[None, :] - jnp.eye(3, dtype=axis.dtype)


def half_way(first: Float[Array, "3"], direction: Direction, still: Direction, v: Float[Array, ""]) -> Float[Array, "3"]:
    """unit(f₀ + f(v)), or its negative, also where f is opposite to f₀ and every axis across would serve.

    A path through the opposite direction takes its own axis: half way lies its tangent, as the limit from both sides says.
    Near it, with w where the path passes nearest, f₀ + f(v) = r + (v − w) g with r = f₀ + f(w) and the mean g of f' from w
    to v, for any w: nothing cancels in that. r is left out if it is no more than rounding; its derivatives by data are kept
    as long as they have digits. A mean over a break between w and v, seen by its error, is not taken. still: `direction`
    of data that are not derived by.
    """
    stop = jax.lax.stop_gradient
    whole = first + direction(v)
    distance = norm(stop(whole))
    near, at = distance < _NEAR, distance < eps(v.dtype) ** _AT
    place = jnp.where(near, stop(_nearest(stop(first), still, stop(v))), stop(v))
    since = v - place
    nodes, weights = (jnp.asarray(x, v.dtype) for x in np.polynomial.legendre.leggauss(_NODES))
    shares = jnp.append((nodes + 1) / 2, jnp.zeros(1, v.dtype))  # at w itself too: one map, compiled once
    values, slopes = jax.vmap(lambda share: value_and_slope(direction, place + share * since))(shares)
    mean, rest = weights @ slopes[:-1] / 2, first + values[-1]
    agrees = norm(stop(rest + since * mean - whole)) < 64 * eps(v.dtype)
    known = jnp.where(norm(stop(rest)) < 16 * eps(v.dtype), 0, stop(rest))
    rest = known + jnp.where(at, 0, rest - stop(rest))
    passes = norm(known) <= norm(stop(since * mean))
    path = jnp.where(passes, mean + divide(rest, since), since * mean + rest)
    return unit(jnp.where(near & agrees, path, jnp.where(at, mean, whole)))


def _nearest(first: Float[Array, "3"], still: Direction, v: Float[Array, ""]) -> Float[Array, ""]:
    """Where, about v, the direction is nearest to the opposite of the first one: ⟨f₀ + f, f'⟩ = 0."""

    def step(place: Float[Array, ""], _: None) -> tuple[Float[Array, ""], None]:
        now, slope = value_and_slope(still, place)
        return place - divide((first + now) @ slope, slope @ slope), None

    return jax.lax.scan(step, v, None, length=_STEPS)[0]
