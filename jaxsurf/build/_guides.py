"""One guide, or two that run side by side, and what sweeps ask of them at a place."""

import math
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._registry import register
from .._safe import norm, unit
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._alike import prepared_alike

_MEET = 1e-9  # chords shorter than this share of their change over the whole guide have the direction of the change


@register
class Guides(eqx.Module):
    """Guides with one parameter v, over the domain of the first one; the second's own parameter follows evenly.

    meet: whether the guides may meet somewhere, so that the chord's direction must come from its change there.
    """

    curves: tuple[AbstractCurve, ...]
    meet: bool = eqx.field(static=True, default=True)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.curves[0].domain

    @property
    def dtype(self) -> Any:
        return self.curves[0].dtype

    def prepared(self) -> "PreparedGuides":
        """The same guides, prepared for many points."""
        curves, together = prepared_alike(self.curves)
        return PreparedGuides(curves, self.meet, together)

    def at(self, v: Float[Array, ""]) -> "Station":
        """What there is to know at one parameter, inside traced code."""
        return Station(self, v)

    def share(self, v: Float[Array, ""]) -> Float[Array, ""]:
        """Where v lies in the domain, from 0 to 1."""
        a, b = self.domain
        return (v - a) / (b - a)

    def first_order(self, v: Float[Array, ""]) -> list[tuple[Float[Array, "3"], Float[Array, "3"]]]:
        """Points and derivatives of all guides at the common parameter."""
        return [self._first_order(curve, v) for curve in self.curves]

    def _first_order(self, curve: Any, v: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        point = curve.point if curve is self.curves[0] else lambda t: curve.point(carried(t, self.domain, curve.domain))
        return value_and_slope(point, v)

    def breaks(self) -> Any:
        """Where a guide is not smooth, and the ends of the domain, in the common parameter."""
        own = breaks(self.curves[0])
        if len(self.curves) == 1:
            return own
        other = carried(jnp.asarray(breaks(self.curves[1])), self.curves[1].domain, self.domain)
        return join_breaks(own, other)


class PreparedGuides(Guides):
    """Guides of prepared curves; together: both stacked, if they are of one kind."""

    together: Any = None

    def prepared(self) -> "PreparedGuides":
        return self

    def first_order(self, v: Float[Array, ""]) -> list[tuple[Float[Array, "3"], Float[Array, "3"]]]:
        if self.together is None:
            return super().first_order(v)
        points, slopes = eqx.filter_vmap(lambda curve: self._first_order(curve, v))(self.together)
        return [(points[i], slopes[i]) for i in range(len(self.curves))]


def join_breaks(one: Any, other: Any) -> Any:
    """Breaks of both, in order; those of known shapes without repetitions, nor such that differ by rounding."""
    both = (one, other)
    if not is_concrete(both):
        return jnp.sort(jnp.concatenate([jnp.asarray(x) for x in both]))
    places = np.unique(np.concatenate([concrete(x) for x in both]))
    apart = np.diff(places) > 1e-12 * (places[-1] - places[0])
    return places[np.append(True, apart)]


class Station:
    """Guides at one parameter: each value is traced when it is asked for, and once."""

    def __init__(self, guides: Guides, v: Float[Array, ""]):
        self.guides, self.v = guides, v

    @cached_property
    def _first_order(self) -> list[tuple[Array, Array]]:
        return self.guides.first_order(self.v)

    @property
    def positions(self) -> list[Float[Array, "3"]]:
        return [position for position, _ in self._first_order]

    @property
    def velocities(self) -> list[Float[Array, "3"]]:
        """Derivatives by the common parameter."""
        return [velocity for _, velocity in self._first_order]

    @cached_property
    def acceleration(self) -> Float[Array, "3"]:
        """The second derivative of the first guide."""
        return value_and_slope(lambda t: Station(self.guides, t).velocities[0], self.v)[1]

    @cached_property
    def tangent(self) -> Float[Array, "3"]:
        """The unit tangent of the first guide."""
        return unit(self.velocities[0])

    @cached_property
    def chord(self) -> Float[Array, "3"]:
        """From the first guide to the second."""
        return self.positions[1] - self.positions[0]

    @cached_property
    def chord_direction(self) -> Float[Array, "3"]:
        """The unit chord; where the guides meet, its limit from inside."""
        if not self.guides.meet:
            return unit(self.chord)
        a, b = self.guides.domain
        late = self.guides.share(self.v) > 0.5
        end = jnp.where(late, b, a).astype(self.v.dtype)
        # the chord is (v − end) times the mean of its change: so its slope is right too, and its bend
        nodes = jnp.asarray([-1, 1], self.v.dtype) / math.sqrt(3)
        places = end + (1 + nodes) / 2 * (self.v - end)
        change = jnp.mean(jax.vmap(lambda v: jnp.subtract(*Station(self.guides, v).velocities[::-1]))(places), axis=0)
        change = jnp.where(late, -change, change) * (b - a)
        meets = norm(self.chord) <= _MEET * norm(change)
        return unit(jnp.where(meets, change, self.chord))

    @property
    def chord_length(self) -> Float[Array, ""]:
        """The length of the chord; its slope is right where the guides meet."""
        return self.chord @ self.chord_direction


def value_and_slope(f: Any, t: Float[Array, ""]) -> tuple[Any, Any]:
    """f(t) and f'(t) in forward mode; f may give a pytree."""
    return jax.jvp(f, (t,), (jnp.ones_like(t),))


def with_two_slopes(f: Any, t: Float[Array, ""]) -> tuple[Any, Any, Any]:
    """f(t), f'(t) and f''(t) in forward mode; f may give a pytree."""
    (value, slope), (_, bend) = value_and_slope(lambda x: value_and_slope(f, x), t)
    return value, slope, bend


def shares_of(
    u: Float[Array, "*n"], v: Float[Array, "*m"], domain: tuple[tuple[Any, Any], tuple[Any, Any]]
) -> tuple[Float[Array, "*n"], Float[Array, "*m"]]:
    """Both parameters of a surface as shares of its domain."""
    return carried(u, domain[0], (0.0, 1.0)), carried(v, domain[1], (0.0, 1.0))


def carried(t: Float[Array, "*n"], domain: tuple[Any, Any], other: tuple[Any, Any]) -> Float[Array, "*n"]:
    """Parameters of one domain, carried evenly to another one; its ends are met exactly."""
    if same_domain(domain, other):
        return t
    share = t
    if not same_domain(domain, (0.0, 1.0)):
        a, b = (jnp.asarray(end, t.dtype) for end in domain)
        share = (t - a) / (b - a)
    if same_domain(other, (0.0, 1.0)):
        return share
    a, b = (jnp.asarray(end, t.dtype) for end in other)
    return (1 - share) * a + share * b


def same_domain(one: tuple[Any, Any], other: tuple[Any, Any]) -> bool:
    """Whether domains are known to be one: the same object, or equal numbers."""
    return all(a is b or (isinstance(a, float) and isinstance(b, float) and a == b) for a, b in zip(one, other, strict=True))
