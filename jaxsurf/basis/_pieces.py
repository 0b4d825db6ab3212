"""A spline as one polynomial on each of its spans."""

from functools import reduce
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import take
from ._bspline import BSplineBasis, Places, span_polynomials


class SplinePieces(eqx.Module):
    """Coefficients (spans, d), by powers of the place in the span.

    Made once for many points: Horner's rule on one row needs no basis values, and a program of a fifth of the operations.
    """

    basis: BSplineBasis
    places: Places
    coefficients: list[Float[Array, "spans d"]]

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        """The point at one parameter."""
        first, t, _ = self.basis.place(u, self.places)
        return horner(t, [take(rows, first) for rows in self.coefficients])


def spline_pieces(basis: BSplineBasis, rows: Float[Array, "n d"]) -> SplinePieces:
    """The pieces of Σ B_i rows_i, from the polynomials of the basis functions."""
    places, functions = span_polynomials(basis.unrolled_knots, basis.degree)
    about = basis.unroll(rows)[np.arange(places.middle.shape[0])[:, None] + np.arange(basis.degree + 1)]
    rows = jnp.einsum("pai,aid->pad", jnp.stack(functions), about, precision="highest")
    return SplinePieces(basis, places, list(rows))


def horner(t: Float[Array, ""], coefficients: Any) -> Float[Array, "d"]:
    """A polynomial by its coefficients, lowest power first."""
    return reduce(lambda total, c: total * t + c, coefficients[::-1])
