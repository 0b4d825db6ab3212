"""Orthonormal frames around a direction."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._array import concrete, eps, is_concrete
from ._errors import InputError
from ._safe import unit


def frame(
    normal: Float[Array, "3"], start: Float[Array, "3"]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """Right-handed unit vectors (x, y, z) with z along `normal` and x as near to `start` as that allows.

    x is `start` made perpendicular to z. If `start` is parallel to `normal`, x and y are zero, with gradient
    0.
    """
    z = unit(normal)
    x = unit(start - jnp.sum(start * z) * z)
    return x, jnp.cross(z, x), z


def perpendicular(normal: Float[Array, "3"]) -> Float[Array, "3"]:
    """A unit vector perpendicular to `normal`, without a singular direction; for (0, 0, ±1) it is (1, 0, 0).

    No choice is continuous everywhere. This one jumps where ⟨normal, (0.3, 0.2, 1)⟩ changes its sign: a
    tilted circle on which no axis, diagonal of a face or diagonal of a cube lies, so that usual normals have
    a smooth neighbourhood.
    Source: Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6 (2017), listing 3, with the seam
    tilted.
    """
    x, y, z = unit(normal)
    one = jnp.ones_like(z)
    side = jnp.where(0.3 * x + 0.2 * y + z >= 0, one, -one)
    share = -x / (side + z)
    return jnp.stack([1 + side * x * share, side * y * share, -side * x])


def check_not_parallel(normal: Float[Array, "3"], start: Float[Array, "3"], names: tuple[str, str]) -> None:
    """On concrete data, refuse a `start` that is parallel to `normal`."""
    if not is_concrete(normal, start):
        return
    a, b = concrete(normal), concrete(start)
    if np.linalg.norm(np.cross(a, b)) <= 64 * eps(start.dtype) * np.linalg.norm(a) * np.linalg.norm(b):
        raise InputError(f"`{names[1]}` must not be parallel to `{names[0]}`, got {b.tolist()} along {a.tolist()}.")
