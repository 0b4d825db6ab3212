"""How far the points are from the shape."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import is_concrete


class Deviation(eqx.Module):
    """Distances of the points to their feet.

    signed: (N,), or (K, N) of many clouds, whose figures are those of all points together; on a surface with the sign of
    ⟨p − S, n⟩; `numpy.asarray` of the deviation is this array.
    """

    signed: Float[Array, "*K N"]

    @property
    def rms(self) -> Any:
        """Root of the mean square."""
        xp = self._numbers
        return xp.sqrt(xp.mean(xp.square(self.signed)))

    @property
    def max(self) -> Any:
        """Largest magnitude."""
        return self._numbers.max(self._numbers.abs(self.signed))

    @property
    def mean(self) -> Any:
        """Mean of the signed distances."""
        return self._numbers.mean(self.signed)

    def quantile(self, q: float) -> Any:
        """The magnitude that a share `q` of the points does not exceed."""
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
