"""Collocation: knots and matrices for interpolation."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._bspline import BSplineBasis


def averaged_knots(parameters: Float[Array, "n"], degree: int) -> Float[Array, "k"]:
    """Knots for interpolation at ascending `parameters`: inner knots are means of `degree` of them (The NURBS Book, (9.8)).

    The collocation matrix on them is regular (Schoenberg-Whitney).
    """
    count = parameters.shape[0]
    inner = [jnp.mean(parameters[j : j + degree]) for j in range(1, count - degree)]
    ends = (jnp.full(degree + 1, parameters[0]), jnp.full(degree + 1, parameters[-1]))
    return jnp.concatenate([ends[0], jnp.asarray(inner, parameters.dtype), ends[1]])


@eqx.filter_jit
def collocation_matrix(
    knots: Float[Array, "k"], degree: int, parameters: Float[Array, "m"], *, periodic: bool = False
) -> Float[Array, "m n"]:
    """Values of all basis functions at all parameters."""
    return BSplineBasis(knots, degree, periodic).matrix(parameters)
