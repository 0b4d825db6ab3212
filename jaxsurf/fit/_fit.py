"""Fit the control data of a shape to measured points."""

from collections.abc import Callable, Sequence
from statistics import NormalDist
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from .. import _safe
from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._progress import Progress, silent
from ..curve import AbstractCurve
from ..query import Foot, closest_point, feet_with_derivatives, foot_at
from ..surface import AbstractSurface, BSplineSurface, QISurface
from ._deviation import Deviation
from ._fixed import bound_to
from ._implicit import with_derivatives
from ._losses import find_loss, noise_scale
from ._pose import diagonal, posed, staged, stages
from ._problem import Problem, unknowns_of
from ._solve import Solved, solve
from ._uncertainty import Uncertainty, uncertainty_of

_RENEWALS = 3
_SIGNIFICANT = 0.1  # share of the gain that a free number owes to noise; steps that gain less for each are not taken


class Fit(eqx.Module):
    """What a fit found.

    shape: the fitted member of the family; foot: the feet of all points on it; deviation: their distances; result: how
    the solver ended, an `optimistix.RESULTS`; steps: solver steps in all; stopped: whether `progress` asked to stop;
    problem: what was solved, in the end, with the resistance to gliding that all its steps amount to. Of `fit_many` all
    arrays have an axis K in front.
    """

    shape: Any
    foot: Foot
    deviation: Deviation
    result: Any
    steps: Int[Array, "*K"]
    stopped: bool
    problem: Problem

    @property
    def converged(self) -> Any:
        """Whether the solver met its tolerance."""
        return self.result == optx.RESULTS.successful

    @property
    def rms(self) -> Float[Array, "*K"]:
        """Root of the weighted mean square distance, of each cloud where there are many."""
        counted = self.problem.weights
        square = jnp.sum(counted * self.deviation.signed**2, axis=-1) / jnp.sum(counted, axis=-1)
        return jnp.sqrt(square)

    @property
    def outliers(self) -> Bool[Array, "*K N"]:
        """Which points lie so far off that noise would put one of twenty such clouds there; the noise is taken from the
        median of the distances."""
        counted = self.problem.weights
        noise = noise_scale(self.deviation.signed, counted)
        chance = 0.05 / max(counted.shape[-1], 1)
        return jnp.abs(self.deviation.signed) > noise[..., None] * NormalDist().inv_cdf(1 - chance / 2)

    def uncertainty(self, noise: float | None = None) -> Uncertainty:
        """Variances of the control data and of the shape's places; see `Uncertainty`.

        noise: standard deviation of a measurement of weight 1, so 1 if weights are 1/variance; by default taken from the
        distances.
        """
        return uncertainty_of(self.problem, self.problem.unknowns(self.shape), self._feet, noise)

    @property
    def _feet(self) -> Array:
        return self.foot.parameters.reshape(self.problem.points.shape[0], -1)


def fit(
    shape: AbstractCurve | AbstractSurface,
    points: Numbers,
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
    minimises the value alone and knows no `fixed`. phase: what `progress` is told.

    Levenberg-Marquardt on signed distances with the feet eliminated (Gauss-Newton by the envelope theorem), normal
    equations accumulated in chunks, stepped by optimistix. Differentiable in points, weights, and all of `shape` that is not
    free, by the implicit function theorem: exact where the fit has converged, so with a small `rtol`; the scale of a robust
    loss is held. Under `jax.jit`, `grad` and `vmap` it is silent; for many clouds see `js.fit_many`.
    Raises `InputError` on points that are not finite or fewer than the shape's control points can use, and where what is
    fixed cannot be kept.
    """
    points = as_float(points, shape.dtype)
    find_loss(loss)
    weights = _check(shape, points, weights)
    check_options(fairness, bending, trimmed)
    fixed = bound_to(shape, (fixed,) if callable(fixed) else tuple(fixed))
    known = parameters is not None
    traced = not is_concrete(shape, points, weights, start, parameters, fixed)
    asked, given = (shape, points, weights, rest, fixed), frozen((shape, points, weights, rest, fixed))
    shape, points, weights, rest, fixed = given
    if known or start is not None:
        feet = jax.lax.stop_gradient(as_float(parameters if known else start, points.dtype))
        if feet.size != points.shape[0] * parameter_count(shape):
            name = "parameters" if known else "start"
            raise InputError(f"`{name}` must hold those of {points.shape[0]} points, got shape {feet.shape}.")
    else:
        feet = closest_point(shape, points).parameters
    feet = feet.reshape(points.shape[0], -1)
    problem = posed(
        shape,
        points,
        weights,
        fairness=fairness,
        bending=bending,
        rest=rest,
        free=free,
        fixed=fixed,
        sliding=sliding,
        held=known,
    )
    if rtol is None:
        rtol = usual_tolerance(unknowns_of(shape, problem.free).size, points.shape[0])
    options = {"rtol": rtol, "max_steps": max_steps, "release": release, "phase": phase, "solver": solver}
    options["progress"] = silent if traced else progress
    total, freed = np.int32(0), jnp.zeros((), points.dtype)
    found: Solved | None = None
    for name, share in stages(loss, trimmed):
        problem = staged(problem, feet, weights, name, share)
        for _ in range(_RENEWALS + 1):
            found = solve(problem, feet, **options)
            shape, feet, total = _member(problem, found.theta), found.feet, total + found.steps
            freed = freed + found.freed
            was_ready = jax.tree.structure(shape)
            shape = shape.renewed()
            if found.stopped or jax.tree.structure(shape) == was_ready:
                break
            # bent further than it was ready for: once more from here
            problem = eqx.tree_at(lambda p: p.shape, problem, shape)
        problem = eqx.tree_at(lambda p: p.shape, problem, shape)
        if found is not None and found.stopped:
            break
    assert found is not None
    problem = given_way(problem, freed)
    if traced:
        problem = attached(problem, *asked)
        shape = problem.member(with_derivatives(problem, found.theta, feet))
    elif fixed:
        _check_kept(problem, found.theta)
    at_feet = feet_with_derivatives if traced and not known else foot_at
    foot = at_feet(shape, problem.points, feet)
    deviation = Deviation(foot.distance)
    return Fit(shape, foot, deviation, found.result, jnp.asarray(total, jnp.int32), found.stopped, problem)


def frozen(tree: Any) -> Any:
    """The same numbers, without derivatives."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_inexact_array(x) else x, tree)


def parameter_count(shape: Any) -> int:
    """How many parameters a place on the shape has."""
    return 1 if isinstance(shape, AbstractCurve) else 2


def given_way(problem: Problem, freed: Float[Array, ""]) -> Problem:
    """The problem with the resistance to gliding that all steps together amount to."""
    return eqx.tree_at(lambda p: p.sliding, problem, jnp.minimum(problem.sliding, _safe.divide(jnp.ones_like(freed), freed)))


def attached(problem: Problem, shape: Any, points: Any, weights: Any, rest: Any = None, fixed: Any = None) -> Problem:
    """The problem with the numbers that were given, which carry derivatives: all but what was free."""
    leaves, structure = jax.tree.flatten(problem.shape)
    given = jax.tree.leaves(shape)
    if len(given) == len(leaves):
        leaves = [old if free else new for old, new, free in zip(leaves, given, problem.free, strict=True)]
    trimmed = jax.lax.stop_gradient(_safe.divide(problem.weights, jax.lax.stop_gradient(weights)))
    known = (jax.tree.unflatten(structure, leaves), points, weights * trimmed, diagonal(points))
    problem = eqx.tree_at(lambda p: (p.shape, p.points, p.weights, p.size), problem, known)
    if fixed:
        problem = eqx.tree_at(lambda p: p.fixed, problem, fixed)
    return problem if rest is None else eqx.tree_at(lambda p: p.rest, problem, unknowns_of(rest, problem.free))


def _check_kept(problem: Problem, theta: Array) -> None:
    left = np.abs(concrete(_violation(problem, theta)))
    if left.size and not left.max() < 1e-6:
        raise InputError(
            f"`fixed` cannot be kept by this shape: condition {int(left.argmax()) + 1} of {left.size} is off by "
            f"{left.max():.3g}; the conditions contradict each other, or too little is free."
        )


@eqx.filter_jit
def _violation(problem: Problem, theta: Array) -> Array:
    return problem.violation(theta)


@eqx.filter_jit
def _member(problem: Problem, theta: Array) -> Any:
    return problem.member(theta)


def _check(shape: Any, points: Array, weights: Any) -> Float[Array, "N"]:
    if points.ndim != 2:
        raise InputError(f"`points` must have shape (N, 3), got {points.shape}.")
    if is_concrete(points) and not np.all(np.isfinite(concrete(points))):
        row = int(np.argmin(np.all(np.isfinite(concrete(points)), axis=1)))
        raise InputError(f"`points` must be finite, but point {row + 1} is {concrete(points)[row]}; remove it.")
    for kind, controls, name in ((BSplineSurface, "control_points", "control points"), (QISurface, "tangents", "tangents")):
        if isinstance(shape, kind):
            n, m = getattr(shape, controls).shape[:2]
            if points.shape[0] < n * m:
                raise InputError(
                    f"`points` must be at least as many as the {n * m} {name} ({n} × {m}), got {points.shape[0]}; "
                    "take fewer or measure more points."
                )
    if weights is None:
        return jnp.asarray(np.ones(points.shape[0]), points.dtype)
    weights = as_float(weights, points.dtype)
    if weights.shape != points.shape[:1]:
        raise InputError(f"`weights` must have shape ({points.shape[0]},), one for each point, got {weights.shape}.")
    if is_concrete(weights) and not (np.all(concrete(weights) >= 0) and np.any(concrete(weights) > 0)):
        raise InputError("`weights` must be ≥ 0 and not all 0.")
    return weights


def usual_tolerance(numbers: int, points: int) -> float:
    """The relative gain of a step that so many free numbers owe to the noise of the points; smaller ones mean nothing."""
    return max(1e-5, _SIGNIFICANT * numbers / points)


def check_options(fairness: float, bending: float | None, trimmed: float) -> None:
    """Refuse penalties and shares out of range."""
    check_weights(fairness, bending)
    if not 0 <= trimmed < 1:
        raise InputError(f"`trimmed` must be a share in [0, 1), got {trimmed}.")


def check_weights(fairness: float, bending: float | None) -> None:
    """Refuse weights of penalties that are negative or not finite."""
    if not all(0 <= weight < np.inf for weight in (fairness, bending or 0)):
        raise InputError(f"`fairness` and `bending` must be ≥ 0, got {fairness} and {bending}.")
