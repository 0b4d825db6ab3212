"""Refinement and elevation matrices for knots whose values are known, in numpy: nothing is compiled.

`basis` has the same for traced knots; there every new number of knots takes a second to compile.
"""

import numpy as np
from jaxtyping import Float


def known_refinement(
    knots: Float[np.ndarray, "k"], refined: Float[np.ndarray, "k2"], degree: int
) -> Float[np.ndarray, "n2 n"]:
    """From control points on `knots` to control points of the same spline on `refined`."""
    arguments = _windows(refined, degree)
    return _blossom(knots, degree, arguments, arguments.mean(axis=1))


def known_elevation(
    knots: Float[np.ndarray, "k"], elevated: Float[np.ndarray, "k2"], degree: int
) -> Float[np.ndarray, "n2 n"]:
    """From control points of `degree` to those of `degree + 1`: means of blossoms, one argument left out."""
    arguments = _windows(elevated, degree + 1)
    where = arguments.mean(axis=1)
    omitted = [_blossom(knots, degree, np.delete(arguments, i, axis=1), where) for i in range(degree + 1)]
    return np.mean(omitted, axis=0)


def _windows(knots: np.ndarray, degree: int) -> np.ndarray:
    """The `degree` inner knots of each function's support."""
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree)


def _blossom(knots: np.ndarray, degree: int, arguments: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Rows of the coefficients of the blossom at `arguments`, for the polynomial around `where` (Ramshaw)."""
    start, end = knots[degree], knots[-degree - 1]
    inner = knots[degree + 1 : -degree - 1]
    inner = np.where(inner <= start, -np.inf, np.where(inner >= end, np.inf, inner))
    first = np.searchsorted(inner, np.clip(where, start, end), side="right")
    count, rows = knots.size - degree - 1, np.arange(where.size)
    near = knots[first[:, None] + 1 + np.arange(2 * degree)]
    # de Boor's triangle with another argument at each level, run on unit vectors
    points = np.broadcast_to(np.eye(degree + 1), (where.size, degree + 1, degree + 1))
    for level in range(1, degree + 1):
        left, right = near[:, level - 1 : degree], near[:, degree : 2 * degree + 1 - level]
        share = ((arguments[:, level - 1 : level] - left) / (right - left))[..., None]
        points = (1 - share) * points[:, :-1] + share * points[:, 1:]
    matrix = np.zeros((where.size, count))
    matrix[rows[:, None], first[:, None] + np.arange(degree + 1)] = points[:, 0]
    return matrix


def derivative_row(knots: Float[np.ndarray, "k"], degree: int, at: float, order: int) -> Float[np.ndarray, "n"]:
    """Coefficients by control points of a derivative at a parameter of the domain (The NURBS Book, §3.3)."""
    steps = np.eye(knots.size - degree - 1)
    for k in range(order):
        inner = knots[k + 1 : knots.size - k - 1]
        d = degree - k
        spans = inner[d:] - inner[:-d]
        steps = d * np.diff(steps, axis=0) / np.where(spans > 0, spans, 1)[:, None]
    d = degree - order
    trimmed = knots[order : knots.size - order]
    row = _blossom(trimmed, d, np.full((1, d), at), np.array([at])) if d else _constant(trimmed, at)
    return row[0] @ steps


def _constant(knots: np.ndarray, at: float) -> np.ndarray:
    """The row of the piecewise constants at a parameter, of the last span at the end."""
    row = np.zeros((1, knots.size - 1))
    row[0, min(int(np.searchsorted(knots, at, side="right")), int(np.searchsorted(knots, knots[-1]))) - 1] = 1
    return row
