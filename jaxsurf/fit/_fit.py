"""Fit the control data of a shape to measured points."""

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .. import _safe
from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import GeometryWarning, InputError
from .._progress import Progress, silent
from ..curve import AbstractCurve
from ..query import Foot, closest_point, feet_with_derivatives, foot_at
from ..surface import AbstractSurface, BSplineSurface, QISurface
from ._chunks import CHUNK, over_chunks
from ._deviation import Deviation
from ._fixed import AbstractCondition, bound_to
from ._found import Fit, attached, frozen, given_way
from ._implicit import with_derivatives
from ._linear import linear_fit
from ._losses import find_loss
from ._pose import posed, staged, stages
from ._problem import Free, Problem, moved
from ._shard import at_home, mesh_of, over_shards
from ._sharded_points import ShardedPoints, check_finite, whole_points
from ._snapshot import Snapshot
from ._solve import Solved, solve

_RENEWALS = 3
_UNSETTLED = 6  # steps of a round from which the next one differs anyway
# share of the gain that a free number owes to noise; after a step that gains less for each no other is taken: of nets, which
# then glide into the noise, and of other shapes
_SIGNIFICANT, _FINE = 0.1, 0.01


def fit(
    shape: AbstractCurve | AbstractSurface,
    points: Numbers | ShardedPoints,
    *,
    loss: str = "squared",
    trimmed: float = 0.0,
    fairness: float = 0.0,
    bending: float | None = None,
    rest: BSplineSurface | None = None,
    free: Callable[[Any], Any] | None = None,
    fixed: Callable[[Any], Any] | Sequence[Callable[[Any], Any]] = (),
    weights: Numbers | None = None,
    start: Numbers | None = None,
    parameters: Numbers | None = None,
    sliding: float = 0.1,
    release: float = 1e3,
    rtol: float | None = None,
    max_steps: int = 60,
    solver: optx.AbstractMinimiser | None = None,
    progress: Progress = silent,
    phase: str = "fit",
    resume: Snapshot | None = None,
) -> Fit:
    """Fit a curve or surface to an unordered cloud (N, 3): minimise the distances of the points to their feet on it.

    shape: the member of the family to start from. free: picks the arrays that may move, as in
    `free=lambda s: s.control_points`; by default all but knots. fixed: what the shape must keep, such as `js.FixedEdge`,
    `js.FixedPoint`, `js.TangentPlane`, `js.Symmetry`, or functions of the shape whose values are to vanish. weights: (N,)
    ≥ 0, such as 1/variance. loss: "squared", "huber", "cauchy" or "tukey", whose scale follows the noise found; trimmed:
    share of the points, the farthest, that do not count. fairness: weight of the scale-free curvature variation
    against the mean squared distance in units of size²; it does not shrink circles (useful: 1e-9 … 1e-3). bending: weight of
    the quadratic bending energy of B-spline nets, and of the turns between control tangents of QI shapes, that holds what no
    point determines; `None` is a weight too weak to be seen in the covered part. rest: the net on the same knots from which
    bending is counted, by default a flat one.
    start: parameters of first feet, from an earlier fit. parameters: those of the points, where they are known: each point
    is then compared with the place of its own. sliding: how much the solver resists gliding of the net along the
    sheet, which points do not see; release: by how much at most that falls while steps are as good as predicted. Both steer
    the way, not the goal, but a net that glides long enough fits the noise too. rtol: relative gain of the objective below
    which a step is the last; by default where it is no more than noise gives to the free numbers, and at least 1e-5.
    solver: an `optimistix` minimiser to use instead of Levenberg-Marquardt on normal equations, such as `optx.BFGS`; it
    minimises the value alone and knows no `fixed`. phase: what `progress` is told; resume: `Event.snapshot` of such a fit
    that was cut off, to go on there with the same arguments. Points of `shard_points`, weights then of this process's, are
    worked on by all of their devices; `Fit.foot` and `Fit.deviation` lie spread likewise if there are several processes.

    Levenberg-Marquardt on signed distances with the feet eliminated (Gauss-Newton by the envelope theorem), normal
    equations accumulated in chunks, stepped by optimistix; one linear solve for nets at known parameters. Differentiable in
    points, weights, and all of `shape` that is not free, by the implicit function theorem: exact where the fit has
    converged, so with a small `rtol`; the scale of a robust loss is held. Under `jax.jit`, `grad` and `vmap` it is silent;
    for many clouds see `js.fit_many`.
    Raises `InputError` on points that are not finite or fewer than the shape's control points can use, and where what is
    fixed cannot be kept.
    """
    cloud = whole_points(points, shape.dtype)
    mesh = cloud.mesh
    find_loss(loss)
    checked = _check(shape, cloud, weights)
    check_options(fairness, bending, trimmed)
    conditions = bound_to(shape, (fixed,) if callable(fixed) else tuple(fixed))
    if solver is not None and (conditions or mesh is not None):
        raise InputError("`solver` works with neither `fixed` nor points of `shard_points`; leave it out.")
    known = parameters is not None
    asked = (shape, cloud.points, checked, rest, conditions)
    traced = not is_concrete(asked, start, parameters)
    shape, places, counts, rest, conditions = frozen(asked)
    problem = posed(
        shape,
        places,
        counts,
        fairness=fairness,
        bending=bending,
        rest=rest,
        free=free,
        fixed=conditions,
        sliding=sliding,
        held=known,
        mesh=mesh,
    )
    if resume is not None:
        shape, start = _moved(shape, jnp.asarray(resume.theta, shape.dtype), problem.free), None
        problem = eqx.tree_at(lambda p: p.shape, problem, shape)
    feet = _first_feet(shape, cloud, places, parameters if known else start, "parameters" if known else "start")
    options = {"max_steps": max_steps, "release": release, "phase": phase, "solver": solver}
    options["rtol"] = usual_tolerance(problem, cloud.count) if rtol is None else rtol
    total, freed = np.int32(0), jnp.zeros((), places.dtype)
    found: Solved | None = None
    bent = problem.bending
    for turn, stage in enumerate(stages(loss, trimmed)):
        if resume is not None and turn < resume.round:
            continue
        problem = staged(problem, feet, counts, bent, stage, None if resume is None else resume.scale)
        told = silent if traced or progress is silent else _telling(progress, turn, problem.scale)
        for _ in range(_RENEWALS + 1):
            steer = options if stage.settled else {**options, "release": 1.0, "max_steps": min(max_steps, _UNSETTLED)}
            found = _solved(problem, feet, {**steer, "progress": told, "resume": resume})
            shape, feet, resume = _moved(shape, at_home(found.theta, mesh), problem.free), found.feet, None
            total = total + at_home(found.steps, mesh).astype(jnp.int32)
            freed = freed + at_home(found.freed, mesh)
            was_ready = jax.tree.structure(shape)
            shape = shape.renewed()
            # bent further than it was ready for: once more from here
            again = not found.stopped and jax.tree.structure(shape) != was_ready
            problem = eqx.tree_at(lambda p: p.shape, problem, shape)
            if not again:
                break
        if found is not None and found.stopped:
            break
    assert found is not None
    problem, result = given_way(problem, freed), at_home(found.result, mesh)
    if traced:
        problem = attached(problem, *asked)
        shape = problem.member(with_derivatives(problem, found.theta, feet))
        foot = (foot_at if known else feet_with_derivatives)(shape, problem.points, feet)
        foot = _from_own_places(foot, problem.points) if known else foot
        deviation = Deviation(foot.distance)
    else:
        if conditions:
            _check_kept(problem, at_home(found.theta, mesh), asked[0])
        foot, deviation = _at_feet(shape, cloud, feet)
        if known:
            foot = _from_own_places(foot, cloud.home(cloud.points))
            deviation = eqx.tree_at(lambda d: d.signed, deviation, foot.distance)
        problem = _at_home(problem, cloud)
    return Fit(shape, foot, deviation, result, jnp.asarray(total, jnp.int32), found.stopped, problem)


def nearest_feet(shape: Any, cloud: ShardedPoints) -> tuple[Foot, Deviation]:
    """The feet of a cloud on a shape, as a fit gives them."""
    return _at_feet(shape, cloud, over_shards(cloud.mesh, _nearest, shape, cloud.points))


def _first_feet(shape: Any, cloud: ShardedPoints, points: Array, given: Any, name: str) -> Float[Array, "N k"]:
    if given is None:
        return over_shards(cloud.mesh, _nearest, shape, points)
    count = 1 if isinstance(shape, AbstractCurve) else 2
    feet = jax.lax.stop_gradient(as_float(given, points.dtype))
    if mesh_of(feet) is None and feet.size != cloud.here * count:
        raise InputError(f"`{name}` must hold those of {cloud.here} points, {count} each, got shape {feet.shape}.")
    return cloud.spread(feet if mesh_of(feet) is not None else feet.reshape(-1, count))


def _solved(problem: Problem, feet: Float[Array, "N k"], options: dict[str, Any]) -> Solved:
    """By one linear solve where the objective is quadratic, else step by step."""
    net = isinstance(problem.shape, BSplineSurface) and problem.free == (True, False, False)
    quadratic = problem.held and net and problem.loss == "squared" and not problem.fair
    from_flat = is_concrete(problem.rest) and not np.any(concrete(problem.rest))
    if not quadratic or not from_flat or problem.fixed or options["solver"] is not None:
        return solve(problem, feet, **options)
    assert problem.penalty is not None
    net = linear_fit(
        problem.shape, problem.points, feet, problem.weights, problem.penalty, problem.bending, mesh=problem.mesh
    )
    one, freely = jnp.asarray(np.int32(1)), jnp.full((), jnp.inf, net.dtype)
    return Solved(net.reshape(-1), feet, one, optx.RESULTS.successful, freely)


def _at_feet(shape: Any, cloud: ShardedPoints, feet: Array) -> tuple[Foot, Deviation]:
    foot = cloud.home(over_shards(cloud.mesh, _feet, shape, cloud.points, feet))
    return foot, Deviation(foot.distance, None if cloud.alone else cloud.counted)


@eqx.filter_jit
def _from_own_places(foot: Foot, points: Array) -> Foot:
    """Distances of points to places that are not their feet, with the sign of the side."""
    whole = _safe.norm(points - foot.points)
    return eqx.tree_at(lambda f: f.distance, foot, jnp.where(foot.distance < 0, -whole, whole))


def _at_home(problem: Problem, cloud: ShardedPoints) -> Problem:
    """The problem with the rows of this process alone, where it has all of them."""
    if problem.mesh is None or not cloud.alone:
        return problem
    rows = cloud.home((problem.points, problem.weights))
    return Problem(**{**vars(problem), "points": rows[0], "weights": rows[1], "mesh": None})


def _nearest(shape: Any, points: Array) -> Float[Array, "N k"]:
    return _nearest_by_chunks(shape, points) if points.shape[0] > CHUNK else _nearest_of_few(shape, points)


def _nearest_of_few(shape: Any, points: Array) -> Float[Array, "N k"]:
    return closest_point(shape, points).parameters.reshape(points.shape[0], -1)


@eqx.filter_jit
def _nearest_by_chunks(shape: Any, points: Array) -> Float[Array, "N k"]:
    return over_chunks(lambda _, rows, new: (None, _nearest_of_few(shape, rows)), None, points)[1]


def _feet(shape: Any, points: Array, feet: Array) -> Foot:
    return foot_at(shape, points, feet)


def _telling(progress: Progress, turn: int, scale: Array) -> Progress:
    """The progress, told too in which robust round it is."""
    numbers = {"round": turn, "scale": float(scale)}
    return lambda event: progress(event._replace(snapshot=event.snapshot and event.snapshot._replace(**numbers)))


@eqx.filter_jit
def _moved(shape: Any, theta: Array, free: Free) -> Any:
    return moved(shape, theta, free)


def _check_kept(problem: Problem, theta: Array, start: Any) -> None:
    left = np.abs(concrete(_violation(problem, theta)))
    if left.size and not left.max() < 1e-6:
        raise InputError(
            f"`fixed` cannot be kept by this shape: condition {int(left.argmax()) + 1} of {left.size} is off by "
            f"{left.max():.3g}; the conditions contradict each other, or too little is free."
        )
    for condition in problem.fixed:
        complaint = condition.complaint(start, problem.member(theta)) if isinstance(condition, AbstractCondition) else None
        if complaint:
            warnings.warn(complaint, GeometryWarning, stacklevel=3)


@eqx.filter_jit
def _violation(problem: Problem, theta: Array) -> Array:
    return problem.violation(theta)


def _check(shape: Any, cloud: ShardedPoints, weights: Any) -> Float[Array, "N"]:
    check_finite(cloud)
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
    return weights if mesh_of(cloud.points) is None and cloud.mesh is None else cloud.spread(weights) * cloud.counted


def _counting(cloud: ShardedPoints, weights: np.ndarray) -> bool:
    return bool(np.all(weights >= 0) and cloud.summed(np.asarray(np.sum(weights > 0))) > 0)


def usual_tolerance(problem: Problem, points: int) -> float:
    """The relative gain of a step that the free numbers owe to the noise of so many points; smaller ones mean nothing."""
    return max(1e-5, (_FINE if problem.penalty is None else _SIGNIFICANT) * problem.rest.shape[-1] / points)


def check_options(fairness: float, bending: float | None, trimmed: float) -> None:
    """Refuse penalties and shares out of range."""
    check_weights(fairness, bending)
    if not 0 <= trimmed < 1:
        raise InputError(f"`trimmed` must be a share in [0, 1), got {trimmed}.")


def check_weights(fairness: float, bending: float | None) -> None:
    """Refuse weights of penalties that are negative or not finite."""
    if not all(0 <= weight < np.inf for weight in (fairness, bending or 0)):
        raise InputError(f"`fairness` and `bending` must be ≥ 0, got {fairness} and {bending}.")
