"""Shapes for the tests of CAD files: uneven and repeated knots, weights not 1, off the origin."""

import numpy as np

from jaxsurf.curve import BSplineCurve, NURBSCurve
from jaxsurf.surface import BSplineSurface, NURBSSurface, TrimmedSurface

KNOTS_U = np.array([2, 2, 2, 2, 2.5, 3.7, 3.7, 5, 5, 5, 5.0])
KNOTS_V = np.array([-1, -1, -1, 0.3, 1.1, 4, 4, 4.0])
_RANDOM = np.random.default_rng(20260101)


def net(rows: int, columns: int) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, 200, rows), np.linspace(0, 120, columns), indexing="ij")
    return np.stack([x, y, 0 * x], axis=-1) + _RANDOM.uniform(-6, 6, (rows, columns, 3)) + [30, -70, 15]


POLYNOMIAL = BSplineSurface(net(7, 5), KNOTS_U, KNOTS_V, 3, 2)
RATIONAL = NURBSSurface(net(7, 5), _RANDOM.uniform(0.4, 2.5, (7, 5)), KNOTS_U, KNOTS_V, 3, 2)
BILINEAR = BSplineSurface(net(3, 2), [2, 2, 3, 5, 5], [-1, -1, 4, 4], 1, 1)
UNCLAMPED = BSplineSurface(net(7, 5), np.sort(_RANDOM.uniform(2, 5, 11)), np.sort(_RANDOM.uniform(-1, 4, 8)), 3, 2)
_RING = np.stack([100 * np.cos(np.arange(6)), 100 * np.sin(np.arange(6)), 7 * np.arange(6) % 5], axis=-1)
PERIODIC_CURVE = BSplineCurve(_RING, [2, 2.5, 2.9, 3.3, 4.2, 4.6, 5], 3, periodic=True)
PERIODIC = BSplineSurface(
    _RING[:, None] * [1, 1, 0] + np.array([[0, 0, z] for z in (0, 20, 60, 90, 130)]),
    [2, 2.5, 2.9, 3.3, 4.2, 4.6, 5],
    KNOTS_V,
    3,
    2,
    periodic_u=True,
)
COLLAPSED = BSplineSurface(
    np.concatenate([np.broadcast_to([30.0, -70.0, 15.0], (1, 5, 3)), net(7, 5)[1:]]), KNOTS_U, KNOTS_V, 3, 2
)
SURFACES = {
    "polynomial": POLYNOMIAL,
    "rational": RATIONAL,
    "bilinear": BILINEAR,
    "unclamped": UNCLAMPED,
    "periodic": PERIODIC,
    "collapsed": COLLAPSED,
}
CURVES = {
    "polynomial": BSplineCurve(net(7, 1)[:, 0], KNOTS_U, 3),
    "rational": NURBSCurve(net(7, 1)[:, 0], _RANDOM.uniform(0.4, 2.5, 7), KNOTS_U, 3),
    "polyline": BSplineCurve(net(4, 1)[:, 0], [2, 2, 2.4, 3, 5, 5], 1),
    "unclamped": BSplineCurve(net(7, 1)[:, 0], np.sort(_RANDOM.uniform(2, 5, 11)), 3),
    "periodic": PERIODIC_CURVE,
}
SQUARE = BSplineCurve([[2.5, 0], [4.5, 0], [4.5, 3], [2.5, 3], [2.5, 0.0]], [0, 0, 1, 2, 3, 4, 4], 1)
_TURN = -2 * np.pi * np.arange(9) / 9
ROUND_HOLE = BSplineCurve(
    np.stack([3.5 + 0.4 * np.cos(_TURN), 1.5 + 0.8 * np.sin(_TURN)], axis=-1),
    np.linspace(0, 1, 10),
    3,
    periodic=True,
)
TRIMMED = TrimmedSurface(POLYNOMIAL, (SQUARE, ROUND_HOLE))
TRIMMED_RATIONAL = TrimmedSurface(RATIONAL, (SQUARE, ROUND_HOLE))


def parameters(shape) -> list[tuple[float, ...]]:
    """Nine parameters, or nine by seven pairs, over the domain."""
    domain = np.asarray(shape.domain, dtype=float)
    if domain.ndim == 1:
        return [(u,) for u in np.linspace(domain[0], domain[1], 9).tolist()]
    (u0, u1), (v0, v1) = domain
    return [(u, v) for u in np.linspace(u0, u1, 9).tolist() for v in np.linspace(v0, v1, 7).tolist()]


def difference(shape, expected) -> float:
    """The largest distance between points at equal parameters, over the domain of `expected`."""
    places = np.array(parameters(expected)).T
    return float(np.max(np.abs(np.asarray(shape(*places)) - np.asarray(expected(*places)))))
