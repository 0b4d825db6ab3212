"""First and second fundamental form."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers
from ..surface import AbstractSurface
from ._normal import normal
from ._partials import partials, second_partials


class FundamentalForm(eqx.Module):
    """A quadratic form on the tangent plane, uu du² + 2 uv du dv + vv dv²; fields (...)."""

    uu: Float[Array, "*batch"]
    uv: Float[Array, "*batch"]
    vv: Float[Array, "*batch"]

    @property
    def determinant(self) -> Float[Array, "*batch"]:
        """uu·vv − uv²; of the first form this is the squared area per unit of the parameters."""
        return self.uu * self.vv - self.uv * self.uv


def first_form(surface: AbstractSurface, u: Numbers, v: Numbers) -> FundamentalForm:
    """E = ⟨S_u, S_u⟩, F = ⟨S_u, S_v⟩, G = ⟨S_v, S_v⟩: lengths, angles, areas (do Carmo, §2-5)."""
    first = partials(surface, u, v)
    return FundamentalForm(_dot(first.u, first.u), _dot(first.u, first.v), _dot(first.v, first.v))


def second_form(surface: AbstractSurface, u: Numbers, v: Numbers) -> FundamentalForm:
    """L = ⟨S_uu, n⟩, M = ⟨S_uv, n⟩, N = ⟨S_vv, n⟩: the bending towards the normal (do Carmo, §3-3)."""
    second = second_partials(surface, u, v)
    n = normal(surface, u, v)
    return FundamentalForm(_dot(second.uu, n), _dot(second.uv, n), _dot(second.vv, n))


def _dot(a: Float[Array, "*batch 3"], b: Float[Array, "*batch 3"]) -> Float[Array, "*batch"]:
    return jnp.sum(a * b, axis=-1)
