"""The sum of two lofts through crossing families of curves less what both have in common."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, is_concrete
from ..edit._spline_axis import SplineAxis
from ..surface import AbstractSurface, BSplineSurface
from ._blend import AbstractBlend, Smoothstep
from ._family import Family
from ._same_knots import as_axes, product, same_knots


class BooleanSum(AbstractSurface):
    """S(u, v) = Σ_j L_j(v) U_j(u) + Σ_i M_i(u) V_i(v) − Σ_ij M_i(u) L_j(v) P_ij.

    along_u: m curves of u; along_v: n curves of v. across_u: M, u → (n,); across_v: L, v → (m,). crossings: (n, m, 3).
    Source: Gordon, Spline-blended surface interpolation through curve networks, 1969.
    """

    along_u: Family
    along_v: Family
    across_u: Any
    across_v: Any
    crossings: Float[Array, "n m 3"]
    bounds: tuple[tuple[Any, Any], tuple[Any, Any]]

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.bounds

    def prepared(self) -> "BooleanSum":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        m, l = self.across_u(u), self.across_v(v)
        excess = self.along_u.points(u) - product(m, self.crossings)
        return product(l, excess) + product(m, self.along_v.points(v))

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        m, l = jax.vmap(self.across_u)(u), jax.vmap(self.across_v)(v)
        excess = self.along_u.rows(u) - product(m, self.crossings)
        first = jnp.einsum("bj,ajd->abd", l, excess, precision="highest")
        return first + jnp.einsum("ai,bid->abd", m, self.along_v.rows(v), precision="highest")


class BlendedPair(eqx.Module):
    """The weights 1 − φ and φ of two opposite sides, over a domain."""

    blend: AbstractBlend
    domain: tuple[Any, Any]

    def __call__(self, t: Float[Array, ""]) -> Float[Array, "2"]:
        a, b = self.domain
        share = self.blend((t - a) / (b - a))
        return jnp.stack([1 - share, share])

    def axis(self) -> SplineAxis | None:
        """The weights as splines, one in each column; None if the blend is no polynomial that we know."""
        if not isinstance(self.blend, Smoothstep) or not is_concrete(self.domain):
            return None
        times = self.blend.order + 1  # the first control points of φ are 0, as many at its end are 1 (Bernstein)
        ends = [jnp.asarray(end) for end in self.domain]
        dtype = ends[0].dtype
        knots = early(lambda: jnp.asarray(np.repeat([float(end) for end in ends], 2 * times), dtype))
        matrix = early(lambda: jnp.asarray(np.repeat(np.eye(2), times, axis=0), dtype))
        return SplineAxis(matrix, knots, 2 * times - 1)


def meetings(
    along_u: Family, along_v: Family, u: Float[Array, "n"], v: Float[Array, "m"]
) -> tuple[Float[Array, "n m 3"], Float[Array, "n m 3"]]:
    """Where curve i of v and curve j of u are at (u_i, v_j): the points amid both, and the gaps from the first to the other.

    Amid: neither family is preferred where they do not quite meet.
    """
    mine, other = along_u.rows(u), jnp.swapaxes(along_v.rows(v), 0, 1)
    return (mine + other) / 2, mine - other


def spline_of_sum(surface: BooleanSum) -> BSplineSurface | None:
    """The sum as one B-spline surface, exactly; None if a curve or a weight is no spline on known knots."""
    bounds, whole = surface.domain, (surface.along_u.domain, surface.along_v.domain)
    if not is_concrete(bounds, whole) or not np.array_equal(np.asarray(bounds, float), np.asarray(whole, float)):
        return None  # curves that run on beyond the surface
    families = as_axes(surface.along_u.curves), as_axes(surface.along_v.curves)
    weights = surface.across_u.axis(), surface.across_v.axis()
    if any(each is None for each in (*families, *weights)):
        return None
    (rows, columns), (across_u, across_v) = families, weights
    assert rows and columns and across_u and across_v
    along_u, along_v = (_stacked(same_knots(axes, ends)) for axes, ends in zip((rows, columns), bounds, strict=True))
    # (u, v, 3) with the axis of each direction: curves of u, curves of v, and the crossings
    nets = (
        jnp.einsum("ajd,bj->abd", along_u.net, across_v.net, precision="highest"),
        jnp.einsum("bid,ai->abd", along_v.net, across_u.net, precision="highest"),
        -jnp.einsum("ai,ijd,bj->abd", across_u.net, surface.crossings, across_v.net, precision="highest"),
    )
    in_u = same_knots([_as(along_u, nets[0]), _as(across_u, nets[1]), _as(across_u, nets[2])])
    swapped = [jnp.swapaxes(axis.net, 0, 1) for axis in in_u]
    in_v = same_knots([_as(across_v, swapped[0]), _as(along_v, swapped[1]), _as(across_v, swapped[2])])
    net = jnp.swapaxes(in_v[0].net + in_v[1].net + in_v[2].net, 0, 1)
    u, v = in_u[0], in_v[0]
    return BSplineSurface(net, u.knots, v.knots, u.degree, v.degree, u.periodic, v.periodic)


def measured(surface: Any, spline: BSplineSurface) -> Float[Array, ""]:
    """The largest distance of two surfaces on a grid of equal parameters."""
    (a, b), (c, d) = surface.domain
    share = np.linspace(0, 1, 41)
    u, v = ((1 - share) * float(first) + share * float(last) for first, last in ((a, b), (c, d)))
    off = concrete(early(lambda: surface.grid(u, v) - spline.grid(u, v)))
    return jnp.asarray(np.sqrt(np.max(np.sum(off * off, axis=-1))), surface.dtype)


def _as(axis: SplineAxis, net: Array) -> SplineAxis:
    return SplineAxis(net, axis.knots, axis.degree, axis.periodic)


def _stacked(axes: list[SplineAxis]) -> SplineAxis:
    """Curves on common knots as one net (control points, curves, 3)."""
    return _as(axes[0], jnp.stack([axis.net for axis in axes], axis=1))
