"""Cardinal functions of spline interpolation: one at their own parameter, zero at the others."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..basis import BSplineBasis, averaged_knots, collocation_matrix
from ..curve._breaks import knot_breaks
from ..edit._spline_axis import SplineAxis


class Cardinals(eqx.Module):
    """L_k(t) = Σ_j B_j(t) matrix_jk with L_k(t_i) = δ_ik.

    matrix: (n, n), from values to control points; knots: means of `degree` neighbouring parameters, of closed ones
    the parameters themselves. Source: The NURBS Book, §9.2.1; de Boor, ch. XIII.
    """

    matrix: Float[Array, "n n"]
    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)
    periodic: bool = eqx.field(static=True)

    @property
    def basis(self) -> BSplineBasis:
        """The B-splines of which they are sums."""
        return BSplineBasis(self.knots, self.degree, self.periodic)

    def breaks(self) -> Any:
        """Their knots."""
        return knot_breaks(self.basis)

    def __call__(self, t: Float[Array, ""]) -> Float[Array, "n"]:
        return jnp.matmul(self.basis.row(t), self.matrix, precision="highest")

    def axis(self) -> SplineAxis:
        """The functions as splines, one in each column."""
        return SplineAxis(self.matrix, self.knots, self.degree, self.periodic)


@eqx.filter_jit
def cardinals(parameters: Float[Array, "k"], degree: int, closed: bool = False) -> Cardinals:
    """The cardinal functions of ascending parameters; closed, the last is the first once more, and `degree` is odd."""
    knots = cardinal_knots(parameters, degree, closed)
    matrix = collocation_matrix(knots, degree, parameters[:-1] if closed else parameters, periodic=closed)
    return Cardinals(jnp.linalg.inv(matrix), knots, degree, closed)


def cardinal_knots(parameters: Float[Array, "k"], degree: int, closed: bool) -> Float[Array, "l"]:
    """The knots of `cardinals`."""
    return parameters if closed else averaged_knots(parameters, degree)
