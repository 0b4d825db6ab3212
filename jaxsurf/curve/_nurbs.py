"""Rational B-spline curves, and what is rational about them."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._registry import register
from ..basis import BSplineBasis, check_knots
from ._abstract import AbstractCurve
from ._breaks import breaks, knot_breaks
from ._bspline import combine


@register
class NURBSCurve(AbstractCurve):
    """C(u) = Σ B_i(u) w_i P_i / Σ B_i(u) w_i, the rational spline curve: conics exactly.

    control_points: (n, 3), or (n, 2) for a curve in a parameter plane; weights: (n,), positive; knots:
    (n + degree + 1,); degree ≥ 1. All arrays take the floating type of `control_points`.
    Raises `InputError` on shapes that do not fit, on weights ≤ 0 and on knots that define no spline.
    Source: The NURBS Book, §4.2.
    """

    control_points: Float[Array, "n d"]
    weights: Float[Array, "n"]
    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)

    def __init__(self, control_points: Numbers, weights: Numbers, knots: Numbers, degree: int):
        self.control_points = as_float(control_points)
        self.weights = as_weights(weights, self.control_points)
        self.knots = as_float(knots, self.control_points.dtype)
        self.degree = int(degree)

    def __check_init__(self):
        shape = self.control_points.shape
        if len(shape) != 2 or shape[1] not in (2, 3):
            raise InputError(f"`control_points` must have shape (n, 3), got {shape}.")
        check_knots(self.knots, self.degree, shape[0])

    @property
    def basis(self) -> BSplineBasis:
        """The basis functions of the homogeneous curve."""
        return BSplineBasis(self.knots, self.degree)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.basis.domain

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return project(combine(self.basis, homogeneous(self.control_points, self.weights), u))


@breaks.register(NURBSCurve)
def _(shape: NURBSCurve) -> Any:
    return knot_breaks(shape.basis)


def homogeneous(points: Float[Array, "*n d"], weights: Float[Array, "*n"]) -> Float[Array, "*n e"]:
    """(w P, w): control data of the polynomial shape one dimension higher whose projection is the shape."""
    weights = weights[..., None]
    return jnp.concatenate([weights * points, weights], axis=-1)


def project(points: Float[Array, "*n e"]) -> Float[Array, "*n d"]:
    """Divide by the last coordinate and drop it."""
    return points[..., :-1] / points[..., -1:]


def as_weights(weights: Numbers, control_points: Float[Array, "*n d"]) -> Float[Array, "*n"]:
    """Convert weights: one for each control point, of their type, on concrete data positive and finite."""
    array = as_float(weights, control_points.dtype)
    if array.shape != control_points.shape[:-1]:
        raise InputError(
            f"`weights` must have shape {control_points.shape[:-1]}, one for each of the `control_points` "
            f"{control_points.shape}, got {array.shape}."
        )
    if is_concrete(array):
        values = concrete(array)
        bad = np.argwhere(~((values > 0) & np.isfinite(values)))
        if bad.size:
            index = tuple(int(i) for i in bad[0])
            place = index[0] if len(index) == 1 else index
            raise InputError(
                f"`weights` must be positive and finite, got {values[index]:g} at index {place}; "
                f"a weight of 1 everywhere gives the polynomial shape."
            )
    return array
