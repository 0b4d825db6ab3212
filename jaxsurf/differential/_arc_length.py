"""Parameters at given arc lengths."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, eps, is_concrete, map_points
from .._errors import InputError
from .._safe import divide
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._measure import speed_at
from ._quadrature import TRACED_SPLITS, box_integrals, gauss, settled_edges, split_spans

_ITERATIONS = 60


class LengthTable(eqx.Module):
    """Ascending parameters (n,) of a curve and the arc lengths (n,) from the first of them."""

    places: Float[Array, "n"]
    lengths: Float[Array, "n"]


def parameter_at_length(curve: AbstractCurve, length: Numbers) -> Float[Array, "*batch"]:
    """Parameters u with ∫ |C'| from the start of the domain to u equal to `length`, of any shape.

    Newton's method, bisecting where it leaves the bracket, on the span found in a table of lengths.
    Derivatives in the curve and in `length` are those of the implicit function, to any order. Lengths below 0
    or beyond the whole (by more than round-off) are refused on concrete data and give the ends of the domain
    under tracing.
    """
    length = as_float(length, curve.dtype)
    table = length_table(curve)
    if is_concrete(length, table):
        values, whole = concrete(length), float(table.lengths[-1])
        slack = 1e3 * eps(length.dtype) * whole
        wrong = ~((values >= -slack) & (values <= whole + slack))
        if wrong.any():
            raise InputError(f"`length` must lie between 0 and the curve's length {whole:g}, got {values[wrong].flat[0]:g}.")
    return map_points(_parameter_at, (curve, table), length)


def equally_spaced(curve: AbstractCurve, n: int) -> Float[Array, "n"]:
    """Parameters of `n` ≥ 2 points at equal distances along the curve, its ends included."""
    if n < 2:
        raise InputError(f"`n` must be at least 2, got {n}.")
    start, end = (jnp.asarray(bound, curve.dtype) for bound in curve.domain)
    table = length_table(curve)
    lengths = table.lengths[-1] * jnp.linspace(0, 1, n, dtype=curve.dtype)[1:-1]
    return jnp.concatenate([start[None], map_points(_parameter_at, (curve, table), lengths), end[None]])


def length_table(curve: AbstractCurve) -> LengthTable:
    """Places dense enough for Gauss-Legendre between them, and the lengths up to them."""
    places = breaks(curve)
    if is_concrete(curve, places):
        places = jnp.asarray(settled_edges(speed_at, curve, places))
    else:
        places = split_spans(places, TRACED_SPLITS[1])
    parts = box_integrals(speed_at, curve, places[:-1, None], places[1:, None])
    return LengthTable(places, jnp.concatenate([jnp.zeros(1, parts.dtype), jnp.cumsum(parts)]))


def _parameter_at(data: tuple[AbstractCurve, LengthTable], length: Float[Array, ""]) -> Float[Array, ""]:
    return parameter_within(*data, length)


def parameter_within(curve: AbstractCurve, table: LengthTable, length: Float[Array, ""]) -> Float[Array, ""]:
    """The parameter at one length, inside traced code."""
    passed = jax.lax.stop_gradient(length) >= jax.lax.stop_gradient(table.lengths[1:-1])
    index = jnp.sum(passed, dtype=jnp.int32)
    # repeated places at the end are spans of no length; the last real one is where the search belongs
    last = jnp.sum(table.places < table.places[-1], dtype=jnp.int32) - 1
    index = jnp.minimum(index, last)
    low, high, before = table.places[index], table.places[index + 1], table.lengths[index]
    nodes, weights = gauss(length.dtype)

    def excess(u: Float[Array, ""]) -> Float[Array, ""]:
        speeds = jax.vmap(lambda x: speed_at(curve, low + (u - low) * x))(nodes[:, 0])
        return before + (u - low) * (weights @ speeds) - length

    def solve(f: Callable[[Array], Array], guess: Float[Array, ""]) -> Float[Array, ""]:
        return _newton(f, lambda u: speed_at(curve, u), low, high, guess)

    over = table.lengths[index + 1] - before
    guess = low + (high - low) * jnp.clip(divide(length - before, over), 0, 1)
    return jax.lax.custom_root(excess, guess, solve, lambda g, y: divide(y, g(jnp.ones_like(y))))


def _newton(
    f: Callable[[Array], Array],
    slope: Callable[[Array], Array],
    low: Float[Array, ""],
    high: Float[Array, ""],
    guess: Float[Array, ""],
) -> Float[Array, ""]:
    """Root of an ascending function in [low, high]: Newton's steps, bisection where they lead out of it."""
    small = 2 * eps(guess.dtype) * jnp.maximum(jnp.abs(low), jnp.abs(high))

    def unfinished(state: tuple[Array, ...]) -> Array:
        _, _, _, step, count = state
        return (jnp.abs(step) > small) & (count < _ITERATIONS)

    def improve(state: tuple[Array, ...]) -> tuple[Array, ...]:
        low, high, u, _, count = state
        value = f(u)
        low, high = jnp.where(value <= 0, u, low), jnp.where(value >= 0, u, high)
        speed = slope(u)
        aim = u - divide(value, speed)
        good = (speed > 0) & (aim >= low) & (aim <= high)
        after = jnp.where(good, aim, (low + high) / 2)
        return low, high, after, after - u, count + 1

    count = jnp.zeros((), jnp.int32)
    return jax.lax.while_loop(unfinished, improve, (low, high, guess, high - low, count))[2]
