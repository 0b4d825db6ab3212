"""Curves moved along a vector."""

from functools import singledispatch
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_direction, as_type, early
from .._array import Numbers, is_concrete
from .._registry import register
from ..convert import Conversion, to_bspline
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve
from ..curve._breaks import breaks as curve_breaks
from ..surface import AbstractSurface, BSplineSurface, NURBSSurface
from ..surface._breaks import breaks
from ._family import check_curve
from ._same_knots import as_spline


@register
class Extrusion(AbstractSurface):
    """S(u, v) = C(u) + v · vector, v in [0, 1]; u runs along the curve. curve: in space; vector: (3,), with its length.

    `js.extrude` makes splines of splines; this class holds no more control data than the curve and the vector.
    """

    curve: AbstractCurve
    vector: Float[Array, "3"]

    def __init__(self, curve: Any, vector: Numbers):
        check_curve(curve, "curve")
        self.curve = curve
        self.vector = as_direction(vector, "vector", curve.dtype)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.curve.domain, (0.0, 1.0)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.curve.point(u) + v * self.vector

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return jax.vmap(self.curve.point)(u)[:, None, :] + (v[:, None] * self.vector[None, :])[None]


def extrude(curve: Any, vector: Numbers) -> BSplineSurface | NURBSSurface | Extrusion:
    """The surface C(u) + v · vector, v in [0, 1]: of a B-spline a B-spline, of NURBS a NURBS, of any other an `Extrusion`.

    vector: (3,), its length is how far. All three are exact. Raises `InputError` on the zero vector and on plane curves.
    """
    check_curve(curve, "curve")
    return _extruded(curve, as_direction(vector, "vector", curve.dtype))


@singledispatch
def _extruded(curve: Any, vector: Float[Array, "3"]) -> Any:
    return Extrusion(curve, vector)


@_extruded.register
def _(curve: BSplineCurve, vector: Float[Array, "3"]) -> BSplineSurface:
    return BSplineSurface(_moved(curve, vector), curve.knots, _knots(curve), curve.degree, 1, curve.periodic)


@_extruded.register
def _(curve: NURBSCurve, vector: Float[Array, "3"]) -> NURBSSurface:
    weights = jnp.stack([curve.weights, curve.weights], axis=1)
    return NURBSSurface(_moved(curve, vector), weights, curve.knots, _knots(curve), curve.degree, 1)


def _moved(curve: Any, vector: Float[Array, "3"]) -> Float[Array, "n 2 3"]:
    return jnp.stack([curve.control_points, curve.control_points + vector[None, :]], axis=1)


def _knots(curve: Any) -> Float[Array, "4"]:
    return early(lambda: jnp.asarray([0, 0, 1, 1], curve.dtype))


@breaks.register(Extrusion)
def _(shape: Extrusion) -> tuple[Any, Any]:
    return curve_breaks(shape.curve), np.array([0, 1], shape.dtype)


@to_bspline.register(Extrusion)
def _(shape: Extrusion, tol: float, *, degree: int = 3) -> Conversion:
    """Exact for splines; any other curve is converted, and its error is that of the surface."""
    spline = as_spline(shape.curve)
    if spline is not None:
        return Conversion(extrude(spline, shape.vector), jnp.zeros((), shape.dtype))
    if not is_concrete(shape):
        return to_bspline.dispatch(AbstractSurface)(shape, tol, degree=degree)
    found = to_bspline(shape.curve, tol, degree=degree)
    return Conversion(extrude(as_type(found.shape, shape.dtype), shape.vector), found.max_error)
