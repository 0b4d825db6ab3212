"""How far the points are from the shape."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import is_concrete
from ._quantile import compiled_quantile


class Deviation(eqx.Module):
    """Distances of the points to their feet.

    signed: (N,), or (K, N) of many clouds, whose figures are those of all points together; on a surface with the sign of
    ⟨p − S, n⟩; `numpy.asarray` of the deviation is this array. counted: (N,), 0 for rows that are no points, or `None`; of
    points spread over processes all must ask for a figure together.
    """

    signed: Float[Array, "*K N"]
    counted: Float[Array, "N"] | None = None

    @property
    def count(self) -> int:
        """How many points there are."""
        return self.signed.shape[0] if self.counted is None else int(jnp.sum(self.counted))

    @property
    def rms(self) -> Any:
        """Root of the mean square."""
        if self.counted is not None:
            return jnp.sqrt(_mean(jnp.square(self.signed), self.counted))
        xp = self._numbers
        return xp.sqrt(xp.mean(xp.square(self.signed)))

    @property
    def max(self) -> Any:
        """Largest magnitude."""
        if self.counted is not None:
            return jnp.max(jnp.abs(self.signed) * self.counted)
        return self._numbers.max(self._numbers.abs(self.signed))

    @property
    def mean(self) -> Any:
        """Mean of the signed distances."""
        if self.counted is not None:
            return _mean(self.signed, self.counted)
        return self._numbers.mean(self.signed)

    def quantile(self, q: float) -> Any:
        """The magnitude that a share `q` of the points does not exceed."""
        if self.counted is not None:
            return compiled_quantile(jnp.abs(self.signed), self.counted > 0, jnp.asarray(q, self.signed.dtype))
        return self._numbers.quantile(self._numbers.abs(self.signed), q)

    @property
    def _numbers(self) -> Any:
        """numpy for values at hand, which compiles nothing; jax.numpy while tracing."""
        return np if is_concrete(self.signed) else jnp

    @property
    def quantiles(self) -> dict[float, Any]:
        """The 50, 90, 95 and 99 % quantiles of the magnitude."""
        return {q: self.quantile(q) for q in (0.5, 0.9, 0.95, 0.99)}

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return np.asarray(self.signed, dtype=dtype)


@eqx.filter_jit
def _mean(values: Float[Array, "N"], counted: Float[Array, "N"]) -> Float[Array, ""]:
    return jnp.sum(values * counted) / jnp.sum(counted)
