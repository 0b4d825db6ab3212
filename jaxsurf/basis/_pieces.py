"""A spline as one polynomial on each of its spans."""

from functools import reduce

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import take
from ._bspline import BSplineBasis, inner_steps, span_polynomials, steps_passed


class SplinePieces(eqx.Module):
    """Coefficients (spans, d), by powers of the place t = (u − middle) · scale in the span.

    Made once for many points: Horner's rule on one row needs no basis values, and a program of a fifth of the operations.
    """

    basis: BSplineBasis
    steps: Float[Array, "inner"]
    middle: Float[Array, "spans"]
    scale: Float[Array, "spans"]
    coefficients: list[Float[Array, "spans d"]]

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        """The point at one parameter."""
        u = self.basis.wrapped(u)
        first = steps_passed(self.steps, u)
        t = (u - take(self.middle, first)) * take(self.scale, first)
        return reduce(lambda total, c: total * t + c, [take(rows, first) for rows in self.coefficients[::-1]])


def spline_pieces(basis: BSplineBasis, rows: Float[Array, "n d"]) -> SplinePieces:
    """The pieces of Σ B_i rows_i, from the polynomials of the basis functions."""
    middle, scale, functions = span_polynomials(basis.unrolled_knots, basis.degree)
    about = basis.unroll(rows)[np.arange(middle.shape[0])[:, None] + np.arange(basis.degree + 1)]
    rows = jnp.einsum("pai,aid->pad", jnp.stack(functions), about, precision="highest")
    return SplinePieces(basis, inner_steps(basis.unrolled_knots, basis.degree), middle, scale, list(rows))
