"""Points of surfaces together with their partial derivatives, and derivatives of any order."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, map_points
from .._errors import InputError
from .._safe import unit
from ..curve import AbstractCurve
from ..surface import AbstractSurface, BSplineSurface
from ._cell_polynomials import cell_count, cell_polynomials

PARTIALS_CHUNK = 1_000
"""Points differentiated together: three to six results per point fill the caches with fewer points."""


class Partials(eqx.Module):
    """Points S and the first partial derivatives S_u, S_v, each (..., 3)."""

    point: Float[Array, "*batch 3"]
    u: Float[Array, "*batch 3"]
    v: Float[Array, "*batch 3"]

    @property
    def normal(self) -> Float[Array, "*batch 3"]:
        """Unit normals along S_u × S_v; 0 where that vanishes (`js.normal` gives the limit there)."""
        return unit(jnp.cross(self.u, self.v))


class Partials2(eqx.Module):
    """Points S with the first and second partial derivatives S_u, S_v, S_uu, S_uv, S_vv, each (..., 3)."""

    point: Float[Array, "*batch 3"]
    u: Float[Array, "*batch 3"]
    v: Float[Array, "*batch 3"]
    uu: Float[Array, "*batch 3"]
    uv: Float[Array, "*batch 3"]
    vv: Float[Array, "*batch 3"]


def derivative(shape: AbstractCurve | AbstractSurface, *arguments: Any, order: Any = None) -> Array:
    """Derivatives of a curve, `derivative(curve, u, order)`, or surface, `derivative(surface, u, v, order)`.

    The order of a curve is a whole number ≥ 0 (default 1), that of a surface a pair: times by u, times by v
    (default (1, 0)). At breaks the derivative is that from the right. Parameters have any shape and are
    broadcast; result (..., 3).
    """
    is_curve = isinstance(shape, AbstractCurve)
    count = 1 if is_curve else 2
    orders = [*arguments[count:], *([] if order is None else [order])]
    if len(arguments) < count or len(orders) > 1:
        call = "derivative(curve, u, order)" if is_curve else "derivative(surface, u, v, order)"
        raise InputError(
            f"A {type(shape).__name__} is differentiated by `{call}`, got {len(arguments)} arguments after it"
            + (" and `order`." if order is not None else ".")
        )
    if is_curve:
        return shape.derivative(arguments[0], *orders)
    return shape.derivative(arguments[0], arguments[1], *orders)


def partials(surface: AbstractSurface, u: Numbers, v: Numbers) -> Partials:
    """Points and both first partial derivatives in one pass; what they share is computed once.

    u and v are broadcast against each other; every field is (..., 3). At breaks the derivatives are those
    from the right.
    """
    u, v = as_float(u, surface.dtype), as_float(v, surface.dtype)
    if isinstance(surface, BSplineSurface) and np.prod(np.broadcast_shapes(u.shape, v.shape)) >= cell_count(surface):
        return _many_partials(surface, u, v)
    return map_points(partials_at, surface, u, v, chunk=PARTIALS_CHUNK)


@eqx.filter_jit
def _many_partials(surface: BSplineSurface, u: Float[Array, "*#batch"], v: Float[Array, "*#batch"]) -> Partials:
    """From the polynomials of the knot cells: for more points than cells it is twice as fast to have them."""
    at = lambda cells, s, t: Partials(*cells.partials(s, t))
    return map_points(at, cell_polynomials(surface), u, v, chunk=PARTIALS_CHUNK)


def second_partials(surface: AbstractSurface, u: Numbers, v: Numbers) -> Partials2:
    """Points, both first and all three second partial derivatives in one pass; fields (..., 3)."""
    u, v = as_float(u, surface.dtype), as_float(v, surface.dtype)
    return map_points(second_partials_at, surface, u, v, chunk=PARTIALS_CHUNK)


def partials_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Partials:
    """`partials` at one pair of parameters, for use inside traced code."""
    one = jnp.ones_like(u)
    # Nested, not side by side: the compiler then shares the work (bicubic, 1.5 times as fast as three calls;
    # side by side the sums were computed three times over).
    row = lambda s: jax.jvp(lambda t: surface.point(s, t), (v,), (one,))
    (point, along_v), (along_u, _) = jax.jvp(row, (u,), (one,))
    return Partials(point, along_u, along_v)


def second_partials_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Partials2:
    """`second_partials` at one pair of parameters, for use inside traced code."""
    one = jnp.ones_like(u)
    first = lambda s, t: jax.jvp(lambda w: surface.point(s, w), (t,), (one,))
    row = lambda s: jax.jvp(lambda t: first(s, t), (v,), (one,))
    twice = lambda s: jax.jvp(row, (s,), (one,))
    (at, by_u), (_, by_uu) = jax.jvp(twice, (u,), (one,))
    (point, along_v), (_, vv) = at
    (along_u, uv), _ = by_u
    (uu, _), _ = by_uu
    return Partials2(point, along_u, along_v, uu, uv, vv)
