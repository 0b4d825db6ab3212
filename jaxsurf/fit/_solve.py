"""The solver: Levenberg-Marquardt on accumulated normal equations, as an optimistix minimiser."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from .._array import eps
from .._progress import Event, Progress, silent
from ..query import refine_feet
from ._constrained import onto, restored
from ._objective import evaluate, objective
from ._problem import Problem
from ._shard import on_mesh
from ._snapshot import Snapshot

_SHORT = 1e-2  # step size from which on a step is nearly Gauss-Newton's

EvalGradHessian = optx.FunctionInfo.EvalGradHessian


class _State(eqx.Module):
    first_step: Bool[Array, ""]
    step_size: Float[Array, ""]
    trial: Float[Array, "P"]
    search: Any
    info: EvalGradHessian
    feet: Float[Array, "N k"]
    normals: Float[Array, "c P"]
    sliding: Float[Array, ""]
    freed: Float[Array, ""]
    done: Bool[Array, ""]
    result: Any


class MarquardtDescent(optx.AbstractDescent):
    """−(H + λD)⁻¹ g with λ = `damping` / step size, D = diag(H) and a floor of 10⁻⁶ of its mean.

    Marquardt's scaling makes the step independent of units and of the point density. The state may hold rows that the step
    must not leave: it is then the least one, in the metric of the matrix, that is orthogonal to them.
    """

    damping: float = 1e-4

    def init(self, y: Any, f_info_struct: Any) -> Any:
        return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), f_info_struct), jnp.zeros((0, y.size), y.dtype)

    def query(self, y: Any, f_info: Any, state: Any) -> Any:
        return f_info, state[1]

    def step(self, step_size: Any, state: Any) -> tuple[Any, Any]:
        info, normals = state
        matrix = info.hessian.matrix
        diagonal = jnp.diag(matrix)
        floor = 1e-6 * jnp.mean(diagonal) + jnp.finfo(diagonal.dtype).tiny
        damped = matrix + jnp.diag(self.damping / step_size * (diagonal + floor) + 1e-9 * floor)
        operator = lx.MatrixLinearOperator(damped, lx.positive_semidefinite_tag)
        factored = lx.Cholesky().init(operator, {})
        inverse = lambda x: lx.linear_solve(operator, x, lx.Cholesky(), state=factored, throw=False)
        solution = inverse(info.grad)
        free = onto(normals, lambda x: inverse(x).value, solution.value)
        return -free, optx.RESULTS.promote(solution.result)


class NormalEquationsSolver(optx.AbstractMinimiser):
    """Minimise an objective whose value, gradient and Gauss-Newton matrix come from one pass over the points.

    `fn(θ, (problem, feet))` gives the value and (gradient, matrix, feet, 0); the pass starts the feet of a trial θ from
    those of the last accepted one. It ends when an accepted step has lowered the value by less than `rtol` of it or `atol`,
    or when steps are refused at a step size below 10⁻⁹ or a value below `atol`. release: by how much at most the resistance
    to gliding falls while steps are as good as was predicted. What the problem holds fixed is kept by every trial.
    """

    rtol: Any
    atol: Any
    release: Any = 1.0
    norm: Callable[[Any], Any] = optx.max_norm
    descent: MarquardtDescent = MarquardtDescent()
    search: optx.ClassicalTrustRegion = optx.ClassicalTrustRegion(high_cutoff=0.75, low_cutoff=0.01)

    def init(self, fn: Any, y: Any, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> _State:
        problem, feet = args
        info = EvalGradHessian(
            jnp.zeros((), y.dtype),
            jnp.zeros_like(y),
            lx.MatrixLinearOperator(jnp.zeros((y.size, y.size), y.dtype), lx.positive_semidefinite_tag),
        )
        struct = eqx.filter_eval_shape(lambda: info)
        trial, normals = restored(problem, y)
        return _State(
            first_step=jnp.asarray(True),
            step_size=jnp.ones((), y.dtype),
            trial=trial,
            search=jax.tree.map(lambda x: x.astype(y.dtype), self.search.init(y, struct)),
            info=info,
            feet=feet,
            normals=normals,
            sliding=problem.sliding,
            freed=jnp.zeros((), y.dtype),
            done=jnp.asarray(False),
            result=optx.RESULTS.successful,
        )

    def step(self, fn: Any, y: Any, args: Any, options: Any, state: _State, tags: Any) -> tuple[Any, _State, Any]:
        problem = args[0]
        free = problem.sliding / jnp.clip(state.step_size, 1, self.release)
        value, (gradient, matrix, feet, _) = fn(state.trial, (eqx.tree_at(lambda p: p.sliding, problem, free), state.feet))
        trial_info = EvalGradHessian(value, gradient, lx.MatrixLinearOperator(matrix, lx.positive_semidefinite_tag))
        step_size, accept, search_result, search = self.search.step(
            state.first_step, y, state.trial, state.info, trial_info, state.search
        )
        gain = state.info.f - value
        # a short step, held back after refused ones, gains little without being near the end
        whole = ~state.first_step & (state.step_size >= _SHORT)
        small = (gain <= self.rtol * state.info.f + self.atol) & whole
        pick = lambda a, b: jax.tree.map(lambda x, z: jnp.where(accept, x, z), a, b)
        y, info, feet = pick(state.trial, y), pick(trial_info, state.info), pick(feet, state.feet)
        # steps taken one after another give way to gliding like springs in a row
        moved = jnp.where(accept & ~state.first_step, 1 / (state.sliding + jnp.finfo(y.dtype).eps), 0)
        normals = pick(restored(problem, y, rounds=0)[1], state.normals) if problem.fixed else state.normals
        step, descent_result = self.descent.step(step_size, (info, normals))
        done = jnp.where(accept, small, (step_size < 1e-9) | (info.f <= self.atol))
        result = optx.RESULTS.where(search_result == optx.RESULTS.successful, descent_result, search_result)
        trial = restored(problem, y + step)[0]
        sliding, freed = pick(free, state.sliding), state.freed + moved
        state = _State(jnp.asarray(False), step_size, trial, search, info, feet, normals, sliding, freed, done, result)
        return y, state, (info.grad, info.hessian.matrix, feet, freed)

    def terminate(self, fn: Any, y: Any, args: Any, options: Any, state: _State, tags: Any) -> tuple[Any, Any]:
        return state.done, state.result

    def postprocess(
        self, fn: Any, y: Any, aux: Any, args: Any, options: Any, state: _State, tags: Any, result: Any
    ) -> tuple[Any, Any, dict[str, Any]]:
        return y, aux, {"value": state.info.f}


class Solved(eqx.Module):
    """Unknowns, feet, number of steps, and how the solver ended (an `optimistix.RESULTS`); freed: the sum of 1 / sliding
    over the steps that were taken; stopped: on the caller's wish."""

    theta: Float[Array, "*K P"]
    feet: Float[Array, "*K N k"]
    steps: Int[Array, "*K"]
    result: Any
    freed: Float[Array, "*K"]
    stopped: bool = False


def solve(
    problem: Problem,
    feet: Float[Array, "N k"],
    *,
    rtol: float,
    max_steps: int,
    release: float = 1.0,
    solver: optx.AbstractMinimiser | None = None,
    progress: Progress = silent,
    phase: str = "fit",
    resume: Snapshot | None = None,
) -> Solved:
    """Minimise the problem's objective from its start; by another `solver` from values alone.

    Silent work is one compiled `optimistix.minimise`; with a `progress` that shows or stops, the same solver is stepped
    from outside. resume: the snapshot of which the problem's shape and the feet are; only with a `progress`.
    """
    # arrays, not floats: another tolerance must not compile again
    known = lambda x: jnp.asarray(x, problem.points.dtype)
    if solver is not None:
        return _by_values(problem, feet, solver, max_steps)
    mine = NormalEquationsSolver(rtol=known(rtol), atol=rounding_of(problem), release=known(release))
    args = problem, feet = on_mesh((problem, feet), problem.mesh)
    mine = on_mesh(mine, problem.mesh)
    theta = problem.unknowns()
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        if progress is silent:
            found = optx.minimise(objective_of, mine, theta, args, has_aux=True, max_steps=max_steps, throw=False)
            return Solved(found.value, found.aux[2], found.stats["num_steps"], found.result, found.aux[3])
        return _stepwise(mine, theta, args, max_steps, progress, phase, resume)


@eqx.filter_jit
def _by_values(problem: Problem, feet: Float[Array, "N k"], solver: Any, max_steps: int) -> Solved:
    """Any minimiser of optimistix, the feet of every trial refined from the first ones."""

    def feet_of(theta: Float[Array, "P"]) -> Float[Array, "N k"]:
        return feet if problem.held else refine_feet(problem.member(theta), problem.points, feet)

    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        value = lambda theta, _: objective(problem, theta, feet_of(theta))
        found = optx.minimise(value, solver, problem.unknowns(), max_steps=max_steps, throw=False)
    freed = jnp.full((), jnp.inf, feet.dtype)  # values alone resist no gliding
    return Solved(found.value, feet_of(found.value), found.stats["num_steps"], found.result, freed)


@eqx.filter_jit
def rounding_of(problem: Problem) -> Float[Array, ""]:
    """The objective of distances that are rounding noise."""
    coordinate = jnp.max(jnp.abs(problem.points)) / problem.size
    return (4 * eps(coordinate.dtype) * jnp.maximum(coordinate, 1)) ** 2


def ended(done: Bool[Array, ""]) -> Any:
    """How a solver ended that either met its tolerance or took all its steps."""
    return optx.RESULTS.where(done, optx.RESULTS.successful, optx.RESULTS.nonlinear_max_steps_reached)


def objective_of(theta: Float[Array, "P"], args: Any) -> tuple[Float[Array, ""], Any]:
    """What the solver minimises: the value, and gradient, matrix and feet beside it."""
    (value, *rest), feet = evaluate(args[0], theta, args[1])
    return value, (*rest, feet, jnp.zeros_like(value))


def _stepwise(
    solver: NormalEquationsSolver,
    theta: Array,
    args: Any,
    max_steps: int,
    progress: Progress,
    phase: str,
    resume: Snapshot | None,
) -> Solved:
    problem = args[0]
    state = solver.init(objective_of, theta, args, {}, None, None, frozenset())
    if resume is not None:
        known = lambda x: jnp.asarray(x, theta.dtype)
        places = lambda s: (s.step_size, s.search)
        search = jax.tree.map(lambda _: known(resume.step_size), state.search)
        state = eqx.tree_at(places, state, (known(resume.measured), search))
    state = _settled(state, problem.mesh)
    steps, stopped, done, begun = 0, False, False, 0 if resume is None else resume.steps - 1
    measured = step_size = float(state.step_size)
    for steps in range(begun + 1, max_steps + 1):
        theta, state = _compiled_step(solver, theta, args, state)
        # a refused step is smaller, and leaves what was measured before
        before, step_size = step_size, float(state.step_size)
        measured = before if step_size >= before else measured
        value = float(state.info.f)
        # what was done before is measured again, and no step more is made
        done = bool(state.done) or (resume is not None and resume.done)
        here = Snapshot(np.asarray(theta), step_size, measured, steps, done)
        event = Event(phase, steps, max_steps, (2 * value) ** 0.5 * float(problem.size), here)
        stopped = bool(progress(event))
        if stopped or done or not np.isfinite(value):
            break
    result = state.result if done or stopped else optx.RESULTS.nonlinear_max_steps_reached
    return Solved(theta, state.feet, jnp.asarray(np.int32(steps)), result, state.freed, stopped)


def _settled(state: _State, mesh: Any) -> _State:
    """The state with every array where, and of the type that, a step leaves it: the second step does not compile again."""
    if mesh is not None:
        return on_mesh(state, mesh)
    return jax.tree.map(lambda x: jnp.asarray(np.asarray(x)), state)


@eqx.filter_jit
def _compiled_step(solver: NormalEquationsSolver, theta: Array, args: Any, state: _State) -> tuple[Array, _State]:
    theta, state, _ = solver.step(objective_of, theta, args, {}, state, frozenset())
    return theta, state
