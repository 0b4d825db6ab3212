"""Curvature of surfaces."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float, eps
from .._safe import arctan2, divide, norm, unit
from ..surface import AbstractSurface
from ._normal import inward_way, is_degenerate, normal_at, quick_partials_at, where_degenerate
from ._partials import Partials, Partials2, second_partials_at


class Curvature(eqx.Module):
    """Curvatures in 1 / length, positive where the surface bends towards its normal S_u × S_v.

    principal: (..., 2), the smaller first; directions: (..., 2, 3), the unit tangent of each, orthogonal to
    each other; mean: (...), their half sum; gaussian: (...), their product.
    """

    principal: Float[Array, "*batch 2"]
    directions: Float[Array, "*batch 2 3"]
    mean: Float[Array, "*batch"]
    gaussian: Float[Array, "*batch"]


def curvature(surface: AbstractSurface, u: Numbers, v: Numbers) -> Curvature:
    """Principal curvatures and directions, mean and Gaussian curvature; u and v are broadcast.

    A sphere of radius R with outward normals has principal curvatures −1/R. With the second form's matrix
    [[p, q], [q, r]] in an orthonormal tangent frame, H = (p + r)/2, K = pr − q² and the principal ones H ∓
    |((p − r)/2, q)|: nothing cancels where they are equal. There (an umbilic) the directions are the frame,
    the first along S_u, and their gradients and that of the difference are 0; H and K are smooth. At a pole
    or a shrunk edge all are extrapolated from inside the domain, good to about 1e-9 in f64 and 1e-2 in f32;
    where they have no limit (the apex of a cone) the result is finite and means nothing. Source: do Carmo,
    Differential Geometry of Curves and Surfaces, §3-2 and §3-3.
    """
    u, v = jnp.broadcast_arrays(as_float(u, surface.dtype), as_float(v, surface.dtype))
    return where_degenerate(_direct_at, _limit_at, surface, u, v)


def curvature_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Curvature:
    """`curvature` at one regular pair of parameters, for use inside traced code; meaningless at poles."""
    return _direct_at(surface, u, v)[0]


def _direct_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> tuple[Curvature, Array]:
    # Without the barriers here and below the compiler works everything out anew for each result, 5 times as slow.
    second = jax.lax.optimization_barrier(second_partials_at(surface, u, v))
    first = Partials(second.point, second.u, second.v)
    return _from_matrix(*_matrix(second)), is_degenerate(surface, first)


def _matrix(second: Partials2) -> tuple[Array, Array, Array, Array, Array]:
    """An orthonormal tangent frame, its first vector along S_u, and p, q, r of the second form in it."""
    n = unit(jnp.cross(second.u, second.v))
    along = unit(second.u)
    across = jnp.cross(n, along)
    # S_u = l·along, S_v = f·along + g·across: the second form in this frame by two substitutions
    l, f, g = norm(second.u), jnp.sum(second.v * along), jnp.sum(second.v * across)
    uu, uv, vv = (jnp.sum(s * n) for s in (second.uu, second.uv, second.vv))
    p = divide(uu, l * l)
    q = divide(divide(uv, l) - f * p, g)
    r = divide(vv - 2 * f * divide(uv, l) + f * f * p, g * g)
    return along, across, p, q, r


def _from_matrix(
    along: Float[Array, "3"],
    across: Float[Array, "3"],
    p: Float[Array, ""],
    q: Float[Array, ""],
    r: Float[Array, ""],
) -> Curvature:
    """All curvatures from the symmetric matrix [[p, q], [q, r]] in an orthonormal tangent frame."""
    along, across, p, q, r = jax.lax.optimization_barrier((along, across, p, q, r))
    mean, half = (p + r) / 2, (p - r) / 2
    size = jnp.abs(p) + jnp.abs(q) + jnp.abs(r)
    umbilic = jnp.maximum(jnp.abs(half), jnp.abs(q)) <= 64 * eps(p.dtype) * size
    half, q_or_0 = jnp.where(umbilic, 0, half), jnp.where(umbilic, 0, q)
    difference = norm(jnp.stack([half, q_or_0]))
    turn = arctan2(q_or_0, half) / 2
    cos, sin = jax.lax.optimization_barrier((jnp.cos(turn), jnp.sin(turn)))
    larger, smaller = cos * along + sin * across, sin * along - cos * across
    return Curvature(jnp.stack([mean - difference, mean + difference]), jnp.stack([smaller, larger]), mean, p * r - q * q)


def _limit_at(surface: AbstractSurface, u: Float[Array, ""], v: Float[Array, ""]) -> Curvature:
    """Curvatures from the shape tensor κ₁ d₁d₁ᵀ + κ₂ d₂d₂ᵀ, smooth across a pole, by extrapolation."""
    step_u, step_v = inward_way(surface, u, v)
    # Round-off grows like eps / distance², the error of the extrapolation like distance⁵.
    steps = eps(u.dtype) ** (1 / 5) * jnp.arange(1, 6, dtype=u.dtype)

    def shape_tensor(t: Float[Array, ""]) -> Float[Array, "3 3"]:
        along, across, p, q, r = _matrix(quick_partials_at(surface, u + t * step_u, v + t * step_v))
        frame = jnp.stack([along, across])
        return frame.T @ jnp.stack([jnp.stack([p, q]), jnp.stack([q, r])]) @ frame

    weights = jnp.asarray([5, -10, 10, -5, 1], u.dtype)
    tensor = jnp.tensordot(weights, jax.vmap(shape_tensor)(steps), axes=1)
    n = normal_at(surface, u, v)
    axes = jnp.eye(3, dtype=n.dtype)
    along = unit(jnp.cross(n, axes[jax.lax.stop_gradient(jnp.argmin(jnp.abs(n)))]))
    across = jnp.cross(n, along)
    p, q, r = (a @ tensor @ b for a, b in ((along, along), (along, across), (across, across)))
    return _from_matrix(along, across, p, q, r)
