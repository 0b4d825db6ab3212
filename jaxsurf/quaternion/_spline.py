"""Orientations on a cumulative B-spline."""

import equinox as eqx
from jaxtyping import Array, Float

from .._array import Numbers, as_float, map_points
from .._errors import InputError
from ..basis import BSplineBasis, check_knots, cumulative_local
from ._algebra import conjugate, multiply, normalize
from ._exponential import exp, log


class QuaternionSpline(eqx.Module):
    """q(t) = exp(ω_n B̃_n(t)) … exp(ω_1 B̃_1(t)) q_0, ω_i = log(q_i q_{i-1}⁻¹): C^(degree − 1) orientations.

    orientations: (n, 4), normalized, q and −q alike; knots: (n + degree + 1,). Clamped knots begin at the first
    orientation and end at the last. Source: Kim, Kim, Shin, A general construction scheme for unit quaternion curves, 1995.
    """

    orientations: Float[Array, "n 4"]
    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)

    def __init__(self, orientations: Numbers, knots: Numbers, degree: int = 3):
        self.orientations = as_float(orientations)
        self.knots = as_float(knots, self.orientations.dtype)
        self.degree = int(degree)

    def __check_init__(self):
        shape = self.orientations.shape
        if len(shape) != 2 or shape[1] != 4:
            raise InputError(f"`orientations` must have shape (n, 4), got {shape}.")
        check_knots(self.knots, self.degree, shape[0])

    def __call__(self, t: Numbers) -> Float[Array, "*batch 4"]:
        """Unit quaternions at parameters t of any shape."""
        return map_points(QuaternionSpline.orientation, self, as_float(t, self.orientations.dtype))

    def orientation(self, t: Float[Array, ""]) -> Float[Array, "4"]:
        """The unit quaternion at one parameter, inside traced code."""
        units = normalize(self.orientations)
        steps = log(multiply(units[1:], conjugate(units[:-1])))
        first, shares = cumulative_local(BSplineBasis(self.knots, self.degree), t)
        q = units[first - 1]  # all turns up to it are complete
        for i, share in enumerate(shares):
            q = multiply(exp(share * steps[first - 1 + i]), q)
        return q
