"""Awkward knots, all on the domain [2, 5], and what scipy says of the functions on them."""

from collections.abc import Callable
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline

import jaxsurf as js
from jaxsurf.basis import BSplineBasis
from jaxsurf.differential._jets import basis_derivatives

A, B = 2.0, 5.0
DEGREES = [1, 2, 3, 4, 5]
ORDER = 3


def _before(degree: int) -> list[float]:
    return [A - 0.4 * (i + 0.1 * i * i) for i in range(degree, 0, -1)]


def _after(degree: int) -> list[float]:
    return [B + 0.3 * (i + 0.2 * i * i) for i in range(1, degree + 1)]


ORDINARY: dict[str, Callable[[int], list[float]]] = {
    "one span": lambda p: [A] * (p + 1) + [B] * (p + 1),
    "uneven": lambda p: [A] * (p + 1) + [2.01, 2.7, 3.9, 4.4] + [B] * (p + 1),
    "inner knots of every multiplicity": lambda p: [A] * (p + 1) + [2.3] * p + [3.1] * max(p - 1, 1) + [4.4] + [B] * (p + 1),
    "unclamped": lambda p: [*_before(p), A, 2.6, 3.0, 3.1, 4.4, B, *_after(p)],
    "uniform": lambda p: list(np.asarray(js.uniform_knots(p + 4, p, (A, B)))),
    "clamped at the start alone": lambda p: [A] * (p + 1) + [2.9, 3.3, 4.1, B, *_after(p)],
    "inner knots at the ends": lambda p: [
        *_before(p)[min(p, 2) - 1 :],
        *[A] * min(p, 2),
        2.9,
        *[B] * min(p, 2),
        *_after(p)[: p + 1 - min(p, 2)],
    ],
}
PERIODIC: dict[str, Callable[[int], list[float]]] = {
    "periodic": lambda p: [A, 2.3, 3.0, 3.1, 3.1 if p > 1 else 3.2, 4.2, 4.9, B],
    "periodic, two control points": lambda p: [A, 2.9, B],
    "periodic, one control point": lambda p: [A, B],
}
CASES = [(name, degree) for name in [*ORDINARY, *PERIODIC] for degree in DEGREES]


@cache
def make(name: str, degree: int) -> BSplineBasis:
    """The basis called `name`."""
    knots = jnp.asarray((ORDINARY | PERIODIC)[name](degree), dtype=float)
    return BSplineBasis(knots, degree, name in PERIODIC)


@cache
def places(name: str, degree: int) -> np.ndarray:
    """All knots of the domain, places between them, and, unless periodic, places beyond the ends."""
    inside = np.unique(make(name, degree).knots)
    inside = inside[(inside >= A) & (inside <= B)]
    between = np.random.default_rng(degree).uniform(A, B, 11)
    beyond = [] if name in PERIODIC else [A - 0.5, np.nextafter(A, 0), np.nextafter(B, 9), B + 0.25]
    return np.concatenate([inside, np.nextafter(inside[1:], 0), between, beyond])


@cache
def tables(name: str, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Values (m, n) and derivatives (m, ORDER + 1, n) of all functions at `places`."""

    @jax.jit
    def both(basis, u):
        index, values = jax.vmap(lambda s: basis_derivatives(basis, s, ORDER))(u)
        spread = jax.nn.one_hot(index, basis.size, dtype=values.dtype)
        return basis.matrix(u), jnp.einsum("mki,min->mkn", values, spread)

    matrix, derivatives = both(make(name, degree), jnp.asarray(places(name, degree)))
    return np.asarray(matrix), np.asarray(derivatives)


def expected(knots: np.ndarray, degree: int, periodic: bool, u: np.ndarray) -> np.ndarray:
    """Derivatives (m, ORDER + 1, n) by scipy, from the Taylor series at the start of the span.

    The span is half open, the last one closed; those at the ends go on beyond the domain.
    """
    count = len(knots) - 1 if periodic else len(knots) - degree - 1
    if periodic:
        period = knots[-1] - knots[0]
        u = np.where(u == knots[-1], knots[0], u)
        turns = np.arange(-degree - 1, degree + 2)[:, None]
        line = np.unique((knots[:-1] + period * turns).reshape(-1), return_inverse=False)
        line = np.sort((knots[:-1] + period * turns).reshape(-1))
        middle = (degree + 1) * count
        knots = line[middle - degree : middle + count + degree + 1]
    functions = len(knots) - degree - 1
    spans = [i for i in range(degree, functions) if knots[i] < knots[i + 1]]
    table = np.zeros((len(u), ORDER + 1, count))
    splines = BSpline(knots, np.eye(functions), degree)
    for row, s in enumerate(u):
        i = max([i for i in spans if knots[i] <= s], default=spans[0])
        taylor = [splines(knots[i], nu=k) for k in range(degree + 1)]
        for order in range(ORDER + 1):
            for k in range(order, degree + 1):
                factor = (s - knots[i]) ** (k - order) / np.prod(np.arange(1, k - order + 1))
                np.add.at(table[row, order], np.arange(functions) % count, factor * taylor[k])
    return table
