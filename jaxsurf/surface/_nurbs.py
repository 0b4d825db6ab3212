"""Rational B-spline surfaces."""

from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from .._array import Numbers, as_float
from .._errors import InputError
from .._registry import register
from ..basis import BSplineBasis, check_knots
from ..curve._breaks import breaks, knot_breaks
from ..curve._nurbs import as_weights, homogeneous, project
from ._abstract import AbstractSurface
from ._bspline import combine_net, contract_net


@register
class NURBSSurface(AbstractSurface):
    """S(u, v) = Σ B_i(u) B_j(v) w_ij P_ij / Σ B_i(u) B_j(v) w_ij: quadrics and tori exactly.

    control_points: (n, m, 3); weights: (n, m), positive; knots_u: (n + degree_u + 1,); knots_v: (m + degree_v
    + 1,). All arrays take the floating type of `control_points`.
    Raises `InputError` on shapes that do not fit, on weights ≤ 0 and on knots that define no spline.
    Source: The NURBS Book, §4.4.
    """

    control_points: Float[Array, "n m 3"]
    weights: Float[Array, "n m"]
    knots_u: Float[Array, "k"]
    knots_v: Float[Array, "l"]
    degree_u: int = eqx.field(static=True)
    degree_v: int = eqx.field(static=True)

    def __init__(
        self,
        control_points: Numbers,
        weights: Numbers,
        knots_u: Numbers,
        knots_v: Numbers,
        degree_u: int,
        degree_v: int,
    ):
        self.control_points = as_float(control_points)
        self.weights = as_weights(weights, self.control_points)
        self.knots_u = as_float(knots_u, self.control_points.dtype)
        self.knots_v = as_float(knots_v, self.control_points.dtype)
        self.degree_u, self.degree_v = int(degree_u), int(degree_v)

    def __check_init__(self):
        shape = self.control_points.shape
        if len(shape) != 3 or shape[2] != 3:
            raise InputError(f"`control_points` must have shape (n, m, 3), got {shape}.")
        check_knots(self.knots_u, self.degree_u, shape[0], name="knots_u")
        check_knots(self.knots_v, self.degree_v, shape[1], name="knots_v")

    @property
    def basis_u(self) -> BSplineBasis:
        """The basis functions of the homogeneous surface in u."""
        return BSplineBasis(self.knots_u, self.degree_u)

    @property
    def basis_v(self) -> BSplineBasis:
        """The basis functions of the homogeneous surface in v."""
        return BSplineBasis(self.knots_v, self.degree_v)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.basis_u.domain, self.basis_v.domain

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        net = homogeneous(self.control_points, self.weights)
        return project(combine_net(self.basis_u, self.basis_v, net, u, v))

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        net = homogeneous(self.control_points, self.weights)
        return project(contract_net(self.basis_u, self.basis_v, net, u, v))


@breaks.register(NURBSSurface)
def _(shape: NURBSSurface) -> tuple[Any, Any]:
    return knot_breaks(shape.basis_u), knot_breaks(shape.basis_v)
