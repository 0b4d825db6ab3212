"""One direction of a spline shape, whatever its class: what all knot operations work on."""

import functools
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, is_concrete
from .._errors import InputError
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve, homogeneous, project
from ..surface import AbstractSurface, BSplineSurface, NURBSSurface

SPLINES = (BSplineCurve, NURBSCurve, BSplineSurface, NURBSSurface)


class SplineAxis(eqx.Module):
    """Control data with one direction in front, and the knots of that direction.

    net: (n, ...), homogeneous if the shape is rational, so that every operation is linear in it.
    """

    net: Float[Array, "n *rest"]
    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)
    periodic: bool = eqx.field(static=True, default=False)

    @property
    def ends(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """First and last parameter."""
        first, last = (0, -1) if self.periodic else (self.degree, -self.degree - 1)
        return early(lambda knots: (knots[first], knots[last]), self.knots)


def check_direction(shape: Any, direction: str | None, function: str) -> None:
    """A surface needs a direction, a curve has none, anything else is no shape."""
    if not isinstance(shape, AbstractCurve | AbstractSurface):
        raise TypeError(f"{function} is not defined for {type(shape).__name__}.")
    if isinstance(shape, AbstractSurface) and direction not in ("u", "v"):
        raise InputError(f'`direction` must be "u" or "v" for a surface, got {direction!r}.')
    if isinstance(shape, AbstractCurve) and direction is not None:
        raise InputError(f"A curve has one direction; leave `direction` out, got {direction!r}.")


def directions(shape: Any) -> tuple[str | None, ...]:
    """All directions of a shape."""
    return ("u", "v") if isinstance(shape, AbstractSurface) else (None,)


def concrete_knots(axis: SplineAxis, function: str) -> np.ndarray:
    """The knots as numbers; how many control points `function` returns depends on them."""
    if not is_concrete(axis.knots):
        raise InputError(
            f"`{function}` needs knots whose values are known, got traced ones: call it outside of the "
            f"transformation, or let only the control points be traced."
        )
    return concrete(axis.knots)


@functools.singledispatch
def spline_axis(shape: Any, direction: str | None = None) -> SplineAxis:
    """The control data along one direction: None for curves, "u" or "v" for surfaces."""
    raise TypeError(f"spline_axis is not defined for {type(shape).__name__}.")


@spline_axis.register
def _(shape: BSplineCurve, direction: str | None = None) -> SplineAxis:
    return SplineAxis(shape.control_points, shape.knots, shape.degree, shape.periodic)


@spline_axis.register
def _(shape: NURBSCurve, direction: str | None = None) -> SplineAxis:
    return SplineAxis(homogeneous(shape.control_points, shape.weights), shape.knots, shape.degree)


@spline_axis.register
def _(shape: BSplineSurface, direction: str | None = None) -> SplineAxis:
    if direction == "u":
        return SplineAxis(shape.control_points, shape.knots_u, shape.degree_u, shape.periodic_u)
    return SplineAxis(_swapped(shape.control_points), shape.knots_v, shape.degree_v, shape.periodic_v)


@spline_axis.register
def _(shape: NURBSSurface, direction: str | None = None) -> SplineAxis:
    net = homogeneous(shape.control_points, shape.weights)
    if direction == "u":
        return SplineAxis(net, shape.knots_u, shape.degree_u)
    return SplineAxis(_swapped(net), shape.knots_v, shape.degree_v)


@functools.singledispatch
def with_axis(shape: Any, axis: SplineAxis, direction: str | None = None) -> Any:
    """The shape with one direction replaced; what it has in the other direction stays."""
    raise TypeError(f"with_axis is not defined for {type(shape).__name__}.")


@with_axis.register
def _(shape: BSplineCurve, axis: SplineAxis, direction: str | None = None) -> BSplineCurve:
    return BSplineCurve(axis.net, axis.knots, axis.degree, axis.periodic)


@with_axis.register
def _(shape: NURBSCurve, axis: SplineAxis, direction: str | None = None) -> NURBSCurve:
    return NURBSCurve(project(axis.net), axis.net[..., -1], axis.knots, axis.degree)


@with_axis.register
def _(shape: BSplineSurface, axis: SplineAxis, direction: str | None = None) -> BSplineSurface:
    u, v, net = _both(shape, axis, direction)
    return BSplineSurface(net, u.knots, v.knots, u.degree, v.degree, u.periodic, v.periodic)


@with_axis.register
def _(shape: NURBSSurface, axis: SplineAxis, direction: str | None = None) -> NURBSSurface:
    u, v, net = _both(shape, axis, direction)
    return NURBSSurface(project(net), net[..., -1], u.knots, v.knots, u.degree, v.degree)


def _both(shape: Any, axis: SplineAxis, direction: str | None) -> tuple[SplineAxis, SplineAxis, Array]:
    """Both axes, one of them new, and the net that belongs to the new one."""
    if direction == "u":
        return axis, spline_axis(shape, "v"), axis.net
    return spline_axis(shape, "u"), axis, _swapped(axis.net)


def _swapped(net: Float[Array, "n m d"]) -> Float[Array, "m n d"]:
    return jnp.swapaxes(net, 0, 1)
