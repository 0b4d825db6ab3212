"""B-spline curves."""

from functools import reduce
from operator import add
from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from .._array import Numbers, as_float, take
from .._errors import InputError
from .._registry import register
from ..basis import BSplineBasis, SplinePieces, check_knots, spline_pieces
from ._abstract import AbstractCurve


@register
class BSplineCurve(AbstractCurve):
    """C(u) = Σ B_i(u) P_i, the polynomial spline curve.

    control_points: (n, 3), or (n, 2) for a curve in a parameter plane; knots: (n + degree + 1,); degree ≥ 1.
    periodic: the curve closes smoothly with n control points and n + 1 knots, none of them copies; unrolled
    it is the ordinary curve on P_0 … P_{n-1}, P_0 … P_{degree-1}. The domain is [knots[degree], knots[n]],
    periodic [knots[0], knots[n]]. All arrays take the floating type of `control_points`. Raises `InputError`
    on shapes that do not fit and on knots that define no spline. Source: The NURBS Book, §3.2.
    """

    control_points: Float[Array, "n d"]
    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)
    periodic: bool = eqx.field(static=True)

    def __init__(self, control_points: Numbers, knots: Numbers, degree: int, periodic: bool = False):
        self.control_points = as_float(control_points)
        self.knots = as_float(knots, self.control_points.dtype)
        self.degree = int(degree)
        self.periodic = bool(periodic)

    def __check_init__(self):
        shape = self.control_points.shape
        if len(shape) != 2 or shape[1] not in (2, 3):
            raise InputError(f"`control_points` must have shape (n, 3), got {shape}.")
        check_knots(self.knots, self.degree, shape[0], periodic=self.periodic)

    @property
    def basis(self) -> BSplineBasis:
        """The basis functions of this curve."""
        return BSplineBasis(self.knots, self.degree, self.periodic)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.basis.domain

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return combine(self.basis, self.control_points, u)

    def prepared(self) -> "PreparedBSplineCurve":
        """The curve by its polynomial pieces."""
        return PreparedBSplineCurve(self)


class PreparedBSplineCurve(BSplineCurve):
    """A `BSplineCurve` with its polynomial pieces."""

    pieces: SplinePieces

    def __init__(self, curve: BSplineCurve):
        super().__init__(curve.control_points, curve.knots, curve.degree, curve.periodic)
        self.pieces = spline_pieces(self.basis, self.control_points)

    def prepared(self) -> "PreparedBSplineCurve":
        return self

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return self.pieces.point(u)


def combine(basis: BSplineBasis, rows: Float[Array, "n d"], u: Float[Array, ""]) -> Float[Array, "d"]:
    """Σ B_i(u) rows_i, one gather of a row for each function that does not vanish."""
    first, values = basis.local(u)
    unrolled = basis.unroll(rows)
    return reduce(add, (value * take(unrolled, first + i) for i, value in enumerate(values)))
