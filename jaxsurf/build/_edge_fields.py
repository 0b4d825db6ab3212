"""Normals of the planes that a surface is to touch along a side."""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import as_float
from .._errors import InputError
from .._registry import register
from .._safe import unit
from ..basis import clamped_knots
from ..convert import interpolate
from ..curve import AbstractCurve, BSplineCurve
from ..differential import normal_at
from ..surface import AbstractSurface
from ._guides import carried

SIDES = ("u0", "u1", "v0", "v1")
"""Sides u = first, u = last, v = first, v = last."""


class AbstractEdgeField(eqx.Module):
    """Normals along a side, a function of the share of the side from 0 to 1."""

    @abc.abstractmethod
    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        """A normal of any length > 0, inside traced code."""


@register
class CurveField(AbstractEdgeField):
    """The points of a curve are the normals; its domain runs over the side."""

    curve: AbstractCurve

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        a, b = self.curve.domain
        return self.curve.point((1 - share) * a + share * b)


@register
class EdgeField(AbstractEdgeField):
    """The normals of another surface along its own side; turned: that side runs the other way."""

    surface: AbstractSurface
    side: str = eqx.field(static=True)
    turned: bool = eqx.field(static=True, default=False)

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        along = 1 - share if self.turned else share
        return normal_at(self.surface, *parameters_on(self.surface, self.side, along))


@register
class GivenField(AbstractEdgeField):
    """Normals by the caller: `function(t)` of the parameter along the side, over `domain`."""

    function: Callable[[Any], Any]
    domain: tuple[Any, Any]

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        a, b = self.domain
        return jnp.asarray(self.function((1 - share) * a + share * b), share.dtype)


def parameters_on(surface: AbstractSurface, side: str, share: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """u and v at a share of a side."""
    along_u, along_v = surface.domain
    fixed = (along_u if side[0] == "u" else along_v)[int(side[1])]
    running = carried(share, (0.0, 1.0), along_v if side[0] == "u" else along_u)
    fixed = jnp.asarray(fixed, share.dtype)
    return (fixed, running) if side[0] == "u" else (running, fixed)


def as_edge_field(given: Any, surface: AbstractSurface, side: str) -> AbstractEdgeField | None:
    """A field of normals given as an object, (surface, side) or (surface, side, turned), a curve, an array or a function."""
    if given is None or isinstance(given, AbstractEdgeField):
        return given
    if isinstance(given, tuple) and given and isinstance(given[0], AbstractSurface):
        if len(given) not in (2, 3) or given[1] not in SIDES:
            raise InputError(
                f"`{side}` given by another surface must be (surface, side) or (surface, side, turned) with a side among "
                f"{', '.join(SIDES)}, got {given[1:]!r}."
            )
        return EdgeField(given[0], given[1], bool(given[2]) if len(given) == 3 else False)
    if isinstance(given, AbstractCurve):
        return CurveField(given)
    if callable(given):
        domain = surface.domain[1 if side[0] == "u" else 0]
        return GivenField(given, domain)
    normals = as_float(given, surface.dtype)
    if normals.shape == (3,):
        normals = jnp.broadcast_to(normals, (2, 3))
    if normals.ndim != 2 or normals.shape[1] != 3 or normals.shape[0] < 2:
        raise InputError(
            f"`{side}` must be normals (n, 3) at even shares of the side, one normal (3,), a curve of normals, a function "
            f"of the parameter, or (surface, side) of a neighbour, got shape {normals.shape}."
        )
    return CurveField(_through(normals))


def _through(normals: Float[Array, "n 3"]) -> AbstractCurve:
    count = normals.shape[0]
    if count < 4:
        return (
            BSplineCurve(normals, clamped_knots(count, count - 1), count - 1)
            if count == 2
            else interpolate(normals, 2, parameters="uniform")
        )
    return interpolate(normals, 3, parameters="uniform")


def unit_normal(field: AbstractEdgeField, share: Float[Array, ""]) -> Float[Array, "3"]:
    """The unit normal of a field."""
    return unit(field.normal(share))
