"""The fairest integral curve through points: Gauss-Newton and Newton steps under equations, on sparse matrices."""

from typing import Any, NamedTuple

import numpy as np

from ._qi_equations import Model, Problem, State, equations, largest_move, model_at, moved, value_at
from ._qi_variation import energy_and_means

_CLOSED_IN = 1e-12  # gaps that are left in the equations, of the chain's length
_LONGEST = 0.7  # radians that a tangent, and shares that a length, may move in a step
_WALLS = 0.02  # of the energy: how thick the walls around the points may be at the end
_THINNER = 6.0
_NOTHING = 1e-10  # an energy: of circles and lines, but for what no one can see


class Found(NamedTuple):
    """The last state, whether it is where the energy is least, the energy, and how many steps were made."""

    state: State
    settled: bool
    energy: float
    steps: int


class _Factors(NamedTuple):
    """Of the damped matrix bordered by the equations, rows and columns scaled: energies stand next to lengths."""

    matrix: Any
    scale: np.ndarray
    scaled: Any

    def solve(self, right: np.ndarray) -> np.ndarray:
        solution = np.zeros_like(right)
        for _ in range(2):  # once more for what is left: noise in steps would hold up chains of a thousand points
            solution = solution + self.scale * self.scaled.solve(self.scale * (right - self.matrix @ solution))
        return solution


def solve(problem: Problem, start: State, max_steps: int) -> Found:
    """Minimise the curvature variation of curves through the points from `start`.

    With a tolerance the points may move inside balls of that radius: an interior-point method, whose walls
    −b log(1 − |e|²/τ²) are made thinner until b for all points is no more than a fiftieth of the energy.
    """
    energy = energy_and_means(problem.plan, start.tangents, start.lengths)[0]
    wall = max(energy, 1e-12) / len(problem.points) if problem.tolerance else 0.0
    state = _restored(problem, start, wall, None, 30)
    if state is None:
        return Found(start, False, energy, 0)
    damping, steps, settled = 1e-3, 0, False
    while steps < max_steps:
        state, damping, used, settled = _descended(problem, state, wall, damping, max_steps - steps)
        steps += used
        energy = energy_and_means(problem.plan, state.tangents, state.lengths)[0]
        if not settled or wall * len(problem.points) <= max(_WALLS * energy, _NOTHING):
            break
        wall /= _THINNER
    return Found(state, settled, energy, steps)


def _descended(problem: Problem, state: State, wall: float, damping: float, most: int) -> tuple[State, float, int, bool]:
    """Steps at one thickness of the walls, until the next one would gain nothing.

    Gauss-Newton steps settle smooth chains in 4 to 6; where they linger, Newton steps follow, of ten times the work.
    """
    pull, exact = None, False
    for step in range(most):
        model = model_at(problem, state, wall, pull if exact else None)
        first, least = damping, np.inf
        while True:
            factors = _factors(model, damping)
            if factors is None:
                return state, damping, step, False
            solution = factors.solve(np.concatenate([-model.gradient, -model.equations]))
            move = solution[: len(model.gradient)]
            curved = move @ (model.matrix @ move)
            stiffness = damping * (move @ (model.damping * move))
            expected = 0.5 * curved + stiffness  # and not from the gradient: differences of large numbers
            largest = largest_move(problem, state, move)
            tiny = abs(expected) <= 1e-13 * model.value + 1e-24
            convex = curved + stiffness > 0
            trial = moved(problem, state, model.frames, move) if convex and largest <= _LONGEST else None
            trial = None if trial is None else _restored(problem, trial, wall, (model, factors), 4)
            gain = -np.inf if trial is None else model.value - value_at(problem, trial, wall)
            if trial is not None and (gain >= 1e-3 * abs(expected) or (tiny and gain >= -1e-10 * model.value - 1e-20)):
                break
            least = min(least, abs(expected)) if damping == first else least
            if tiny:
                return state, damping, step + 1, True
            damping *= 10
            if damping > 1e9:  # noise refuses what would gain no more than this
                return state, 1e-3, step + 1, bool(least <= 1e-8 * model.value + 1e-18)
        assert trial is not None
        state, pull = trial, solution[len(model.gradient) :]
        if gain > 0.7 * expected:
            damping = max(damping / 10, 1e-10)
        elif gain < 0.25 * expected:
            damping *= 4
        if tiny or (expected <= 1e-9 * model.value and largest < 1e-7) or (wall and expected <= 1e-3 * model.value):
            return state, damping, step + 1, True
        exact = exact or (step >= 5 and 1e-6 * model.value < gain < 0.1 * model.value)
    return state, damping, most, False


def _restored(
    problem: Problem, state: State, wall: float, known: tuple[Model, _Factors | None] | None, renewals: int
) -> State | None:
    """The state moved back onto the equations, with as little of a change of the energy's model as can be; None if it fails.

    Newton's method with old derivatives while it is quick, and renewed ones else.
    """
    last = np.inf
    for _ in range(60):
        left = equations(problem, state)
        error = float(np.abs(left).max())
        if error <= 1e-15 or (last <= _CLOSED_IN and error > 0.3 * last):
            return state
        if known is None or error > 0.3 * last:
            if error <= _CLOSED_IN:
                return state
            if renewals == 0 or error > 2 * last:
                return None
            renewals -= 1
            model = model_at(problem, state, wall)
            known = model, _factors(model, 1e-3)
        model, factors = known
        if factors is None:
            return None
        move = factors.solve(np.concatenate([0 * model.gradient, -left]))[: len(model.gradient)]
        share = min(1.0, _LONGEST / max(largest_move(problem, state, move), 1e-300))
        trial = moved(problem, state, model.frames, share * move)
        while trial is None and share > 0.01:
            share /= 2
            trial = moved(problem, state, model.frames, share * move)
        if trial is None:
            return None
        state, last = trial, error if share == 1 else np.inf
    return None


def _factors(model: Model, damping: float) -> _Factors | None:
    """None where the equations contradict each other, as with too few unknowns."""
    from scipy.sparse import bmat, diags
    from scipy.sparse.linalg import splu

    matrix = bmat([[model.matrix + diags(damping * model.damping), model.slopes.T], [model.slopes, None]]).tocsc()
    first = 1 / np.sqrt(model.damping)
    sizes = np.sqrt(np.asarray((model.slopes.multiply(model.slopes)) @ first**2))
    scale = np.concatenate([first, 1 / np.maximum(sizes, 1e-300)])
    try:
        return _Factors(matrix, scale, splu((diags(scale) @ matrix @ diags(scale)).tocsc()))
    except RuntimeError:
        return None
