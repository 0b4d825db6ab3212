"""The nearest point of a curve or surface to given points."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import _safe
from .._array import Numbers, as_float, eps, map_points
from .._errors import InputError
from ..curve import AbstractCurve
from ..surface import AbstractSurface
from ._newton import descend, held_parameters, local_frame, value_and_tangents
from ._samples import sample_parameters

_CHUNK = 2048  # points whose iterations run in step
_TABLE = 2**21  # entries of a distance table held at once: 16 MB in double precision


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
    candidates: int = 2,
) -> Foot:
    """Feet of `points` (..., 3) on a curve or surface, borders included.

    Without `start` the nearest of a grid of samples (two in each knot span) begins a safeguarded Newton iteration, and so
    does the nearest one away from it, up to `candidates` of them; the best foot wins. With `start` (parameters in the form
    of `Foot.parameters`, from an earlier call) only these are refined. Memory does not grow with the number of points
    apart from points and feet.

    Differentiable in the points and in the shape's control data by the implicit function theorem, to any order; where the
    foot is not unique (centres of curvature) derivatives are finite but meaningless.
    Raises `InputError` if the points do not have the shape's dimension.
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
        starts = _starts(shape, flat, candidates)
    else:
        starts = as_float(start, shape.dtype).reshape(flat.shape[0], 1, -1)
    foot = _feet(shape, flat, starts)
    return jax.tree.map(lambda leaf: leaf.reshape(*batch, *leaf.shape[1:]), foot)


def _dimension(shape: AbstractCurve | AbstractSurface) -> int:
    if isinstance(shape, AbstractSurface):
        return 3
    return jax.eval_shape(shape.point, jnp.zeros((), shape.dtype)).shape[0]


@eqx.filter_jit
def _starts(shape: Any, points: Float[Array, "N d"], candidates: int) -> Float[Array, "N c k"]:
    """Parameters of the nearest samples, each away from the ones before it."""
    axes = sample_parameters(shape)
    counts = [axis.shape[0] for axis in axes]
    samples = shape(axes[0]) if len(axes) == 1 else shape.grid_points(*axes)
    samples = jax.lax.stop_gradient(samples.reshape(-1, samples.shape[-1]))
    parameters = jnp.stack(jnp.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    indices = jnp.stack(jnp.meshgrid(*[jnp.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(
        -1, len(axes)
    )
    centre = jnp.mean(samples, axis=0)
    samples = samples - centre[None, :]
    squared = 0.5 * jnp.sum(samples * samples, axis=-1)

    def nearest(_: Any, x: Array, *rest: Array) -> Array:
        distance = squared - samples @ (jnp.stack([x, *rest]) - centre)
        found = []
        for _ in range(candidates):
            best = jnp.argmin(distance)
            found.append(parameters[best])
            near = jnp.all(jnp.abs(indices - indices[best][None, :]) <= 3, axis=-1)
            distance = jnp.where(near, jnp.inf, distance)
        return jnp.stack(found)

    chunk = max(64, min(10_000, _TABLE // samples.shape[0]))
    return map_points(nearest, None, *jax.lax.stop_gradient(points).T, chunk=chunk)


@eqx.filter_jit
def _feet(shape: Any, points: Float[Array, "N d"], starts: Float[Array, "N c k"]) -> Foot:
    count, candidates, k = starts.shape
    size = _size(shape)
    frozen = jax.lax.stop_gradient(shape)
    d = points.shape[1]

    def search(shape: Any, *row: Array) -> tuple[Array, Array]:
        return descend(shape, jnp.stack(row[:d]), jnp.stack(row[d:]), size)

    # every candidate is a row of its own: a map within the map would be traced and batched twice
    targets = jnp.repeat(jax.lax.stop_gradient(points), candidates, axis=0)
    found, squared = map_points(search, frozen, *targets.T, *starts.reshape(-1, k).T, chunk=_CHUNK)
    best = jnp.argmin(squared.reshape(count, candidates), axis=1)
    parameters = jnp.take_along_axis(found.reshape(count, candidates, k), best[:, None, None], axis=1)[:, 0]
    finish = lambda shape, *row: _foot(shape, jnp.stack(row[:d]), jnp.stack(row[d:]))
    return map_points(finish, shape, *points.T, *parameters.T, chunk=_CHUNK)


def refine_feet(
    shape: Any, points: Float[Array, "N d"], parameters: Float[Array, "N k"]
) -> Float[Array, "N k"]:
    """Parameters of feet, refined from good ones; no derivatives. For use inside traced code."""
    size = _size(shape)
    d = points.shape[1]
    search = lambda shape, *row: descend(shape, jnp.stack(row[:d]), jnp.stack(row[d:]), size)[0]
    return map_points(search, jax.lax.stop_gradient(shape), *points.T, *parameters.T, chunk=_CHUNK)


@eqx.filter_jit
def foot_at(shape: Any, points: Float[Array, "N d"], parameters: Float[Array, "N k"]) -> Foot:
    """The feet at known parameters, not refined."""
    d = points.shape[1]
    measure = lambda shape, *row: _measured(shape, jnp.stack(row[:d]), jnp.stack(row[d:]))
    return map_points(measure, shape, *points.T, *parameters.T, chunk=_CHUNK)


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
    height = offset @ _safe.unit(jnp.cross(tangents[:, 0], tangents[:, 1]))
    beyond = jnp.where(height < 0, -_safe.norm(offset), _safe.norm(offset))
    return Foot(t, point, jnp.where(jnp.any(held_parameters(shape, t, -offset @ tangents)), beyond, height))


def _solve_small(matrix: Float[Array, "k k"], y: Float[Array, "k"]) -> Float[Array, "k"]:
    """Solve one or two linear equations; a singular matrix gives 0."""
    if y.shape[0] == 1:
        return _safe.divide(y, matrix[0])
    (a, b), (c, d) = matrix
    return _safe.divide(jnp.stack([d * y[0] - b * y[1], a * y[1] - c * y[0]]), a * d - b * c)


def _size(shape: Any) -> Float[Array, ""]:
    """Extent of the shape: the largest side of the samples' bounding box."""
    axes = sample_parameters(shape)
    samples = jax.lax.stop_gradient(shape(axes[0]) if len(axes) == 1 else shape.grid_points(*axes))
    flat = samples.reshape(-1, samples.shape[-1])
    return jnp.max(jnp.max(flat, axis=0) - jnp.min(flat, axis=0)) + eps(flat.dtype)
