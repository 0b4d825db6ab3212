"""Many safeguarded Newton searches towards feet, a fixed number of them at a time."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .._array import eps
from .._prepared import prepare
from ._newton import Box, across_pole, local_frame, parameter_box, step

_LANES = 1024  # searches that run side by side
_TURNS = 60
_POLE_TURNS = 12  # in which a search may cross a pole; at the tip of a cone both ways lead up


class Scale(NamedTuple):
    """Lengths that tolerances are measured by: the largest side of a shape's bounding box, and the largest
    coordinate in it."""

    size: Float[Array, ""]
    coordinate: Float[Array, ""]


class _Lane(NamedTuple):
    """A search: the best parameters so far with the derivatives of ½ d² there, and the ones to look at next."""

    turns: Int[Array, ""]
    best: Float[Array, "k"]
    value: Float[Array, ""]
    gradient: Float[Array, "k"]
    metric: Float[Array, "k k"]
    bend: Float[Array, "k k"]
    trial: Float[Array, "k"]
    length: Float[Array, ""]
    predicted: Float[Array, ""]
    radius: Float[Array, ""]


def descend(
    shape: Any,
    points: Float[Array, "N d"],
    starts: Float[Array, "s k"],
    chosen: Int[Array, "N c"],
    wanted: Bool[Array, "N c"],
    scale: Scale,
    turns: int = _TURNS,
) -> Float[Array, "N k"]:
    """Parameters of the lowest minimum of ½|S(t) − p|² on the domain's box that a search finds for each point.

    A search begins at each of `starts[chosen]` that is `wanted` and goes down: Newton's step where it is
    defined and short enough to be trusted, else one along the eigenvalues of the Hessian, shifted. It ends
    when Newton's step is shorter than √eps / 10 of the size (the next error is about the square of it), or the
    gradient is rounding noise. Searches take 4 to 6 turns on average and up to 60: a lane that is done takes
    up the next search, since in fixed batches the slowest made all wait (5 to 9 times the average). No derivatives.
    """
    shape = prepare(shape)
    searches = chosen.size
    owners = chosen.shape[1]
    lanes = min(searches, _LANES)
    box = parameter_box(shape)
    if owners == 1 and searches <= _LANES:
        return _descend_abreast(shape, points, starts[chosen[:, 0]], box, scale, turns)
    order = jnp.nonzero(wanted.reshape(-1), size=searches, fill_value=searches)[0].astype(jnp.int32)
    count = jnp.sum(wanted, dtype=jnp.int32)
    look = jax.vmap(lambda lane, p: _turn(shape, lane, p, box, scale, turns))
    begin = jax.vmap(lambda t: _begin(t, scale))

    def take_up(search: Int[Array, "w"]) -> _Lane:
        return begin(starts[chosen.reshape(-1)[jnp.minimum(search, searches - 1)]])

    def going(state: Any) -> Bool[Array, ""]:
        return jnp.any(state[1] < searches)

    def turn(state: Any) -> Any:
        lane, search, following, found, least = state
        owner = jnp.minimum(search, searches - 1) // owners
        lane, done = look(lane, points[owner])
        done &= search < searches
        least = least.at[owner].min(jnp.where(done, lane.value, jnp.inf))
        # of equals that end in the same turn any may win
        winner = jnp.where(done & (lane.value <= least[owner]), owner, points.shape[0])
        found = found.at[winner].set(lane.best, mode="drop")
        place = following + jnp.cumsum(done, dtype=jnp.int32) - 1
        fetched = jnp.where(place < count, order[jnp.minimum(place, searches - 1)], searches)
        search = jnp.where(done, fetched, search)
        lane = jax.tree.map(lambda new, old: _where(done, new, old), take_up(search), lane)
        return lane, search, following + jnp.sum(done, dtype=jnp.int32), found, least

    search = jnp.where(jnp.arange(lanes, dtype=jnp.int32) < count, order[:lanes], searches)
    least = jnp.full(points.shape[0], jnp.inf, starts.dtype)
    state = (take_up(search), search, jnp.minimum(count, lanes), starts[chosen[:, 0]], least)
    found = jax.lax.while_loop(going, turn, state)[3]
    return jax.vmap(lambda t: _wrapped(t, box))(found)


def _descend_abreast(
    shape: Any, points: Float[Array, "N d"], starts: Float[Array, "N k"], box: Box, scale: Scale, turns: int
) -> Float[Array, "N k"]:
    """One search for each point, all side by side; with so few the queue would cost more than it saves."""

    def turn(state: tuple[_Lane, Bool[Array, "N"]]) -> tuple[_Lane, Bool[Array, "N"]]:
        lane, done = state
        moved, ended = jax.vmap(lambda lane, p: _turn(shape, lane, p, box, scale, turns))(lane, points)
        return jax.tree.map(lambda new, old: _where(done, old, new), moved, lane), done | ended

    begun = jax.vmap(lambda t: _begin(t, scale))(starts), jnp.zeros(starts.shape[0], bool)
    lane, _ = jax.lax.while_loop(lambda state: ~jnp.all(state[1]), turn, begun)
    return jax.vmap(lambda t: _wrapped(t, box))(lane.best)


def _wrapped(t: Float[Array, "k"], box: Box) -> Float[Array, "k"]:
    inside = box.lower + jnp.mod(t - box.lower, box.upper - box.lower)
    return jnp.where(box.free & ((t < box.lower) | (t > box.upper)), inside, t)


def _where(condition: Bool[Array, "w"], a: Array, b: Array) -> Array:
    return jnp.where(condition.reshape(-1, *[1] * (a.ndim - 1)), a, b)


def _begin(t: Float[Array, "k"], scale: Scale) -> _Lane:
    k, dtype = t.shape[0], t.dtype
    none, unknown = jnp.zeros((), dtype), jnp.zeros((k, k), dtype)
    turns = jnp.zeros((), jnp.int32)
    return _Lane(turns, t, none + jnp.inf, unknown[0], unknown, unknown, t, none, none, scale.size / 10)


def _turn(
    shape: Any, lane: _Lane, p: Float[Array, "d"], box: Box, scale: Scale, turns: int
) -> tuple[_Lane, Bool[Array, ""]]:
    """Look at the trial parameters, keep them or not, and step on from the better ones; and whether that is all."""
    precision = eps(p.dtype)
    short, rounding = 0.1 * precision**0.5 * scale.size, 4 * precision * scale.coordinate
    point, tangents, curving = local_frame(shape, lane.trial)
    offset = point - p
    value = 0.5 * offset @ offset
    distance = jnp.sqrt(2 * value)
    # Near the end the gain drowns in rounding; without slack the last steps would be refused there.
    slack = (rounding + 4 * precision * distance) * (distance + rounding)
    better = value <= lane.value + slack
    gain = (lane.value - value + slack) / (lane.predicted + slack)
    judged = jnp.where(gain < 0.25, lane.length / 2, lane.radius)
    judged = jnp.where(gain > 0.75, jnp.maximum(lane.radius, 3 * lane.length), judged)
    radius = jnp.where(better, judged, lane.length / 4)
    radius = jnp.where(lane.turns == 0, lane.radius, radius)

    pick = lambda new, old: jnp.where(better, new, old)
    here, value = pick(lane.trial, lane.best), pick(value, lane.value)
    gradient = pick(offset @ tangents, lane.gradient)
    metric = pick(tangents.T @ tangents, lane.metric)
    bend = pick(jnp.tensordot(offset, curving, axes=1), lane.bend)
    onward = step(here, gradient, metric, bend, radius, box)
    settled = onward.newton & (onward.length <= short)
    flat = onward.slope <= rounding / 4 + precision * distance
    trial, blocked = onward.trial, jnp.asarray(False)
    if here.shape[0] == 2:
        beyond, blocked = across_pole(here, gradient, metric, box)
        blocked &= lane.turns < _POLE_TURNS
        trial = jnp.where(blocked, beyond, trial)
    settled, flat = settled & ~blocked, flat & ~blocked
    done = settled | flat | (radius <= 1e-3 * short) | (lane.turns + 1 >= turns)
    lane = _Lane(
        lane.turns + 1,
        jnp.where(settled, onward.trial, here),
        value,
        gradient,
        metric,
        bend,
        trial,
        onward.length,
        onward.predicted,
        radius,
    )
    return lane, done
