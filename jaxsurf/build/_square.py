"""A surface over the unit square, and what its sides know."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..surface import AbstractSurface
from ._guides import carried

CORNERS = tuple((i, j) for i in (0, 1) for j in (0, 1))


class Square:
    """S over shares (s, t) in [0, 1]², inside traced code; places of equal kind share one pass, which compiles once."""

    def __init__(self, surface: AbstractSurface):
        self.surface = surface

    def __call__(self, place: Float[Array, "2"]) -> Float[Array, "3"]:
        along_u, along_v = self.surface.domain
        return self.surface.point(carried(place[0], (0.0, 1.0), along_u), carried(place[1], (0.0, 1.0), along_v))

    def slopes(self, place: Float[Array, "2"]) -> tuple[Float[Array, "3"], Float[Array, "2 3"]]:
        """The point, and its derivatives by s and t."""
        return with_derivatives(self, place)

    def ends(self, axis: int, share: Float[Array, ""]) -> tuple[Float[Array, "2 3"], Float[Array, "2 2 3"]]:
        """Points and derivatives by s and t on both sides across an axis, at a share along them."""
        return jax.vmap(self.slopes)(places_on(axis, share))

    def corners(self) -> tuple[Float[Array, "4 2 3"], Float[Array, "4 2 2 3"]]:
        """First and second derivatives at the `CORNERS`."""
        places = jnp.asarray(np.array(CORNERS), self.surface.dtype)
        (_, first), (_, second) = jax.vmap(lambda x: with_derivatives(self.slopes, x))(places)
        return first, second


def with_derivatives(f: Any, place: Float[Array, "2"]) -> tuple[Any, Any]:
    """f and its derivatives by both parameters (leading axis), in one forward pass."""
    values, derivatives = jax.vmap(lambda d: jax.jvp(f, (place,), (d,)), out_axes=(None, 0))(jnp.eye(2, dtype=place.dtype))
    return values, derivatives


def places_on(axis: int, share: Float[Array, ""]) -> Float[Array, "2 2"]:
    """(s, t) on both sides across an axis: s = 0, 1 for axis 0, t = 0, 1 for axis 1."""
    ends = jnp.arange(2, dtype=share.dtype)
    both = [ends, jnp.broadcast_to(share, (2,))]
    return jnp.stack(both if axis == 0 else both[::-1], axis=1)


def hermite_weight(end: int, x: Any) -> Any:
    """The cubic with slope 1 at this end, and with value 0 at both ends and slope 0 at the other one."""
    return x * (1 - x) ** 2 if end == 0 else x * x * (x - 1)
