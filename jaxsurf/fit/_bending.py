"""Bending energy of a B-spline net: the quiet background of a fit, which holds what no point determines."""

from functools import singledispatch
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..basis import BSplineBasis
from ..curve import BSplineCurve, NURBSCurve
from ..differential import basis_derivatives
from ..surface import BSplineSurface, NURBSSurface


@singledispatch
def bending_matrix(shape: Any, sides: tuple[Any, ...]) -> Float[Array, "q q"] | None:
    """Matrix K of the quadratic form Σ_xyz cᵀKc in the control points, or `None` for shapes that have none.

    For a surface it is A ∬ |S_ss|² + 2|S_st|² + |S_tt|² ds dt over the sheet unrolled to `sides`, A its area; for a curve
    L³ ∫ |C_ss|² ds, L its length, the only one of `sides`: without unit but for length², like a mean squared distance. It is
    quadratic, and drags curved shapes flat where it is not weak. Of rational shapes it is that of the net.
    """
    return None


@bending_matrix.register(BSplineCurve)
@bending_matrix.register(NURBSCurve)
def _(shape: Any, sides: tuple[Any, ...]) -> Float[Array, "q q"] | None:
    a, b = shape.domain
    return (b - a) ** 3 * _grams(shape.basis)[2]


@bending_matrix.register(BSplineSurface)
@bending_matrix.register(NURBSSurface)
def _(shape: Any, sides: tuple[Any, ...]) -> Float[Array, "q q"] | None:
    total: Any = sum(weight * jnp.kron(in_u, in_v) for in_u, in_v, weight in bending_terms(shape, sides))
    return total


def bending_terms(shape: BSplineSurface | NURBSSurface, sides: tuple[Any, ...]) -> list[tuple[Array, Array, Any]]:
    """`bending_matrix` as a sum of Kronecker products: matrices along u and along v, and their weights."""
    u, v = _grams(shape.basis_u), _grams(shape.basis_v)
    (a, b), (c, d) = shape.domain
    # lengths per parameter: s = along_u · u
    along_u, along_v = sides[0] / (b - a), sides[1] / (d - c)
    area = sides[0] * sides[1]
    return [
        (u[2], v[0], area * (along_v / along_u**3)),
        (u[1], v[1], area * (2 / (along_u * along_v))),
        (u[0], v[2], area * (along_u / along_v**3)),
    ]


def bending_of(shape: Any, sides: tuple[Any, ...]) -> Float[Array, "q q"] | None:
    """`bending_matrix`, compiled."""
    return _compiled(shape, tuple(jnp.asarray(side, shape.dtype) for side in sides))


@eqx.filter_jit
def _compiled(shape: Any, sides: tuple[Array, ...]) -> Float[Array, "q q"] | None:
    return bending_matrix(shape, sides)


def _grams(basis: BSplineBasis) -> list[Float[Array, "n n"]]:
    """∫ B_i^(k) B_j^(k) over the domain for k = 0, 1, 2, exact by Gauss-Legendre nodes in every span."""
    nodes, weights = span_nodes(basis, basis.degree + 1)
    index, values = jax.vmap(lambda t: basis_derivatives(basis, t, 2))(nodes)
    rows = jnp.zeros((3, nodes.shape[0], basis.size), values.dtype)
    rows = rows.at[:, jnp.arange(nodes.shape[0])[:, None], index].add(jnp.moveaxis(values, 1, 0))
    return [(row * weights[:, None]).T @ row for row in rows]


def span_nodes(basis: BSplineBasis, count: int) -> tuple[Float[Array, "m"], Float[Array, "m"]]:
    """Gauss-Legendre nodes and weights, `count` in every span, empty spans with weight 0; for integrals over the domain."""
    knots = basis.knots if basis.periodic else basis.knots[basis.degree : basis.size + 1]
    x, w = (jnp.asarray(a, knots.dtype) for a in np.polynomial.legendre.leggauss(count))
    half = 0.5 * (knots[1:] - knots[:-1])
    nodes = knots[:-1, None] + half[:, None] * (1 + x[None, :])
    return nodes.reshape(-1), (half[:, None] * w[None, :]).reshape(-1)
