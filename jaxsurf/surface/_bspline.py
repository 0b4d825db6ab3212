"""B-spline surfaces."""

from functools import partial, reduce
from operator import add
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float, Int

from .._array import Numbers, as_float, take
from .._errors import InputError
from .._registry import register
from ..basis import BSplineBasis, check_knots
from ..curve import combine
from ._abstract import AbstractSurface

_DENSE_LIMIT = 80  # control points up to which a matrix with mostly zeros is faster on a grid (20: 4 times)


@register
class BSplineSurface(AbstractSurface):
    """S(u, v) = Σ_i Σ_j B_i(u) B_j(v) P_ij, the polynomial tensor-product surface.

    control_points: (n, m, 3); knots_u: (n + degree_u + 1,); knots_v: (m + degree_v + 1,). periodic_u,
    periodic_v: closed in that direction, with n (m) control points and n + 1 (m + 1) knots, none of them
    copies. All arrays take the floating type of `control_points`. Raises `InputError` on shapes that do not
    fit and on knots that define no spline. Source: The NURBS Book, §3.4.
    """

    control_points: Float[Array, "n m 3"]
    knots_u: Float[Array, "k"]
    knots_v: Float[Array, "l"]
    degree_u: int = eqx.field(static=True)
    degree_v: int = eqx.field(static=True)
    periodic_u: bool = eqx.field(static=True)
    periodic_v: bool = eqx.field(static=True)

    def __init__(
        self,
        control_points: Numbers,
        knots_u: Numbers,
        knots_v: Numbers,
        degree_u: int,
        degree_v: int,
        periodic_u: bool = False,
        periodic_v: bool = False,
    ):
        self.control_points = as_float(control_points)
        self.knots_u = as_float(knots_u, self.control_points.dtype)
        self.knots_v = as_float(knots_v, self.control_points.dtype)
        self.degree_u, self.degree_v = int(degree_u), int(degree_v)
        self.periodic_u, self.periodic_v = bool(periodic_u), bool(periodic_v)

    def __check_init__(self):
        shape = self.control_points.shape
        if len(shape) != 3 or shape[2] != 3:
            raise InputError(f"`control_points` must have shape (n, m, 3), got {shape}.")
        check_knots(self.knots_u, self.degree_u, shape[0], periodic=self.periodic_u, name="knots_u")
        check_knots(self.knots_v, self.degree_v, shape[1], periodic=self.periodic_v, name="knots_v")

    @property
    def basis_u(self) -> BSplineBasis:
        """The basis functions in u."""
        return BSplineBasis(self.knots_u, self.degree_u, self.periodic_u)

    @property
    def basis_v(self) -> BSplineBasis:
        """The basis functions in v."""
        return BSplineBasis(self.knots_v, self.degree_v, self.periodic_v)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.basis_u.domain, self.basis_v.domain

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return combine_net(self.basis_u, self.basis_v, self.control_points, u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return contract_net(self.basis_u, self.basis_v, self.control_points, u, v)


def combine_net(
    basis_u: BSplineBasis,
    basis_v: BSplineBasis,
    net: Float[Array, "n m d"],
    u: Float[Array, ""],
    v: Float[Array, ""],
) -> Float[Array, "d"]:
    """Σ_ij B_i(u) B_j(v) net_ij, unrolled: one gather of a short vector per term.

    A gather of the whole block and an `einsum` is 8 times slower on a processor.
    """
    unrolled = _unroll(basis_u, basis_v, net)
    columns = unrolled.shape[1]
    first_u, values_u = basis_u.local(u)
    first_v, values_v = basis_v.local(v)
    corner = first_u * columns + first_v
    return _sum_block(columns, unrolled.reshape(-1, net.shape[2]), corner, values_u, values_v)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _sum_block(
    columns: int,
    rows: Float[Array, "nm d"],
    corner: Int[Array, ""],
    values_u: list[Float[Array, ""]],
    values_v: list[Float[Array, ""]],
) -> Float[Array, "d"]:
    """Σ_ij values_u[i] values_v[j] rows[corner + i·columns + j].

    One product of weights per term, not a sum per row: the compiler then keeps the accumulation in one loop.
    """
    return reduce(
        add,
        (
            (weight_u * weight_v) * take(rows, corner + (i * columns + j))
            for i, weight_u in enumerate(values_u)
            for j, weight_v in enumerate(values_v)
        ),
    )


@partial(_sum_block.defjvp, symbolic_zeros=True)
def _(columns: int, primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Array, Array]:
    """The product rule; for derivatives by the rows the weights are computed once and kept.

    Left alone the compiler computes the basis anew for each of the sixteen scatters of a reverse gradient,
    which then takes 6 times the time of the value; so it takes 2.5 times.
    """
    rows, corner, values_u, values_v = primals
    by_rows, _, by_u, by_v = tangents
    terms = []
    if not _is_zero(by_rows):
        kept_u, kept_v = jax.lax.optimization_barrier((jnp.stack(values_u), jnp.stack(values_v)))
        terms.append(_sum_block(columns, by_rows, corner, list(kept_u), list(kept_v)))
    if not _is_zero(by_u):
        terms.append(_sum_block(columns, rows, corner, by_u, values_v))
    if not _is_zero(by_v):
        terms.append(_sum_block(columns, rows, corner, values_u, by_v))
    return _sum_block(columns, rows, corner, values_u, values_v), reduce(add, terms)


def _is_zero(tangents: Any) -> bool:
    leaves = jax.tree.leaves(tangents, is_leaf=_is_symbolic)
    return all(_is_symbolic(leaf) for leaf in leaves)


def _is_symbolic(tangent: Any) -> bool:
    return isinstance(tangent, SymbolicZero)


def contract_net(
    basis_u: BSplineBasis,
    basis_v: BSplineBasis,
    net: Float[Array, "n l d"],
    u: Float[Array, "m"],
    v: Float[Array, "k"],
) -> Float[Array, "m k d"]:
    """All Σ_ij B_i(u_a) B_j(v_b) net_ij: the net is evaluated along v, and its long rows then along u."""
    n, m, d = net.shape
    along_v = _contract(basis_v, jnp.swapaxes(net, 0, 1).reshape(m, n * d), v)
    rows = jnp.swapaxes(along_v.reshape(-1, n, d), 0, 1).reshape(n, -1)
    return _contract(basis_u, rows, u).reshape(u.shape[0], v.shape[0], d)


def _contract(basis: BSplineBasis, rows: Float[Array, "n w"], u: Float[Array, "m"]) -> Float[Array, "m w"]:
    if basis.size > _DENSE_LIMIT:
        return jax.vmap(lambda s: combine(basis, rows, s))(u)
    return jnp.matmul(basis.matrix(u), rows, precision=jax.lax.Precision.HIGHEST)


def _unroll(basis_u: BSplineBasis, basis_v: BSplineBasis, net: Float[Array, "n l d"]) -> Float[Array, "n2 m2 d"]:
    along_v = jnp.swapaxes(basis_v.unroll(jnp.swapaxes(net, 0, 1)), 0, 1) if basis_v.periodic else net
    return basis_u.unroll(along_v)
