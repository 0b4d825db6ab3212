"""How far the points are from the shape."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Deviation(eqx.Module):
    """Distances of the points to their feet.

    signed: (N,), on a surface with the sign of ⟨p − S, n⟩; `numpy.asarray` of the deviation is this array.
    """

    signed: Float[Array, "N"]

    @property
    def rms(self) -> Float[Array, ""]:
        """Root of the mean square."""
        return jnp.sqrt(jnp.mean(self.signed**2))

    @property
    def max(self) -> Float[Array, ""]:
        """Largest magnitude."""
        return jnp.max(jnp.abs(self.signed))

    @property
    def mean(self) -> Float[Array, ""]:
        """Mean of the signed distances."""
        return jnp.mean(self.signed)

    def quantile(self, q: float) -> Float[Array, ""]:
        """The magnitude that a share `q` of the points does not exceed."""
        return jnp.quantile(jnp.abs(self.signed), q)

    @property
    def quantiles(self) -> dict[float, Float[Array, ""]]:
        """The 50, 90, 95 and 99 % quantiles of the magnitude."""
        return {q: self.quantile(q) for q in (0.5, 0.9, 0.95, 0.99)}

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return np.asarray(self.signed, dtype=dtype)
