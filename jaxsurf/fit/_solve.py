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

from .._progress import Event, Progress, silent
from ._objective import evaluate
from ._problem import Problem
from ._shard import on_mesh
from ._snapshot import Snapshot

EvalGradHessian = optx.FunctionInfo.EvalGradHessian


class _State(eqx.Module):
    first_step: Bool[Array, ""]
    step_size: Float[Array, ""]
    trial: Float[Array, "P"]
    search: Any
    info: EvalGradHessian
    feet: Float[Array, "N k"]
    descent: Any
    done: Bool[Array, ""]
    result: Any


class MarquardtDescent(optx.AbstractDescent):
    """−(H + λD)⁻¹ g with λ = `damping` / step size, D = diag(H) and a floor of 10⁻⁶ of its mean.

    Marquardt's scaling makes the step independent of units and of the point density.
    """

    damping: float = 1e-4

    def init(self, y: Any, f_info_struct: Any) -> EvalGradHessian:
        return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), f_info_struct)

    def query(self, y: Any, f_info: Any, state: Any) -> EvalGradHessian:
        return f_info

    def step(self, step_size: Any, state: Any) -> tuple[Any, Any]:
        matrix = state.hessian.matrix
        diagonal = jnp.diag(matrix)
        floor = 1e-6 * jnp.mean(diagonal) + jnp.finfo(diagonal.dtype).tiny
        damped = matrix + jnp.diag(self.damping / step_size * (diagonal + floor) + 1e-9 * floor)
        operator = lx.MatrixLinearOperator(damped, lx.positive_semidefinite_tag)
        solution = lx.linear_solve(operator, state.grad, lx.Cholesky(), throw=False)
        return -solution.value, optx.RESULTS.promote(solution.result)


class NormalEquationsSolver(optx.AbstractMinimiser):
    """Minimise an objective whose value, gradient and Gauss-Newton matrix come from one pass over the points.

    `fn(θ, (problem, feet, penalty))` gives the value and (gradient, matrix, feet); the pass starts the feet of a trial θ
    from those of the last accepted one. It ends when an accepted step has lowered the value by less than `rtol` of it, or
    when steps are refused at a step size below 10⁻⁹. release: by how much at most the resistance to gliding falls while
    steps are as good as was predicted.
    """

    rtol: Any
    atol: float
    release: Any = 1.0
    norm: Callable[[Any], Any] = optx.max_norm
    descent: MarquardtDescent = MarquardtDescent()
    search: optx.ClassicalTrustRegion = optx.ClassicalTrustRegion(high_cutoff=0.75, low_cutoff=0.01)

    def init(self, fn: Any, y: Any, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> _State:
        _, feet, _ = args
        info = EvalGradHessian(
            jnp.zeros((), y.dtype),
            jnp.zeros_like(y),
            lx.MatrixLinearOperator(jnp.zeros((y.size, y.size), y.dtype), lx.positive_semidefinite_tag),
        )
        struct = eqx.filter_eval_shape(lambda: info)
        return _State(
            first_step=jnp.asarray(True),
            step_size=jnp.ones((), y.dtype),
            trial=y,
            search=jax.tree.map(lambda x: x.astype(y.dtype), self.search.init(y, struct)),
            info=info,
            feet=feet,
            descent=info,
            done=jnp.asarray(False),
            result=optx.RESULTS.successful,
        )

    def step(self, fn: Any, y: Any, args: Any, options: Any, state: _State, tags: Any) -> tuple[Any, _State, Any]:
        problem, _, penalty = args
        free = problem.sliding / jnp.clip(state.step_size, 1, self.release)
        problem = eqx.tree_at(lambda p: p.sliding, problem, free)
        value, (gradient, matrix, feet) = fn(state.trial, (problem, state.feet, penalty))
        trial_info = EvalGradHessian(value, gradient, lx.MatrixLinearOperator(matrix, lx.positive_semidefinite_tag))
        step_size, accept, search_result, search = self.search.step(
            state.first_step, y, state.trial, state.info, trial_info, state.search
        )
        gain = state.info.f - value
        small = (gain <= self.rtol * state.info.f + self.atol) & ~state.first_step
        pick = lambda a, b: jax.tree.map(lambda x, z: jnp.where(accept, x, z), a, b)
        y, info, feet = pick(state.trial, y), pick(trial_info, state.info), pick(feet, state.feet)
        step, descent_result = self.descent.step(step_size, info)
        done = jnp.where(accept, small, step_size < 1e-9)
        result = optx.RESULTS.where(search_result == optx.RESULTS.successful, descent_result, search_result)
        state = _State(jnp.asarray(False), step_size, y + step, search, info, feet, info, done, result)
        return y, state, (info.grad, info.hessian.matrix, feet)

    def terminate(self, fn: Any, y: Any, args: Any, options: Any, state: _State, tags: Any) -> tuple[Any, Any]:
        return state.done, state.result

    def postprocess(
        self, fn: Any, y: Any, aux: Any, args: Any, options: Any, state: _State, tags: Any, result: Any
    ) -> tuple[Any, Any, dict[str, Any]]:
        return y, aux, {"value": state.info.f}


class Solved(eqx.Module):
    """Unknowns, feet, number of steps, and how the solver ended (an `optimistix.RESULTS`); stopped: on the caller's wish."""

    theta: Float[Array, "P"]
    feet: Float[Array, "N k"]
    steps: Int[Array, ""]
    result: Any
    stopped: bool = False


def solve(
    problem: Problem,
    feet: Float[Array, "N k"],
    penalty: Any,
    *,
    rtol: float,
    max_steps: int,
    release: float = 1.0,
    progress: Progress = silent,
    phase: str = "fit",
    resume: Snapshot | None = None,
) -> Solved:
    """Minimise the problem's objective from its start.

    Silent work is one compiled `optimistix.minimise`; with a `progress` that shows or stops, the same solver is stepped
    from outside. resume: the snapshot of which the problem's shape and the feet are; only with a `progress`.
    """
    # arrays, not floats: another tolerance must not compile again
    known = lambda x: jnp.asarray(x, problem.points.dtype)
    solver = NormalEquationsSolver(rtol=known(rtol), atol=0.0, release=known(release))
    args = problem, feet, penalty = on_mesh((problem, feet, penalty), problem.mesh)
    theta = problem.unknowns()
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        if progress is silent:
            found = optx.minimise(_objective, solver, theta, args, has_aux=True, max_steps=max_steps, throw=False)
            return Solved(found.value, found.aux[2], found.stats["num_steps"], found.result)
        return _stepwise(solver, theta, args, max_steps, progress, phase, resume)


def _objective(theta: Float[Array, "P"], args: Any) -> tuple[Float[Array, ""], Any]:
    problem, feet, penalty = args
    value, *rest = evaluate(problem, theta, feet, penalty)
    return value, tuple(rest)


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
    state = solver.init(_objective, theta, args, {}, None, None, frozenset())
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
    return Solved(theta, state.feet, jnp.asarray(np.int32(steps)), result, stopped)


def _settled(state: _State, mesh: Any) -> _State:
    """The state with every array where, and of the type that, a step leaves it: the second step does not compile again."""
    if mesh is not None:
        return on_mesh(state, mesh)
    return jax.tree.map(lambda x: jnp.asarray(np.asarray(x)), state)


@eqx.filter_jit
def _compiled_step(solver: NormalEquationsSolver, theta: Array, args: Any, state: _State) -> tuple[Array, _State]:
    theta, state, _ = solver.step(_objective, theta, args, {}, state, frozenset())
    return theta, state
