"""B-spline surfaces."""

from functools import reduce
from operator import add
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, as_float, take
from .._errors import InputError
from .._registry import register
from ..basis import BSplineBasis, check_knots
from ..curve import combine
from ._abstract import AbstractSurface


@register
class BSplineSurface(AbstractSurface):
    """S(u, v) = Σ_i Σ_j B_i(u) B_j(v) P_ij, the polynomial tensor-product surface.

    control_points: (n, m, 3); knots_u: (n + degree_u + 1,); knots_v: (m + degree_v + 1,). periodic_u, periodic_v: closed in
    that direction, with n (m) control points and n + 1 (m + 1) knots, none of them copies. All arrays take the floating
    type of `control_points`. Raises `InputError` on shapes that do not fit and on knots that define no spline.
    Source: The NURBS Book, §3.4.
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

    A gather of the whole block and an `einsum` is 8 times slower on a processor. One product of weights per term, not a
    sum per row: the compiler then keeps the whole accumulation in one loop, derivatives included.
    """
    unrolled = _unroll(basis_u, basis_v, net)
    columns = unrolled.shape[1]
    rows = unrolled.reshape(-1, net.shape[2])
    first_u, values_u = basis_u.local(u)
    first_v, values_v = basis_v.local(v)
    corner = first_u * columns + first_v
    return reduce(
        add,
        (
            (weight_u * weight_v) * take(rows, corner + (i * columns + j))
            for i, weight_u in enumerate(values_u)
            for j, weight_v in enumerate(values_v)
        ),
    )


def contract_net(
    basis_u: BSplineBasis,
    basis_v: BSplineBasis,
    net: Float[Array, "n m d"],
    u: Float[Array, "m"],
    v: Float[Array, "k"],
) -> Float[Array, "m k d"]:
    """All Σ_ij B_i(u_a) B_j(v_b) net_ij: the net's rows are combined once for every u, then each along v."""
    rows = net.reshape(net.shape[0], -1)
    along_u = jax.vmap(lambda s: combine(basis_u, rows, s))(u).reshape(-1, *net.shape[1:])
    return jax.vmap(lambda row: jax.vmap(lambda t: combine(basis_v, row, t))(v))(along_u)


def _unroll(
    basis_u: BSplineBasis, basis_v: BSplineBasis, net: Float[Array, "n m d"]
) -> Float[Array, "n2 m2 d"]:
    along_v = jnp.swapaxes(basis_v.unroll(jnp.swapaxes(net, 0, 1)), 0, 1) if basis_v.periodic else net
    return basis_u.unroll(along_v)
