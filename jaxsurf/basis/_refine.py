"""Knot insertion and degree elevation as matrices, by blossoms.

A control point is the blossom (polar form) of its span's polynomial at `degree` neighbouring knots, so the control points
on a finer knot vector, or of a higher degree, are fixed linear combinations of the old ones (Ramshaw, Blossoming).
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete
from ._bspline import BSplineBasis
from ._knots import greville


def refinement_matrix(knots: Float[Array, "k"], refined: Float[Array, "k2"], degree: int) -> Float[Array, "n2 n"]:
    """Matrix from control points on `knots` to control points of the same spline on `refined` ⊇ `knots`.

    Both are ordinary (not periodic) knot vectors with the same domain. Which one contains the other is not checked.
    """
    count = refined.shape[0] - degree - 1
    arguments = jnp.stack([refined[1 + i : 1 + i + count] for i in range(degree)], axis=1)
    return _blossom(knots, degree, arguments, greville(refined, degree))


def elevation_matrix(knots: Float[Array, "k"], elevated: Float[Array, "k2"], degree: int) -> Float[Array, "n2 n"]:
    """Matrix from control points of `degree` on `knots` to those of `degree + 1` on `elevated` (see `elevated_knots`)."""
    count = elevated.shape[0] - degree - 2
    arguments = jnp.stack([elevated[1 + i : 1 + i + count] for i in range(degree + 1)], axis=1)
    where = greville(elevated, degree + 1)
    leave_one_out = [jnp.delete(arguments, i, axis=1, assume_unique_indices=True) for i in range(degree + 1)]
    return jnp.mean(jnp.stack([_blossom(knots, degree, rest, where) for rest in leave_one_out]), axis=0)


def elevated_knots(knots: Float[Array, "k"], degree: int) -> Float[Array, "k2"]:
    """The knots for one degree more: every distinct knot once more. Concrete knots only.

    The result has the same domain and, at its ends, no more knots than the degree needs.
    """
    values = concrete(knots)
    a, b = values[degree], values[-degree - 1]
    distinct = np.unique(values)
    raised = np.sort(np.concatenate([values, distinct]))
    first = np.searchsorted(raised, a, side="right") - 1
    last = np.searchsorted(raised, b, side="left")
    # the last copy of `a` must have index degree + 1; the first copy of `b` be followed by degree + 1 knots
    lead, tail = first - (degree + 1), raised.size - last - (degree + 2)
    start, stop = max(lead, 0), raised.size - max(tail, 0)
    return jnp.asarray(raised[start:stop], knots.dtype)


def inserted_knots(knots: Float[Array, "k"], new: Float[Array, "m"]) -> Float[Array, "k2"]:
    """The union of `knots` and `new`, multiplicities added."""
    return jnp.sort(jnp.concatenate([knots, new]))


def _blossom(
    knots: Float[Array, "k"], degree: int, arguments: Float[Array, "m p"], where: Float[Array, "m"]
) -> Float[Array, "m n"]:
    """Rows of the blossom's coefficients at `arguments`, of the polynomial around `where`."""
    basis = BSplineBasis(knots, degree)
    a, b = basis.domain

    def row(values: Float[Array, "p"], u: Float[Array, ""]) -> Float[Array, "n"]:
        first, _ = basis.local(jnp.clip(u, a, b))
        near = [knots[first + 1 + i] for i in range(2 * degree)]
        # de Boor's triangle with another argument at each level, run on unit vectors
        points = [jnp.zeros(basis.size, knots.dtype).at[first + i].set(1) for i in range(degree + 1)]
        for level in range(1, degree + 1):
            points = [
                _between(points[i], points[i + 1], near[level - 1 + i], near[degree + i], values[level - 1])
                for i in range(degree + 1 - level)
            ]
        return points[0]

    return jax.vmap(row)(arguments, where)


def _between(left: Array, right: Array, start: Array, end: Array, u: Array) -> Array:
    share = (u - start) / (end - start)
    return (1 - share) * left + share * right
