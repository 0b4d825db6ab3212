"""Blending functions φ: from one character to the other."""

import abc
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._errors import InputError
from .._registry import register

_SLACK = 1e-9


class AbstractBlend(eqx.Module):
    """φ on [0, 1] with φ(0) = 0, φ(1) = 1 and 0 ≤ φ ≤ 1; a function of one share or of arrays of them."""

    @abc.abstractmethod
    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        """φ(t)."""


@register
class Smoothstep(AbstractBlend):
    """The polynomial of degree 2·order + 1 whose derivatives up to `order` vanish at both ends; order 0: φ(t) = t."""

    order: int = eqx.field(static=True, default=1)

    def __check_init__(self):
        if int(self.order) != self.order or not 0 <= self.order <= 6:
            raise InputError(f"`order` of a smoothstep must be a whole number from 0 to 6, got {self.order!r}.")

    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        return _smoothstep(int(self.order), t)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _smoothstep(n: int, t: Float[Array, "..."]) -> Float[Array, "..."]:
    total, rest = jnp.ones_like(t), jnp.ones_like(t)
    for i in range(n - 1, -1, -1):  # tⁿ⁺¹ Σ C(2n+1, n+1+i) tⁱ (1 − t)ⁿ⁻ⁱ, of which nothing cancels
        rest = rest * (1 - t)
        total = total * t + math.comb(2 * n + 1, n + 1 + i) * rest
    return t ** (n + 1) * total


@_smoothstep.defjvp
def _(n: int, primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (t,), (along,) = primals, tangents
    slope = (2 * n + 1) * math.comb(2 * n, n) * (t * (1 - t)) ** n if n else jnp.ones_like(t)
    return _smoothstep(n, t), along * slope


@register
class GivenBlend(AbstractBlend):
    """A blending function by the caller; best an `equinox.Module` if it has parameters of its own."""

    function: Callable[[Any], Any]

    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        return jnp.asarray(self.function(t), t.dtype)


smoothstep = Smoothstep(1)
"""3t² − 2t³."""

linear = Smoothstep(0)
"""t."""


def as_blend(blend: Any, dtype: Any) -> AbstractBlend:
    """A blending function given as an object or a callable; on concrete data its conditions are checked."""
    if not callable(blend):
        raise InputError(f"`blend` must be a function on [0, 1] such as `js.smoothstep`, got {type(blend).__name__}.")
    found = blend if isinstance(blend, AbstractBlend) else GivenBlend(blend)
    if isinstance(found, Smoothstep) or not is_concrete(found):
        return found
    shares = jnp.linspace(0, 1, 65, dtype=dtype)
    try:
        values = jnp.stack([found(t) for t in shares])
    except (TypeError, ValueError) as error:
        raise InputError(f"`blend` must give one number for one number; it failed with: {error}") from error
    if not is_concrete(values):
        return found
    values = concrete(values)
    if values.shape != shares.shape or not np.all(np.isfinite(values)):
        raise InputError(f"`blend` must give one finite number for one number, got shape {values.shape[1:]}.")
    for end, wanted in ((0, 0.0), (-1, 1.0)):
        if abs(values[end] - wanted) > _SLACK:
            raise InputError(f"`blend` must be {wanted:g} at {wanted:g}, got {values[end]:g}.")
    if values.min() < -_SLACK or values.max() > 1 + _SLACK:
        raise InputError(f"`blend` must stay between 0 and 1, got values from {values.min():g} to {values.max():g}.")
    return found
