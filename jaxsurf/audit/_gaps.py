"""Gaps of position, tangent plane and curvature between two rims at known places, all in one compiled program."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._array import eps
from .._prepared import prepare
from .._safe import angle, divide, norm, unit
from ..differential import Partials2
from ..surface import AbstractSurface
from ._feet import Start, foot
from ._sides import AbstractPath, Place, partials_on


class Gaps(NamedTuple):
    """What is measured at every sample; `regular`: whether both surfaces have a tangent plane there."""

    parameters_a: Float[Array, "n 2"]
    parameters_b: Float[Array, "n 2"]
    points_a: Float[Array, "n 3"]
    points_b: Float[Array, "n 3"]
    tangents: Float[Array, "n 3"]
    g0: Float[Array, "n"]
    g1: Float[Array, "n"]
    curvature_a: Float[Array, "n"]
    curvature_b: Float[Array, "n"]
    regular: Bool[Array, "n"]
    reversed: Bool[Array, "n"]


class _Sheet(NamedTuple):
    """A surface at its rim: unit tangent of the rim, unit direction into the surface at a right angle to it, and the
    second derivative of the surface that way, whose part along the normal is the normal curvature."""

    along: Float[Array, "3"]
    inward: Float[Array, "3"]
    bend: Float[Array, "3"]


@eqx.filter_jit
def gaps(
    a: AbstractSurface,
    path_a: AbstractPath,
    shares_a: Float[Array, "n"],
    b: AbstractSurface,
    path_b: AbstractPath,
    shares_b: Float[Array, "n"],
) -> Gaps:
    """The gaps between places of two rims that belong to each other."""
    a, b = prepare((a, b))

    def one(s: Float[Array, ""], t: Float[Array, ""]) -> Gaps:
        at, other = path_a.at(s), path_b.at(t)
        return _gaps_at(a, at, partials_on(a, at), b, other, partials_on(b, other))

    return jax.vmap(one)(shares_a, shares_b)


@eqx.filter_jit
def gaps_at_feet(
    a: AbstractSurface,
    path_a: AbstractPath,
    shares_a: Float[Array, "n"],
    b: AbstractSurface,
    path_b: AbstractPath,
    start: Start,
) -> Gaps:
    """The gaps between places of the first rim and their feet on the second; no derivatives."""
    a, b = prepare((a, b))

    def one(s: Float[Array, ""], begin: Start) -> Gaps:
        at = path_a.at(s)
        second = partials_on(a, at)
        share, partials = foot(b, path_b, second.point.astype(b.dtype), begin)
        return _gaps_at(a, at, second, b, path_b.at(share), partials)

    return jax.vmap(one)(shares_a, start)


def _gaps_at(a: AbstractSurface, at: Place, in_a: Partials2, b: AbstractSurface, bt: Place, in_b: Partials2) -> Gaps:
    # Without the barrier the compiler works out the derivatives anew for each result.
    second_a, second_b = jax.lax.optimization_barrier((in_a, in_b))
    sheet_a, sheet_b = _sheet(second_a, at), _sheet(second_b, bt)
    turned = sheet_a.along @ sheet_b.along < 0
    # The sheets go on into each other where these are the same, and fold back where they are opposite.
    normal_a = jnp.cross(sheet_a.along, sheet_a.inward)
    normal_b = jnp.cross(jnp.where(turned, sheet_b.along, -sheet_b.along), sheet_b.inward)
    return Gaps(
        at.parameters,
        bt.parameters,
        second_a.point,
        second_b.point,
        sheet_a.along,
        norm(second_a.point - second_b.point),
        angle(normal_a, normal_b),
        sheet_a.bend @ normal_a,
        sheet_b.bend @ normal_b,
        _is_regular(a, second_a) & _is_regular(b, second_b),
        turned,
    )


def _sheet(second: Partials2, place: Place) -> _Sheet:
    by = lambda way: way[0] * second.u + way[1] * second.v
    along = by(place.along)
    way = place.inward - divide(by(place.inward) @ along, along @ along) * place.along
    across = by(way)
    bend = way[0] ** 2 * second.uu + 2 * way[0] * way[1] * second.uv + way[1] ** 2 * second.vv
    return _Sheet(unit(along), unit(across), divide(bend, across @ across))


def _is_regular(surface: AbstractSurface, second: Partials2) -> Bool[Array, ""]:
    """Whether neither partial derivative vanishes against the other and they are not parallel."""
    (a, b), (c, d) = surface.domain
    along_u, along_v = norm(second.u) * (b - a), norm(second.v) * (d - c)
    area = norm(jnp.cross(second.u, second.v)) * (b - a) * (d - c)
    close = 100 * eps(area.dtype) ** 0.75
    least, most = jnp.minimum(along_u, along_v), jnp.maximum(along_u, along_v)
    return (least > close * most) & (area > 10 * eps(area.dtype) ** 0.5 * along_u * along_v)
