"""Fit the control data of a shape to measured points."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float, Int

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._progress import Progress, silent
from ..curve import AbstractCurve, QICurve
from ..query import Foot, closest_point, foot_at
from ..surface import AbstractSurface, BSplineSurface, QISurface
from ._bending import bending_of
from ._deviation import Deviation
from ._losses import find_loss, noise_scale
from ._problem import Problem, free_leaves, moved, unknowns_of
from ._shard import at_home, mesh_of, over_shards
from ._sharded_points import ShardedPoints, check_finite, whole_points
from ._snapshot import Snapshot
from ._solve import Solved, solve

_RENEWALS = 3


class Fit(eqx.Module):
    """What a fit found.

    shape: the fitted member of the family; foot: the feet of all points on it; deviation: their distances; result: how
    the solver ended, an `optimistix.RESULTS`; steps: solver steps in all; stopped: whether `progress` asked to stop.
    """

    shape: Any
    foot: Foot
    deviation: Deviation
    result: Any
    steps: Int[Array, ""]
    stopped: bool = False

    @property
    def converged(self) -> Any:
        """Whether the solver met its tolerance."""
        return self.result == optx.RESULTS.successful


def fit(
    shape: AbstractCurve | AbstractSurface,
    points: Numbers | ShardedPoints,
    *,
    loss: str = "squared",
    fairness: float = 0.0,
    bending: float | None = None,
    rest: BSplineSurface | None = None,
    free: Callable[[Any], Any] | None = None,
    weights: Numbers | None = None,
    start: Numbers | None = None,
    sliding: float = 1e-3,
    release: float = 1.0,
    rtol: float = 1e-5,
    max_steps: int = 60,
    progress: Progress = silent,
    phase: str = "fit",
    resume: Snapshot | None = None,
) -> Fit:
    """Fit a curve or surface to an unordered cloud (N, 3): minimise the distances of the points to their feet on it.

    shape: the member of the family to start from. free: picks the arrays that may move, as in
    `free=lambda s: s.control_points`; by default all but knots. weights: (N,) ≥ 0, such as 1/variance. loss: "squared",
    "huber", "cauchy" or "tukey", whose scale follows the noise found. fairness: weight of the scale-free curvature variation
    against the mean squared distance in units of size²; it does not shrink circles (useful: 1e-9 … 1e-3). bending: weight of
    the quadratic bending energy of B-spline nets, and of the turns between control tangents of QI shapes, that holds what no
    point determines; `None` is a weight too weak to be seen in the covered part. rest: the net on the same knots from which
    bending is counted, by default a flat one.
    start: parameters of first feet, from an earlier fit. sliding: how much the solver resists gliding of the net along the
    sheet, which points do not see; release: by how much at most that falls while steps are as good as predicted. Both steer
    the way, not the goal.
    phase: what `progress` is told; resume: `Event.snapshot` of such a fit that was cut off, to go on there with the same
    arguments. Points of `shard_points`, weights then of this process's, are worked on by all of their devices; `Fit.foot`
    and `Fit.deviation` lie spread likewise if there are several processes.

    Levenberg-Marquardt on signed distances with the feet eliminated (Gauss-Newton by the envelope theorem), normal
    equations accumulated in chunks, stepped by optimistix until a step gains less than `rtol` of the objective.
    Raises `InputError` on points that are not finite or fewer than the shape's control points can use.
    """
    cloud = whole_points(points, shape.dtype)
    points, mesh = cloud.points, cloud.mesh
    find_loss(loss)
    weights = _check(shape, cloud, weights, fairness, bending)
    free_flags = free_leaves(shape, free)
    number = lambda x: jnp.asarray(x, shape.dtype)
    size = at_home(_diagonal(points), mesh)
    penalty = None
    if isinstance(shape, BSplineSurface) and free_flags[0] and not any(free_flags[1:]):
        penalty = bending_of(shape, side_lengths(shape))
    weight = _faint(shape) if bending is None else bending
    rest_theta = _rest(shape, rest, free_flags)
    if resume is not None:
        shape, start = _moved(shape, number(resume.theta), free_flags), None
    feet = over_shards(mesh, _nearest, shape, points) if start is None else cloud.spread(start)
    feet = as_float(feet, points.dtype).reshape(points.shape[0], -1)
    total = np.int32(0)
    found: Solved | None = None
    for turn, name in enumerate(_rounds(loss)):
        if resume is not None and turn < resume.round:
            continue
        scale = number(1)
        if resume is not None:
            scale = number(resume.scale)
        elif name != "squared":
            scale = at_home(_noise(over_shards(mesh, _distances, shape, points, feet), weights, name, size), mesh)
        problem = Problem(
            shape,
            points,
            weights,
            size,
            scale,
            number(weight),
            number(fairness),
            number(sliding),
            rest_theta,
            free_flags,
            name,
            fairness != 0,
            mesh=mesh,
        )
        told = progress if progress is silent else _telling(progress, turn, scale)
        solved = {"rtol": rtol, "max_steps": max_steps, "release": release, "progress": told, "phase": phase}
        for _ in range(_RENEWALS + 1):
            found = solve(problem, feet, penalty, **solved, resume=resume)
            shape, feet, resume = _moved(shape, at_home(found.theta, mesh), free_flags), found.feet, None
            total = total + at_home(found.steps, mesh).astype(jnp.int32)
            was_ready = jax.tree.structure(shape)
            shape = shape.renewed()
            if found.stopped or jax.tree.structure(shape) == was_ready:
                break
            # bent further than it was ready for: once more from here
            problem = eqx.tree_at(lambda p: p.shape, problem, shape)
        if found is not None and found.stopped:
            break
    assert found is not None
    foot, deviation = _at_feet(shape, cloud, feet)
    return Fit(shape, foot, deviation, at_home(found.result, mesh), jnp.asarray(total, jnp.int32), found.stopped)


def nearest_feet(shape: Any, cloud: ShardedPoints) -> tuple[Foot, Deviation]:
    """The feet of a cloud on a shape, as a fit gives them."""
    return _at_feet(shape, cloud, over_shards(cloud.mesh, _nearest, shape, cloud.points))


def _at_feet(shape: Any, cloud: ShardedPoints, feet: Array) -> tuple[Foot, Deviation]:
    foot = cloud.home(over_shards(cloud.mesh, _feet, shape, cloud.points, feet))
    return foot, Deviation(foot.distance, None if cloud.alone else cloud.counted)


@eqx.filter_jit
def _diagonal(points: Array) -> Float[Array, ""]:
    """Diagonal of the points' bounding box."""
    return jnp.sqrt(jnp.sum((jnp.max(points, axis=0) - jnp.min(points, axis=0)) ** 2))


@eqx.filter_jit
def _noise(distance: Array, weights: Array, loss: str, size: Array) -> Float[Array, ""]:
    """The scale of a robust loss, from the distances at hand; never 0."""
    return jnp.maximum(noise_scale(distance, weights) * find_loss(loss).deviations, 1e-12 * size)


def _nearest(shape: Any, points: Array) -> Float[Array, "N k"]:
    return closest_point(shape, points).parameters.reshape(points.shape[0], -1)


def _distances(shape: Any, points: Array, feet: Array) -> Float[Array, "N"]:
    return foot_at(shape, points, feet).distance


def _feet(shape: Any, points: Array, feet: Array) -> Foot:
    return foot_at(shape, points, feet)


def _telling(progress: Progress, turn: int, scale: Array) -> Progress:
    """The progress, told too in which robust round it is."""
    numbers = {"round": turn, "scale": float(scale)}
    return lambda event: progress(event._replace(snapshot=event.snapshot and event.snapshot._replace(**numbers)))


def _rest(shape: Any, rest: Any, free: tuple[bool, ...]) -> Float[Array, "P"]:
    """Unknowns of the shape at rest."""
    if rest is not None and jax.tree.map(jnp.shape, rest) != jax.tree.map(jnp.shape, shape):
        raise InputError("`rest` must be a shape of the same class and sizes as `shape`; insert the knots that it lacks.")
    return jnp.zeros_like(unknowns_of(shape, free)) if rest is None else unknowns_of(rest, free)


@eqx.filter_jit
def _moved(shape: Any, theta: Array, free: tuple[bool, ...]) -> Any:
    return moved(shape, theta, free)


def _rounds(loss: str) -> tuple[str, ...]:
    """A robust loss is solved in rounds with the scale found anew; one that forgets far points starts from one that
    does not."""
    if loss == "squared":
        return ("squared",)
    return ("huber", "huber", "huber") if loss == "huber" else ("huber", "huber", loss, loss)


def _check(shape: Any, cloud: ShardedPoints, weights: Any, fairness: float, bending: float | None) -> Float[Array, "N"]:
    check_finite(cloud)
    check_weights(fairness, bending)
    for kind, controls, name in ((BSplineSurface, "control_points", "control points"), (QISurface, "tangents", "tangents")):
        if isinstance(shape, kind):
            n, m = getattr(shape, controls).shape[:2]
            if cloud.count < n * m:
                raise InputError(
                    f"`points` must be at least as many as the {n * m} {name} ({n} × {m}), got {cloud.count}; "
                    "take fewer or measure more points."
                )
    if weights is None:
        return cloud.counted
    weights = as_float(weights, cloud.points.dtype)
    if mesh_of(weights) is None and weights.shape != (cloud.here,):
        raise InputError(f"`weights` must have shape ({cloud.here},), one for each point, got {weights.shape}.")
    if mesh_of(weights) is None and is_concrete(weights) and not _counting(cloud, concrete(weights)):
        raise InputError("`weights` must be ≥ 0 and not all 0.")
    return cloud.spread(weights) * cloud.counted


def _counting(cloud: ShardedPoints, weights: np.ndarray) -> bool:
    return bool(np.all(weights >= 0) and cloud.summed(np.asarray(np.sum(weights > 0))) > 0)


def check_weights(fairness: float, bending: float | None) -> None:
    """Refuse weights of penalties that are negative or not finite."""
    if not all(0 <= weight < np.inf for weight in (fairness, bending or 0)):
        raise InputError(f"`fairness` and `bending` must be ≥ 0, got {fairness} and {bending}.")


def _faint(shape: Any) -> float:
    """A bending weight that takes 10⁻⁴ off a ripple of two spans' wavelength (attenuation = α (π · spans)⁴).

    On a 6 × 6 net and 600 points with noise the surface is then 0.3 of the noise off; at 10⁻⁶ the net folds into the
    noise and is up to 1.7 of it off, at 10⁻² exact points are missed by 3·10⁻⁴ of the sheet's size.
    """
    if isinstance(shape, QICurve | QISurface):
        return (
            1e-7  # of the sum of squared turns; without it neighbours on bunny_back drift to 180° apart for 8 % of the rms
        )
    if not isinstance(shape, BSplineSurface):
        return 0.0
    return faint_bending(max(shape.control_points.shape[:2]), 1e-4)


def faint_bending(count: int, attenuation: float) -> float:
    """The bending weight that takes the share `attenuation` off the shortest ripple that `count` control points carry."""
    return attenuation / (np.pi * count) ** 4


@eqx.filter_jit
def side_lengths(surface: AbstractSurface) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Mean lengths of the u-lines and of the v-lines, from a coarse grid."""
    (a, b), (c, d) = surface.domain
    share = jnp.linspace(0, 1, 17, dtype=surface.dtype)
    grid = jax.lax.stop_gradient(surface.grid_points(a + (b - a) * share, c + (d - c) * share))
    length = lambda axis: jnp.mean(jnp.sum(jnp.sqrt(jnp.sum(jnp.diff(grid, axis=axis) ** 2, -1)), axis=axis))
    return length(0), length(1)
