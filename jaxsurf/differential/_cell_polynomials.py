"""A B-spline surface as one polynomial on each of its knot cells."""

from functools import reduce

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import take
from ..basis import BSplineBasis, Places, span_polynomials
from ..surface import BSplineSurface


class CellPolynomials(eqx.Module):
    """Coefficients by powers of the places t in the spans, a row of 3 each: u-major cells, in a cell u-major powers.

    Made once for many points: Horner's rule on them needs no basis values, half the work of the sum over control points.
    """

    basis_u: BSplineBasis
    basis_v: BSplineBasis
    places_u: Places
    places_v: Places
    rows: Float[Array, "n 3"]

    def partials(
        self, u: Float[Array, ""], v: Float[Array, ""]
    ) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
        """S, S_u and S_v at one pair of parameters."""
        first_u, s, by_u = self.basis_u.place(u, self.places_u)
        first_v, t, by_v = self.basis_v.place(v, self.places_v)
        powers_v = self.basis_v.degree + 1
        corner = (first_u * self.places_v.middle.shape[0] + first_v) * ((self.basis_u.degree + 1) * powers_v)
        values, slopes = [], []
        for p in range(self.basis_u.degree + 1):
            coefficients = [take(self.rows, corner + (p * powers_v + q)) for q in range(powers_v)]
            value, slope = _horner(coefficients, t)
            values.append(value)
            slopes.append(slope)
        point, along_u = _horner(values, s)
        return point, along_u * by_u, _horner(slopes, s)[0] * by_v


def cell_count(surface: BSplineSurface) -> int:
    """Number of knot cells, empty ones included."""
    spans = lambda basis: basis.unrolled_knots.shape[0] - 2 * basis.degree - 1
    return spans(surface.basis_u) * spans(surface.basis_v)


def cell_polynomials(surface: BSplineSurface) -> CellPolynomials:
    """All cells at once, from the polynomials of the basis functions."""
    bases, places, tables = (surface.basis_u, surface.basis_v), [], []
    net = surface.control_points
    for axis, basis in enumerate(bases):
        spans, coefficients = span_polynomials(basis.unrolled_knots, basis.degree)
        places.append(spans)
        tables.append(jnp.stack(coefficients, axis=1))  # span, power, function
        net = jnp.swapaxes(basis.unroll(jnp.swapaxes(net, 0, axis)), 0, axis)
    at_u, at_v = (np.arange(t.shape[0])[:, None] + np.arange(t.shape[2]) for t in tables)
    blocks = net[at_u[:, None, :, None], at_v[None, :, None, :]]
    rows = jnp.einsum("api,bqj,abijx->abpqx", *tables, blocks, precision="highest")
    return CellPolynomials(bases[0], bases[1], places[0], places[1], rows.reshape(-1, 3))


def _horner(coefficients: list[Array], t: Float[Array, ""]) -> tuple[Array, Array]:
    """A polynomial and its derivative."""
    step = lambda state, c: (state[0] * t + c, state[1] * t + state[0])
    return reduce(step, coefficients[-2::-1], (coefficients[-1], jnp.zeros_like(coefficients[-1])))
