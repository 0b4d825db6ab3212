"""Directions blended by turns on great circles: the cumulative B-spline on the sphere."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import take
from .._safe import unit
from ..basis import BSplineBasis, cumulative_local, cumulative_row, span_polynomials
from ._rotation import half_rotation, turn


def turned(
    direction: Float[Array, "*#batch 3"],
    halves: Sequence[Float[Array, "*#batch 3"]],
    shares: Sequence[Float[Array, "*#batch"]],
) -> Float[Array, "*batch 3"]:
    """`direction` turned by the shares of half rotation vectors, the first one first."""
    for half, share in zip(halves, shares, strict=True):
        direction = turn(share[..., None] * half, direction)
    return direction


def blended_direction(
    basis: BSplineBasis, directions: Float[Array, "n *rest 3"], t: Float[Array, ""]
) -> Float[Array, "*rest 3"]:
    """The unit direction q(t) v q(t)⁻¹ at one parameter, q(t) = exp(ω_n B̃_n(t)) … exp(ω_1 B̃_1(t)) q_0.

    directions: of any length > 0, q_0 takes v to the first and exp(ω_i) the one before to number i; several chains may lie
    side by side (`rest`). Turns that are complete carry the first direction to a given one exactly, so only `degree` turns
    are made. Source: paper 004, (3).
    """
    units = unit(directions)
    halves = half_rotation(units[:-1], units[1:])
    first, shares = cumulative_local(basis, t)
    ones = (1,) * (directions.ndim - 2)
    steps = [take(halves, first - 1 + i) for i in range(basis.degree)]
    return turned(take(units, first - 1), steps, [share.reshape(ones) for share in shares])


def angular_velocity(
    basis: BSplineBasis, directions: Float[Array, "n 3"], t: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """The blended direction T, its angular velocity W and dW/dt, so that T' = W × T.

    Turn by turn: with R the turn by B̃ about φ = 2ω, W becomes R W + B̃' φ, and W' becomes R W' + B̃'' φ + B̃' φ × R W.
    """
    units = unit(directions)
    halves = half_rotation(units[:-1], units[1:])
    once = lambda x: jnp.stack(cumulative_local(basis, x)[1])
    twice = lambda x: jax.jvp(once, (x,), (jnp.ones_like(x),))
    (shares, slopes), (_, bends) = jax.jvp(twice, (t,), (jnp.ones_like(t),))
    first, _ = cumulative_local(basis, t)
    direction = take(units, first - 1)
    velocity, change = jnp.zeros_like(direction), jnp.zeros_like(direction)
    for i in range(basis.degree):
        half = take(halves, first - 1 + i)
        step = shares[i] * half
        direction, carried = turn(step, direction), turn(step, velocity)
        added = 2 * slopes[i] * half
        change = turn(step, change) + 2 * bends[i] * half + jnp.cross(added, carried)
        velocity = carried + added
    return direction, velocity, change


def blended_on_spans(
    basis: BSplineBasis, directions: Float[Array, "n *rest 3"], places: Float[np.ndarray, "q"]
) -> Float[Array, "spans q *rest 3"]:
    """`blended_direction` at the same places in every span; places: from −1 to 1, the ends of a span.

    On a span of no length they are that at its knot: the length that it may get counts in derivatives by knots.
    """
    p, ones = basis.degree, (1,) * (directions.ndim - 2)
    shares = _shares_on_spans(basis, places)
    spans = shares.shape[1]
    units = unit(directions)
    halves = half_rotation(units[:-1], units[1:])
    steps = jnp.stack([halves[i : i + spans] for i in range(p)])[:, :, None]
    one_turn = lambda direction, step: (turn(step[1][..., None] * step[0], direction), None)
    # a loop, not unrolled: few, large turns, of which the compiler needs to see one
    start = jnp.broadcast_to(units[:spans, None], (spans, len(places), *units.shape[1:]))
    return jax.lax.scan(one_turn, start, (steps, shares.reshape(*shares.shape, *ones)))[0]


def _shares_on_spans(basis: BSplineBasis, places: Float[np.ndarray, "q"]) -> Float[Array, "p spans q"]:
    """The cumulative functions that are neither 0 nor 1 on a span, at the same places in every span."""
    p, knots = basis.degree, basis.knots
    _, coefficients = span_polynomials(knots, p)
    powers = jnp.asarray(np.vander(places, p + 1, increasing=True), knots.dtype)
    values = jnp.einsum("ksi,qk->siq", jnp.stack(coefficients), powers, precision="highest")
    shares = jnp.cumsum(values[:, :0:-1], axis=1)[:, ::-1]
    spans = shares.shape[0]
    starts, ends = knots[p : p + spans], knots[p + 1 : p + 1 + spans]
    rows = jax.vmap(lambda t: cumulative_row(basis, t))(starts)
    index = np.arange(spans)[:, None]
    at_knots = rows[index, index + np.arange(1, p + 1)]
    return jnp.moveaxis(jnp.where((starts == ends)[:, None, None], at_knots[:, :, None], shares), 1, 0)
