"""Many fits by one compiled loop: a fixed number of them side by side, and the next one when one is done."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ._problem import Problem
from ._solve import NormalEquationsSolver, Solved, ended, objective_of, rounding_of

_NONE = frozenset()


class _Lane(eqx.Module):
    """A fit under way: which one, its unknowns, the solver's state, and steps taken."""

    number: Int[Array, ""]
    theta: Float[Array, "P"]
    state: Any
    steps: Int[Array, ""]


def solve_all(
    problems: Problem,
    feet: Float[Array, "K N k"],
    lanes: int,
    *,
    rtol: float,
    release: float,
    max_steps: int,
) -> Solved:
    """`solve` for problems with an axis K in front of every array, at most `lanes` at a time."""
    count = feet.shape[0]
    lanes = min(lanes, count)
    arrays, static = eqx.partition(problems, eqx.is_array)
    at = lambda k: eqx.combine(jax.tree.map(lambda x: x[k], arrays), static)
    known = lambda x: jnp.asarray(x, feet.dtype)
    solver_of = lambda problem: NormalEquationsSolver(rtol=known(rtol), atol=rounding_of(problem), release=known(release))

    def begin(number: Int[Array, ""]) -> _Lane:
        problem, own = at(jnp.minimum(number, count - 1)), feet[jnp.minimum(number, count - 1)]
        theta = problem.unknowns()
        state = solver_of(problem).init(objective_of, theta, (problem, own), {}, None, None, _NONE)
        return _Lane(number, theta, state, jnp.zeros((), jnp.int32))

    def step(lane: _Lane) -> _Lane:
        problem = at(jnp.minimum(lane.number, count - 1))
        theta, state, _ = solver_of(problem).step(
            objective_of, lane.theta, (problem, lane.state.feet), {}, lane.state, _NONE
        )
        return _Lane(lane.number, theta, state, lane.steps + 1)

    def turn(carry: Any) -> Any:
        lane, following, found = carry
        lane = jax.vmap(step)(lane)
        done = (lane.state.done | (lane.steps >= max_steps)) & (lane.number < count)
        place = jnp.where(done, lane.number, count)
        new = (lane.theta, lane.state.feet, lane.steps, lane.state.done, lane.state.freed)
        found = jax.tree.map(lambda old, x: old.at[place].set(x, mode="drop"), found, new)
        number = jnp.where(done, following + jnp.cumsum(done, dtype=jnp.int32) - 1, lane.number)
        fresh = jax.vmap(begin)(number)
        pick = lambda a, b: jnp.where(done.reshape(-1, *[1] * (a.ndim - 1)), a, b)
        lane = jax.tree.map(pick, fresh, lane)
        return lane, following + jnp.sum(done, dtype=jnp.int32), found

    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        first = jax.vmap(begin)(jnp.arange(lanes, dtype=jnp.int32))
        size = first.theta.shape[1]
        empty = (
            jnp.zeros((count, size), feet.dtype),
            feet,
            jnp.zeros(count, jnp.int32),
            jnp.zeros(count, bool),
            jnp.zeros(count, feet.dtype),
        )
        start = (first, jnp.asarray(lanes, jnp.int32), empty)
        _, _, (theta, feet, steps, done, freed) = jax.lax.while_loop(lambda c: jnp.any(c[0].number < count), turn, start)
    return Solved(theta, feet, steps, eqx.filter_vmap(ended)(done), freed)
