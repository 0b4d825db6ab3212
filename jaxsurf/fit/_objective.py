"""Objective, gradient and Gauss-Newton matrix of a fit in one pass over the points."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..query import refine_feet
from ._background import background_terms
from ._fairness import fairness_terms
from ._normal_equations import accumulate
from ._problem import Problem, linearise
from ._shard import in_shards, total


def evaluate(
    problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"], penalty: Float[Array, "q q"] | None
) -> tuple[Float[Array, ""], Float[Array, "P"], Float[Array, "P P"], Float[Array, "N k"]]:
    """Value, gradient, Gauss-Newton matrix at θ, and the feet there, refined from `feet`.

    penalty: the bending matrix of the control points or `None`. Values have no unit: mean squared distance over size².
    """
    value, gradient, matrix, feet = data_terms(problem, theta, feet)
    shape = problem.member(theta)
    if penalty is not None:
        # the net is the first leaf: rows of θ are control points, coordinates innermost
        scaled = problem.bending / problem.size**2 * penalty
        net = (theta - problem.rest).reshape(penalty.shape[0], -1)
        pull = scaled @ net
        value = value + 0.5 * jnp.sum(net * pull)
        gradient = gradient + pull.reshape(-1)
        d = net.shape[1]
        blocks = matrix.reshape(net.shape[0], d, net.shape[0], d)
        for axis in range(d):
            blocks = blocks.at[:, axis, :, axis].add(scaled)
        matrix = blocks.reshape(matrix.shape)
    background = background_terms(problem, theta)
    if background is not None:
        value, gradient, matrix = (a + b for a, b in zip((value, gradient, matrix), background, strict=True))
    if problem.fair:
        more_value, more_gradient, more_matrix = fairness_terms(shape, problem)
        value, gradient, matrix = value + more_value, gradient + more_gradient, matrix + more_matrix
    return value, gradient, matrix, feet


def data_terms(
    problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]
) -> tuple[Float[Array, ""], Float[Array, "P"], Float[Array, "P P"], Float[Array, "N k"]]:
    """What `evaluate` sums over the points; of points spread over devices each device sums its own."""
    if problem.mesh is None:
        return _sums(problem, theta, feet)
    split = lambda p: (p.points, p.weights)
    bare = eqx.tree_at(split, problem, (None, None))

    def one_shard(whole: Any, rows: Any) -> Any:
        bare, theta = whole
        *point_rows, feet = rows
        return _sums(eqx.tree_at(split, bare, tuple(point_rows), is_leaf=lambda x: x is None), theta, feet)

    results = (False, False, False, True)
    return in_shards(problem.mesh, one_shard, (bare, theta), (*split(problem), feet), results)


def _sums(
    problem: Problem, theta: Float[Array, "P"], feet: Float[Array, "N k"]
) -> tuple[Float[Array, ""], Float[Array, "P"], Float[Array, "P P"], Float[Array, "N k"]]:
    shape = problem.member(theta)
    feet = refine_feet(shape, problem.points, feet)
    lines = linearise(shape, feet, problem.points, problem.sliding)
    distance = jnp.sqrt(jnp.sum(lines.offset**2, axis=-1))
    weights, value = problem.point_weights(distance)
    gradient, matrix = accumulate(shape, problem, feet, lines, weights)
    return *total((value, gradient, matrix), problem.mesh), feet
