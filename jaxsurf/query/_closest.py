"""The nearest point of a curve or surface to given points."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .. import _safe
from .._array import Numbers, as_float, eps, map_points
from .._errors import InputError
from ..curve import AbstractCurve
from ..surface import AbstractSurface
from ._descend import Scale, descend
from ._newton import held_parameters, local_frame, parameter_box, value_and_tangents
from ._starts import choose_starts, sample_points


class Foot(eqx.Module):
    """Nearest points of a shape.

    parameters: (..., 2) on a surface, (...,) on a curve; points: (..., 3), the feet; distance: (...,), to the given
    points, on a surface with the sign of ⟨p − S, n⟩, on a curve ≥ 0.
    """

    parameters: Float[Array, "..."]
    points: Float[Array, "... d"]
    distance: Float[Array, "..."]


def closest_point(
    shape: AbstractCurve | AbstractSurface,
    points: Numbers,
    *,
    start: Numbers | None = None,
    candidates: int = 6,
) -> Foot:
    """Feet of `points` (..., 3) on a curve or surface, borders included.

    Without `start` safeguarded Newton iterations begin in all parts of the shape whose bounding boxes are near enough,
    at up to `candidates` places where a grid of samples (four or more in each knot span) is near, and the best
    foot wins: on smooth sheets the nearest one, on a very bumpy one and far away another one a few times in ten thousand.
    With `start` (parameters in the form of `Foot.parameters`, from an earlier call) only these are refined. Memory does
    not grow with the number of points apart from points, feet and 5 bytes per candidate.

    Differentiable in the points and in the shape's control data by the implicit function theorem, to any order; where the
    foot is not unique (centres of curvature) derivatives are finite but meaningless.
    Raises `InputError` if the points do not have the shape's dimension, or `start` does not fit them.
    """
    points = as_float(points, shape.dtype)
    if points.ndim == 0 or points.shape[-1] != _dimension(shape):
        raise InputError(f"`points` must have shape (..., {_dimension(shape)}), got {points.shape}.")
    if candidates < 1:
        raise InputError(f"`candidates` must be at least 1, got {candidates}.")
    batch = points.shape[:-1]
    flat = points.reshape(-1, points.shape[-1])
    if flat.shape[0] == 0:
        width = () if isinstance(shape, AbstractCurve) else (2,)
        return Foot(jnp.zeros((*batch, *width), shape.dtype), points, jnp.zeros(batch, shape.dtype))
    if start is None:
        starts = choose_starts(shape, flat, candidates)
    else:
        parameters = _given(shape, start, batch).reshape(flat.shape[0], -1)
        starts = parameters, *_as_chosen(parameters)
    foot = _feet(shape, flat, *starts)
    return jax.tree.map(lambda leaf: leaf.reshape(*batch, *leaf.shape[1:]), foot)


def _given(shape: AbstractCurve | AbstractSurface, start: Numbers, batch: tuple[int, ...]) -> Array:
    """The user's starting parameters, inside the domain."""
    parameters = as_float(start, shape.dtype)
    expected = batch if isinstance(shape, AbstractCurve) else (*batch, 2)
    if parameters.shape != expected:
        raise InputError(f"`start` must have shape {expected}, one entry for each point, got {parameters.shape}.")
    box = parameter_box(shape)
    lower, upper = (jnp.broadcast_to(end.reshape(expected[len(batch) :]), expected) for end in (box.lower, box.upper))
    return jax.lax.stop_gradient(jnp.clip(parameters, lower, upper))


def _dimension(shape: AbstractCurve | AbstractSurface) -> int:
    if isinstance(shape, AbstractSurface):
        return 3
    return jax.eval_shape(shape.point, jnp.zeros((), shape.dtype)).shape[0]


@eqx.filter_jit
def _feet(
    shape: Any,
    points: Float[Array, "N d"],
    starts: Float[Array, "s k"],
    chosen: Int[Array, "N c"],
    wanted: Bool[Array, "N c"],
) -> Foot:
    frozen = jax.lax.stop_gradient((shape, points))
    parameters = descend(*frozen, starts, chosen, wanted, _scale(shape))
    return feet_with_derivatives(shape, points, parameters)


@eqx.filter_jit
def feet_with_derivatives(shape: Any, points: Float[Array, "N d"], parameters: Float[Array, "N k"]) -> Foot:
    """The feet at converged parameters, differentiable like those of `closest_point`."""
    d = points.shape[1]
    finish = lambda shape, *row: _foot(shape, jnp.stack(row[:d]), jnp.stack(row[d:]))
    return map_points(finish, shape, *points.T, *parameters.T)


def refine_feet(
    shape: Any, points: Float[Array, "N d"], parameters: Float[Array, "N k"], turns: int = 60
) -> Float[Array, "N k"]:
    """Parameters of feet, refined from good ones by at most so many steps; no derivatives. For use inside traced code."""
    frozen = jax.lax.stop_gradient((shape, points, parameters))
    return descend(*frozen, *_as_chosen(parameters), _scale(shape), turns)


def _as_chosen(parameters: Float[Array, "N k"]) -> tuple[Int[Array, "N 1"], Bool[Array, "N 1"]]:
    count = parameters.shape[0]
    return jnp.arange(count, dtype=jnp.int32)[:, None], jnp.ones((count, 1), bool)


@eqx.filter_jit
def foot_at(shape: Any, points: Float[Array, "N d"], parameters: Float[Array, "N k"]) -> Foot:
    """The feet at known parameters, not refined."""
    d = points.shape[1]
    measure = lambda shape, *row: _measured(shape, jnp.stack(row[:d]), jnp.stack(row[d:]))
    return map_points(measure, shape, *points.T, *parameters.T)


def _foot(shape: Any, p: Float[Array, "d"], t: Float[Array, "k"]) -> Foot:
    """The foot at converged parameters `t`, with implicit derivatives."""
    found = jax.lax.stop_gradient(t)

    def stationary(x: Float[Array, "k"]) -> Float[Array, "k"]:
        point, tangents, _ = local_frame(shape, x)
        gradient = (point - p) @ tangents
        return jnp.where(held_parameters(shape, found, gradient), x - found, gradient)

    def tangent_solve(linear: Any, y: Float[Array, "k"]) -> Float[Array, "k"]:
        return _solve_small(jax.jacfwd(linear)(jnp.zeros_like(y)), y)

    return _measured(shape, p, jax.lax.custom_root(stationary, t, lambda _, x: x, tangent_solve))


def _measured(shape: Any, p: Float[Array, "d"], t: Float[Array, "k"]) -> Foot:
    """Point and signed distance at the foot's parameters."""
    point, tangents = value_and_tangents(shape, t)
    offset = p - point
    if isinstance(shape, AbstractCurve):
        return Foot(t[0], point, _safe.norm(offset))
    normal = _safe.unit(jnp.cross(tangents[:, 0], tangents[:, 1]))
    height = offset @ normal
    beyond = jnp.where(height < 0, -_safe.norm(offset), _safe.norm(offset))
    # beyond a border, or where the surface has shrunk to a line or a point
    aside = jnp.any(held_parameters(shape, t, -offset @ tangents)) | (normal @ normal < 0.5)
    return Foot(t, point, jnp.where(aside, beyond, height))


def _solve_small(matrix: Float[Array, "k k"], y: Float[Array, "k"]) -> Float[Array, "k"]:
    """Solve one or two linear equations; a singular matrix gives 0."""
    if y.shape[0] == 1:
        return _safe.divide(y, matrix[0])
    (a, b), (c, d) = matrix
    return _safe.divide(jnp.stack([d * y[0] - b * y[1], a * y[1] - c * y[0]]), a * d - b * c)


def _scale(shape: Any) -> Scale:
    """What the samples of a shape say of its size and place."""
    flat = sample_points(shape)[1].reshape(-1, _dimension(shape))
    sides = jnp.max(flat, axis=0) - jnp.min(flat, axis=0)
    coordinate = jnp.max(jnp.abs(flat))
    return Scale(jnp.maximum(jnp.max(sides), eps(flat.dtype) * coordinate), coordinate)
