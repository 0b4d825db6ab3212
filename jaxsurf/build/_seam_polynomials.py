"""Static matrices of the polynomials along seams."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

NODES = 7  # Chebyshev-Lobatto places where the mean normal is taken
DEGREE = 7
GAUSS = 12


class Tables(NamedTuple):
    """Static matrices: slopes of the polynomial through values at the Chebyshev places, at both ends (2, k); its Bernstein
    coefficients (d, k); those of the four bends times the quadratics through three places (4, 3, d)."""

    slopes: np.ndarray
    through: np.ndarray
    bends: np.ndarray


@cache
def chebyshev() -> np.ndarray:
    return 0.5 - 0.5 * np.cos(math.pi * np.arange(NODES) / (NODES - 1))


@cache
def gauss() -> tuple[np.ndarray, np.ndarray]:
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
    return (1 + nodes) / 2, weights / 2


@cache
def tables() -> Tables:
    places = chebyshev()
    cardinal = [np.polynomial.Polynomial.fit(places, row, NODES - 1, domain=[0, 1], window=[0, 1]) for row in np.eye(NODES)]
    slopes = np.array([[p.deriv()(end) for p in cardinal] for end in (0.0, 1.0)])
    quadratic = [np.polynomial.Polynomial.fit([0, 0.5, 1], row, 2, domain=[0, 1], window=[0, 1]) for row in np.eye(3)]
    t = np.polynomial.Polynomial([0, 1], domain=[0, 1], window=[0, 1])
    bends = [t * (1 - t) ** 2, t**2 * (t - 1), 16 * t**2 * (1 - t) ** 2, 16 * t**2 * (1 - t) ** 2 * (2 * t - 1)]
    even = np.linspace(0, 1, DEGREE + 1)
    basis = np.array([[math.comb(DEGREE, k) * x**k * (1 - x) ** (DEGREE - k) for k in range(DEGREE + 1)] for x in even])
    to_bernstein = lambda p: np.linalg.solve(basis, p(even))
    through = np.stack([to_bernstein(p) for p in cardinal], axis=1)
    return Tables(slopes, through, np.array([[to_bernstein(f * q) for q in quadratic] for f in bends]))


@cache
def fairness_tables() -> tuple[np.ndarray, np.ndarray]:
    """Derivatives 0, 1, 2 at the Gauss places: of the weights w₀, w₁ (3, 2, g), and of values there (3, g, g), by the
    polynomial of degree 7 that fits them."""
    g, _ = gauss()
    t = np.polynomial.Polynomial([0, 1], domain=[0, 1], window=[0, 1])
    weights = [t * (1 - t) ** 2, t**2 * (t - 1)]
    bent = np.array([[p(g), p.deriv()(g), p.deriv(2)(g)] for p in weights])
    powers = np.polynomial.chebyshev.chebvander(2 * g - 1, DEGREE)
    of = lambda order: (
        2.0**order * np.polynomial.chebyshev.chebval(2 * g - 1, np.polynomial.chebyshev.chebder(np.eye(DEGREE + 1), order)).T
    )
    fit = np.linalg.pinv(powers)
    return np.swapaxes(bent, 0, 1), np.stack([np.eye(GAUSS), of(1) @ fit, of(2) @ fit])
