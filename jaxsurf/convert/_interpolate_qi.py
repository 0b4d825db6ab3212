"""Quaternion integral curves through given points."""

from typing import Any

import numpy as np
from jaxtyping import Float

from .._arguments import as_direction
from .._array import Numbers, as_float, concrete, eps, is_concrete
from .._errors import InputError
from ..curve import QICurve
from ..quaternion._control import neighbour_angles
from ._qi_solve import Found, Problem, solve
from ._qi_spans import layout
from ._qi_start import start_state

_PARTS = (2, 3, 4, 6, 8)
_BEND = np.radians(50)  # between neighbouring control tangents at the start; more of them where it is larger
_OPPOSITE = 1e-5
_FEWEST, _MOST = 12, 800  # spans of a curve; more for more points only


def interpolate_qi(
    points: Numbers,
    degree: int = 3,
    *,
    closed: bool = False,
    start_tangent: Numbers | None = None,
    end_tangent: Numbers | None = None,
    tolerance: float | None = None,
    spans: int | None = None,
    max_steps: int = 200,
) -> QICurve:
    """The fairest quaternion integral curve through points (n, 3), in their order, n ≥ 2.

    Of all `QICurve`s with the points at every `spans`-th knot it has the least L³ ∫ |(dk/ds)_⊥|² ds, the variation of the
    curvature vector k, free of scale (degree 1, circular arcs: of its jumps). Lines and circles have none; unless tangents
    are given it falls to 0 at the ends. The domain is [0, 1], point i is at `curve.knots[degree + spans * i]`.

    closed: the curve returns to the first point, C^degree there too; a last point equal to the first is dropped.
    start_tangent, end_tangent: directions (3,) of an open curve. tolerance: a length, for noisy points; the curve is then
    the fairest, within a few per cent of the energy, of which no point is further away than that from its own place on it.
    spans: between neighbouring points, by default 2, and more where points turn sharply or are few.

    Runs on the host, in double precision, on concrete points; the result is differentiable, the way to it is not. Raises
    `InputError` for fewer than 2 points (3 if closed), neighbours that coincide, chains that turn straight back, under
    tracing, and when no curve settles within `max_steps`. Source: the formulation is our own; of interpolation by these
    curves (Miura, 1998) no text is public.
    """
    points = as_float(points)
    chain, ends = _checked(points, degree, closed, (start_tangent, end_tangent))
    allowed = _checked_policy(tolerance, spans, max_steps)
    loop = np.concatenate([chain, chain[:1]]) if closed else chain
    size = float(np.sum(np.linalg.norm(np.diff(loop, axis=0), axis=1)))
    scaled = (chain - chain[0]) / size
    found, problem = _found(scaled, degree, closed, ends, allowed / size, spans, max_steps)
    _refuse_unsettled(found, max_steps)
    curve = _curve(found, problem, chain[0], size, points.dtype)
    _refuse_misses(curve, problem.plan.parts, loop, allowed, size)
    return curve


def _found(
    points: Float[np.ndarray, "n 3"],
    degree: int,
    closed: bool,
    ends: tuple[Any, Any],
    tolerance: float,
    spans: int | None,
    max_steps: int,
) -> tuple[Found, Problem]:
    """Solved with as few spans as bend little, from a start on chord lengths, and, if that fails, from a centripetal one."""
    gaps = len(points) - (not closed)
    counts = [spans] if spans else [count for count in _PARTS if _FEWEST <= count * gaps <= max(_MOST, 2 * gaps)]
    tried = []
    for power in (1.0, 0.5):
        for parts in counts or [-(-_FEWEST // gaps)]:
            plan = layout(gaps, degree, parts, closed)
            state = start_state(points, plan, ends, tolerance, power)
            bend = float(np.max(neighbour_angles(np.concatenate([state.tangents, state.tangents[: int(closed)]]))))
            if bend < _BEND:
                break
        if bend > np.pi - _OPPOSITE:
            raise InputError(
                "`points` and tangents turn straight back, to no side; move a point or turn a tangent a little "
                "out of the line."
            )
        given = np.zeros(plan.count, bool)
        given[0], given[-1] = ends[0] is not None, ends[1] is not None
        problem = Problem(points, plan, given, tolerance)
        tried.append((solve(problem, state, max_steps), problem))
        if tried[-1][0].settled:
            return tried[-1]
    return tried[0]


def _curve(found: Found, problem: Problem, origin: np.ndarray, size: float, dtype: Any) -> QICurve:
    plan, state = problem.plan, found.state
    steps = np.repeat(state.lengths / plan.parts, plan.parts)
    inner = np.concatenate([[0], np.cumsum(steps)])
    inner = inner / inner[-1]
    degree, tangents = plan.degree, state.tangents
    if plan.closed:
        index = np.arange(-degree, len(steps) + degree + 1)
        knots = inner[index % len(steps)] + index // len(steps)
        tangents = np.concatenate([tangents, tangents[np.arange(degree) % len(tangents)]])
    else:
        knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    return QICurve(
        as_float(origin + size * state.offsets[0], dtype),
        as_float(size * state.total, dtype),
        as_float(tangents, dtype),
        degree,
        as_float(knots, dtype),
    )


def _refuse_unsettled(found: Found, max_steps: int) -> None:
    if found.settled:
        return
    advice = "give more points where they turn sharply, more `spans`, or a `tolerance`"
    if found.steps == 0:
        raise InputError(f"`points` could not be met: no quaternion integral curve through them was found; {advice}.")
    if found.steps >= max_steps:
        raise InputError(
            f"`points` were met, but the fairest curve through them was not found in `max_steps` = {max_steps}: "
            f"allow more steps, {advice}."
        )
    raise InputError(f"`points` were met, but the search for the fairest curve through them got stuck; {advice}.")


def _refuse_misses(curve: QICurve, parts: int, loop: np.ndarray, tolerance: float, size: float) -> None:
    """Measured on the curve itself: what comes back is near the points, or nothing does."""
    knots = curve.knots[curve.degree : len(curve.knots) - curve.degree : parts]
    misses = np.linalg.norm(concrete(curve(knots)).astype(np.float64) - loop, axis=1)
    noise = 64 * eps(curve.dtype) * (size + np.abs(loop).max()) + 100 * curve.tolerance * size
    if misses.max() > tolerance + noise:
        i = int(np.argmax(misses)) % len(loop)
        raise InputError(
            f"`points` {i} is missed by {misses.max():.2g}: neighbouring tangents turn too far; give more points there, or "
            f"more `spans`."
        )


def _checked(points: Any, degree: int, closed: bool, ends: tuple[Any, Any]) -> tuple[np.ndarray, tuple[Any, Any]]:
    """The points in double precision, without the return of a closed chain, and unit end tangents."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"`points` must have shape (n, 3), got {points.shape}.")
    if not is_concrete(points, ends):
        raise InputError(
            "`interpolate_qi` searches step by step and needs concrete numbers; call it outside `jit`, `grad` and `vmap`."
        )
    if isinstance(degree, bool) or degree < 1:
        raise InputError(f"`degree` must be at least 1, got {degree}.")
    chain = concrete(points).astype(np.float64)
    if not np.all(np.isfinite(chain)):
        where = np.argwhere(~np.isfinite(chain))[0].tolist()
        raise InputError(f"`points` must be finite, got {chain[tuple(where)]} at index {where}.")
    if closed and len(chain) > 1 and np.array_equal(chain[0], chain[-1]):
        chain = chain[:-1]
    if len(chain) < (3 if closed else 2):
        kind = "of a closed curve must be at least 3 different ones" if closed else "must be at least 2"
        raise InputError(f"`points` {kind}, got {len(chain)}.")
    steps = np.linalg.norm(np.diff(np.concatenate([chain, chain[:1]]) if closed else chain, axis=0), axis=1)
    equal = np.flatnonzero(steps <= 8 * eps(points.dtype) * np.abs(chain).max())
    if equal.size:
        i = int(equal[0])
        raise InputError(f"`points` {i} and {(i + 1) % len(chain)} coincide; remove one of them.")
    if closed and ends != (None, None):
        raise InputError("`start_tangent` and `end_tangent` are for open curves; a closed one has no ends.")
    units = []
    for end, name in zip(ends, ("start_tangent", "end_tangent"), strict=True):
        vector = None if end is None else concrete(as_direction(end, name)).astype(np.float64)
        units.append(None if vector is None else vector / np.linalg.norm(vector))
    return chain, (units[0], units[1])


def _checked_policy(tolerance: float | None, spans: int | None, max_steps: int) -> float:
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance >= 0):
        raise InputError(f"`tolerance` must be a length ≥ 0, got {tolerance}.")
    if spans is not None and spans < 1:
        raise InputError(f"`spans` must be at least 1, got {spans}.")
    if max_steps < 1:
        raise InputError(f"`max_steps` must be at least 1, got {max_steps}.")
    return float(tolerance or 0)
