"""Normals of the planes that a surface is to touch along a side."""

import abc
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_type
from .._array import as_float, eps, is_concrete
from .._errors import InputError
from .._prepared import Preparable
from .._registry import register
from .._safe import divide, norm, unit
from ..basis import clamped_knots, horner
from ..convert import interpolate
from ..curve import AbstractCurve, BSplineCurve
from ..differential import normal_at
from ..surface import AbstractSurface
from ._guides import carried, value_and_slope, with_two_slopes
from ._ribbons import SIDES, AbstractRibbon, ribbon_of


class AbstractEdgeField(Preparable):
    """Normals along a side, a function of the share of the side from 0 to 1."""

    @abc.abstractmethod
    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        """A normal of any length > 0, inside traced code."""

    @property
    def curved(self) -> bool:
        """Whether `curvature` is known."""
        return False

    def curvature(self, share: Float[Array, ""]) -> Float[Array, ""]:
        """The normal curvature across the side, in the direction M × t and by the normal M, if `curved`."""
        raise NotImplementedError

    @property
    def weight(self) -> Float[Array, ""] | None:
        """0 where the side is left as it is, so that sides with and without planes have one structure; None counts as 1."""
        return None


@register
class CurveField(AbstractEdgeField):
    """The points of a curve are the normals; its domain runs over the side."""

    curve: AbstractCurve

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        a, b = self.curve.domain
        return self.curve.point((1 - share) * a + share * b)


@register
class EdgeField(AbstractEdgeField):
    """The normals of another surface along its own side; turned: that side runs the other way.

    thin: whether the derivatives there may be parallel, as on a side that is a point; the normal is then the limit.
    """

    surface: AbstractSurface
    side: str = eqx.field(static=True)
    turned: bool = eqx.field(static=True, default=False)
    thin: bool = eqx.field(static=True, default=False)

    def prepared(self) -> "PreparedEdgeField | EdgeField":
        if self.thin:
            return self
        axis, end = divmod(SIDES.index(self.side), 2)
        number = lambda x: jnp.asarray(x, self.surface.dtype)
        start, step = (1.0, -1.0) if self.turned else (0.0, 1.0)
        ribbon = ribbon_of(self.surface.prepared(), axis, end)
        return PreparedEdgeField(ribbon, number(start), number(step), number(1.0 - 2 * axis))

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        if not self.thin:
            return self.prepared().normal(share)
        along = 1 - share if self.turned else share
        axis, end = divmod(SIDES.index(self.side), 2)
        place = (jnp.asarray(float(end), share.dtype), along)[:: 1 - 2 * axis]
        return normal_at(self.surface, *(carried(x, (0.0, 1.0), d) for x, d in zip(place, self.surface.domain, strict=True)))

    @property
    def curved(self) -> bool:
        return not self.thin

    def curvature(self, share: Float[Array, ""]) -> Float[Array, ""]:
        return self.prepared().curvature(share)


class PreparedEdgeField(AbstractEdgeField):
    """An `EdgeField` by the ribbon of its side, at start + step · share; sign: of S_u × S_v by across × along."""

    ribbon: AbstractRibbon
    start: Float[Array, ""]
    step: Float[Array, ""]
    sign: Float[Array, ""]

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        (_, across), (along, _) = value_and_slope(self.ribbon.at, self.start + self.step * share)
        return self.sign * unit(jnp.cross(across, along))

    @property
    def curved(self) -> bool:
        return True

    def curvature(self, share: Float[Array, ""]) -> Float[Array, ""]:
        place = self.start + self.step * share
        (_, across), (along, mixed), (twice, _) = with_two_slopes(self.ribbon.at, place)
        normal = self.sign * unit(jnp.cross(across, along))
        return curvature_across(normal, along, across, twice, mixed, self.ribbon.bend(place))


def curvature_across(
    normal: Float[Array, "3"],
    along: Float[Array, "3"],
    across: Float[Array, "3"],
    twice_along: Float[Array, "3"],
    mixed: Float[Array, "3"],
    twice_across: Float[Array, "3"],
) -> Float[Array, ""]:
    """The normal curvature across a side by first and second derivatives, in the direction b = M × t = α S_t + β Y."""
    t = unit(along)
    beta = divide(jnp.ones_like(t[0]), across @ jnp.cross(normal, t))
    alpha = -divide(beta * (across @ t), norm(along))
    return (alpha * alpha * twice_along + 2 * alpha * beta * mixed + beta * beta * twice_across) @ normal


@register
class CurvatureField(AbstractEdgeField):
    """A field of normals with the normal curvature across the side: the first coordinate of a curve whose domain runs over
    the side, or a function of the parameter over `domain`."""

    field: AbstractEdgeField
    values: AbstractCurve | Callable[[Any], Any]
    domain: tuple[Any, Any] | None = None

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        return self.field.normal(share)

    @property
    def curved(self) -> bool:
        return True

    def curvature(self, share: Float[Array, ""]) -> Float[Array, ""]:
        if isinstance(self.values, AbstractCurve):
            return self.values.point(carried(share, (0.0, 1.0), self.values.domain))[0]
        assert self.domain is not None
        return jnp.asarray(self.values(carried(share, (0.0, 1.0), self.domain)), share.dtype)


@register
class SeamField(AbstractEdgeField):
    """Polynomials one after another: Bernstein vectors (pieces, degree + 1, 3), shares (pieces + 1,), and a weight.

    bends: Bernstein coefficients (pieces, degree + 1) of the normal curvature across, or None.
    """

    vectors: Float[Array, "p d 3"]
    shares: Float[Array, "q"]
    held: Float[Array, ""]
    bends: Float[Array, "p d"] | None = None

    @property
    def weight(self) -> Float[Array, ""]:
        return self.held

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        return self._at(self.vectors, share)

    @property
    def curved(self) -> bool:
        return self.bends is not None

    def curvature(self, share: Float[Array, ""]) -> Float[Array, ""]:
        assert self.bends is not None
        return self._at(self.bends[..., None], share)[0]

    def _at(self, coefficients: Float[Array, "p d w"], share: Float[Array, ""]) -> Float[Array, "w"]:
        powers = jnp.asarray(_powers(coefficients.shape[1] - 1), share.dtype)
        rows = jnp.einsum("kd,pdx->pkx", powers, coefficients, precision="highest")
        if len(rows) == 1:
            return horner(2 * share - 1, rows[0])
        piece = jnp.sum(share > self.shares[1:-1])
        first, last = self.shares[piece], self.shares[piece + 1]
        return horner(2 * (share - first) / (last - first) - 1, rows[piece])


def bernstein(t: Float[Array, "*n"], degree: int) -> Float[Array, "*n d"]:
    """The Bernstein polynomials of a degree."""
    x = 2 * t - 1
    powers = [jnp.ones_like(x), x]
    for _ in range(2, degree + 1):
        powers.append(powers[-1] * x)
    return jnp.matmul(jnp.stack(powers, axis=-1), jnp.asarray(_powers(degree), t.dtype), precision="highest")


@cache
def _powers(degree: int) -> Float[np.ndarray, "d d"]:
    """Bernstein polynomials by powers of 2t − 1 (power, polynomial); exact."""
    half = (np.polynomial.Polynomial([0.5, 0.5]), np.polynomial.Polynomial([0.5, -0.5]))
    found = [math.comb(degree, k) * half[0] ** k * half[1] ** (degree - k) for k in range(degree + 1)]
    return np.stack([p.coef for p in found], axis=1)


@register
class GivenField(AbstractEdgeField):
    """Normals by the caller: `function(t)` of the parameter along the side, over `domain`."""

    function: Callable[[Any], Any]
    domain: tuple[Any, Any]

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        a, b = self.domain
        return jnp.asarray(self.function((1 - share) * a + share * b), share.dtype)


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
        return EdgeField(given[0], given[1], bool(given[2]) if len(given) == 3 else _runs_back(given, surface, side))
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


def _runs_back(given: tuple[Any, str], surface: AbstractSurface, side: str) -> bool:
    """Whether a neighbour's side runs against this one; refuses one that is not the same curve at equal shares."""
    if not is_concrete((given[0], surface)):
        return False
    at = np.linspace(0, 1, 9)
    own, other = (points_on(shape, name, at) for shape, name in ((surface, side), given))
    straight, back = (float(np.abs(own - points).max()) for points in (other, other[::-1]))
    size = float(np.ptp(own, axis=0).max())
    if min(straight, back) > max(1e-6, 1e3 * eps(surface.dtype)) * size:
        raise InputError(
            f"`{side}` must be given by a side that is the same curve at equal shares, but {given[1]} of that surface is "
            f"{min(straight, back):.3g} off; give another side, one with the same parameters, or normals as a function."
        )
    return back < straight


def points_on(surface: AbstractSurface, side: str, shares: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
    """Points on a known side at shares of it."""
    axis, end = divmod(SIDES.index(side), 2)
    first, last = (float(x) for x in surface.domain[1 - axis])
    run, fixed = first + (last - first) * shares, np.full(len(shares), float(surface.domain[axis][end]))
    u, v = (fixed, run) if axis == 0 else (run, fixed)
    return np.asarray(surface(u, v))


def given_fields(surface: Any, given: dict[str, Any]) -> tuple[AbstractEdgeField | None, ...]:
    """The fields of all four sides, of the surface's type; refuses what is no surface, and sides that are all left out."""
    if not isinstance(surface, AbstractSurface):
        raise InputError(f"`surface` must be a surface, got {type(surface).__name__}.")
    fields = as_type(tuple(as_edge_field(given[side], surface, side) for side in SIDES), surface.dtype)
    if all(field is None for field in fields):
        raise InputError("At least one of `u0`, `u1`, `v0`, `v1` must give the normals along its side, got none.")
    return fields


def with_curvature(field: AbstractEdgeField, given: Any, surface: AbstractSurface, side: str) -> AbstractEdgeField:
    """A field with curvatures across: a number, numbers (n,) at even shares of the side, or a function of the parameter."""
    if callable(given):
        return CurvatureField(field, given, surface.domain[1 if side[0] == "u" else 0])
    values = as_float(given, surface.dtype)
    if values.shape == ():
        values = jnp.broadcast_to(values, (2,))
    if values.ndim != 1 or values.shape[0] < 2:
        raise InputError(
            f"`curvature` of {side} must be a number, numbers (n,) at even shares of the side, or a function of the "
            f"parameter, got shape {values.shape}."
        )
    return CurvatureField(field, _through(jnp.stack([values, jnp.zeros_like(values), jnp.zeros_like(values)], axis=1)))


def _through(normals: Float[Array, "n 3"]) -> AbstractCurve:
    count = normals.shape[0]
    if count < 4:
        return (
            BSplineCurve(normals, clamped_knots(count, count - 1), count - 1)
            if count == 2
            else interpolate(normals, 2, parameters="uniform")
        )
    return interpolate(normals, 3, parameters="uniform")
