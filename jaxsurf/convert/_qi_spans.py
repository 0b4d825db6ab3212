"""Spans of quaternion integral curves: direction and angular velocity at Gauss nodes, with derivatives by unknowns."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

NODES = 10
ABSCISSAE, WEIGHTS = np.polynomial.legendre.leggauss(NODES)
_TINY = 1e-30  # of a complex step: derivatives without cancellation


class Layout(NamedTuple):
    """Which unknowns shape which span: spans are the `parts` equal ones of every gap between two points.

    A span depends on degree + 1 control tangents and, through its knots, on the lengths of a few gaps around its own; of
    degree 1 one more tangent counts, for the jump of the curvature at its end.
    """

    degree: int
    parts: int
    closed: bool
    count: int  # of control tangents
    tangents: Int[np.ndarray, "s t"]  # of each span
    gaps: Int[np.ndarray, "s g"]  # around each span, its own in the middle
    inside: Float[np.ndarray, "s g"]  # 0 for gaps beyond the ends, of no length
    knots: Float[np.ndarray, "s k g"]  # the 2 degree knots around a span from its start, by gap lengths


def layout(gaps: int, degree: int, parts: int, closed: bool) -> Layout:
    """Spans of a curve of so many gaps, clamped if it is open."""
    spans, reach = gaps * parts, -(-max(degree - 1, 1) // parts)
    count = spans if closed else spans + degree
    which = np.arange(spans)
    around = (which // parts)[:, None] + np.arange(-reach, reach + 1)
    inside = np.ones(around.shape) if closed else ((around >= 0) & (around < gaps)).astype(float)
    steps = np.repeat(np.eye(2 * reach + 1), parts, axis=0) / parts
    places = np.concatenate([np.zeros((1, 2 * reach + 1)), np.cumsum(steps, axis=0)])
    starts = reach * parts + np.arange(parts)
    knots = np.stack([places[i - degree + 1 : i + degree + 1] - places[i] for i in starts])
    tangents = (which[:, None] + np.arange(max(degree, 2) + 1)) % count
    return Layout(degree, parts, closed, count, tangents, around % gaps, inside, np.tile(knots, (gaps, 1, 1)))


class Spans(NamedTuple):
    """The unknowns as every span sees them: its tangents, the vectors along which they move, the gaps around it."""

    tangents: Float[np.ndarray, "s t 3"]
    frames: Float[np.ndarray, "s t 3 2"]
    lengths: Float[np.ndarray, "s g"]


def spans_of(
    plan: Layout, tangents: Float[np.ndarray, "n 3"], frames: Float[np.ndarray, "n 3 2"], lengths: Float[np.ndarray, "g"]
) -> Spans:
    """tangents: unit; frames: two unit vectors across each tangent; lengths: of the gaps, 1 together."""
    return Spans(tangents[plan.tangents], frames[plan.tangents], lengths[plan.gaps] * plan.inside)


def shares_at_nodes(near: np.ndarray, degree: int) -> Any:
    """Cumulative functions that are neither 0 nor 1 on spans, and two derivatives by u, at the nodes: (3, s, q, degree).

    near: the 2 degree knots around each span, its start at 0; complex ones give complex results. Source: The NURBS Book,
    A2.2.
    """
    knots = [near[:, i, None] for i in range(2 * degree)]
    u = knots[degree] * (1 + ABSCISSAE) / 2
    zero = np.zeros_like(u)
    values = [[np.ones_like(u), zero, zero]]
    for level in range(1, degree + 1):
        carried, raised = [zero, zero, zero], []
        for r in range(level):
            left, right = knots[degree + r - level], knots[degree + r]
            v, v1, v2 = (value / (right - left) for value in values[r])
            falling = [(right - u) * v, (right - u) * v1 - v, (right - u) * v2 - 2 * v1]
            raised.append([a + b for a, b in zip(carried, falling, strict=True)])
            carried = [(u - left) * v, (u - left) * v1 + v, (u - left) * v2 + 2 * v1]
        values = [*raised, carried]
    table = np.stack([np.stack(order, axis=-1) for order in zip(*values, strict=True)])
    return np.cumsum(table[..., :0:-1], axis=-1)[..., ::-1]


def gap_derivatives(plan: Layout, near: Float[np.ndarray, "s k"]) -> Float[np.ndarray, "3 s q d g"]:
    """Of `shares_at_nodes`, by the lengths of the gaps around each span, the nodes moving along."""
    by = [
        shares_at_nodes(near + 1j * _TINY * plan.knots[:, :, g], plan.degree).imag / _TINY * plan.inside[:, g, None, None]
        for g in range(plan.knots.shape[2])
    ]
    return np.stack(by, axis=-1)


def turns_between(tangents: np.ndarray, frames: np.ndarray | None = None, columns: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors (s, t − 1, 3) from each tangent of a span to the next, and derivatives (s, t − 1, c, 3)."""
    first, second = tangents[:, :-1], tangents[:, 1:]
    across, cosine = np.cross(first, second), np.sum(first * second, axis=2)
    factor, slope = _arc_over_sine(across, cosine)
    by = np.zeros((*across.shape[:2], columns, 3))
    if frames is not None:
        moves = np.swapaxes(frames, 2, 3)
        for shift, other in ((0, second), (1, first)):
            move = moves[:, shift : shift + across.shape[1]]
            turned = np.cross(move, other[:, :, None]) * (1 - 2 * shift)
            by_cosine = np.sum(move * other[:, :, None], axis=3, keepdims=True)
            found = factor[..., None, None] * turned + slope[..., None, None] * by_cosine * across[:, :, None]
            for i in range(across.shape[1]):
                by[:, i, 2 * (i + shift) : 2 * (i + shift) + 2] = found[:, i]
    return across * factor[..., None], by


def _arc_over_sine(across: np.ndarray, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f = θ / sin θ, and its derivative by cos θ, (f cos θ − 1) / sin² θ, −1/3 at 0."""
    sine = np.linalg.norm(across, axis=-1)
    arc = np.arctan2(sine, cosine)
    small = arc < 1e-3
    divisor = np.where(small | (sine == 0), 1, sine)
    factor = np.where(small, 1 + arc**2 / 6, arc / divisor)
    return factor, np.where(small, -(1 + 0.4 * arc**2) / 3, (factor * cosine - 1) / divisor**2)


def motion(
    start: Float[np.ndarray, "s 3"],
    turns: Float[np.ndarray, "s t 3"],
    shares: Float[np.ndarray, "3 s q d"],
    by_start: Float[np.ndarray, "s c 3"] | None = None,
    by_turns: Float[np.ndarray, "s t c 3"] | None = None,
    by_gaps: Float[np.ndarray, "3 s q d g"] | None = None,
) -> tuple[Float[np.ndarray, "3 s q 3"], Float[np.ndarray, "3 s q c 3"] | None]:
    """Direction, its angular velocity w and dw/du at the nodes, and derivatives by unknowns if asked for.

    One turn after the other: with R = exp(β φ) on the left of the turns so far, w becomes R w + β' φ and
    dw/du becomes R dw/du + β' φ × R w + β'' φ.
    """
    spans, nodes = shares.shape[1:3]
    state = np.zeros((3, spans, nodes, 3))
    state[0] = start[:, None]
    moves = None
    if by_start is not None:
        moves = np.zeros((3, spans, nodes, *by_start.shape[1:]))
        moves[0] = by_start[:, None]
    for i in range(shares.shape[-1]):
        b, b1, b2 = shares[..., i, None]
        phi = turns[:, None, i]
        rotation, rate = _rotation(b, phi)
        state = (rotation @ state[..., None])[..., 0]
        if moves is not None and by_turns is not None and by_gaps is not None:
            by_phi = by_turns[:, None, i]
            by_gap = np.pad(by_gaps[..., i, :], [(0, 0)] * 3 + [(by_phi.shape[2] - by_gaps.shape[-1], 0)])[..., None]
            by_gap = by_gap * phi[:, :, None]
            moves = moves @ np.swapaxes(rotation, -1, -2)
            moves += (by_phi @ np.swapaxes(b[..., None] * rate, -1, -2) + by_gap[0]) @ skew(state)
            by_b1 = b1[..., None] * by_phi + by_gap[1]
            moves[2] += by_b1 @ skew(state[1]) + b1[..., None] * (moves[1] @ np.swapaxes(skew(phi), -1, -2))
            moves[2] += b2[..., None] * by_phi + by_gap[2]
            moves[1] += by_b1
        state[2] += b1 * np.cross(phi, state[1]) + b2 * phi
        state[1] += b1 * phi
    return state, moves


def _rotation(share: Float[np.ndarray, "s q 1"], phi: Float[np.ndarray, "s 1 3"]) -> tuple[np.ndarray, np.ndarray]:
    """The matrix of exp(share φ), and that of the rate by which it turns on when share φ grows, the left Jacobian."""
    angle = (share * np.linalg.norm(phi, axis=-1, keepdims=True))[..., None]
    bend = np.sinc(angle / (2 * np.pi)) ** 2 / 2
    once = share[..., None] * skew(phi)
    twice = once @ once
    small = angle < 1e-2
    rest = np.where(small, 1 / 6 - angle**2 / 120, (1 - np.sinc(angle / np.pi)) / np.where(small, 1, angle) ** 2)
    return np.eye(3) + np.sinc(angle / np.pi) * once + bend * twice, np.eye(3) + bend * once + rest * twice


def skew(vectors: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Matrices [x] with [x] y = x × y; y [x] = y × x."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
