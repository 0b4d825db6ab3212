"""Corners of known curves: breaks at which the tangent jumps."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, eps
from .._safe import angle
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._guides import value_and_slope

_JUMP = 1e-4  # radians, as for the guides of a sweep


class Corners(NamedTuple):
    """Inner parameters, points and angles (radians) of corners, and whether the curve, closed, has one at its seam."""

    parameters: Float[np.ndarray, "k"]
    points: Float[np.ndarray, "k 3"]
    angles: Float[np.ndarray, "k"]
    seam: bool


def corners(curve: AbstractCurve) -> Corners:
    """The corners of a known curve."""
    places = concrete(early(breaks, curve)).astype(np.float64)
    first, last = places[0], places[-1]
    inner = places[1:-1]
    step = (1e-9 if curve.dtype == np.float64 else 1e-5) * (last - first)
    before, after = np.append(inner - step, last - step), np.append(inner + step, first + step)
    points, angles = (concrete(x) for x in early(_turns, curve, np.append(inner, first), before, after))
    bent = angles > max(_JUMP, 1e3 * eps(curve.dtype) ** 0.5)
    return Corners(inner[bent[:-1]], points[:-1][bent[:-1]], angles[:-1][bent[:-1]], bool(bent[-1]))


@eqx.filter_jit
def _turns(curve: Any, at: Any, before: Any, after: Any) -> tuple[Float[Array, "k 3"], Float[Array, "k"]]:
    ready = curve.prepared()
    here, below, above = (jnp.asarray(x, curve.dtype) for x in (at, before, after))
    tangent = lambda t: value_and_slope(ready.point, t)[1]
    return jax.vmap(ready.point)(here), angle(jax.vmap(tangent)(below), jax.vmap(tangent)(above))
