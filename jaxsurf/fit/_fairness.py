"""Geometric fairness: curvature variation, the same for every parametrisation, so that a circle stays a circle."""

from functools import singledispatch
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import _safe
from .._prepared import prepare
from ..basis import BSplineBasis
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve, QICurve
from ..differential import basis_derivatives, jet
from ..surface import AbstractSurface, BSplineSurface, QISurface
from ._bending import span_nodes
from ._normal_equations import KnotCells, derivatives_by_unknowns
from ._problem import Problem

_NODES = 3  # Gauss-Legendre nodes in each span


def fairness_terms(shape: Any, problem: Problem) -> tuple[Float[Array, ""], Float[Array, "P"], Float[Array, "P P"]]:
    """Value, gradient and Gauss-Newton matrix of ½ · fairness · (scale-free curvature variation).

    Of a curve: L³/(2π)⁴ ∫ |(dk/ds)_⊥|² ds, k the curvature vector. Of a surface: the analogue A/(2π)⁴ ∬ |∇II|² dA with the
    covariant derivative of the second fundamental form, which has no singularity at umbilics (Moreton, Séquin: Functional
    optimization for fair surface design, 1992, uses the principal directions). Length and area move with the shape: held
    fixed they would let it fall in energy by growing.
    """
    found = _variation(shape, problem)
    # rows r of the sum of squares grow with the size too: J + r sᵀ
    pull = jnp.outer(found.gradient, found.growth)
    more = jnp.outer(found.growth, found.growth)
    return (
        0.5 * problem.fairness * found.square,
        problem.fairness * (found.gradient + found.square * found.growth),
        problem.fairness * (found.matrix + pull + pull.T + found.square * more),
    )


class _Variation(NamedTuple):
    """|r|², Jᵀr and JᵀJ of the rows r, their size factor held fixed in J = ∂r/∂θ, and s, the gradient of its logarithm."""

    square: Float[Array, ""]
    gradient: Float[Array, "P"]
    matrix: Float[Array, "P P"]
    growth: Float[Array, "P"]


def curvature_variation(derivatives: dict[tuple[int, int], Float[Array, "3"]]) -> Float[Array, "4"]:
    """∇II in an orthonormal frame: the components 111, √3·112, √3·122, 222, from partial derivatives up to order 3.

    ∇_k h_ij = ⟨S_ijk, n⟩ − Γ^l_ij h_kl − Γ^l_jk h_il − Γ^l_ki h_jl, symmetric by Codazzi's equations.
    """
    d = derivatives
    first = jnp.stack([d[1, 0], d[0, 1]])
    second = jnp.stack([jnp.stack([d[2, 0], d[1, 1]]), jnp.stack([d[1, 1], d[0, 2]])])
    by_ones = [d[3, 0], d[2, 1], d[1, 2], d[0, 3]]
    third = jnp.stack([jnp.stack([jnp.stack([by_ones[i + j + k] for k in (0, 1)]) for j in (0, 1)]) for i in (0, 1)])
    normal = _safe.unit(jnp.cross(first[0], first[1]))
    h = second @ normal
    e1 = _safe.unit(first[0])
    e2 = jnp.cross(normal, e1)
    # contravariant components of the frame: e_a = Σ_i frame[a, i] S_i
    a, b, c = first[0] @ e1, first[1] @ e1, first[1] @ e2
    zero = jnp.zeros_like(a)
    frame = jnp.stack(
        [
            jnp.stack([_safe.divide(jnp.ones_like(a), a), zero]),
            jnp.stack([-_safe.divide(b, a * c), _safe.divide(jnp.ones_like(c), c)]),
        ]
    )
    inverse = frame.T @ frame
    christoffel = jnp.einsum("ijx,mx,ml->ijl", second, first, inverse)
    mixed = jnp.einsum("ijl,kl->ijk", christoffel, h)
    nabla = third @ normal - mixed - jnp.transpose(mixed, (1, 2, 0)) - jnp.transpose(mixed, (2, 0, 1))
    nabla = jnp.einsum("ai,bj,ck,ijk->abc", frame, frame, frame, nabla)
    root = jnp.sqrt(jnp.asarray(3.0, h.dtype))
    return jnp.stack([nabla[0, 0, 0], root * nabla[0, 0, 1], root * nabla[0, 1, 1], nabla[1, 1, 1]])


@singledispatch
def _variation(shape: Any, problem: Problem) -> _Variation:
    raise TypeError(f"`fairness` expects a curve or a surface, got {type(shape).__name__}.")


@_variation.register
def _(shape: AbstractCurve, problem: Problem) -> _Variation:
    nodes, weights = _curve_nodes(shape)

    def length(theta: Float[Array, "P"]) -> Float[Array, ""]:
        member = prepare(problem.member(theta))
        return weights @ jax.vmap(lambda t: _safe.norm(jet(member, (t,), 1)[1,]))(nodes)

    def residual(member: Any, t: Float[Array, ""], factor: Float[Array, ""]) -> Float[Array, "d"]:
        d = jet(member, (t,), 3)
        return factor * _curve_variation(d[1,], d[2,], d[3,])

    theta = problem.unknowns(shape)
    whole, growth = jax.value_and_grad(length)(theta)
    scale = jnp.sqrt(whole**3 / (2 * jnp.pi) ** 4 * weights)
    return _Variation(*_dense(residual, problem, theta, nodes, scale), 1.5 * growth / whole)


def _curve_variation(c1: Array, c2: Array, c3: Array) -> Array:
    """(dk/ds)_⊥ |C'|^½ by the parameter's derivatives."""
    square = c1 @ c1
    across = lambda x: x - c1 * _safe.divide(c1 @ x, square)
    bend, more = across(c2), across(c3)
    change = more - 3 * _safe.divide(c1 @ c2, square) * bend
    return _safe.divide(change, square * _safe.safe_sqrt(square)) * _safe.safe_sqrt(_safe.safe_sqrt(square))


def _curve_nodes(shape: Any) -> tuple[Array, Array]:
    if isinstance(shape, BSplineCurve | NURBSCurve | QICurve):
        return span_nodes(shape.basis, _NODES + 1)
    a, b = shape.domain
    knots = a + (b - a) * jnp.linspace(0, 1, 33, dtype=shape.dtype)
    return span_nodes(BSplineBasis(jnp.concatenate([knots[:1], knots, knots[-1:]]), 1), _NODES + 1)


@_variation.register
def _(shape: AbstractSurface, problem: Problem) -> _Variation:
    (u, weights_u), (v, weights_v) = _surface_nodes(shape)
    nodes = jnp.stack(jnp.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
    weights = (weights_u[:, None] * weights_v[None, :]).reshape(-1)

    def residual(member: Any, t: Float[Array, "2"], weight: Float[Array, ""]) -> Float[Array, "4"]:
        return _weighted(jet(member, (t[0], t[1]), 3), weight)

    def area(theta: Float[Array, "P"]) -> Float[Array, ""]:
        member = prepare(problem.member(theta))
        return weights @ jax.vmap(lambda t: _element(jet(member, (t[0], t[1]), 1)))(nodes)

    theta = problem.unknowns(shape)
    whole, growth = jax.value_and_grad(area)(theta)
    scale = weights * whole / (2 * jnp.pi) ** 4
    return _Variation(*_dense(residual, problem, theta, nodes, scale), 0.5 * growth / whole)


def _surface_nodes(shape: AbstractSurface) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    if isinstance(shape, QISurface):
        return span_nodes(shape.basis_u, _NODES), span_nodes(shape.basis_v, _NODES)
    (a, b), (c, d) = shape.domain
    return _even_nodes(a, b, shape.dtype), _even_nodes(c, d, shape.dtype)


def _even_nodes(a: Any, b: Any, dtype: Any) -> tuple[Array, Array]:
    knots = a + (b - a) * jnp.linspace(0, 1, 9, dtype=dtype)
    return span_nodes(BSplineBasis(jnp.concatenate([knots[:1], knots, knots[-1:]]), 1), _NODES)


def _dense(residual: Any, problem: Problem, theta: Array, nodes: Array, weights: Array) -> tuple[Array, Array, Array]:
    values, jacobian = jax.vmap(derivatives_by_unknowns(problem, theta, residual))(nodes, weights)
    values, jacobian = values.reshape(-1), jacobian.reshape(-1, theta.size)
    return values @ values, values @ jacobian, jacobian.T @ jacobian


@_variation.register
def _(shape: BSplineSurface, problem: Problem) -> _Variation:
    if problem.free != (True, False, False):
        return _variation.dispatch(AbstractSurface)(shape, problem)
    cells = KnotCells(shape)
    (u, weights_u), (v, weights_v) = span_nodes(cells.u, _NODES), span_nodes(cells.v, _NODES)
    derivatives = lambda basis, nodes: jax.vmap(lambda t: basis_derivatives(basis, t, 3)[1])(nodes)
    by_span = lambda x, count: x.reshape(count, _NODES, *x.shape[1:])
    along_u, along_v = (
        by_span(derivatives(cells.u, u), cells.count_u),
        by_span(derivatives(cells.v, v), cells.count_v),
    )
    weights_u, weights_v = by_span(weights_u, cells.count_u), by_span(weights_v, cells.count_v)
    indices = [(i, j) for i in range(4) for j in range(4 - i)]
    # table[cell, node, derivative, control point]
    table = jnp.stack([jnp.einsum("xai,ybj->xyabij", along_u[:, :, i], along_v[:, :, j]) for i, j in indices], axis=4)
    table = table.reshape(cells.count, _NODES**2, len(indices), cells.terms)
    weights = jnp.einsum("xa,yb->xyab", weights_u, weights_v).reshape(cells.count, _NODES**2)
    unpack = lambda x: dict(zip(indices, x, strict=True))

    def area(net: Float[Array, "u v 3"]) -> tuple[Float[Array, ""], Float[Array, "cells nodes jet 3"]]:
        jets = jnp.einsum("cndt,ctx->cndx", table, net.reshape(-1, 3)[cells.control_points()])
        return jnp.sum(weights * jax.vmap(jax.vmap(lambda x: _element(unpack(x))))(jets)), jets

    (whole, jets), growth = jax.value_and_grad(area, has_aux=True)(shape.control_points)
    residual = lambda x, w: _weighted(unpack(x), w)
    scaled = weights * whole / (2 * jnp.pi) ** 4
    both = lambda x, w: (residual(x, w), jax.jacfwd(residual)(x, w))
    values, by_jet = jax.vmap(jax.vmap(both))(jets, scaled)
    jacobian = jnp.einsum("cnrdx,cndt->cnrtx", by_jet, table).reshape(cells.count, -1, 3 * cells.terms)
    flat = values.reshape(cells.count, -1)
    gradient = jnp.einsum("cr,crp->cp", flat, jacobian)
    summed = cells.scatter(gradient, jnp.einsum("crp,crq->cpq", jacobian, jacobian))
    return _Variation(jnp.sum(values**2), *summed, 0.5 * growth.reshape(-1) / whole)


def _element(derivatives: dict) -> Float[Array, ""]:
    return _safe.norm(jnp.cross(derivatives[1, 0], derivatives[0, 1]))


def _weighted(derivatives: dict, weight: Float[Array, ""]) -> Float[Array, "4"]:
    return curvature_variation(derivatives) * _safe.safe_sqrt(weight * _element(derivatives))
