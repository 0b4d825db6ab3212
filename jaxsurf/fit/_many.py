"""Many clouds fitted at once, in one compiled call."""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from ..curve import AbstractCurve
from ..query import feet_with_derivatives, nearest_samples, refine_feet
from ..surface import AbstractSurface
from ._deviation import Deviation
from ._fit import check_options, usual_tolerance
from ._fixed import bound_to
from ._found import Fit, attached, frozen, given_way
from ._implicit import with_derivatives
from ._lanes import solve_all
from ._losses import find_loss
from ._pose import Round, posed, staged, stages

_TOGETHER = 4096  # points of scans that are worked on side by side: they stay in the caches
_TURNS = 4  # steps by which feet follow a step of the solver: all wait for the slowest


def fit_many(
    shape: AbstractCurve | AbstractSurface,
    clouds: Numbers | Sequence[Numbers],
    *,
    weights: Numbers | Sequence[Numbers] | None = None,
    stacked: bool = False,
    loss: str = "squared",
    trimmed: float = 0.0,
    fairness: float = 0.0,
    bending: float | None = None,
    free: Callable[[Any], Any] | None = None,
    fixed: Callable[[Any], Any] | Sequence[Callable[[Any], Any]] = (),
    sliding: float = 0.1,
    release: float = 1e3,
    rtol: float | None = None,
    max_steps: int = 60,
) -> Fit:
    """Fit one shape to each of many clouds; the compiled call serves again for as many clouds of as many points.

    shape: the start of all fits, or with `stacked=True` a shape of which every array has one more axis in front, a start
    for each cloud (as `eqx.filter_vmap` makes). clouds: (K, N, 3), or a sequence of K arrays (N_i, 3) of different size,
    which are padded to the longest with points of weight 0. weights: (K, N), or a sequence alike. All else as in `fit`, the
    same for all; what `fixed` takes from a start it takes from the first one.

    Returns a `Fit` with an axis K in front of every array; distances of padding are 0. `jax.tree.map(lambda x: x[k],
    found.shape)` is the k-th shape. Some clouds are worked on side by side; one that is done makes room for the next. First
    feet are the nearest of a grid of samples, so that shapes which fold back on themselves need a start near by.
    Differentiable like `fit`. Raises `InputError` on clouds that are empty or not finite.
    """
    points, weights = padded(clouds, weights, shape.dtype)
    find_loss(loss)
    check_options(fairness, bending, trimmed)
    if stacked and any(x.shape[:1] != points.shape[:1] for x in jax.tree.leaves(eqx.filter(shape, eqx.is_array))):
        raise InputError(f"With `stacked=True` every array of `shape` must have {points.shape[0]} entries, one a cloud.")
    arrays, others = eqx.partition(shape, eqx.is_array)
    if not stacked:
        arrays = jax.tree.map(lambda x: jnp.broadcast_to(x[None], (points.shape[0], *x.shape)), arrays)
    shapes = eqx.combine(arrays, others)
    first = jax.tree.map(lambda x: x[0] if eqx.is_array(x) else x, shapes)
    conditions = bound_to(first, (fixed,) if callable(fixed) else tuple(fixed))
    pose = {"fairness": fairness, "bending": bending, "free": free, "fixed": conditions, "sliding": sliding}
    steering = {"rtol": rtol, "release": release, "max_steps": max_steps}
    return _fit_many(shapes, points, weights, pose, stages(loss, trimmed), steering)


@eqx.filter_jit
def _fit_many(
    shapes: Any,
    points: Array,
    weights: Array,
    pose: dict[str, Any],
    rounds: tuple[Round, ...],
    steering: dict[str, Any],
) -> Fit:
    each = lambda f: eqx.filter_vmap(f)
    given = (shapes, points, weights)
    shapes, points, weights = frozen(given)
    put = lambda shape, points, weights: posed(shape, points, weights, rest=None, held=False, turns=_TURNS, **pose)
    problems = each(put)(shapes, points, weights)
    feet = each(nearest_samples)(shapes, points)
    steps, freed, found = jnp.zeros(points.shape[0], jnp.int32), jnp.zeros(points.shape[0], points.dtype), None
    bent = problems.bending
    if steering["rtol"] is None:
        steering = {**steering, "rtol": usual_tolerance(problems, points.shape[1])}
    for stage in rounds:
        put = lambda problem, feet, weights, bent, stage=stage: staged(problem, feet, weights, bent, stage)
        problems = each(put)(problems, feet, weights, bent)
        found = solve_all(problems, feet, max(1, _TOGETHER // points.shape[1]), **steering)
        shapes = each(lambda problem, theta: problem.member(theta))(problems, found.theta)
        problems, feet, steps = eqx.tree_at(lambda p: p.shape, problems, shapes), found.feet, steps + found.steps
        freed = freed + found.freed
    assert found is not None
    feet = each(lambda shape, points, feet: refine_feet(shape, points, feet))(shapes, points, feet)
    problems = each(given_way)(problems, freed)
    # without anyone who asks for derivatives this is the identity
    problems = each(attached)(problems, *given)
    shapes = each(lambda problem, theta, feet: problem.member(with_derivatives(problem, theta, feet)))(
        problems, found.theta, feet
    )
    foot = each(feet_with_derivatives)(shapes, problems.points, feet)
    deviation = Deviation(jnp.where(weights > 0, foot.distance, 0))
    return Fit(shapes, foot, deviation, found.result, steps, False, problems)


def padded(clouds: Any, weights: Any, dtype: Any) -> tuple[Float[Array, "K N d"], Float[Array, "K N"]]:
    """Clouds of equal length and their weights, 0 where points are copies that fill up."""
    try:
        rows = [clouds] if isinstance(clouds, jax.Array | np.ndarray) else [as_float(c, dtype) for c in clouds]
    except TypeError as error:
        raise InputError(f"`clouds` must be a sequence of arrays (N, 3), got {type(clouds).__name__}.") from error
    if isinstance(clouds, jax.Array | np.ndarray):
        points = as_float(clouds, dtype)
        if points.ndim != 3 or points.shape[0] == 0 or points.shape[1] == 0:
            raise InputError(f"`clouds` must have shape (K, N, 3) with K and N above 0, got {points.shape}.")
        given = jnp.ones(points.shape[:2], dtype) if weights is None else as_float(weights, dtype)
        if given.shape != points.shape[:2]:
            raise InputError(f"`weights` must have shape {points.shape[:2]}, one for each point, got {given.shape}.")
    else:
        for k, cloud in enumerate(rows):
            if cloud.ndim != 2 or cloud.shape[0] == 0:
                raise InputError(f"`clouds` must hold arrays (N, 3) with points, but number {k + 1} is {cloud.shape}.")
        if not rows:
            raise InputError("`clouds` must hold at least one cloud, got none.")
        longest = max(len(cloud) for cloud in rows)
        points = jnp.stack([jnp.pad(c, ((0, longest - len(c)), (0, 0)), mode="edge") for c in rows])
        marks = [jnp.ones(len(c), dtype) for c in rows] if weights is None else [as_float(w, dtype) for w in weights]
        if [mark.shape for mark in marks] != [cloud.shape[:1] for cloud in rows]:
            raise InputError(
                "`weights` must hold an array for each of the `clouds`, with one weight for each of its points."
            )
        given = jnp.stack([jnp.pad(mark, (0, longest - len(mark))) for mark in marks])
    if is_concrete(points) and not np.all(np.isfinite(concrete(points))):
        k = int(np.argmin(np.all(np.isfinite(concrete(points)), axis=(1, 2))))
        raise InputError(f"`clouds` must be finite, but number {k + 1} is not; remove its points that are not.")
    return points, given
