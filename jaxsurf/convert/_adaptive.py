"""Knots on which interpolation reproduces sampled values within a tolerance."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

DENSITY = 3
"""Places per interpolation site, at least, at which the error is measured."""
SAFETY = 0.7
"""Part of the tolerance aimed at: errors between the places of measurement are a little larger."""
_ROUNDS = 60

Sample = Callable[[np.ndarray], np.ndarray]


def interpolation(
    knots: Float[np.ndarray, "k"], degree: int, values: Float[np.ndarray, "n *d"]
) -> Float[np.ndarray, "n *d"]:
    """Control data of the spline with `values` at the Greville abscissae of `knots`, by one banded solve."""
    from scipy.interpolate import make_interp_spline  # half a second, only when it is needed

    return make_interp_spline(sites(knots, degree), values, degree, t=knots, axis=0).c


def sites(knots: Float[np.ndarray, "k"], degree: int) -> Float[np.ndarray, "n"]:
    """Greville abscissae, the ends exactly those of the domain."""
    count = len(knots) - degree - 1
    means = np.mean(np.stack([knots[1 + i : 1 + i + count] for i in range(degree)]), axis=0)
    means[0], means[-1] = knots[0], knots[-1]
    return np.clip(means, knots[0], knots[-1])


def clamped(inner: np.ndarray, multiplicity: Int[np.ndarray, "n"], degree: int) -> Float[np.ndarray, "k"]:
    """Knots from the breaks `inner`, the ends included, each inner one repeated so often."""
    times = multiplicity.copy()
    times[[0, -1]] = degree + 1
    return np.repeat(inner, times)


def amid(places: Float[np.ndarray, "n"], parts: int) -> Float[np.ndarray, "m"]:
    """Parameters amid `parts` equal parts of each span: the error peaks between sites, mostly amid spans."""
    share = (np.arange(parts) + 0.5) / parts
    return (places[:-1, None] + np.diff(places)[:, None] * share).reshape(-1)


def dense_parts(count: int, spans: int) -> int:
    """An odd number of parts per span that gives `DENSITY` times as many places as there are sites."""
    return max(5, -(-DENSITY * count // spans)) | 1


def span_errors(
    knots: np.ndarray, degree: int, control: np.ndarray, where: np.ndarray, exact: np.ndarray
) -> Float[np.ndarray, "m"]:
    """Largest distance between spline and `exact` (m, ..., 3) at each place."""
    from scipy.interpolate import BSpline

    off = np.linalg.norm(BSpline(knots, control, degree, axis=0)(where) - exact, axis=-1)
    return off.reshape(len(where), -1).max(axis=1)


class Unreachable(Exception):
    """The tolerance cannot be met: `error` was reached with `count` control points."""

    def __init__(self, error: float, count: int):
        super().__init__(error, count)
        self.error, self.count = error, count


def adapted(
    sample: Sample,
    places: Float[np.ndarray, "n"],
    multiplicity: Int[np.ndarray, "n"],
    degree: int,
    tolerance: float,
    noise: float,
    most: int,
) -> tuple[Float[np.ndarray, "n2"], Int[np.ndarray, "n2"]]:
    """Breaks and multiplicities on which interpolation of `sample` (m,) -> (m, ..., d) is within `tolerance`.

    Breaks at which all is smooth are left out if that does already. Spans in error are cut into as many equal
    parts as the order of the error, degree + 1, asks for, at most 4 a round. Raises `Unreachable` if the
    error does not fall, is down to `noise`, or needs more than `most` control points.
    """
    target = SAFETY * tolerance
    rough = multiplicity > 1
    rough[[0, -1]] = True
    few = (places[rough], multiplicity[rough])
    if largest_errors(sample, *few, degree, places).max() <= target:
        return few
    best, stale = np.inf, 0
    for _ in range(_ROUNDS):
        errors = largest_errors(sample, places, multiplicity, degree, places)
        worst = float(errors.max())
        if worst <= target or worst <= min(tolerance, noise):
            return places, multiplicity
        stale = stale + 1 if worst > 0.9 * best else 0
        best = min(best, worst)
        count = int(multiplicity[1:-1].sum()) + degree + 1
        if stale >= 3 or worst <= noise or count > most:
            break
        ratio = (errors / target) ** (1 / (degree + 1))
        parts = np.where(errors > target, np.clip(np.ceil(ratio), 2, 4), 1).astype(int)
        places, multiplicity = _cut(places, multiplicity, parts)
    raise Unreachable(best, count)


def largest_errors(
    sample: Sample, places: np.ndarray, multiplicity: np.ndarray, degree: int, spans: np.ndarray
) -> Float[np.ndarray, "n"]:
    """The largest error of the interpolating spline in each of `spans`."""
    knots = clamped(places, multiplicity, degree)
    control = interpolation(knots, degree, sample(sites(knots, degree)))
    where = amid(spans, dense_parts(len(control), len(spans) - 1))
    return span_errors(knots, degree, control, where, sample(where)).reshape(len(spans) - 1, -1).max(axis=1)


def _cut(places: np.ndarray, multiplicity: np.ndarray, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each span cut into so many equal parts, at simple knots."""
    spans = zip(places[:-1], places[1:], parts, strict=True)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in spans]
    times = np.ones(int(parts.sum()) + 1, int)
    times[np.concatenate([[0], np.cumsum(parts)])] = multiplicity
    return np.concatenate([*pieces, places[-1:]]), times
