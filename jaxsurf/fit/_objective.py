"""Objective, gradient and Gauss-Newton matrix of a fit in one pass over the points."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..query import feet_with_derivatives, foot_at, refine_feet
from ._background import background_terms
from ._chunks import over_chunks
from ._fairness import fairness_terms
from ._normal_equations import Quadratic, accumulate
from ._problem import Linearised, Problem, linearise
from ._shard import in_shards, total


def evaluate(problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]) -> tuple[Quadratic, Float[Array, "N k"]]:
    """Value, gradient and Gauss-Newton matrix at θ, and the feet there, refined from `feet`.

    Values have no unit: mean squared distance over size².
    """
    data, feet = data_terms(problem, theta, feet)
    return data + penalty_terms(problem, theta), feet


def data_terms(
    problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]
) -> tuple[Quadratic, Float[Array, "N k"]]:
    """What the points contribute, and their feet; of points spread over devices each device sums its own."""
    if problem.mesh is None:
        return _sums(problem, theta, feet)
    split = lambda p: (p.points, p.weights)
    bare = eqx.tree_at(split, problem, (None, None))

    def one_shard(whole: Any, rows: Any) -> Any:
        bare, theta = whole
        *point_rows, feet = rows
        return _sums(eqx.tree_at(split, bare, tuple(point_rows), is_leaf=lambda x: x is None), theta, feet)

    results: Any = (Quadratic(*(False,) * 3), True)  # type: ignore[arg-type]
    return in_shards(problem.mesh, one_shard, (bare, theta), (*split(problem), feet), results)


def _sums(problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]) -> tuple[Quadratic, Float[Array, "N k"]]:
    shape = problem.member(theta)

    def add(summed: Quadratic, rows: Any, new: Bool[Array, "n"]) -> tuple[Quadratic, Array]:
        points, weights, feet = rows
        chunk = eqx.tree_at(lambda p: (p.points, p.weights), problem, (points, jnp.where(new, weights, 0)))
        more, feet = _chunk_sums(chunk, shape, feet)
        return summed + more, feet

    none = Quadratic(jnp.zeros((), theta.dtype), jnp.zeros_like(theta), jnp.zeros((theta.size,) * 2, theta.dtype))
    summed, feet = over_chunks(add, none, (problem.points, problem.weights, feet))
    unit = problem.unit()
    return total(Quadratic(*(x / unit for x in summed)), problem.mesh), feet


def _chunk_sums(problem: Problem, shape: Any, feet: Float[Array, "N k"]) -> tuple[Quadratic, Float[Array, "N k"]]:
    if problem.held:
        offset = foot_at(shape, problem.points, feet).points - problem.points
        d = offset.shape[1]
        lines = Linearised(offset, jnp.broadcast_to(jnp.eye(d, dtype=offset.dtype)[None], (offset.shape[0], d, d)))
    else:
        feet = refine_feet(shape, problem.points, feet, problem.turns)
        lines = linearise(shape, feet, problem.points, problem.sliding)
    square = jnp.sum(lines.offset**2, axis=-1)
    weights = problem.point_weights(jnp.sqrt(square))
    return Quadratic(problem.loss_of(square), *accumulate(shape, problem, feet, lines, weights)), feet


def penalty_terms(problem: Problem, theta: Float[Array, "P"]) -> Quadratic:
    """What bending and fairness contribute."""
    summed = Quadratic(jnp.zeros((), theta.dtype), jnp.zeros_like(theta), jnp.zeros((theta.size, theta.size), theta.dtype))
    if problem.penalty is not None:
        summed = summed + _bending_terms(problem, theta)
    background = background_terms(problem, theta)
    if background is not None:
        summed = summed + Quadratic(*background)
    if problem.fair:
        summed = summed + Quadratic(*fairness_terms(problem.member(theta), problem))
    return summed


def _bending_terms(problem: Problem, theta: Float[Array, "P"]) -> Quadratic:
    # the control points are the first leaf: rows of θ are points, coordinates innermost
    assert problem.penalty is not None
    scaled = problem.bending / problem.size**2 * problem.penalty
    count, d = scaled.shape[0], problem.points.shape[1]
    net = (theta - problem.rest)[: count * d].reshape(count, d)
    pull = scaled @ net
    blocks = jnp.einsum("ij,xy->ixjy", scaled, jnp.eye(d, dtype=theta.dtype)).reshape(count * d, count * d)
    more = theta.size - count * d
    return Quadratic(0.5 * jnp.sum(net * pull), jnp.pad(pull.reshape(-1), (0, more)), jnp.pad(blocks, (0, more)))


def objective(problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]) -> Float[Array, ""]:
    """The value alone at the converged `feet`, to be differentiated twice in θ and in everything that the problem holds."""
    shape = problem.member(theta)
    at_feet = foot_at if problem.held else feet_with_derivatives
    offset = at_feet(shape, problem.points, feet).points - problem.points
    # the distance itself has no derivative at 0, its square has
    return problem.loss_of(jnp.sum(offset**2, axis=-1)) / problem.unit() + penalty_terms(problem, theta).value
