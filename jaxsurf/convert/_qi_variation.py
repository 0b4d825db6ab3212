"""Curvature variation and mean directions of integral curves, with derivatives, on the host in double precision."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ._qi_spans import WEIGHTS, Layout, Spans, gap_derivatives, motion, shares_at_nodes, skew, turns_between

_STEP = 1e-6  # of differences: the result serves Newton steps
_UNIT = (2 * np.pi) ** 2  # of residuals: those of `fairness` in fits


class Blocks(NamedTuple):
    """Residuals and mean directions of spans, and their derivatives by the unknowns that shape each.

    The columns are, in this order, two for each tangent along the vectors of its frame and one for each gap.
    """

    residuals: Float[np.ndarray, "s r"]
    by_unknowns: Float[np.ndarray, "s r c"]
    means: Float[np.ndarray, "s 3"]
    means_by_unknowns: Float[np.ndarray, "s 3 c"]


def energy_and_means(
    plan: Layout, tangents: Float[np.ndarray, "n 3"], lengths: Float[np.ndarray, "g"]
) -> tuple[float, Float[np.ndarray, "s 3"]]:
    """Half the sum of squared residuals, and the mean directions of the spans."""
    own = tangents[plan.tangents]
    around = lengths[plan.gaps] * plan.inside
    turns = turns_between(own)[0]
    near = np.einsum("skg,sg->sk", plan.knots, around)
    (x, w, v), _ = motion(own[:, 0], turns, shares_at_nodes(near, plan.degree))
    means = np.einsum("q,sqx->sx", WEIGHTS / 2, x)
    if plan.degree == 1:
        residuals = _jumps(plan, turns, around)[0]
    else:
        residuals = _variation(x, w, v) * _roots(near, plan.degree)[..., None]
    return 0.5 * float(np.sum(residuals**2)), means


def _roots(near: Float[np.ndarray, "s k"], degree: int) -> Float[np.ndarray, "s q"]:
    return np.sqrt(near[:, degree, None] / 2 * WEIGHTS) / _UNIT


def blocks(plan: Layout, spans: Spans) -> Blocks:
    """What `energy_and_means` sums up, with derivatives.

    The residuals are the root of L³ / (2π)⁴ ∫ |(dk/ds)_⊥|² ds, |(dk/ds)_⊥| = |T × T_ss| of the curvature vector k; of degree
    1, where k jumps, that of Σ |jump|² / (mean length of the two spans).
    """
    count, tangents, middle = *spans.tangents.shape[:2], spans.lengths.shape[1] // 2
    first_gap = 2 * tangents
    columns = first_gap + spans.lengths.shape[1]
    turns, by_turns = turns_between(spans.tangents, spans.frames, columns)
    near = np.einsum("skg,sg->sk", plan.knots, spans.lengths)
    shares = shares_at_nodes(near, plan.degree)
    by_start = np.zeros((count, columns, 3))
    by_start[:, :2] = np.swapaxes(spans.frames[:, 0], 1, 2)
    (x, w, v), moves = motion(spans.tangents[:, 0], turns, shares, by_start, by_turns, gap_derivatives(plan, near))
    means = np.einsum("q,sqx->sx", WEIGHTS / 2, x)
    assert moves is not None
    means_by = np.swapaxes(np.einsum("q,sqcx->scx", WEIGHTS / 2, moves[0]), 1, 2)
    if plan.degree == 1:
        return Blocks(*_jumps(plan, turns, spans.lengths, by_turns), means, means_by)
    roots = _roots(near, plan.degree)
    found = _variation(x, w, v)
    by = _variation_derivative(x, w, v, moves)
    by[:, :, first_gap + middle] += found / (2 * spans.lengths[:, middle])[:, None, None]
    residuals = (found * roots[..., None]).reshape(count, -1)
    return Blocks(residuals, np.moveaxis(by * roots[..., None, None], 2, 3).reshape(count, -1, columns), means, means_by)


def second_derivatives(plan: Layout, spans: Spans, pull: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "s c c"]:
    """Of half the squared residuals of each span and `pull` · its mean direction, by differences of first derivatives."""

    def slope(at: Spans) -> np.ndarray:
        found = blocks(plan, at)
        return np.einsum("sr,src->sc", found.residuals, found.by_unknowns) + np.einsum(
            "sx,sxc->sc", pull, found.means_by_unknowns
        )

    here, rows = slope(spans), []
    for i in range(spans.tangents.shape[1]):
        for k in range(2):
            tangents, frames = spans.tangents.copy(), spans.frames.copy()
            tangents[:, i] += _STEP * frames[:, i, :, k]
            tangents[:, i] /= np.linalg.norm(tangents[:, i], axis=1, keepdims=True)
            along = np.einsum("sx,sxk->sk", tangents[:, i], frames[:, i])
            frames[:, i] -= tangents[:, i, :, None] * along[:, None]
            rows.append((slope(Spans(tangents, frames, spans.lengths)) - here) / _STEP)
    middle = spans.lengths.shape[1] // 2
    for g in range(spans.lengths.shape[1]):
        step = _STEP * spans.lengths[:, middle] * plan.inside[:, g]
        lengths = spans.lengths.copy()
        lengths[:, g] += step
        divisor = np.where(plan.inside[:, g] > 0, step, 1)[:, None]
        rows.append((slope(Spans(spans.tangents, spans.frames, lengths)) - here) / divisor)
    found = np.stack(rows, axis=1)
    return (found + np.swapaxes(found, 1, 2)) / 2


def _jumps(
    plan: Layout, turns: np.ndarray, around: np.ndarray, by_turns: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Jumps of the curvature vector from span to span over the root of the mean length, and their derivatives."""
    spans, middle = len(turns), around.shape[1] // 2
    later = middle + (np.arange(1, spans + 1) % plan.parts == 0)
    index = np.arange(spans)
    there = np.full(spans, 1 / _UNIT)
    there[-1] *= plan.closed
    h0 = around[:, middle] / plan.parts
    h1 = np.where(there > 0, around[index, later] / plan.parts, h0)
    factor = (there / np.sqrt((h0 + h1) / 2))[:, None]
    before, after = turns[:, 0] / h0[:, None], turns[:, 1] / h1[:, None]
    residuals = factor * (after - before)
    if by_turns is None:
        return residuals, np.zeros(0)
    by = factor[:, None] * (by_turns[:, 1] / h1[:, None, None] - by_turns[:, 0] / h0[:, None, None])
    shrink = residuals / (2 * (h0 + h1))[:, None]
    first_gap = 2 * plan.tangents.shape[1]
    by[:, first_gap + middle] += (factor * before / h0[:, None] - shrink) / plan.parts
    by[index, first_gap + later] -= (factor * after / h1[:, None] + shrink) / plan.parts
    return residuals, np.swapaxes(by, 1, 2)


def _variation(x: np.ndarray, w: np.ndarray, v: np.ndarray) -> np.ndarray:
    """x × T_uu of T = x: v_⊥ + (w · x) x × w."""
    return v - x * _dot(v, x) + _dot(w, x) * np.cross(x, w)


def _variation_derivative(x: np.ndarray, w: np.ndarray, v: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """As matrices by which moves of x, w and v are multiplied from the right."""
    along, outer = _dot(w, x)[..., None], lambda a, b: a[..., :, None] * b[..., None, :]
    turned = np.cross(x, w)
    by_x = along * skew(w) + outer(w, turned) - outer(v, x) - _dot(v, x)[..., None] * np.eye(3)
    by_w = outer(x, turned) - along * skew(x)
    by_v = np.eye(3) - outer(x, x)
    return moves[0] @ by_x + moves[1] @ by_w + moves[2] @ by_v


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1, keepdims=True)
