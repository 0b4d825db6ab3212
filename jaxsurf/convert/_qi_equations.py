"""The fairest curve through points as a problem in numbers: energy, equations, and their derivatives by the unknowns."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ._qi_spans import Layout, spans_of
from ._qi_variation import blocks, energy_and_means, second_derivatives


class State(NamedTuple):
    """Unknowns: unit control tangents, the lengths of the gaps as shares, the whole length, offsets from the points."""

    tangents: Float[np.ndarray, "n 3"]
    lengths: Float[np.ndarray, "g"]
    total: float
    offsets: Float[np.ndarray, "m 3"]


class Problem(NamedTuple):
    """Points in order, which unknowns make which span, which tangents are given, and how far off points may be (0: not)."""

    points: Float[np.ndarray, "m 3"]
    plan: Layout
    given: Bool[np.ndarray, "n"]
    tolerance: float


class Model(NamedTuple):
    """Value, gradient, Gauss-Newton matrix, equations and their derivatives at a state."""

    value: float
    gradient: np.ndarray
    matrix: Any
    equations: np.ndarray
    slopes: Any
    damping: np.ndarray
    frames: np.ndarray


def model_at(problem: Problem, state: State, wall: float, pull: np.ndarray | None = None) -> Model:
    """pull: the multipliers of the equations; with them the matrix has all second derivatives, not Gauss-Newton's alone."""
    from scipy.sparse import coo_matrix

    plan, gaps, points = problem.plan, _gap_count(problem), len(problem.points)
    frames = across(state.tangents)
    spans = spans_of(plan, state.tangents, frames, state.lengths)
    found = blocks(plan, spans)
    columns = _columns(problem)
    free = 2 * int(np.sum(~problem.given))
    offsets = 3 * points if problem.tolerance else 0
    size = free + gaps + 1 + offsets
    gradient = _summed(columns, np.einsum("sr,src->sc", found.residuals, found.by_unknowns), size)
    # equations: total · length · mean direction of a gap = step to the next point
    own = np.repeat(np.arange(gaps), plan.parts)
    rows = 3 * own[:, None] + np.arange(3)
    scaled = state.total * state.lengths[own] / plan.parts
    means = found.means.reshape(gaps, plan.parts, 3).mean(axis=1)
    by_gap = 3 * np.arange(gaps)[:, None] + np.arange(3)
    ends = np.arange(gaps)
    squares = np.swapaxes(found.by_unknowns, 1, 2) @ found.by_unknowns
    entries = []
    if pull is not None:
        force = pull[:-1].reshape(gaps, 3)[own]
        squares = second_derivatives(plan, spans, scaled[:, None] * force)
        by_mean = np.einsum("sx,sxc->sc", force, found.means_by_unknowns) / plan.parts
        for other, factor in (
            (free + own, np.full(len(own), state.total)),
            (np.full(len(own), free + gaps), state.lengths[own]),
        ):
            value, pair = factor[:, None] * by_mean, np.broadcast_arrays(columns, other[:, None])
            entries += [(pair[0], pair[1], value), (pair[1], pair[0], value)]
        value, last = np.sum(pull[:-1].reshape(gaps, 3) * means, axis=1), np.full(gaps, free + gaps)
        entries += [(free + ends, last, value), (last, free + ends, value)]
    entries.append((*np.broadcast_arrays(columns[:, :, None], columns[:, None, :]), squares))
    slopes = [
        (*np.broadcast_arrays(rows[:, :, None], columns[:, None, :]), scaled[:, None, None] * found.means_by_unknowns),
        (by_gap, np.broadcast_to(free + ends[:, None], by_gap.shape), state.total * means),
        (by_gap, np.full(by_gap.shape, free + gaps), state.lengths[:, None] * means),
        (np.full(gaps, 3 * gaps), free + ends, np.ones(gaps)),
    ]
    if offsets:
        room = problem.tolerance**2 - np.sum(state.offsets**2, axis=1)
        first = free + gaps + 1
        at = first + np.arange(offsets).reshape(points, 3)
        gradient[first:] += (2 * wall * state.offsets / room[:, None]).reshape(-1)
        curved = (
            2 * wall / room[:, None, None] * np.eye(3)
            + 4 * wall / room[:, None, None] ** 2 * state.offsets[:, :, None] * state.offsets[:, None, :]
        )
        entries.append((*np.broadcast_arrays(at[:, :, None], at[:, None, :]), curved))
        slopes.append((by_gap, at[ends], np.ones(by_gap.shape)))
        slopes.append((by_gap, at[(ends + 1) % points], -np.ones(by_gap.shape)))
    matrix = _sparse(coo_matrix, entries, (size, size))
    diagonal = np.abs(matrix.diagonal())
    turning = float(np.mean(diagonal[:free])) if free else 1.0
    damping = np.full(size, turning)
    damping[free : free + gaps] /= state.lengths**2
    damping[free + gaps] /= state.total**2
    if offsets:
        damping[free + gaps + 1 :] = diagonal[free + gaps + 1 :] + 1e-3 * turning
    return Model(
        value_at(problem, state, wall),
        gradient,
        matrix,
        equations(problem, state, found.means),
        _sparse(coo_matrix, slopes, (3 * gaps + 1, size)),
        damping,
        frames,
    )


def equations(problem: Problem, state: State, means: np.ndarray | None = None) -> np.ndarray:
    """What is left between the ends of every gap and the curve's, and of the sum of shares."""
    known = energy_and_means(problem.plan, state.tangents, state.lengths)[1] if means is None else means
    by_gap = known.reshape(-1, problem.plan.parts, 3).mean(axis=1)
    places = problem.points + state.offsets
    steps = np.roll(places, -1, axis=0)[: len(by_gap)] - places[: len(by_gap)]
    left = state.total * state.lengths[:, None] * by_gap - steps
    return np.concatenate([left.reshape(-1), [np.sum(state.lengths) - 1]])


def value_at(problem: Problem, state: State, wall: float) -> float:
    """The energy and the cost of the walls."""
    value = energy_and_means(problem.plan, state.tangents, state.lengths)[0]
    if wall:
        value -= wall * float(np.sum(np.log1p(-np.sum(state.offsets**2, axis=1) / problem.tolerance**2)))
    return value


def moved(problem: Problem, state: State, frames: np.ndarray, move: np.ndarray) -> State | None:
    """None where lengths would not be positive, or points out of their balls."""
    turns, gaps, total, offsets = _parts(problem, move)
    sideways = np.zeros((len(state.tangents), 2))
    sideways[~problem.given] = turns
    tangents = state.tangents + np.einsum("nxk,nk->nx", frames, sideways)
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    there = State(tangents, state.lengths + gaps, state.total + total, state.offsets + (offsets if len(offsets) else 0))
    inside = not problem.tolerance or np.all(np.sum(there.offsets**2, axis=1) < 0.999 * problem.tolerance**2)
    return there if inside and np.all(there.lengths > 0) and there.total > 0 else None


def largest_move(problem: Problem, state: State, move: np.ndarray) -> float:
    """The largest turn of a tangent, in radians, or relative change of a length."""
    turns, gaps, total, _ = _parts(problem, move)
    return float(max(np.abs(turns).max(initial=0), np.abs(gaps / state.lengths).max(), abs(total / state.total)))


def _parts(problem: Problem, move: np.ndarray) -> tuple[Any, Any, float, Any]:
    """Turns of free tangents, changes of the gaps' lengths and of the whole, moves of the points if they may."""
    free = 2 * int(np.sum(~problem.given))
    gaps = free + _gap_count(problem)
    return move[:free].reshape(-1, 2), move[free:gaps], float(move[gaps]), move[gaps + 1 :].reshape(-1, 3)


def _gap_count(problem: Problem) -> int:
    return len(problem.points) - (not problem.plan.closed)


def _columns(problem: Problem) -> Int[np.ndarray, "s c"]:
    """The numbers of the unknowns of every span, −1 for those that are given."""
    plan = problem.plan
    number = np.where(problem.given, -1, np.cumsum(~problem.given) - 1)[plan.tangents]
    turns = np.where(number[:, :, None] < 0, -1, 2 * number[:, :, None] + np.arange(2)).reshape(len(number), -1)
    gaps = np.where(plan.inside > 0, 2 * int(np.sum(~problem.given)) + plan.gaps, -1)
    return np.concatenate([turns, gaps], axis=1)


def _summed(columns: np.ndarray, values: np.ndarray, size: int) -> np.ndarray:
    known = columns >= 0
    return np.bincount(columns[known], values[known], minlength=size)


def _sparse(build: Any, entries: list[tuple[np.ndarray, np.ndarray, np.ndarray]], shape: tuple[int, int]) -> Any:
    rows, columns, values = (np.concatenate([entry[i].reshape(-1) for entry in entries]) for i in range(3))
    known = (rows >= 0) & (columns >= 0)
    return build((values[known], (rows[known], columns[known])), shape=shape).tocsc()


def across(directions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 2"]:
    """Two unit vectors across each unit vector and each other."""
    least = np.argmin(np.abs(directions), axis=1)
    first = np.cross(directions, np.eye(3)[least])
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directions, first)], axis=2)
