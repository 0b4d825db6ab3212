"""All partial derivatives up to some order at one parameter, for use inside traced code."""

from functools import singledispatch
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._derivative import PartialDerivative
from .._prepared import point_of
from ..basis import BSplineBasis
from ..curve import AbstractCurve, BSplineCurve
from ..surface import AbstractSurface, BSplineSurface
from ..surface._quaternion_integral import PreparedQISurface


@singledispatch
def jet(shape: Any, parameters: tuple[Float[Array, ""], ...], order: int) -> dict[tuple[int, ...], Float[Array, "d"]]:
    """Derivatives by multi-index: of a curve (i,) with i ≤ `order`, of a surface (i, j) with i + j ≤ `order`.

    Any shape by nested forward mode; polynomial splines by derivatives of their basis, which compiles several times
    faster and touches every control point once.
    """
    raise TypeError(f"`jet` expects a curve or a surface, got {type(shape).__name__}.")


@jet.register
def _(shape: AbstractCurve, parameters: tuple[Float[Array, ""], ...], order: int) -> dict:
    return _by_forward_mode(shape, parameters, [(i,) for i in range(order + 1)])


@jet.register
def _(shape: AbstractSurface, parameters: tuple[Float[Array, ""], ...], order: int) -> dict:
    indices = [(i, j) for i in range(order + 1) for j in range(order + 1 - i)]
    return _by_forward_mode(shape, parameters, indices)


@jet.register
def _(shape: BSplineCurve, parameters: tuple[Float[Array, ""], ...], order: int) -> dict:
    index, values = basis_derivatives(shape.basis, parameters[0], order)
    combined = values @ shape.control_points[index]
    return {(k,): combined[k] for k in range(order + 1)}


@jet.register
def _(shape: BSplineSurface, parameters: tuple[Float[Array, ""], ...], order: int) -> dict:
    u, v = parameters
    index_u, along_u = basis_derivatives(shape.basis_u, u, order)
    index_v, along_v = basis_derivatives(shape.basis_v, v, order)
    net = shape.control_points
    block = net.reshape(-1, 3)[index_u[:, None] * net.shape[1] + index_v[None, :]]
    table = jnp.einsum("ki,ild->kld", along_u, jnp.einsum("lj,ijd->ild", along_v, block))
    return {(k, l): table[k, l] for k in range(order + 1) for l in range(order + 1 - k)}


@jet.register
def _(shape: PreparedQISurface, parameters: tuple[Float[Array, ""], ...], order: int) -> dict:
    u, v = parameters
    return shape.derivatives(u, v, order)


def _by_forward_mode(shape: Any, parameters: tuple[Float[Array, ""], ...], indices: list[tuple[int, ...]]) -> dict:
    return {index: PartialDerivative(point_of, index)(shape, *parameters) for index in indices}


def basis_derivatives(basis: BSplineBasis, u: Float[Array, ""], order: int) -> tuple[Int[Array, "q"], Float[Array, "l q"]]:
    """Control points of the functions that do not vanish at `u`, and their values and derivatives up to `order`.

    Written with short vectors: it traces and compiles several times faster than `BSplineBasis.local` under forward mode,
    which in turn runs faster on values alone.
    """
    first, near, u = basis.near(u)
    f = lambda t: _values(near, basis.degree, t)
    table = []
    for _ in range(order + 1):
        table.append(f(u))
        f = lambda t, g=f: jax.jvp(g, (t,), (jnp.ones_like(t),))[1]
    return basis.control_index(first, jnp.arange(basis.degree + 1, dtype=jnp.int32)), jnp.stack(table)


def _values(near: Float[Array, "w"], degree: int, u: Float[Array, ""]) -> Float[Array, "q"]:
    """The NURBS Book, A2.2, a level at a time."""
    values = jnp.ones(1, u.dtype)
    for d in range(1, degree + 1):
        left, right = near[degree - d : degree], near[degree : degree + d]
        share = values / (right - left)
        values = jnp.pad((right - u) * share, (0, 1)) + jnp.pad((u - left) * share, (1, 0))
    return values
