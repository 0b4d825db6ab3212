"""Surfaces of revolution."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_direction, as_number, as_vector, early
from .._array import Numbers, concrete, eps, is_concrete
from .._errors import InputError
from .._registry import register
from .._safe import unit
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve
from ..curve._breaks import breaks as curve_breaks, even_breaks
from ..edit import clamp
from ..surface import AbstractSurface, NURBSSurface
from ..surface._breaks import breaks
from ._family import check_curve
from ._same_knots import as_spline


@register
class Revolution(AbstractSurface):
    """S(u, v): the curve's point at u, turned by v radians about the line through `origin` along `axis`.

    curve: in space; origin, axis: (3,); angle: 0 < angle ≤ 2π, where v ends. u runs along the curve. S = C + sin v w +
    2 sin²(v/2) n × w with w = n × (C − origin), n the unit axis (Rodrigues): the curve itself at v = 0, and smooth where
    that is on the axis. There S_v vanishes: a pole. With 2π it closes to round-off.
    """

    curve: AbstractCurve
    origin: Float[Array, "3"]
    axis: Float[Array, "3"]
    angle: Float[Array, ""]

    def __init__(self, curve: Any, point: Numbers, axis: Numbers, angle: Numbers = 2 * math.pi):
        check_curve(curve, "curve")
        self.curve = curve
        self.origin = as_vector(point, "point", curve.dtype)
        self.axis = as_direction(axis, "axis", curve.dtype)
        self.angle = as_number(angle, "angle", curve.dtype)

    def __check_init__(self):
        if not is_concrete(self.angle):
            return
        angle = float(concrete(self.angle))
        if not 0 < angle <= 2 * math.pi * (1 + 4 * eps(self.dtype)):
            raise InputError(
                f"`angle` of a revolution must lie above 0 and be at most 2π radians, got {angle:g}; "
                "turn the other way with the opposite `axis`."
            )

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.curve.domain, (0.0, self.angle)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        start, side, inward = self._parts(u)
        return start + jnp.sin(v) * side + 2 * jnp.sin(v / 2) ** 2 * inward

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        start, side, inward = (part[:, None, :] for part in jax.vmap(self._parts)(u))
        sine, rest = (each[None, :, None] for each in (jnp.sin(v), 2 * jnp.sin(v / 2) ** 2))
        return start + sine * side + rest * inward

    def _parts(self, u: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
        place = self.curve.point(u)
        return place, *self.arms(place)

    def arms(self, place: Float[Array, "3"]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Where a point moves to when it is turned by a quarter, less its foot on the axis; and from it to the foot."""
        axis = unit(self.axis)
        side = jnp.cross(axis, place - self.origin)
        return side, jnp.cross(axis, side)

    def as_nurbs(self) -> NURBSSurface:
        """The same surface as NURBS, exactly, of B-spline, NURBS and line curves: arcs of a quarter or less, degree 2 in v.

        v is still the angle at the ends of the arcs; between them v and the angle differ, by up to 0.016 radians. Raises
        `InputError` for other curves and under tracing of the angle or of knots. Source: The NURBS Book, A8.1.
        """
        spline = self.curve if isinstance(self.curve, NURBSCurve) else as_spline(self.curve)
        if spline is None:
            raise InputError(
                f"A revolved {type(self.curve).__name__} is no NURBS surface: convert the curve with `js.to_bspline` first."
            )
        if not is_concrete(self.angle, spline.knots):
            raise InputError("`as_nurbs` needs a known `angle` and known knots, got traced ones; call it outside of `jit`.")
        if isinstance(spline, BSplineCurve) and spline.periodic:
            spline = clamp(spline)
        return _nurbs(self, spline)


def revolve(curve: Any, point: Numbers, axis: Numbers, angle: Numbers = 2 * math.pi) -> Revolution:
    """The surface of revolution of any curve: u along it, v the angle in radians, from 0 at the curve to `angle`.

    point: (3,), on the axis; axis: (3,), its direction, right-handed; 0 < angle ≤ 2π. The curve may touch the axis (poles)
    and cross it. Exact; `.as_nurbs()` of the result is a NURBS surface where the curve is a spline. Raises `InputError`
    on the zero axis, on other angles, and on plane curves.
    """
    return Revolution(curve, point, axis, angle)


def _nurbs(surface: Revolution, curve: Any) -> NURBSSurface:
    angle = float(concrete(surface.angle))
    arcs = max(1, math.ceil(angle / (math.pi / 2) - 1e-6))
    half = angle / arcs / 2
    dtype = surface.dtype
    places = early(lambda: jnp.asarray(np.arange(2 * arcs + 1) * half, dtype))
    # every other control point lies outside, where the tangents at the ends of its arc meet
    far = np.where(np.arange(2 * arcs + 1) % 2, 1 / math.cos(half), 1.0)
    ends = np.linspace(0, angle, arcs + 1)
    values = np.concatenate([ends[:1], np.repeat(ends[:-1], 2), np.repeat(ends[-1:], 3)])
    knots, reach, light = early(lambda: tuple(jnp.asarray(x, dtype) for x in (values, far, 1 / far)))
    side, inward = (arm[:, None, :] for arm in jax.vmap(surface.arms)(curve.control_points))
    foot = curve.control_points[:, None, :] + inward
    cosine, sine = jnp.cos(places) * reach, jnp.sin(places) * reach
    net = foot + sine[None, :, None] * side - cosine[None, :, None] * inward
    own = curve.weights if isinstance(curve, NURBSCurve) else jnp.ones(curve.control_points.shape[0], dtype)
    return NURBSSurface(net, own[:, None] * light[None, :], curve.knots, knots, curve.degree, 2)


@breaks.register(Revolution)
def _(shape: Revolution) -> tuple[Any, Any]:
    return curve_breaks(shape.curve), even_breaks(shape.domain[1], shape.dtype)
