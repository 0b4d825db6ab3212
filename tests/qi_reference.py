"""Unit quaternion integral curves and surfaces a second time, in numpy, from the formulas of paper 004: an oracle.

Quaternions are multiplied out, q v q⁻¹; basis functions are scipy's; integrals are sums over Gauss nodes, without tables.
"""

import numpy as np
from scipy.interpolate import BSpline

ABSCISSAE, WEIGHTS = np.polynomial.legendre.leggauss(24)
PARTS = 6  # of each span: many more nodes than are needed


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Hamilton's product of quaternions (w, x, y, z)."""
    a, b, c, d = np.moveaxis(p, -1, 0)
    e, f, g, h = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ],
        axis=-1,
    )


def exponential(omega: np.ndarray) -> np.ndarray:
    """exp ω = cos |ω| + sin |ω| ω / |ω|."""
    size = np.linalg.norm(omega, axis=-1, keepdims=True)
    return np.concatenate([np.cos(size), np.sinc(size / np.pi) * omega], axis=-1)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def half_turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """ω of (5) between unit vectors, for all angles below 180°; a half turn about z for v₀ to −v₀."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    if sine == 0:
        return np.zeros(3) if a @ b > 0 else np.array([0.0, 0.0, np.pi / 2])
    return 0.5 * np.arctan2(sine, a @ b) * axis / sine


def cumulative(knots: np.ndarray, degree: int, u: np.ndarray, order: int = 0) -> np.ndarray:
    """B̃_i = Σ_{j ≥ i} B_j or a derivative; shape (u, i)."""
    count = len(knots) - degree - 1
    rows = np.stack([BSpline(knots, row, degree)(u, nu=order) for row in np.eye(count)], axis=-1)
    return np.cumsum(rows[..., ::-1], axis=-1)[..., ::-1]


def quaternions(tangents: np.ndarray, knots: np.ndarray, degree: int, u: np.ndarray) -> np.ndarray:
    """q(u) of (3), the latest turn on the left."""
    units = unit(tangents)
    shares = cumulative(knots, degree, u)
    q = np.broadcast_to(exponential(half_turn(np.array([1.0, 0, 0]), units[0])), (*u.shape, 4))
    for i in range(1, len(units)):
        q = product(exponential(shares[..., i, None] * half_turn(units[i - 1], units[i])), q)
    return q


def directions(tangents: np.ndarray, knots: np.ndarray, degree: int, u: np.ndarray) -> np.ndarray:
    """q v₀ q⁻¹."""
    q = quaternions(tangents, knots, degree, u)
    v0 = np.broadcast_to(np.array([0.0, 1, 0, 0]), q.shape)
    inverse = q * np.array([1.0, -1, -1, -1]) / np.sum(q * q, axis=-1, keepdims=True)
    return product(product(q, v0), inverse)[..., 1:]


def domain(knots: np.ndarray, degree: int) -> tuple[float, float]:
    return knots[degree], knots[-degree - 1]


def nodes(knots: np.ndarray, degree: int, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Gauss nodes and weights from the start of the domain to `end`, none across a knot."""
    a, b = domain(knots, degree)
    edges = np.unique(np.clip(knots, a, min(end, b)))
    edges = np.unique(
        np.concatenate([np.linspace(*pair, PARTS + 1) for pair in zip(edges, edges[1:], strict=False)] + [[a]])
    )
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + ABSCISSAE)).ravel(), (half * WEIGHTS).ravel()


def integral(tangents: np.ndarray, knots: np.ndarray, degree: int, end: float) -> np.ndarray:
    """∫ q v₀ q⁻¹ / (b − a) from the start of the domain to `end`."""
    a, b = domain(knots, degree)
    at, weights = nodes(knots, degree, end)
    return weights @ directions(tangents, knots, degree, at) / (b - a) if len(at) else np.zeros(3)


def curve(start, length, tangents, knots: np.ndarray, degree: int, u: np.ndarray) -> np.ndarray:
    """Points of the QI curve (2) at parameters u (k,)."""
    return np.array(start) + length * np.stack([integral(tangents, knots, degree, end) for end in u])


def curvature_and_torsion(length, tangents, knots: np.ndarray, degree: int, u: float) -> tuple[float, float]:
    """From the angular velocity W of the tangent, W = Σ B̃_i' a_i with a_i = R_n … R_{i+1} φ_i, by t = s / length."""
    units = unit(tangents)
    a, b = domain(knots, degree)
    shares, first, second = (cumulative(knots, degree, np.array(u), k) * (b - a) ** k for k in range(3))
    count = len(units)
    phi = [2 * half_turn(units[i - 1], units[i]) for i in range(1, count)]
    turned = []  # a_i, each turned by all factors to its left
    for i in range(1, count):
        vector = np.array([0.0, *phi[i - 1]])
        for k in range(i + 1, count):
            q = exponential(shares[k] * phi[k - 1] / 2)
            vector = product(product(q, vector), q * np.array([1.0, -1, -1, -1]))
        turned.append(vector[1:])
    w = sum(first[i] * turned[i - 1] for i in range(1, count))
    change = np.zeros(3)
    for i in range(1, count):
        later = sum((first[k] * turned[k - 1] for k in range(i + 1, count)), np.zeros(3))
        change += second[i] * turned[i - 1] + first[i] * np.cross(later, turned[i - 1])
    t = directions(tangents, knots, degree, np.array(u))
    across = w - (w @ t) * t
    bend = np.linalg.norm(across)
    return bend / length, (w @ t + t @ np.cross(w, change) / bend**2) / length


def rows(tangents: np.ndarray, knots_v: np.ndarray, degree_v: int, v: float) -> np.ndarray:
    """Control tangents of the u-line at v: every row of (n, m, 3) blended along v."""
    return np.stack([directions(row, knots_v, degree_v, np.array(v)) for row in tangents])


def surface(spine, tangents, lengths, knots: tuple, degrees: tuple, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Points of the QI surface (6), the initial curve first; spine: the arguments of `curve` but u; u, v: (k,)."""
    points = []
    for s, t in zip(u, v, strict=True):
        length = BSpline(knots[1], lengths, degrees[1])(t)
        line = integral(rows(tangents, knots[1], degrees[1], t), knots[0], degrees[0], s)
        points.append(curve(*spine, u=np.array([t]))[0] + length * line)
    return np.stack(points)


def walk(rng: np.random.Generator, count: int, largest: float) -> np.ndarray:
    """Directions of various lengths, neighbours up to `largest` degrees apart, two of them exactly so."""
    angles = np.radians(largest) * rng.uniform(0.3, 1, count - 1)
    angles[rng.integers(count - 1)] = np.radians(largest)
    found = [unit(rng.normal(size=3))]
    for angle in angles:
        aside = unit(np.cross(found[-1], rng.normal(size=3)))
        found.append(np.cos(angle) * found[-1] + np.sin(angle) * aside)
    return np.array(found) * rng.uniform(0.3, 3, (count, 1))


def clamped(count: int, degree: int) -> np.ndarray:
    """Even knots on [2, 5] with full ends."""
    return np.concatenate([[2.0] * degree, np.linspace(2, 5, count - degree + 1), [5.0] * degree])


def uniform(count: int, degree: int) -> np.ndarray:
    """Even knots, none repeated, with the domain [2, 5]."""
    return 2 + 3 * np.arange(-degree, count + 1) / (count - degree)


def uneven(rng: np.random.Generator, count: int, degree: int, *, full: bool = True) -> np.ndarray:
    """Uneven knots on [2, 5], an inner one repeated `degree` times if there are enough; full: clamped."""
    inner = np.sort(rng.uniform(2.1, 4.9, count - degree - 1))
    if len(inner) >= degree:
        first = rng.integers(len(inner) - degree + 1)
        inner[first : first + degree] = inner[first]
    before, after = (
        (np.sort(rng.uniform(0, 2, (2, degree))) + np.array([[0.0], [5.0]]))
        if not full
        else ([2.0] * degree, [5.0] * degree)
    )
    return np.concatenate([before, [2.0], inner, [5.0], after])


def net(rng: np.random.Generator, count_u: int, count_v: int, largest: float) -> np.ndarray:
    """Directions scattered about one, neighbours along rows and columns up to `largest` degrees apart."""
    middle, noise = unit(rng.normal(size=3)), rng.normal(size=(count_u, count_v, 3))
    found = np.broadcast_to(middle, noise.shape)
    for size in np.linspace(0, 3, 301):
        wider = unit(middle + size * noise)
        cosines = [
            np.min(np.sum(np.delete(w, 0, 0) * np.delete(w, -1, 0), axis=-1)) for w in (wider, np.swapaxes(wider, 0, 1))
        ]
        if min(cosines) < np.cos(np.radians(largest)):
            break
        found = wider
    return found
