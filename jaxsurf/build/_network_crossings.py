"""Where guides and characters cross: a search on known curves, and parameters that follow the curves afterwards."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._arguments import early
from .._array import concrete, eps
from .._safe import divide
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._guides import value_and_slope
from ._network_corners import Corners
from ._network_curves import Stacks, stacked, wrapped

_SAMPLES, _MOST = 129, 1025
_FOLLOW = 8  # steps with which crossings follow curves that changed
_SEARCH = 30


class Samples(NamedTuple):
    """Points of all known curves at as many even parameters: (curves, n), (curves, n, 3)."""

    parameters: Float[np.ndarray, "c n"]
    points: Float[np.ndarray, "c n 3"]


FREE, FIRST, LAST, THERE = range(4)
"""A parameter of a crossing: found anew for changed curves, held at the curve's start or end, or where it is."""


class Crossing(NamedTuple):
    """Numbers of the guide and of the character, parameters, and what holds them."""

    guide: int
    character: int
    at: tuple[float, float]
    held: tuple[int, int]
    gap: float
    point: Float[np.ndarray, "3"]


def sample(curves: Sequence[AbstractCurve]) -> Samples:
    """Points of known curves, six or more in each smooth span."""
    count = min(max([_SAMPLES, *(6 * len(breaks(curve)) + 1 for curve in curves)]), _MOST)
    stacks = early(stacked, curves, (False,) * len(curves))
    places, points = np.zeros((len(curves), count)), np.zeros((len(curves), count, 3))
    for group in stacks.groups:
        t, x = early(_sampled, group.stacked, count)
        places[list(group.members)], points[list(group.members)] = concrete(t), concrete(x)
    return Samples(places, points)


@eqx.filter_jit
def _sampled(group: Any, count: int) -> tuple[Float[Array, "c n"], Float[Array, "c n 3"]]:
    def one(curve: AbstractCurve) -> tuple[Array, Array]:
        a, b = (jnp.asarray(end, curve.dtype) for end in curve.domain)
        share = jnp.linspace(0, 1, count, dtype=curve.dtype)
        t = (1 - share) * a + share * b
        return t, jax.vmap(curve.point)(t)

    return eqx.filter_vmap(one)(group)


def nearest_pairs(samples: Samples, guides: int, allowed: float) -> list[tuple[int, int, int, int]]:
    """Where samples of a guide and a character are nearest and may meet: (guide, sample, character, sample)."""
    steps = np.linalg.norm(np.diff(samples.points, axis=1), axis=2)
    reach = np.maximum(np.pad(steps, ((0, 0), (1, 0))), np.pad(steps, ((0, 0), (0, 1))))
    low, high = samples.points.min(axis=1), samples.points.max(axis=1)
    room = allowed + reach.max(axis=1)
    found = []
    for i in range(guides):
        for j in range(guides, len(samples.points)):
            if np.any((low[i] - high[j] > room[i] + room[j]) | (low[j] - high[i] > room[i] + room[j])):
                continue
            apart = distances(samples.points[i], samples.points[j])
            padded = np.pad(apart, 1, constant_values=np.inf)
            n, m = apart.shape
            least = np.ones_like(apart, bool)
            for a in range(3):
                for b in range(3):
                    least &= apart <= padded[a : a + n, b : b + m]
            near = least & (apart <= allowed + reach[i][:, None] + reach[j][None, :])
            found += [(i, int(a), j, int(b)) for a, b in np.argwhere(near)]
    return found


def distances(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "n m"]:
    """Distances between all points of one set and of another."""
    squares = sum((one[:, None, k] - other[None, :, k]) ** 2 for k in range(3))
    return np.sqrt(squares)


def find_crossings(
    curves: Sequence[AbstractCurve],
    samples: Samples,
    guides: int,
    closed: Sequence[bool],
    corners: Sequence[Corners],
    allowed: float,
    size: float,
) -> list[Crossing]:
    """All places where a known guide and a known character come within `allowed` of each other."""
    pairs = nearest_pairs(samples, guides, allowed)
    if not pairs:
        return []
    stacks = early(stacked, curves, (False,) * len(curves))
    starts = np.array([(samples.parameters[i, a], samples.parameters[j, b]) for i, a, j, b in pairs])
    index = [(i, j) for i, _, j, _ in pairs]
    found = np.zeros((len(pairs), 2))
    points = np.zeros((len(pairs), 2, 3))
    for (one, other), numbers in by_groups(stacks, index).items():
        rows = _rows(stacks, index, numbers)
        first, second = stacks.groups[one].stacked, stacks.groups[other].stacked
        t, x = early(_searched, first, second, rows, jnp.asarray(starts[numbers], curves[0].dtype))
        found[numbers], points[numbers] = concrete(t), concrete(x)
    gaps = np.linalg.norm(points[:, 0] - points[:, 1], axis=1)
    crossings: list[Crossing] = []
    snap = max(1e-9 * size, 1e-3 * allowed, 64 * eps(curves[0].dtype) * size)
    for number in np.argsort(gaps, kind="stable"):
        if not gaps[number] <= allowed:
            continue
        at, held = [], []
        for side, curve in enumerate(index[number]):
            place, hold = float(found[number, side]), FREE
            domain = samples.parameters[curve, [0, -1]]
            # ends, and corners: on both sides of these the curve is another one
            known = np.concatenate([domain, corners[curve].parameters])
            there = np.concatenate([samples.points[curve, [0, -1]], corners[curve].points])
            off = np.linalg.norm(points[number, side] - there, axis=1)
            off = np.where(np.abs(known - place) <= 0.02 * (domain[1] - domain[0]), off, np.inf)
            nearest = int(off.argmin())
            if off[nearest] <= snap:
                place, hold = float(known[nearest]), (FIRST, LAST, THERE)[min(nearest, 2)]
                if closed[curve] and hold != THERE:
                    place, hold = float(domain[0]), FIRST if corners[curve].seam else FREE
            at.append(place)
            held.append(hold)
        i, j = index[number]
        known = [c for c in crossings if (c.guide, c.character) == (i, j)]
        if any(np.linalg.norm(c.point - points[number, 0]) <= max(2 * allowed, 1e-7 * size) for c in known):
            continue
        crossings.append(Crossing(i, j, (at[0], at[1]), (held[0], held[1]), float(gaps[number]), points[number, 0]))
    return sorted(crossings, key=lambda c: (c.guide, c.character, c.at))


def by_groups(stacks: Stacks, pairs: Sequence[tuple[int, int]]) -> dict[tuple[int, int], np.ndarray]:
    """Numbers of pairs of curves, by the groups of both."""
    found: dict[tuple[int, int], list[int]] = {}
    for number, (i, j) in enumerate(pairs):
        found.setdefault((stacks.group_of[i], stacks.group_of[j]), []).append(number)
    return {key: np.array(numbers) for key, numbers in found.items()}


def _rows(stacks: Stacks, pairs: Sequence[tuple[int, int]], numbers: np.ndarray) -> np.ndarray:
    return np.array([[stacks.row_of[curve] for curve in pairs[number]] for number in numbers])


@eqx.filter_jit
def _searched(
    first: Any, second: Any, rows: Any, starts: Float[Array, "x 2"]
) -> tuple[Float[Array, "x 2"], Float[Array, "x 2 3"]]:
    """Nearest places of pairs of curves, by damped Gauss-Newton steps inside the domains, and the points there."""

    def one(row: Array, start: Float[Array, "2"]) -> tuple[Array, Array]:
        pair = [_row_of(first, row[0]), _row_of(second, row[1])]
        low, high = _box(pair)
        apart = lambda x: jnp.sum((pair[0].point(x[0]) - pair[1].point(x[1])) ** 2)
        shares = jnp.asarray([1, 0.5, 0.125, 0.01, 0], starts.dtype)

        def step(_: Any, x: Float[Array, "2"]) -> Float[Array, "2"]:
            free, places = jnp.ones(2, bool), _both(pair, x, (False, False))
            for _ in range(2):  # a parameter that would leave its domain is held
                along = _gauss_newton(places, free)
                free = free & ~((x <= low) & (along < 0) | (x >= high) & (along > 0))
            along = jnp.where(free, _gauss_newton(places, free), 0)
            tried = jax.vmap(lambda share: jnp.clip(x + share * along, low, high))(shares)
            return tried[jnp.argmin(jax.vmap(apart)(tried))]

        x = jax.lax.fori_loop(0, _SEARCH, step, start)
        return x, jnp.stack([pair[0].point(x[0]), pair[1].point(x[1])])

    return jax.vmap(one)(jnp.asarray(rows), starts)


def follow_crossings(
    stacks: Stacks,
    pairs: Sequence[tuple[int, int]],
    closed: Sequence[bool],
    held: Int[np.ndarray, "x 2"],
    starts: Float[Array, "x 2"],
) -> Float[Array, "x 2"]:
    """Parameters of crossings near `starts`, with implicit derivatives by the curves; held ones are where they are held."""
    result = starts
    for (one, other), numbers in by_groups(stacks, pairs).items():
        rows = jnp.asarray(_rows(stacks, pairs, numbers))
        first, second = stacks.groups[one], stacks.groups[other]
        loops = (closed[first.members[0]], closed[second.members[0]])

        def follow(row: Array, fixed: Array, start: Array, f: Any = first, s: Any = second, l: Any = loops) -> Array:
            return _followed([_row_of(f.stacked, row[0]), _row_of(s.stacked, row[1])], l, fixed, start)

        found = jax.vmap(follow)(rows, jnp.asarray(held[numbers]), starts[numbers])
        result = result.at[numbers].set(found)
    return result


def _followed(pair: list[Any], closed: tuple[bool, bool], kind: Int[Array, "2"], start: Float[Array, "2"]) -> Array:
    low, high = _box(pair)
    held = kind != FREE
    target = jnp.where(kind == FIRST, low, jnp.where(kind == LAST, high, jax.lax.stop_gradient(start)))
    frozen, start = jax.lax.stop_gradient((pair, start))
    loops = jnp.asarray(closed)

    def step(_: Any, x: Float[Array, "2"]) -> Float[Array, "2"]:
        along = jnp.where(held, 0, _gauss_newton(_both(frozen, x, closed), ~held))
        return jnp.where(loops, x + along, jnp.clip(x + along, low, high))

    first = jax.lax.stop_gradient(jnp.where(held, target, start))
    found = jax.lax.stop_gradient(jax.lax.fori_loop(0, _FOLLOW, step, first))

    def stationary(x: Float[Array, "2"]) -> Float[Array, "2"]:
        (p, dp), (q, dq) = _both(pair, x, closed)
        return jnp.where(held, x - target, jnp.stack([(p - q) @ dp, (q - p) @ dq]))

    def solve(linear: Callable[[Array], Array], y: Float[Array, "2"]) -> Float[Array, "2"]:
        return _solved(jax.jacfwd(linear)(jnp.zeros_like(y)), y)

    return jax.lax.custom_root(stationary, found, lambda _, x: x, solve)


def _gauss_newton(places: list[tuple[Array, Array]], free: Bool[Array, "2"]) -> Float[Array, "2"]:
    """The step towards the nearest places of both tangent lines; of a parameter that is not free 0."""
    (p, dp), (q, dq) = places
    tangents = jnp.where(free[None, :], jnp.stack([dp, -dq], axis=1), 0)
    matrix = tangents.T @ tangents + jnp.diag((~free).astype(p.dtype))
    return -_solved(matrix, (p - q) @ tangents)


def _both(pair: list[Any], x: Float[Array, "2"], closed: tuple[bool, bool]) -> list[tuple[Array, Array]]:
    return [
        value_and_slope(lambda t, c=c, l=l: c.point(wrapped(c, t, l)), t) for c, l, t in zip(pair, closed, x, strict=True)
    ]


def _solved(matrix: Float[Array, "2 2"], y: Float[Array, "2"]) -> Float[Array, "2"]:
    (a, b), (c, d) = matrix
    return divide(jnp.stack([d * y[0] - b * y[1], a * y[1] - c * y[0]]), a * d - b * c)


def _box(pair: list[Any]) -> tuple[Float[Array, "2"], Float[Array, "2"]]:
    low, high = ([jnp.asarray(curve.domain[k], curve.dtype) for curve in pair] for k in (0, 1))
    return jnp.stack(low), jnp.stack(high)


def _row_of(group: Any, row: Any) -> Any:
    return jax.tree.map(lambda leaf: leaf[row] if eqx.is_array(leaf) else leaf, group)
