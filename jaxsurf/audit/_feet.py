"""Feet on a rim near known places: one Newton search, compiled several times faster than the search over whole shapes."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._array import eps
from .._prepared import prepare
from .._safe import divide
from ..differential import Partials2
from ..surface import AbstractSurface
from ._sides import AbstractPath, RimCurve, partials_on

_TURNS = 40


class Start(NamedTuple):
    """Where a search begins: a share, how far the foot may be from it, and whether the rim goes on over its end."""

    share: Float[Array, "*n"]
    width: Float[Array, "*n"]
    closed: Bool[Array, "*n"]


class _State(NamedTuple):
    turns: Int[Array, ""]
    trial: Float[Array, ""]
    low: Float[Array, ""]
    high: Float[Array, ""]
    close: Bool[Array, ""]
    done: Bool[Array, ""]
    share: Float[Array, ""]
    partials: Partials2


@eqx.filter_jit
def rim_feet(surface: AbstractSurface, path: AbstractPath, points: Float[Array, "n 3"], start: Start) -> Float[Array, "n"]:
    """Shares of the feet of points on a rim, from good ones; no derivatives."""
    surface, path, points, start = jax.lax.stop_gradient((prepare(surface), path, points, start))
    return jax.vmap(lambda p, begin: foot(surface, path, p, begin)[0])(points, start)


@eqx.filter_jit
def differentiable_feet(
    surface: AbstractSurface, path: AbstractPath, points: Float[Array, "n 3"], shares: Float[Array, "n"]
) -> Float[Array, "n"]:
    """The same shares, with implicit derivatives to any order; those at an end beyond which the foot would lie stay."""
    curve = RimCurve(prepare(surface), path)

    def one(p: Float[Array, "3"], found: Float[Array, ""]) -> Float[Array, ""]:
        found = jax.lax.stop_gradient(found)

        def stationary(x: Float[Array, ""]) -> Float[Array, ""]:
            point, slope = jax.jvp(curve.point, (x,), (jnp.ones_like(x),))
            rise = (point - p) @ slope
            held = jax.lax.stop_gradient(((found <= 0) & (rise > 0)) | ((found >= 1) & (rise < 0)))
            return jnp.where(held, x - found, rise)

        solve = lambda linear, y: divide(y, linear(jnp.ones_like(y)))
        return jax.lax.custom_root(stationary, found, lambda _, x: x, solve)

    return jax.vmap(one)(points, shares)


def foot(
    surface: AbstractSurface, path: AbstractPath, p: Float[Array, "3"], start: Start
) -> tuple[Float[Array, ""], Partials2]:
    """The share of the foot of p and the derivatives of the surface there, inside traced code.

    Newton's method on the derivative of ½ |C(t) − p|² within the interval about the start, halved where a step leaves it;
    one more evaluation after the first step below √eps, whose error is about the square of it. An end of the rim is kept
    where the foot lies beyond.
    """
    whole = jnp.stack([start.share - start.width, start.share + start.width])
    first, last = jnp.where(start.closed, whole, jnp.clip(whole, 0, 1))
    small = eps(p.dtype) ** 0.5

    def turn(state: _State) -> _State:
        t = state.trial
        share = jnp.where(start.closed, t - jnp.floor(t), t)
        place = path.at(share)
        second = partials_on(surface, place)
        (x, y), turning = place.along, place.turn
        slope = x * second.u + y * second.v
        bend = x * x * second.uu + 2 * x * y * second.uv + y * y * second.vv + turning[0] * second.u + turning[1] * second.v
        offset = second.point - p
        rise, convex = offset @ slope, slope @ slope + offset @ bend
        low, high = jnp.where(rise < 0, t, state.low), jnp.where(rise > 0, t, state.high)
        newton = t - divide(rise, convex)
        middle = (low + high) / 2
        aim = jnp.where((convex > 0) & (newton > low) & (newton < high), newton, middle)
        # beyond an end of the interval at which nothing was found yet: look there
        aim = jnp.where((convex > 0) & (newton >= high) & (high == last), last, aim)
        aim = jnp.where((convex > 0) & (newton <= low) & (low == first), first, aim)
        settled = (convex > 0) & (jnp.abs(newton - t) <= small)  # there rounding may put it outside of (low, high)
        aim = jnp.where((rise == 0) | settled, jnp.clip(newton, first, last), aim)
        close = jnp.abs(aim - t) <= small
        done = state.close | (aim == t) | (state.turns + 1 >= _TURNS)
        return _State(state.turns + 1, aim, low, high, close, done, share, second)

    shape = jax.eval_shape(lambda t: partials_on(surface, path.at(t)), start.share)
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
    no = jnp.zeros((), bool)
    begin = jnp.clip(start.share, first, last)
    state = _State(jnp.zeros((), jnp.int32), begin, first, last, no, no, begin, nothing)
    found = jax.lax.while_loop(lambda state: ~state.done, turn, state)
    return found.share, found.partials
