"""The safeguarded Newton iteration towards a foot point."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .. import _safe
from .._array import eps
from ..differential._jets import jet
from ._samples import domain_box, periodic_directions

_STEPS = 60


def local_frame(
    shape: Any, t: Float[Array, "k"]
) -> tuple[Float[Array, "d"], Float[Array, "d k"], Float[Array, "d k k"]]:
    """Point, first and second derivatives at one parameter vector."""
    k = t.shape[0]
    derivatives = jet(shape, tuple(t), 2)
    at = lambda *axes: derivatives[tuple(sum(axis == i for axis in axes) for i in range(k))]
    tangents = jnp.stack([at(i) for i in range(k)], axis=-1)
    return (
        at(),
        tangents,
        jnp.stack([jnp.stack([at(i, j) for j in range(k)], axis=-1) for i in range(k)], axis=-2),
    )


def value_and_tangents(shape: Any, t: Float[Array, "k"]) -> tuple[Float[Array, "d"], Float[Array, "d k"]]:
    """Point and first derivatives at one parameter vector."""
    derivatives = jet(shape, tuple(t), 1)
    k = t.shape[0]
    tangents = [derivatives[tuple(int(axis == i) for axis in range(k))] for i in range(k)]
    return derivatives[(0,) * k], jnp.stack(tangents, axis=-1)


def held_parameters(shape: Any, t: Float[Array, "k"], gradient: Float[Array, "k"]) -> Bool[Array, "k"]:
    """Which parameters of a foot sit on a border that the foot would like to cross, `gradient` being that of ½ d²."""
    return jax.lax.stop_gradient(_held(t, gradient, *_box(shape)))


def _held(t: Array, gradient: Array, lower: Array, upper: Array, free: Array) -> Bool[Array, "k"]:
    return (((t <= lower) & (gradient > 0)) | ((t >= upper) & (gradient < 0))) & ~free


def _box(shape: Any) -> tuple[Array, Array, Array]:
    return *domain_box(shape), jnp.asarray(periodic_directions(shape))


def descend(
    shape: Any, p: Float[Array, "d"], start: Float[Array, "k"], size: Float[Array, ""]
) -> tuple[Float[Array, "k"], Float[Array, ""]]:
    """Parameters of a local minimum of ½|S(t) − p|² on the domain's box, and the value there.

    Newton's step where the Hessian is positive, else Gauss-Newton's, damped in the metric of the surface and accepted
    only if it does not raise the distance; parameters on a border that the step would cross are held. It ends when a
    step is shorter than √eps·10⁻² of the size (Newton's next error is the square of it) or cannot improve.
    """
    lower, upper, free = _box(shape)
    short = (0.01 * eps(start.dtype) ** 0.5 * size) ** 2

    def look(t: Float[Array, "k"]) -> tuple[Array, Array, Array, Array]:
        point, tangents, curving = local_frame(shape, t)
        offset = point - p
        return (
            0.5 * offset @ offset,
            offset @ tangents,
            tangents.T @ tangents,
            jnp.tensordot(offset, curving, axes=1),
        )

    def going(state: Any) -> Bool[Array, ""]:
        return ~state[-1]

    def move(state: Any) -> Any:
        # One evaluation a turn: judge the trial point, keep it or not, and step on from the better one.
        count, t, here, trial, damping, _ = state
        there = look(trial)
        better = (there[0] <= here[0]) | (count == 0)
        step = trial - t
        settled = better & (step @ here[2] @ step <= short) & (damping < 1e-6) & (count > 0)
        stuck = ~better & ((damping > 1e8) | (step @ here[2] @ step <= short))
        pick = lambda a, b: jax.tree.map(lambda x, y: jnp.where(better, x, y), a, b)
        t, here = pick(trial, t), pick(there, here)
        damping = jnp.where(better, damping * 0.01, jnp.maximum(damping * 10, 1e-3))
        _, gradient, metric, bend = here
        trial = t + _step(gradient, metric, bend, _held(t, gradient, lower, upper, free), damping)
        trial = jnp.where(free, trial, jnp.clip(trial, lower, upper))
        return count + 1, t, here, trial, damping, settled | stuck | (count + 1 >= _STEPS)

    k = start.shape[0]
    none = jnp.zeros((), start.dtype)
    unknown = (
        none,
        jnp.zeros(k, start.dtype),
        jnp.zeros((k, k), start.dtype),
        jnp.zeros((k, k), start.dtype),
    )
    state = (jnp.zeros((), jnp.int32), start, unknown, start, none, jnp.asarray(False))
    _, t, here, *_ = jax.lax.while_loop(going, move, state)
    wrapped = lower + jnp.mod(t - lower, upper - lower)
    return jnp.where(free & ((t < lower) | (t > upper)), wrapped, t), here[0]


def _step(
    gradient: Float[Array, "k"],
    metric: Float[Array, "k k"],
    bend: Float[Array, "k k"],
    held: Bool[Array, "k"],
    damping: Float[Array, ""],
) -> Float[Array, "k"]:
    """The damped step on the parameters that are not held."""
    k = gradient.shape[0]
    scale = jnp.diag(metric) + eps(metric.dtype) * jnp.trace(metric) + jnp.finfo(metric.dtype).tiny
    newton = metric + bend + jnp.diag(damping * scale)
    fallback = metric + jnp.diag((damping + 1e-6) * scale)
    gradient = jnp.where(held, 0, gradient)
    hold = lambda m: jnp.where(held[:, None] | held[None, :], jnp.diag(scale), m)
    newton, fallback = hold(newton), hold(fallback)
    if k == 1:
        positive = newton[0, 0] > 1e-3 * scale[0]
        return -gradient / jnp.where(positive, newton[0, 0], fallback[0, 0])
    determinant = lambda m: m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    limit = 1e-6 * scale[0] * scale[1]
    positive = (
        (newton[0, 0] > 0)
        & (newton[1, 1] > 0)
        & (determinant(newton) > jnp.minimum(limit, 1e-3 * determinant(fallback)))
    )
    m = jnp.where(positive, newton, fallback)
    turned = jnp.stack(
        [m[1, 1] * gradient[0] - m[0, 1] * gradient[1], m[0, 0] * gradient[1] - m[1, 0] * gradient[0]]
    )
    return -_safe.divide(turned, determinant(m))
