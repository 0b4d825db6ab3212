"""Curvature, torsion and Frenet frame of curves."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._array import Numbers, as_float, eps, map_points
from .._errors import InputError
from .._safe import divide, norm, unit
from ..curve import AbstractCurve
from ._jets import jet


class FrenetFrame(eqx.Module):
    """Unit tangent, principal normal and binormal, right-handed, (..., 3); curvature and torsion, (...)."""

    tangent: Float[Array, "*batch 3"]
    normal: Float[Array, "*batch 3"]
    binormal: Float[Array, "*batch 3"]
    curvature: Float[Array, "*batch"]
    torsion: Float[Array, "*batch"]


def curve_curvature(curve: AbstractCurve, u: Numbers) -> Float[Array, "*batch"]:
    """κ = |C' × C''| / |C'|³ in 1 / length; of a curve of points (x, y) signed, positive where it turns left.

    In space κ ≥ 0; where it vanishes (a straight piece, an inflection) its gradient is 0. Where C' = 0 it is
    0. Source: do Carmo, Differential Geometry of Curves and Surfaces, §1-5.
    """
    return map_points(_curvature_at, curve, as_float(u, curve.dtype))


def torsion(curve: AbstractCurve, u: Numbers) -> Float[Array, "*batch"]:
    """τ = ⟨C' × C'', C'''⟩ / |C' × C''|² in 1 / length, positive for a right-handed helix.

    It is 0 where the curve is straight. Source: do Carmo, §1-5 (with the opposite sign of τ).
    """
    return frenet_frame(curve, u).torsion


def frenet_frame(curve: AbstractCurve, u: Numbers) -> FrenetFrame:
    """Frenet frame of a curve in space: tangent T = C'/|C'|, binormal B along C' × C'', normal N = B × T.

    Where the curve is straight, B is perpendicular to T and to the coordinate axis that is furthest from T;
    on both sides of an inflection N and B are opposite, as they are by definition. Where C' = 0, T is 0.
    Gradients are finite everywhere.
    """
    if eqx.filter_eval_shape(curve.point, jnp.zeros((), curve.dtype)).shape != (3,):
        raise InputError("`curve` must be a curve in space for a Frenet frame; give its points a third coordinate.")
    return map_points(_frame_at, curve, as_float(u, curve.dtype))


def _curvature_at(curve: AbstractCurve, u: Float[Array, ""]) -> Float[Array, ""]:
    point, first, second, _ = _derivatives(curve, u)
    if point.shape == (2,):
        return divide(jnp.cross(first, second), norm(first) ** 3)
    turn, _ = _turn(curve, point, first, second)
    return divide(norm(turn), norm(first) ** 3)


def _frame_at(curve: AbstractCurve, u: Float[Array, ""]) -> FrenetFrame:
    point, first, second, third = _derivatives(curve, u)
    turn, bent = _turn(curve, point, first, second)
    tangent = unit(first)
    axis = jnp.eye(3, dtype=u.dtype)[jax.lax.stop_gradient(jnp.argmin(jnp.abs(tangent)))]
    binormal = jnp.where(bent, unit(turn), unit(jnp.cross(tangent, axis)))
    return FrenetFrame(
        tangent,
        jnp.cross(binormal, tangent),
        binormal,
        divide(norm(turn), norm(first) ** 3),
        divide(jnp.sum(turn * third), jnp.sum(turn * turn)),
    )


def _turn(
    curve: AbstractCurve, point: Float[Array, "3"], first: Float[Array, "3"], second: Float[Array, "3"]
) -> tuple[Float[Array, "3"], Bool[Array, ""]]:
    """C' × C'' without the round-off that is all of it on a straight line, and whether there is more."""
    start, end = curve.domain
    length, speed = end - start, norm(first)
    turn = jnp.cross(first, second)
    bent = norm(turn) > 1024 * eps(turn.dtype) * speed * (norm(second) + speed / length + norm(point) / length**2)
    return jnp.where(bent, turn, 0), bent


def _derivatives(curve: AbstractCurve, u: Float[Array, ""]) -> tuple[Array, Array, Array, Array]:
    """The point, C', C'' and the third derivative."""
    derived = jet(curve, (u,), 3)
    return derived[(0,)], derived[(1,)], derived[(2,)], derived[(3,)]
