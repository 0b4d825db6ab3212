"""How far two tangent fields of a surface are from fitting together."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float, map_points
from .._errors import InputError
from ._quaternion_integral import QISurface


def closure_density(surface: Any, u: Numbers, v: Numbers, *, across: Any = None) -> Float[Array, "*batch 3"]:
    """G = ∂A/∂v − ∂B/∂u of the fields A along u and B along v, at parameters that are broadcast; 0 where they fit together.

    A = l(v) / (b − a) T of `surface`. B is the derivative of its initial curve, for all u, or, of a second QI surface
    `across` whose u runs along v, that surface's field. ∬ G is the difference of the two ways of integration. With
    A = l T it is l' T + l Wᵛ × T − m' T̃ − m W̃ᵘ × T̃, Wᵛ and W̃ᵘ the angular velocities.
    """
    _check(surface, across)
    return map_points(_density, (surface, across), as_float(u, surface.dtype), as_float(v, surface.dtype))


def closure_gap(surface: Any, u: Numbers, v: Numbers, *, across: Any = None) -> Float[Array, "*batch 3"]:
    """∬ G from the first corner to (u, v): what integration along v first and then u has more than u first and then v.

    Fields as in `closure_density`; without `across` it is the difference of `path="spine first"` and `path="u first"`. It
    vanishes for translation surfaces, and for surfaces of revolution with matched lengths. Source: paper 004, (6).
    """
    _check(surface, across)
    u, v = jnp.broadcast_arrays(as_float(u, surface.dtype), as_float(v, surface.dtype))
    (a, _), (c, _) = surface.domain
    first_u, first_v = jnp.broadcast_to(a, u.shape), jnp.broadcast_to(c, v.shape)
    gap = _along(surface, u, v) - _along(surface, u, first_v)
    return gap if across is None else gap + _along(across, v, first_u) - _along(across, v, u)


def _along(surface: QISurface, u: Float[Array, "*batch"], v: Float[Array, "*batch"]) -> Float[Array, "*batch 3"]:
    """∫ of the field from the first u."""
    integrated = surface.replace(path="spine first", angles=(surface.angle_u, surface.angle_v))
    return integrated(u, v) - surface.spine(v)


def _density(fields: tuple[Any, Any], u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
    surface, across = (None if field is None else field.surface for field in fields)  # as before they were prepared
    assert surface is not None
    change = jax.jvp(lambda t: _field(surface, u, t), (v,), (jnp.ones_like(v),))[1]
    if across is None:
        return change
    return change - jax.jvp(lambda s: _field(across, v, s), (u,), (jnp.ones_like(u),))[1]


def _field(surface: QISurface, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
    (a, b), _ = surface.domain
    return surface.length(v) / (b - a) * surface.direction(u, v)


def _check(surface: Any, across: Any) -> None:
    for name, shape in (("surface", surface), ("across", across)):
        if shape is not None and not isinstance(shape, QISurface):
            raise InputError(f"`{name}` must be a `QISurface`, got {type(shape).__name__}.")
