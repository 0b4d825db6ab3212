"""Quaternion integral shapes in place of other ones, with the change measured."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, eps, is_concrete
from .._errors import InputError
from .._safe import norm, unit
from ..basis import check_knots, clamped_knots, greville, refinement_matrix
from ..curve import AbstractCurve, QICurve
from ..differential import arc_length, parameter_at_length
from ..quaternion import half_rotation, turn
from ..surface import QISurface
from ._bspline import Conversion

_PER_SPAN = 8  # places in a span where shapes are compared
_STEPS = 40


def to_qi(curve: AbstractCurve, count: int, *, degree: int = 3, knots: Numbers | None = None) -> Conversion:
    """The QI curve with `count` control tangents nearest to a curve in space at equal shares of the length, and how near.

    knots: (count + degree + 1,), by default clamped and even on the curve's domain. Least squares of the distances at 8
    places in every span over tangents, length and start; `max_error` is the largest distance, measured between those
    places too. A QI curve of other tangents, a part or the reverse of one, is found to rounding where it is such a curve.
    Raises `InputError` for curves in a parameter plane, without length, and under tracing.
    """
    if not is_concrete(curve):
        raise InputError("`to_qi` measures its error and needs concrete numbers; call it outside `jit` and `grad`.")
    first, last = (float(end) for end in curve.domain)
    if knots is None:
        knots = clamped_knots(count, degree, (first, last))
    knots = as_float(knots, curve.dtype)
    check_knots(knots, degree, count)
    whole = arc_length(curve)
    if not float(whole) > 0:
        raise InputError("`curve` has no length, so it has no tangents; take another one.")
    begin, end = concrete(knots)[degree], concrete(knots)[count]
    at = lambda u: parameter_at_length(curve, whole * jnp.asarray((u - begin) / (end - begin), curve.dtype))
    middles = np.clip(concrete(greville(knots, degree)), begin, end)
    directions = curve.derivative(at(middles))
    if directions.shape[-1] != 3:
        raise InputError("`curve` must be in space, got one in a parameter plane.")
    start = QICurve(curve(first), whole, directions, degree, knots)
    where, check = _places(knots, degree, count)
    found = _fitted(start, (where,), curve(at(where)))
    error = jnp.max(norm(found(check) - curve(at(check))))
    return Conversion(found, error)


def insert_tangent(shape: QICurve | QISurface, at: Numbers, direction: str | None = None) -> Conversion:
    """The shape with one more control tangent, at a knot `at`; of a surface one more row or column, `direction` "u" or "v".

    Of degree 1 a curve, and a surface along v, are kept exactly. Otherwise that cannot be in general: the tangents are then
    found by least squares of the distances at equal parameters, and `max_error` is the largest one. Lengths stay exactly.
    Raises `InputError` if `at` is not inside the domain.
    """
    if isinstance(shape, QICurve):
        if direction is not None:
            raise InputError(f"`direction` belongs to surfaces, got {direction!r} for a QICurve.")
        knots, matrix = _inserted(shape.knots, shape.degree, at)
        finer = shape.replace(knots=knots, tangents=_refined(shape.tangents, matrix))
        where, check = _places(knots, shape.degree, matrix.shape[0])
        places, checks = (where,), (check,)
        exact = shape.degree == 1
    elif isinstance(shape, QISurface):
        if direction not in ("u", "v"):
            raise InputError(f'`direction` must be "u" or "v" for a surface, got {direction!r}.')
        finer, exact = _finer_surface(shape, at, direction)
        pairs = [
            _places(k, d, n)
            for k, d, n in zip(
                (finer.knots_u, finer.knots_v), (finer.degree_u, finer.degree_v), finer.tangents.shape[:2], strict=True
            )
        ]
        places, checks = (tuple(x.ravel() for x in np.meshgrid(*axes, indexing="ij")) for axes in zip(*pairs, strict=True))
    else:
        raise InputError(f"`shape` must be a `QICurve` or a `QISurface`, got {type(shape).__name__}.")
    found = finer if exact else _fitted(finer, places, shape(*places), tangents_only=True)
    return Conversion(found, jnp.max(norm(found(*checks) - shape(*checks))))


def _finer_surface(shape: QISurface, at: Numbers, direction: str) -> tuple[QISurface, bool]:
    """The surface with tangents inserted, and whether it is the same surface."""
    if direction == "u":
        knots, matrix = _inserted(shape.knots_u, shape.degree_u, at)
        return shape.replace(knots_u=knots, tangents=_refined(shape.tangents, matrix)), False
    knots, matrix = _inserted(shape.knots_v, shape.degree_v, at)
    across = _refined(jnp.swapaxes(shape.tangents, 0, 1), matrix)
    changes = {"knots_v": knots, "tangents": jnp.swapaxes(across, 0, 1), "lengths": matrix @ shape.lengths}
    return shape.replace(**changes), shape.degree_v == 1


def _inserted(knots: Float[Array, "k"], degree: int, at: Numbers) -> tuple[Float[Array, "k1"], Float[Array, "n1 n"]]:
    values, place = concrete(knots), float(concrete(as_float(at, knots.dtype)))
    a, b = float(values[degree]), float(values[-degree - 1])
    if not a < place < b:
        raise InputError(f"`at` must lie inside the domain ({a:g}, {b:g}), got {place:g}.")
    finer = jnp.asarray(np.sort(np.append(values, place)), knots.dtype)
    check_knots(finer, degree, len(finer) - degree - 1)
    return finer, refinement_matrix(knots, finer, degree)


def _refined(tangents: Float[Array, "n *rest 3"], matrix: Float[Array, "m n"]) -> Float[Array, "m *rest 3"]:
    """New control tangents on the great arcs between old ones, at the shares by which knot insertion mixes their points."""
    share = concrete(matrix)
    last = np.minimum(share.shape[1] - 1 - np.argmax(share[:, ::-1] > 0, axis=1), share.shape[1] - 1)
    first = np.maximum(last - 1, 0)
    weight = share[np.arange(len(last)), last].reshape(-1, *(1,) * (tangents.ndim - 1))
    old = unit(tangents)
    return turn(jnp.asarray(weight, old.dtype) * half_rotation(old[first], old[last]), old[first])


def _places(knots: Array, degree: int, count: int) -> tuple[Float[np.ndarray, "p"], Float[np.ndarray, "q"]]:
    """Where shapes are compared in a fit, and where afterwards: between those too."""
    edges = np.unique(concrete(knots)[degree : count + 1])
    inside = lambda share: np.append((edges[:-1, None] + np.diff(edges)[:, None] * share).ravel(), edges[-1])
    return inside(np.arange(_PER_SPAN) / _PER_SPAN), inside(np.arange(3 * _PER_SPAN) / (3 * _PER_SPAN))


def _fitted(start: Any, places: tuple[np.ndarray, ...], wanted: Array, *, tangents_only: bool = False) -> Any:
    """The shape of least squared distances to points at known parameters."""
    size = float(np.max(np.ptp(concrete(wanted).reshape(-1, 3), axis=0)))
    which = lambda s: [s.tangents] if tangents_only else [s.tangents, s.length, s.start]

    def residual(changes: list[Array], known: Any) -> list[Array]:
        shape, places, wanted = known
        bent = _moved(shape, which, changes, size)
        # the lengths of control tangents mean nothing: they are held at 1
        return [(bent(*places) - wanted) / size, jnp.sum(bent.tangents**2, axis=-1) - 1]

    tolerance = 10 * eps(start.dtype)
    solver = optx.LevenbergMarquardt(rtol=tolerance**0.5, atol=tolerance)
    zeros = [jnp.zeros_like(leaf) for leaf in which(start)]
    known = (start, tuple(jnp.asarray(p, start.dtype) for p in places), wanted)
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        changes = optx.least_squares(residual, solver, zeros, known, max_steps=_STEPS, throw=False).value
    return _moved(start, which, changes, size).renewed()


def _moved(shape: Any, which: Any, changes: list[Array], size: float) -> Any:
    """The shape with changes added: of directions as they are, of lengths in units of `size`."""
    units = [1.0, *[size] * (len(changes) - 1)]
    moved = [leaf + unit * change for leaf, change, unit in zip(which(shape), changes, units, strict=True)]
    return eqx.tree_at(which, shape, moved)
