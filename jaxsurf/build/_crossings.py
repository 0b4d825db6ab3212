"""Where the curves of a network cross, found on known curves."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, eps
from .._errors import InputError
from .._safe import divide, norm
from ..curve import AbstractCurve
from ._guides import value_and_slope
from ._placing import places_on

_PLACES = 129  # on a curve, from the nearest of which the search starts
_ROUNDS = 30


class Crossings(NamedTuple):
    """Of each curve of v (row) with each curve of u (column): both parameters as shares of the domains, and the distance."""

    u: Float[np.ndarray, "n m"]
    v: Float[np.ndarray, "n m"]
    gap: Float[np.ndarray, "n m"]


def crossings(u_curves: Sequence[AbstractCurve], v_curves: Sequence[AbstractCurve]) -> Crossings:
    """The nearest places of each pair of known curves: nearest samples, then Gauss–Newton steps inside the domains."""
    on_u, on_v = ([places_on(curve, _PLACES) for curve in family] for family in (u_curves, v_curves))
    found = np.zeros((3, len(v_curves), len(u_curves)))
    for i, across in enumerate(v_curves):
        for j, along in enumerate(u_curves):
            apart = np.sum((on_u[j][:, None] - on_v[i][None]) ** 2, axis=-1)
            start = np.array(np.unravel_index(np.argmin(apart), apart.shape)) / (_PLACES - 1)
            found[:, i, j] = concrete(early(_nearest, along, across, jnp.asarray(start, along.dtype)))
    return Crossings(*found)


@eqx.filter_jit
def _nearest(one: AbstractCurve, other: AbstractCurve, start: Float[Array, "2"]) -> Float[Array, "3"]:
    """Shares of both domains where two curves are nearest to each other, and the distance."""
    pair = one.prepared(), other.prepared()

    def offset(shares: Float[Array, "2"]) -> tuple[Float[Array, "3"], list[Float[Array, "3"]]]:
        points, slopes = zip(*(value_and_slope(_by_share(c), t) for c, t in zip(pair, shares, strict=True)), strict=True)
        return points[0] - points[1], [slopes[0], -slopes[1]]

    def step(shares: Float[Array, "2"], _: Any) -> tuple[Float[Array, "2"], None]:
        off, (p, q) = offset(shares)
        damped = 1 + 8 * eps(shares.dtype)  # parallel curves have no unique nearest places
        a, b, c = p @ p * damped, p @ q, q @ q * damped
        wanted = jnp.stack(
            [divide(c * (p @ off) - b * (q @ off), a * c - b * b), divide(a * (q @ off) - b * (p @ off), a * c - b * b)]
        )
        near = jnp.clip(wanted, -1 / 16, 1 / 16)
        return jnp.clip(shares - near, 0, 1), None

    shares = jax.lax.scan(step, start, None, length=_ROUNDS)[0]
    off = offset(shares)[0]
    return jnp.append(shares, norm(off))


def _by_share(curve: Any) -> Any:
    a, b = curve.domain
    return lambda t: curve.point((1 - t) * a + t * b)


def common_shares(shares: Float[np.ndarray, "n m"], names: tuple[str, str], allowed: float) -> Float[np.ndarray, "n"]:
    """Of curves in the columns, crossed in the rows: the shares that all have in common, from their first crossing on.

    names: of the family in the columns and of the other one. Refused where crossings do not ascend, and where they differ
    after the even map of the first crossing to 0 and the last one to 1.
    """
    family, other = names
    for j, column in enumerate(shares.T):
        falls = np.flatnonzero(np.diff(column) <= allowed)
        if not falls.size:
            continue
        if np.all(np.diff(column) < -allowed):
            advice = f"turn it with `js.reverse`, or give `{other}` in the other order"
        else:
            advice = f"give `{other}` in the order in which they cross"
        raise InputError(
            f"`{family}[{j}]` meets `{other}[{falls[0] + 1}]` at {column[falls[0] + 1]:.4g} of its way, not after "
            f"`{other}[{falls[0]}]` at {column[falls[0]]:.4g}: {advice}."
        )
    even = (shares - shares[0]) / (shares[-1] - shares[0])
    off = np.abs(even - even[:, :1])
    i, j = np.unravel_index(np.argmax(off), off.shape)
    if off[i, j] > allowed:
        raise InputError(
            f"`{other}[{i}]` meets `{family}[{j}]` at {even[i, j]:.6g} and `{family}[0]` at {even[i, 0]:.6g} of the way "
            "from the first to the last crossing, and a Gordon surface needs crossings at equal parameters: make "
            f"`{family}` anew through their crossings with `js.interpolate`, at the same `parameters`, or take `js.network`."
        )
    return even.mean(axis=1)
