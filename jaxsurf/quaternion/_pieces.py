"""Polynomials in place of directions: how many pieces a span needs, and the matrices that make them."""

import math
from collections.abc import Iterator
from functools import cache
from itertools import count

import numpy as np
from jaxtyping import Float

CURVE_NODES = (6, 7, 8, 10)
SURFACE_NODES = 16
"""Gauss-Legendre nodes of a piece, per direction: fewer need more pieces and so larger tables, more cost more per point."""

_LARGEST_TABLE = 1000  # rows of three numbers, which the fastest cache holds


def gauss_places(pieces: int, nodes: int) -> Float[np.ndarray, "q"]:
    """Nodes in a span from −1 to 1 that is cut in equal pieces, piece by piece."""
    places, _ = np.polynomial.legendre.leggauss(nodes)
    middles = (2 * np.arange(pieces) + 1) / pieces - 1
    return (middles[:, None] + places / pieces).reshape(-1)


@cache
def series_matrix(nodes: int) -> Float[np.ndarray, "q q"]:
    """Values at the nodes of [−1, 1] to the Legendre coefficients of the polynomial through them (exact quadrature)."""
    places, weights = np.polynomial.legendre.leggauss(nodes)
    values = np.polynomial.legendre.legvander(places, nodes - 1)
    return (2 * np.arange(nodes)[:, None] + 1) / 2 * values.T * weights


@cache
def integral_matrix(nodes: int) -> Float[np.ndarray, "r q"]:
    """Values at the nodes of [−1, 1] to the Legendre coefficients of their polynomial's integral from −1."""
    series = series_matrix(nodes)
    raised = np.zeros((nodes + 1, nodes))
    raised[:2] += series[0]  # ∫ 1 = 1 + x
    for k in range(1, nodes):  # ∫ P_k = (P_{k+1} − P_{k−1}) / (2k + 1), 0 at −1
        raised[k + 1] += series[k] / (2 * k + 1)
        raised[k - 1] -= series[k] / (2 * k + 1)
    return raised


@cache
def powers_of_series(count: int) -> Float[np.ndarray, "r r"]:
    """Legendre coefficients to those by power.

    A step of its own: high coefficients of smooth functions are small, so that its large entries cost no digits, while in
    the product with the matrices above the round-off of values would meet them (1e-12 for 16 nodes).
    """
    columns = [np.polynomial.legendre.leg2poly(row) for row in np.eye(count)]
    return np.stack([np.pad(column, (0, count - len(column))) for column in columns], axis=1)


@cache
def curve_layout(degree: int, angle: float, tolerance: float, spans: int) -> tuple[int, int]:
    """Pieces per span and nodes per piece of a curve: as few nodes as its table stays small with."""
    for nodes in CURVE_NODES:
        pieces = pieces_per_span(degree, angle, tolerance, nodes)
        if spans * pieces * (nodes + 1) <= _LARGEST_TABLE:
            break
    return pieces, nodes


@cache
def pieces_per_span(degree: int, angle: float, tolerance: float, nodes: int) -> int:
    """Into how many equal pieces a span is cut so that polynomials through the nodes miss directions by `tolerance` at most.

    angle: the largest between neighbouring control directions, radians. A direction is an entire function of the parameter
    z, no larger than exp Σ angle |Im B̃_i(z)|; by Bernstein's bound the polynomial is off by about 16 times that largest
    value on an ellipse about the piece times ρ^−nodes / (ρ − 1), ρ the sum of the half axes, whichever ρ is best. B̃_i are
    those of a Bézier span, the wildest there are. Source: Trefethen, Approximation Theory and Approximation Practice, ch. 8.
    """
    return next(pieces for pieces in _counts() if _error_bound(degree, angle, pieces, nodes) <= tolerance)


def _counts() -> Iterator[int]:
    """1, 2, 3, 4, 6, 8, 12, 16, …: few enough that shapes of one family share compiled programs."""
    yield 1
    for exponent in count(1):
        yield 2**exponent
        yield 3 * 2 ** (exponent - 1)


def _error_bound(degree: int, angle: float, pieces: int, nodes: int) -> float:
    rho = np.exp(np.linspace(0.05, 5, 60))[:, None, None]
    around = np.exp(1j * np.linspace(0, np.pi, 25))[None, :, None]
    middles = ((np.arange(pieces) + 0.5) / pieces)[None, None, :]
    z = middles + (rho * around + 1 / (rho * around)) / (4 * pieces)
    bernstein = [math.comb(degree, j) * z**j * (1 - z) ** (degree - j) for j in range(degree + 1)]
    cumulative = np.cumsum(bernstein[:0:-1], axis=0)
    growth = angle * np.max(np.sum(np.abs(cumulative.imag), axis=0), axis=(1, 2))
    rho = rho[:, 0, 0]
    return float(np.min(16 * np.exp(np.minimum(growth, 700)) * rho**-nodes / (rho - 1)))
