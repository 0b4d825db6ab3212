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
from ._guides import carried, join_breaks

_STACKED = 5  # curves of one kind from which on they are evaluated as one: the program stays short


class Family(eqx.Module):
    """Curves over one domain; the domain of each is carried to it evenly."""

    curves: tuple[AbstractCurve, ...]
    domain: tuple[Any, Any]

    def prepared(self) -> "Family":
        """The family with its curves prepared."""
        return Family(tuple(curve.prepared() for curve in self.curves), self.domain)

    def points(self, t: Float[Array, ""]) -> Float[Array, "n 3"]:
        """The point of each curve at the common parameter."""
        if len(self.curves) < _STACKED or not _alike(self.curves):
            return jnp.stack([_at(curve, self.domain, t) for curve in self.curves])
        static = eqx.filter(self.curves[0], eqx.is_array, inverse=True)
        stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(eqx.filter(c, eqx.is_array) for c in self.curves))
        return jax.vmap(lambda curve: _at(eqx.combine(curve, static), self.domain, t))(stacked)

    def rows(self, t: Float[Array, "m"]) -> Float[Array, "m n 3"]:
        """The points at many parameters."""
        return jax.vmap(self.points)(t)

    def breaks(self) -> Any:
        """Where a curve is not smooth, and the ends of the domain, in the common parameter."""
        places = None
        for curve in self.curves:
            own = breaks(curve)
            own = own if _same(curve.domain, self.domain) else carried(jnp.asarray(own), curve.domain, self.domain)
            places = own if places is None else join_breaks(places, own)
        return places


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


def _at(curve: Any, domain: tuple[Any, Any], t: Float[Array, ""]) -> Float[Array, "3"]:
    return curve.point(t if _same(curve.domain, domain) else carried(t, domain, curve.domain))


def _same(one: tuple[Any, Any], other: tuple[Any, Any]) -> bool:
    """Whether domains are known to be one: the same object, or equal numbers."""
    return all(a is b or (isinstance(a, float) and isinstance(b, float) and a == b) for a, b in zip(one, other, strict=True))


def _alike(curves: tuple[Any, ...]) -> bool:
    """Whether curves differ in the values of their arrays alone."""
    arrays = [eqx.filter(curve, eqx.is_array) for curve in curves]
    statics = [jax.tree.flatten(eqx.filter(curve, eqx.is_array, inverse=True)) for curve in curves]
    kinds = {jax.tree.structure(each) for each in arrays}
    sizes = {tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(each)) for each in arrays}
    return len(kinds) == 1 and len(sizes) == 1 and all(static == statics[0] for static in statics)
