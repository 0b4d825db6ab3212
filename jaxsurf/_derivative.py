"""Derivatives of one-point functions with respect to their parameters."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ._errors import InputError


class PartialDerivative(eqx.Module):
    """The partial derivative of `function(shape, *parameters)`, `orders[i]` times by parameter i, in forward mode.

    Static and hashable, so that `map_points` compiles it once.
    """

    function: Callable[..., Array] = eqx.field(static=True)
    orders: tuple[int, ...] = eqx.field(static=True)

    def __call__(self, shape: Any, *parameters: Array) -> Array:
        f = lambda *p: self.function(shape, *p)
        for axis, order in enumerate(self.orders):
            for _ in range(order):
                f = _tangent(f, axis)
        return f(*parameters)


def check_orders(order: Any, count: int) -> tuple[int, ...]:
    """The orders of derivation as a tuple of `count` whole numbers ≥ 0; a lone number stands for a curve's."""
    orders = (order,) if isinstance(order, int) else tuple(order)
    if len(orders) != count or any(int(k) != k or k < 0 for k in orders):
        wanted = "a whole number ≥ 0" if count == 1 else "a pair of whole numbers ≥ 0 such as (1, 0), by u and by v"
        raise InputError(f"`order` must be {wanted}, got {order!r}.")
    return tuple(int(k) for k in orders)


def _tangent(f: Callable[..., Array], axis: int) -> Callable[..., Array]:
    def derived(*p: Array) -> Array:
        along = lambda t: f(*p[:axis], t, *p[axis + 1 :])
        return jax.jvp(along, (p[axis],), (jnp.ones_like(p[axis]),))[1]

    return derived
