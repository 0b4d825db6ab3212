"""Unit normals, also where the parametrisation is degenerate."""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, eps, is_concrete, map_points
from .._safe import divide, norm, unit
from ..surface import AbstractSurface
from ._jets import jet
from ._partials import PARTIALS_CHUNK, Partials, Partials2, partials_at

Result = TypeVar("Result")


def normal(surface: AbstractSurface, u: Numbers, v: Numbers) -> Float[Array, "*batch 3"]:
    """Unit normals S_u × S_v / |S_u × S_v|, (..., 3) for u and v broadcast against each other.

    Where S_u × S_v vanishes (a pole, an apex, an edge shrunk to a point) the result is the limit from inside the
    domain: with C(t) = S_u × S_v on the way from there into the domain, the first of C'(0), C''(0) that does not
    vanish. The way leaves a degenerate edge straight, so the limit at the apex of a cone is that of its ruling;
    from other points it leads to the middle of the domain. If C'' vanishes too, the result is 0. Gradients are
    finite everywhere.
    """
    u, v = jnp.broadcast_arrays(as_float(u, surface.dtype), as_float(v, surface.dtype))
    return where_degenerate(_direct_at, _limit_at, surface, u, v)


def normal_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
    """`normal` at one pair of parameters, for use inside traced code; works out the limit at every point."""
    return _limit_at(surface, u, v)


def where_degenerate(
    direct: Callable[..., tuple[Result, Array]],
    limit: Callable[..., Result],
    surface: AbstractSurface,
    u: Float[Array, "*b"],
    v: Float[Array, "*b"],
) -> Result:
    """`direct` at all points, which also says where it fails, and there, if anywhere, `limit`."""
    found, failed = map_points(direct, surface, u, v, chunk=PARTIALS_CHUNK)

    def mended() -> Result:
        limits = map_points(limit, surface, u, v, chunk=PARTIALS_CHUNK)
        pick = lambda a, b: jnp.where(failed.reshape(failed.shape + (1,) * (a.ndim - failed.ndim)), a, b)
        return jax.tree.map(pick, limits, found)

    if is_concrete(failed):
        return mended() if concrete(failed).any() else found  # does not even compile what is not needed
    return jax.lax.cond(jnp.any(failed), mended, lambda: found)


def _direct_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> tuple[Float[Array, "3"], Array]:
    first = partials_at(surface, u, v)
    return unit(cross_product(first)), is_degenerate(surface, first)


def is_degenerate(surface: AbstractSurface, first: Partials) -> Array:
    """Whether S_u × S_v may be too small for a direction, against the larger partial and the domain."""
    (a, b), (c, d) = surface.domain
    along_u, along_v = norm(first.u) * (b - a), norm(first.v) * (d - c)
    area = norm(cross_product(first)) * (b - a) * (d - c)
    return area <= _closeness(area.dtype) * jnp.maximum(along_u, along_v) ** 2


def cross_product(first: Partials) -> Float[Array, "3"]:
    """S_u × S_v, whose length is the area per unit of the parameters."""
    return jnp.cross(first.u, first.v)


def inward_way(
    surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """The way from a degenerate point into the domain: its lengths in u and v, signed towards the middle.

    Along a whole degenerate edge S_u × S_v stays 0; the way leaves it at a right angle, in the parameters.
    """
    (a, b), (c, d) = surface.domain
    inwards = lambda t, start, end: jnp.where(t < (start + end) / 2, 1, -1) * (end - start)
    way_u, way_v = inwards(u, a, b).astype(u.dtype), inwards(v, c, d).astype(v.dtype)
    _, by_u, by_v = _slopes(surface, u, v)
    along_u, along_v = norm(by_u * way_u), norm(by_v * way_v)
    close = _closeness(u.dtype)
    way_u = jnp.where((along_u <= close * along_v) & (along_v > 0), 0, way_u)
    way_v = jnp.where((along_v <= close * along_u) & (along_u > 0), 0, way_v)
    return jax.lax.stop_gradient(way_u), jax.lax.stop_gradient(way_v)


def quick_partials_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Partials2:
    """`second_partials_at` for the few degenerate points: quick to compile instead of quick to run."""
    found = jet(surface, (u, v), 2)
    return Partials2(found[0, 0], found[1, 0], found[0, 1], found[2, 0], found[1, 1], found[0, 2])


def _slopes(
    surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """C = S_u × S_v and its partial derivatives."""
    second = quick_partials_at(surface, u, v)
    by_u = jnp.cross(second.uu, second.v) + jnp.cross(second.u, second.uv)
    by_v = jnp.cross(second.uv, second.v) + jnp.cross(second.u, second.vv)
    return jnp.cross(second.u, second.v), by_u, by_v


def _limit_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
    """The normal from the Taylor coefficients of C(t) = S_u × S_v on the way t into the domain."""
    step_u, step_v = inward_way(surface, u, v)

    def slope(t: Float[Array, ""]) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        value, by_u, by_v = _slopes(surface, u + t * step_u, v + t * step_v)
        return value, step_u * by_u + step_v * by_v

    value, first = slope(jnp.zeros_like(u))
    # At a distance δ from the degenerate point C = δ C'(0) + δ²/2 C''(0), so C / δ is C' at δ/2, without the
    # cancellation and with the right gradients. C'' by differences: third derivatives take long to compile.
    h = _closeness(u.dtype)
    back = -divide(jnp.sum(value * first), jnp.sum(first * first)) / 2
    _, (middle, near, far) = jax.vmap(slope)(jnp.stack([back, jnp.full_like(u, h), jnp.full_like(u, 2 * h)]))
    second = (4 * near - far - 3 * first) / (2 * h)
    regular = norm(value) > h * jnp.maximum(norm(first), h * norm(second))
    simple = norm(first) > h * norm(second)
    return unit(jnp.where(regular, value, jnp.where(simple, middle, second)))


def _closeness(dtype: jnp.dtype) -> float:
    # Further away C itself is good to eps / closeness, nearer the series is good to closeness²: equal at the
    # cube root.
    return eps(dtype) ** (1 / 3)
