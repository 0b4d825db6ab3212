"""How a fit is posed: its units, its quiet background, and the rounds of robust losses."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._errors import InputError
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve, QICurve
from ..query import foot_at
from ..surface import AbstractSurface, BSplineSurface, NURBSSurface, QISurface
from ._bending import bending_of
from ._losses import find_loss, noise_scale
from ._problem import Free, Problem, free_leaves, unknowns_of
from ._quantile import quantile
from ._shard import at_home, over_shards

_NETS = (BSplineSurface, NURBSSurface, BSplineCurve, NURBSCurve)
STIFFER = 100.0  # times the bending by which a robust fit starts
_HALVINGS = 5  # rounds in which the better half of the points is chosen anew
_TRIMMINGS = 4  # rounds in which the farthest points are chosen anew


def posed(
    shape: Any,
    points: Float[Array, "N d"],
    weights: Float[Array, "N"],
    *,
    fairness: float,
    bending: float | None,
    rest: Any,
    free: Callable[[Any], Any] | None,
    fixed: tuple[Callable[[Any], Any], ...],
    sliding: float,
    held: bool,
    turns: int = 60,
    mesh: Any = None,
) -> Problem:
    """The problem of the squared loss."""
    flags = free_leaves(shape, free)
    number = lambda x: jnp.asarray(x, shape.dtype)
    net = isinstance(shape, _NETS) and flags[0]
    return Problem(
        shape,
        points,
        weights,
        at_home(diagonal(points), mesh),
        number(1),
        number(_faint(shape) if bending is None else bending),
        number(fairness),
        number(sliding),
        _rest(shape, rest, flags),
        bending_of(shape, side_lengths(shape)) if net else None,
        fixed,
        flags,
        "squared",
        fairness != 0,
        held,
        turns,
        mesh,
    )


class Round(NamedTuple):
    """One solve of a robust fit: the loss, the share of the points that does not count, and whether the shape is thought to
    be near where it belongs."""

    loss: str
    trimmed: float = 0.0
    settled: bool = False


def stages(loss: str, trimmed: float) -> tuple[Round, ...]:
    """The rounds of a fit, each with the noise found anew. A loss that forgets far points has minima of its own about every
    group of points: it starts from the better half of the points, found in rounds of its own, and from a stiffer shape
    that does not reach out for the others. Borders then lie too far inside; a loss that lets no point go brings them back
    first. Source: Rousseeuw, Leroy, Robust regression and outlier detection, 1987."""
    if loss == "squared" and trimmed == 0:
        return (Round("squared", settled=True),)
    if loss == "huber" and trimmed == 0:
        return (Round("huber", settled=True),) * 3
    start = (Round("huber"), *[Round("squared", trimmed=0.5)] * _HALVINGS, Round("cauchy", settled=True))
    if trimmed > 0:
        return (*start, *[Round("squared" if loss == "tukey" else loss, trimmed, settled=True)] * _TRIMMINGS)
    return (*start, Round(loss, settled=True), Round(loss, settled=True))


def staged(
    problem: Problem,
    feet: Array,
    weights: Float[Array, "N"],
    bending: Float[Array, ""],
    stage: Round,
    scale: float | None = None,
) -> Problem:
    """The problem of the next round: its loss, the scale by the distances now, unless it is known, the farthest points
    without weight."""
    if stage == Round("squared", settled=True):
        return problem
    distance = over_shards(problem.mesh, _distances, problem.shape, problem.points, feet)
    found, weights = _scale_and_weights(distance, weights, problem.size, stage)
    known = at_home(found, problem.mesh) if scale is None else jnp.asarray(scale, distance.dtype)
    stiff = bending if stage.settled else STIFFER * bending
    problem = eqx.tree_at(lambda p: (p.scale, p.weights, p.bending), problem, (known, weights, stiff))
    return Problem(**{**vars(problem), "loss": stage.loss})


def _distances(shape: Any, points: Array, feet: Array) -> Float[Array, "N"]:
    return jnp.abs(foot_at(shape, points, feet).distance)


@eqx.filter_jit
def _scale_and_weights(distance: Array, weights: Array, size: Array, stage: Round) -> tuple[Array, Array]:
    if stage.trimmed > 0:
        far = quantile(distance, weights > 0, jnp.asarray(1 - stage.trimmed, distance.dtype))
        weights = jnp.where(distance <= far, weights, 0)
    noise = noise_scale(distance, weights) * find_loss(stage.loss).deviations
    return jnp.maximum(noise, 1e-12 * size), weights


@eqx.filter_jit
def diagonal(points: Array) -> Float[Array, ""]:
    """Diagonal of the points' bounding box."""
    return jnp.sqrt(jnp.sum((jnp.max(points, axis=0) - jnp.min(points, axis=0)) ** 2))


def _rest(shape: Any, rest: Any, free: Free) -> Float[Array, "P"]:
    """Unknowns of the shape at rest."""
    if rest is not None and jax.tree.map(jnp.shape, rest) != jax.tree.map(jnp.shape, shape):
        raise InputError("`rest` must be a shape of the same class and sizes as `shape`; insert the knots that it lacks.")
    return jnp.zeros_like(unknowns_of(shape, free)) if rest is None else unknowns_of(rest, free)


def _faint(shape: Any) -> float:
    """A bending weight that takes 10⁻⁴ off a ripple of two spans' wavelength (attenuation = α (π · spans)⁴).

    On a 6 × 6 net and 600 points with noise the surface is then 0.3 of the noise off; at 10⁻⁶ the net folds into the
    noise and is up to 1.7 of it off, at 10⁻² exact points are missed by 3·10⁻⁴ of the sheet's size.
    """
    if isinstance(shape, QICurve | QISurface):
        return (
            1e-7  # of the sum of squared turns; without it neighbours on bunny_back drift to 180° apart for 8 % of the rms
        )
    return faint_bending(max(shape.control_points.shape[:-1]), 1e-4) if isinstance(shape, _NETS) else 0.0


def faint_bending(count: int, attenuation: float) -> float:
    """The bending weight that takes the share `attenuation` off the shortest ripple that `count` control points carry."""
    return attenuation / (np.pi * count) ** 4


@eqx.filter_jit
def side_lengths(shape: AbstractSurface | AbstractCurve) -> tuple[Float[Array, ""], ...]:
    """Mean lengths of the u-lines and of the v-lines of a surface, the length of a curve; from coarse samples."""
    share = jnp.linspace(0, 1, 17, dtype=shape.dtype)
    within = lambda ends: ends[0] + (ends[1] - ends[0]) * share
    if isinstance(shape, AbstractCurve):
        return (_lengths(jax.lax.stop_gradient(shape(within(shape.domain))), 0),)
    grid = jax.lax.stop_gradient(shape.grid_points(*(within(ends) for ends in shape.domain)))
    return _lengths(grid, 0), _lengths(grid, 1)


def _lengths(places: Array, axis: int) -> Float[Array, ""]:
    return jnp.mean(jnp.sum(jnp.sqrt(jnp.sum(jnp.diff(places, axis=axis) ** 2, -1)), axis=axis))
