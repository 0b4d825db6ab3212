"""Axes of splines extended and joined by pseudo-vertices: knots and control points along one direction."""

from itertools import pairwise
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, eps, is_concrete
from .._errors import InputError
from ..edit import _knots
from ..edit._blossom import derivative_row
from ..edit._spline_axis import SplineAxis, concrete_knots
from ._same_knots import product

_FREE = 3  # vertices of a fairest bridge that no end determines


def turned(axis: SplineAxis) -> SplineAxis:
    """The same spline run backwards."""
    return SplineAxis(axis.net[::-1], early(lambda knots: -knots[::-1], axis.knots), axis.degree)


def extended(axis: SplineAxis, points: Float[Array, "k *rest"] | None, natural: bool) -> SplineAxis:
    """With further vertices at the end, or one without second derivative there."""
    if points is None and not natural:
        return axis
    known, count = _known(axis), 1 if points is None else len(points)
    body, step = known[: len(known) - axis.degree], _last_step(known, axis.degree)
    outer = known[len(known) - axis.degree :]
    if not np.all(np.diff(np.append(body[-1], outer)) > 1e-9 * step):
        outer = body[-1] + step * np.arange(1, axis.degree + 1)
    whole = np.concatenate([body, outer, outer[-1] + step * np.arange(1, count + 1)])
    net = _on(axis, known, np.concatenate([body, outer]))
    if points is None:
        row = derivative_row(whole, axis.degree, whole[-axis.degree - 1], min(2, axis.degree))
        if axis.degree == 1:  # straight on
            row = np.concatenate([np.zeros(len(net) - 2), [1.0, -2.0, 1.0]])
        points = -product(jnp.asarray(row[None, :-1] / row[-1], net.dtype), net)
    return SplineAxis(jnp.concatenate([net, points]), _as_knots(whole, axis), axis.degree)


def joined(
    a: SplineAxis,
    b: SplineAxis,
    curvature: str,
    bridge: str | None,
    tolerance: float | None,
    length: float | None = None,
) -> SplineAxis:
    """Both, as smooth as `curvature` says at the seam between them, or with a bridge, "shortest" or "fairest"."""
    degree = max(a.degree, b.degree, 3)
    a, b = (_knots.raised(axis, degree, "join") for axis in (a, b))
    known_a, known_b = _known(a), _known(b)
    allowed = 1e6 * eps(a.net.dtype) * _size(a.net, b.net) if tolerance is None else tolerance
    steps = _last_step(known_a, degree), _last_step(-known_b[::-1], degree)
    if bridge is not None:
        free = (_FREE if bridge == "fairest" else 0) + int(curvature == "zero")
        sizes = np.linspace(*steps, degree + free)
        if bridge == "fairest":
            sizes = sizes * ((length or _gap_length(a, b, known_a, known_b) or sizes.sum()) / sizes.sum())
        return _bridged(a, b, known_a[-degree - 1], sizes, curvature == "zero")
    order = 1 if curvature == "tangent" else 2
    made, gap, bend = _merged(a, b, known_a[-degree - 1] + steps[0], steps, degree - order, curvature)
    _refuse_gap(gap, allowed, curvature, "the last vertex of `a` to be the first of `b`")
    _refuse_gap(bend, allowed, curvature, "that vertex to be midway between its neighbours")
    return made


def _merged(
    a: SplineAxis, b: SplineAxis, seam: float, steps: tuple[float, float], times: int, curvature: str
) -> tuple[SplineAxis, Any, Any]:
    """One segment more each up to a seam of so many knots; distances of what should be one vertex, and off the midpoint."""
    degree = a.degree
    sizes = np.array([steps[0], *[0.0] * (times - 1), steps[1]])
    whole, (net_a, net_b), _ = chained([a, b], [sizes])
    shared = degree - times - 1
    middle = 0.5 * (net_a[len(net_a) - shared :] + net_b[:shared])
    made = jnp.concatenate([net_a[: len(net_a) - shared], middle, net_b[shared:]])
    bend = None
    if curvature == "zero":
        row = derivative_row(whole, degree, seam, 2) * 0.5 * steps[0] * steps[1]
        bend = product(jnp.asarray(row[None], made.dtype), made)
    return SplineAxis(made, _as_knots(whole, a), degree), net_a[len(net_a) - shared :] - net_b[:shared], bend


def _bridged(a: SplineAxis, b: SplineAxis, end: float, sizes: np.ndarray, zero: bool) -> SplineAxis:
    """Segments of given sizes between, C^(degree − 1) throughout; each one beyond `degree` of them takes one vertex more.

    Those make the integral of the squared third derivative over the bridge least, if `zero` under the condition that the
    second derivative amid vanishes.
    """
    degree, free = a.degree, len(sizes) - a.degree
    edges = end + np.append(0, np.cumsum(sizes))
    whole, parts, _ = chained([a, b], [sizes])
    if free:
        middle = derivative_row(whole, degree, edges[(len(edges) - 1) // 2], 2)[None]
        matrix = _least_bent(whole, degree, edges, len(parts[0]), free, middle if zero else middle[:0])
        known = jnp.concatenate(parts)
        parts.insert(1, product(jnp.asarray(matrix, known.dtype), known))
    return SplineAxis(jnp.concatenate(parts), _as_knots(whole, a), degree)


def _least_bent(
    knots: np.ndarray, degree: int, edges: np.ndarray, first: int, free: int, condition: np.ndarray
) -> Float[np.ndarray, "free known"]:
    """The `free` control points from number `first` on, by all others: `condition` makes nothing of them all, and the
    integral of the squared third derivative over the spans between `edges` is least."""
    nodes, weights = np.polynomial.legendre.leggauss(degree - 2)
    rows = [
        np.sqrt(weight * (end - start) / 2) * derivative_row(knots, degree, (start + end) / 2 + x * (end - start) / 2, 3)
        for start, end in pairwise(edges)
        for x, weight in zip(nodes, weights, strict=True)
    ]
    width = edges[-1] - edges[0]
    energy, condition = np.stack(rows) * width**2.5, condition * width**2
    own, count = np.arange(first, first + free), len(condition)
    rest = np.delete(np.arange(energy.shape[1]), own)
    square = energy[:, own].T @ energy[:, own]
    system = np.block([[square, condition[:, own].T], [condition[:, own], np.zeros((count, count))]])
    right = np.concatenate([energy[:, own].T @ energy[:, rest], condition[:, rest]])
    return -np.linalg.solve(system, right)[:free]


def _gap_length(a: SplineAxis, b: SplineAxis, known_a: np.ndarray, known_b: np.ndarray) -> float | None:
    """The parameters that the gap between both ends takes at their speeds; None without a gap."""
    if not is_concrete((a.net, b.net)):
        raise InputError('`bridge="fairest"` measures the gap: with traced control points give the bridge a `length`.')
    ends = []
    for axis, known, at in ((a, known_a, known_a[-a.degree - 1]), (b, known_b, known_b[b.degree])):
        rows = np.stack([derivative_row(known, axis.degree, at, order) for order in (0, 1)])
        ends.append(np.tensordot(rows, concrete(axis.net), axes=1))
    distance = np.linalg.norm(ends[1][0] - ends[0][0], axis=-1).mean()
    speed = np.mean([np.linalg.norm(end[1], axis=-1).mean() for end in ends])
    return float(distance / speed) if distance > 1e-6 * speed else None


def closed(
    axis: SplineAxis, curvature: str, bridge: str | None, tolerance: float | None, length: float | None
) -> SplineAxis:
    """The periodic spline whose end is joined to its start: one period of the axis joined to itself."""
    twice = joined(axis, axis, curvature, bridge, tolerance, length)
    degree, spans = twice.degree, len(_known(_knots.raised(axis, twice.degree, "join"))) - 2 * twice.degree - 1
    period = len(twice.net) - spans - degree
    # vertices whose knots lie before the end of the second turn are taken from there, those of the bridge from the first
    net = jnp.concatenate([twice.net[period : period + spans + 1], twice.net[spans + 1 : period]])
    return SplineAxis(net, early(lambda: twice.knots[degree : degree + period + 1]), degree, periodic=True)


def chained(axes: list[SplineAxis], sizes: list[np.ndarray]) -> tuple[np.ndarray, list[Array], list[int]]:
    """Axes of one degree one after the other, with segments of given sizes between each two.

    Returns the knots, those of the first axis kept and all others shifted, the nets on them, and the number that the first
    control point of each net has among those of all.
    """
    degree, known = axes[0].degree, [_known(axis) for axis in axes]
    whole, shifts, firsts = known[0][: len(known[0]) - degree], [0.0], [0]
    for knots, between in zip(known[1:], sizes, strict=True):
        edges = whole[-1] + np.cumsum(between)
        shifts.append(edges[-1] - knots[degree])
        firsts.append(len(whole) + len(between) - 1 - degree)
        whole = np.concatenate([whole, edges[:-1], knots[degree : len(knots) - degree] + shifts[-1]])
    whole = np.concatenate([whole, known[-1][len(known[-1]) - degree :] + shifts[-1]])
    nets = []
    for axis, knots, shift, first in zip(axes, known, shifts, firsts, strict=True):
        around = whole[first : first + len(knots)] - shift
        around[degree : len(knots) - degree] = knots[degree : len(knots) - degree]
        nets.append(_on(axis, knots, around))
    return whole, nets, firsts


def _on(axis: SplineAxis, known: np.ndarray, knots: np.ndarray) -> Array:
    """The net on knots that differ outside the domain alone; vertices whose knots stay are kept bit for bit."""
    near = 1e-12 * (known[-1] - known[0])
    windows = lambda x: np.lib.stride_tricks.sliding_window_view(x[1:-1], axis.degree)
    same = np.all(np.abs(windows(known) - windows(knots)) <= near, axis=1)
    if np.all(same):
        return axis.net
    changed = _knots.on_knots(axis, _as_knots(knots, axis)).net
    return jnp.where(jnp.asarray(same).reshape(-1, *[1] * (axis.net.ndim - 1)), axis.net, changed)


def _known(axis: SplineAxis) -> np.ndarray:
    return concrete_knots(axis, "join").astype(np.float64)


def _as_knots(values: np.ndarray, axis: SplineAxis) -> Array:
    return early(lambda: jnp.asarray(values, axis.knots.dtype))


def _last_step(knots: np.ndarray, degree: int) -> float:
    """The length of the last span of the domain."""
    end = knots[len(knots) - degree - 1]
    return float(end - knots[knots < end].max())


def _size(*nets: Array) -> float:
    """The largest extent of control points; 1 for traced ones."""
    if not is_concrete(nets):
        return 1.0
    points = np.concatenate([concrete(net).reshape(-1, net.shape[-1]) for net in nets])
    return float(np.ptp(points, axis=0).max())


def _refuse_gap(gap: Any, allowed: float, curvature: str, wanted: str) -> None:
    if gap is None or not is_concrete(gap) or not gap.size:
        return
    distance = float(np.sqrt(np.sum(concrete(gap) ** 2, axis=-1)).max())
    if distance > allowed:
        raise InputError(
            f'`curvature="{curvature}"` needs {wanted}, within {allowed:.2g}, but they are {distance:.6g} apart; take '
            '`bridge=True` for more segments between, "tangent", or a larger `tolerance`.'
        )
