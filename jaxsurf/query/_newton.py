"""One step of the search for a foot point, and the derivatives that it needs."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..differential._jets import jet
from ._samples import domain_box, periodic_directions


class Box(NamedTuple):
    """Ends of the parameters' intervals, and which of the intervals have none because the shape closes there."""

    lower: Float[Array, "k"]
    upper: Float[Array, "k"]
    free: Bool[Array, "k"]


class Step(NamedTuple):
    """Where to look next; how far that is; by how much ½ d² should fall; whether the step is Newton's own;
    and the gradient's length. Lengths are in space."""

    trial: Float[Array, "k"]
    length: Float[Array, ""]
    predicted: Float[Array, ""]
    newton: Bool[Array, ""]
    slope: Float[Array, ""]


def local_frame(shape: Any, t: Float[Array, "k"]) -> tuple[Float[Array, "d"], Float[Array, "d k"], Float[Array, "d k k"]]:
    """Point, first and second derivatives at one parameter vector."""
    k = t.shape[0]
    derivatives = jet(shape, tuple(t), 2)
    at = lambda *axes: derivatives[tuple(sum(axis == i for axis in axes) for i in range(k))]
    tangents = jnp.stack([at(i) for i in range(k)], axis=-1)
    rows = [jnp.stack([at(i, j) for j in range(k)], axis=-1) for i in range(k)]
    return at(), tangents, jnp.stack(rows, axis=-2)


def value_and_tangents(shape: Any, t: Float[Array, "k"]) -> tuple[Float[Array, "d"], Float[Array, "d k"]]:
    """Point and first derivatives at one parameter vector."""
    derivatives = jet(shape, tuple(t), 1)
    k = t.shape[0]
    tangents = [derivatives[tuple(int(axis == i) for axis in range(k))] for i in range(k)]
    return derivatives[(0,) * k], jnp.stack(tangents, axis=-1)


def held_parameters(shape: Any, t: Float[Array, "k"], gradient: Float[Array, "k"]) -> Bool[Array, "k"]:
    """Which parameters of a foot sit on a border that the foot would like to cross, `gradient` being that of ½ d²."""
    return jax.lax.stop_gradient(_held(t, gradient, parameter_box(shape)))


def parameter_box(shape: Any) -> Box:
    """The domain of a curve or surface."""
    lower, upper = domain_box(shape)
    return Box(lower, upper, jnp.asarray(periodic_directions(shape)))


def step(
    t: Float[Array, "k"],
    gradient: Float[Array, "k"],
    metric: Float[Array, "k k"],
    bend: Float[Array, "k k"],
    radius: Float[Array, ""],
    box: Box,
) -> Step:
    """A step no longer than about `radius` down the quadratic model of ½ d², whose Hessian is `metric + bend`.

    Newton's if the Hessian is positive and the step short enough, else with the Hessian shifted by
    |gradient| / radius − (its least eigenvalue), which makes it so. Parameters on a border that the step would
    cross are held; where it meets a border the other parameter follows. At the zero gradient the step is 0.
    """
    held = _held(t, gradient, box)
    squared, sides = jnp.diag(metric), box.upper - box.lower
    # lengths per parameter; where one vanishes (at a pole) a way across the domain still counts as a tenth of the other
    floor = 0.01 * jnp.max(squared * sides**2) / sides**2
    speed = jnp.sqrt(jnp.maximum(squared, floor) + jnp.finfo(t.dtype).tiny)
    slope = jnp.where(held, 0, gradient / speed)
    steepness = jnp.sqrt(slope @ slope)
    hessian = (metric + bend) / (speed[:, None] * speed[None, :])
    hessian = jnp.where(held[:, None] | held[None, :], jnp.eye(t.shape[0], dtype=t.dtype), hessian)
    go = _along if t.shape[0] == 1 else _across
    move, newton, shifted = go(slope, steepness, hessian, radius)

    confine = lambda x: jnp.where(box.free, x, jnp.clip(x, box.lower, box.upper))
    aim = t + move / speed
    trial = confine(aim)
    if t.shape[0] == 2:
        cut = trial != aim
        rest = slope + hessian[0, 1] * ((trial - t) * speed)[::-1]
        follow = jnp.clip(-rest / jnp.diag(shifted), -radius, radius)
        trial = confine(t + jnp.where(cut[::-1] & ~cut, follow, move) / speed)
    trial = jnp.where(held, t, trial)
    moved = (trial - t) * speed
    predicted = -(slope @ moved) - 0.5 * moved @ hessian @ moved
    return Step(trial, jnp.sqrt(moved @ moved), predicted, newton, steepness)


def across_pole(
    t: Float[Array, "2"], gradient: Float[Array, "2"], metric: Float[Array, "2 2"], box: Box
) -> tuple[Float[Array, "2"], Bool[Array, ""]]:
    """The same place half a turn on, and whether that helps: a foot would cross a border that is a point of a closed shape,
    and so cannot know the way from there."""
    held, sides = _held(t, gradient, box), box.upper - box.lower
    lengths = jnp.diag(metric) * sides**2
    turning = box.free & held[::-1] & (lengths <= 1e-12 * lengths[::-1])
    return t + jnp.where(turning, sides / 2, 0), jnp.any(turning)


def _along(
    slope: Float[Array, "1"], steepness: Float[Array, ""], hessian: Float[Array, "1 1"], radius: Float[Array, ""]
) -> tuple[Float[Array, "1"], Bool[Array, ""], Float[Array, "1 1"]]:
    """Move, whether it is Newton's, and the Hessian that gave it: one parameter."""
    bend = hessian[0, 0]
    newton = (bend > 1e-3) & (steepness <= radius * bend)
    shifted = jnp.where(newton, bend, _positive(steepness / radius))
    return -slope / shifted, newton, shifted[None, None]


def _across(
    slope: Float[Array, "2"], steepness: Float[Array, ""], hessian: Float[Array, "2 2"], radius: Float[Array, ""]
) -> tuple[Float[Array, "2"], Bool[Array, ""], Float[Array, "2 2"]]:
    """Move, whether it is Newton's, and the Hessian that gave it: two parameters."""
    a, b, c = hessian[0, 0], hessian[0, 1], hessian[1, 1]
    middle, half = (a + c) / 2, jnp.sqrt(((a - c) / 2) ** 2 + b * b)
    least = middle - half
    turned = lambda a, c: jnp.stack([b * slope[1] - c * slope[0], b * slope[0] - a * slope[1]])
    newton = least > 1e-3 * jnp.minimum(1, middle + half)
    whole = turned(a, c)
    newton &= whole @ whole <= (radius * (a * c - b * b)) ** 2
    shift = jnp.where(newton, 0, steepness / radius - least)
    a, c = a + shift, c + shift
    shifted = jnp.stack([jnp.stack([_positive(a), b]), jnp.stack([b, _positive(c)])])
    return turned(a, c) / _positive(a * c - b * b), newton, shifted


def _positive(x: Float[Array, ""]) -> Float[Array, ""]:
    return jnp.where(x > 0, x, 1)


def _held(t: Float[Array, "k"], gradient: Float[Array, "k"], box: Box) -> Bool[Array, "k"]:
    return (((t <= box.lower) & (gradient > 0)) | ((t >= box.upper) & (gradient < 0))) & ~box.free
