"""Clouds moved onto a given shape: rigid registration by distances to the shape."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._safe import arctan2, norm
from ..curve import AbstractCurve
from ..edit import transform
from ..quaternion import exp, to_matrix
from ..query import Foot, closest_point
from ..surface import AbstractSurface
from ._deviation import Deviation

_STEPS = 50


class Alignment(eqx.Module):
    """How a cloud is moved: p ↦ matrix · p + offset.

    matrix: (3, 3), a rotation, times the scale if that was free; offset: (3,); foot, deviation: of the moved points; before:
    the deviation of the points as given; converged: whether the solver met its tolerance.
    """

    matrix: Float[Array, "3 3"]
    offset: Float[Array, "3"]
    foot: Foot
    deviation: Deviation
    before: Deviation
    converged: Any

    @property
    def scale(self) -> Any:
        """By what lengths grow."""
        return jnp.cbrt(jnp.linalg.det(self.matrix))

    @property
    def angle(self) -> Any:
        """By what the cloud is turned, radians."""
        twist = self.matrix - self.matrix.T
        axis = jnp.stack([twist[2, 1], twist[0, 2], twist[1, 0]])
        return arctan2(norm(axis), jnp.trace(self.matrix) - self.scale)

    def __call__(self, moved: Any) -> Any:
        """Points (..., 3), or a shape, moved likewise."""
        if isinstance(moved, AbstractCurve | AbstractSurface):
            return transform(moved, self.matrix, self.offset)
        points = as_float(moved, self.matrix.dtype)
        return jnp.vectorize(lambda p: jnp.matmul(self.matrix, p, precision="highest") + self.offset, signature="(i)->(i)")(
            points
        )


def align(
    points: Numbers, shape: AbstractCurve | AbstractSurface, *, weights: Numbers | None = None, scale: bool = False
) -> Alignment:
    """Turn and shift points (N, 3) so that the sum of their squared distances to a shape is least.

    weights: (N,) ≥ 0; points that do not belong to the shape get 0. scale: whether the cloud may grow too. Starts from where
    the points are: the turn to be found should be below some 30°, and the shift small against the shape's features. What the
    distances do not see, as the shift along a plane, stays as it is. Levenberg-Marquardt on signed distances by optimistix,
    about the centre of the points; differentiable in points, weights and the shape by the implicit function theorem. Raises
    `InputError` on fewer than 6 points. Source: Chen, Medioni (1992), with the feet followed rather than frozen.
    """
    points = as_float(points, shape.dtype)
    if points.ndim != 2 or points.shape[1] != 3 or points.shape[0] < 6:
        raise InputError(f"`points` must have shape (N, 3) with N of at least 6, got {points.shape}.")
    if is_concrete(points) and not np.all(np.isfinite(concrete(points))):
        raise InputError("`points` must be finite; remove those that are not.")
    weights = jnp.ones_like(points[:, 0]) if weights is None else as_float(weights, shape.dtype)
    if weights.shape != points.shape[:1]:
        raise InputError(f"`weights` must have shape ({points.shape[0]},), one for each point, got {weights.shape}.")
    first = closest_point(shape, points)
    return _aligned(shape, points, weights, first, scale)


@eqx.filter_jit
def _aligned(shape: Any, points: Array, weights: Array, first: Foot, scale: bool) -> Alignment:
    centre = jnp.mean(points, axis=0)
    size = jnp.sqrt(jnp.mean(jnp.sum((points - centre[None]) ** 2, axis=1)))

    def moves(x: Array, centre: Array, size: Array) -> tuple[Array, Array]:
        matrix = to_matrix(exp(x[:3] / 2))
        matrix = matrix * jnp.exp(x[6]) if scale else matrix
        return matrix, centre + x[3:6] * size - jnp.matmul(matrix, centre, precision="highest")

    def moved(x: Array, points: Array, centre: Array, size: Array) -> Array:
        matrix, offset = moves(x, centre, size)
        return jnp.matmul(points, matrix.T, precision="highest") + offset[None]

    def residual(x: Array, known: Any) -> Array:
        shape, points, weights, start, centre, size = known
        foot = closest_point(shape, moved(x, points, centre, size), start=start)
        return jnp.sqrt(weights) * foot.distance / size

    known = (shape, points, weights, first.parameters, centre, size)
    solver = optx.LevenbergMarquardt(rtol=1e-10, atol=1e-12)
    start = jnp.zeros(7 if scale else 6, points.dtype)
    found = optx.least_squares(residual, solver, start, known, max_steps=_STEPS, throw=False)
    foot = closest_point(shape, moved(found.value, points, centre, size), start=first.parameters)
    matrix, offset = moves(found.value, centre, size)
    done = found.result == optx.RESULTS.successful
    return Alignment(matrix, offset, foot, Deviation(foot.distance), Deviation(first.distance), done)
