"""Curves that run side by side, with one parameter."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._arguments import as_type
from .._errors import InputError
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._alike import prepared_alike
from ._guides import carried, join_breaks, same_domain


class Family(eqx.Module):
    """Curves over one domain; the domain of each is carried to it evenly."""

    curves: tuple[AbstractCurve, ...]
    domain: tuple[Any, Any]

    def prepared(self) -> "PreparedFamily":
        """The family with its curves prepared, those of one kind as one."""
        return PreparedFamily(self.curves, self.domain, *prepared_alike(self.curves))

    def points(self, t: Float[Array, ""]) -> Float[Array, "n 3"]:
        """The point of each curve at the common parameter."""
        return jnp.stack([self._point(curve, t) for curve in self.curves])

    def _point(self, curve: Any, t: Float[Array, ""]) -> Float[Array, "3"]:
        return curve.point(carried(t, self.domain, curve.domain))

    def rows(self, t: Float[Array, "m"]) -> Float[Array, "m n 3"]:
        """The points at many parameters."""
        return jax.vmap(self.points)(t)

    def breaks(self) -> Any:
        """Where a curve is not smooth, and the ends of the domain, in the common parameter."""
        places = None
        for curve in self.curves:
            own = breaks(curve)
            own = own if same_domain(curve.domain, self.domain) else carried(jnp.asarray(own), curve.domain, self.domain)
            places = own if places is None else join_breaks(places, own)
        return places


class PreparedFamily(Family):
    """A family with its curves prepared: each, and all of them stacked if they are of one kind."""

    ready: tuple[Any, ...]
    together: Any

    def prepared(self) -> "PreparedFamily":
        return self

    def points(self, t: Float[Array, ""]) -> Float[Array, "n 3"]:
        if self.together is None:
            return jnp.stack([self._point(curve, t) for curve in self.ready])
        return eqx.filter_vmap(lambda curve: self._point(curve, t))(self.together)


def given_curves(curves: Any, name: str, least: int) -> tuple[AbstractCurve, ...]:
    """The curves of an argument, at least so many and all in space."""
    if not isinstance(curves, Sequence):
        raise InputError(f"`{name}` must be a sequence of at least {least} curves, got {type(curves).__name__}.")
    if len(curves) < least:
        raise InputError(f"`{name}` must be at least {least} curves, got {len(curves)}.")
    for i, curve in enumerate(curves):
        check_curve(curve, f"{name}[{i}]")
    return tuple(curves)


def check_curve(curve: Any, name: str) -> None:
    """Refuse what is no curve in space."""
    if not isinstance(curve, AbstractCurve):
        raise InputError(f"`{name}` must be a curve, got {type(curve).__name__}.")
    if eqx.filter_eval_shape(curve.point, jnp.zeros((), curve.dtype)).shape != (3,):
        raise InputError(f"`{name}` must be a curve in space, got one in a parameter plane.")


def of_one_type(shapes: Any) -> Any:
    """The shapes with all their arrays of the widest floating type among them."""
    types = [leaf.dtype for leaf in jax.tree.leaves(shapes) if eqx.is_inexact_array(leaf)]
    return as_type(shapes, max(types, key=lambda dtype: jnp.finfo(dtype).bits))
