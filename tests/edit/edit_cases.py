"""Splines at awkward places, and their points by scipy."""

import numpy as np
from scipy.interpolate import BSpline

from jaxsurf.curve import BSplineCurve, NURBSCurve
from jaxsurf.surface import BSplineSurface, NURBSSurface


def clamped(degree, *inner):
    return np.array([2.0] * (degree + 1) + list(inner) + [5.0] * (degree + 1))


UNCLAMPED = np.array([0.0, 0.7, 1.1, 2.0, 2.6, 3.0, 3.1, 4.4, 5.0, 5.5, 5.9, 6.5])  # degree 3: domain [2, 5]

# name: (knots, degree, periodic, rational)
CURVES = {
    "polygon": (clamped(1, 2.5, 4.0), 1, False, False),
    "quadratic with a corner": (clamped(2, 2.4, 2.4, 4.1), 2, False, False),
    "rational cubic, full knot": (clamped(3, 2.7, 3.1, 3.1, 3.1, 4.4), 3, False, True),
    "unclamped": (UNCLAMPED, 3, False, False),
    "quintic without inner knots": (clamped(5), 5, False, True),
    "periodic": (np.array([2.0, 2.3, 3.0, 3.0, 4.2, 5.0]), 3, True, False),
    "periodic, two points": (np.array([2.0, 2.9, 5.0]), 4, True, False),
}

# name: (knots and degree in u, in v, periodic in u and v, rational)
SURFACES = {
    "uneven": ((clamped(2, 2.5, 4.0, 4.0), 2), (UNCLAMPED, 3), (False, False), False),
    "tube": ((np.array([2.0, 2.2, 4.0, 5.0]), 3), (clamped(1, 3.0), 1), (True, False), False),
    "rational": ((clamped(3, 4.0), 3), (clamped(2, 2.1), 2), (False, False), True),
}


def curve(name):
    knots, degree, periodic, rational = CURVES[name]
    rng = np.random.default_rng(len(name))
    count = _count(knots, degree, periodic)
    points = 3 + rng.normal(size=(count, 3))
    if rational:
        return NURBSCurve(points, rng.uniform(0.5, 2, count), knots, degree)
    return BSplineCurve(points, knots, degree, periodic)


def surface(name):
    (knots_u, degree_u), (knots_v, degree_v), periodic, rational = SURFACES[name]
    rng = np.random.default_rng(len(name))
    counts = _count(knots_u, degree_u, periodic[0]), _count(knots_v, degree_v, periodic[1])
    points = 3 + rng.normal(size=(*counts, 3))
    if rational:
        return NURBSSurface(points, rng.uniform(0.5, 2, counts), knots_u, knots_v, degree_u, degree_v)
    return BSplineSurface(points, knots_u, knots_v, degree_u, degree_v, *periodic)


def points(shape, *parameters):
    """The points of a spline by scipy; on surfaces a grid."""
    net = np.asarray(shape.control_points)
    rational = isinstance(shape, NURBSCurve | NURBSSurface)
    if rational:
        weights = np.asarray(shape.weights)[..., None]
        net = np.concatenate([net * weights, weights], axis=-1)
    if isinstance(shape, BSplineCurve | NURBSCurve):
        axes = [(shape.knots, shape.degree, getattr(shape, "periodic", False))]
    else:
        axes = [
            (shape.knots_u, shape.degree_u, getattr(shape, "periodic_u", False)),
            (shape.knots_v, shape.degree_v, getattr(shape, "periodic_v", False)),
        ]
    for place, ((knots, degree, periodic), u) in enumerate(zip(axes, parameters, strict=True)):
        matrix = _matrix(np.asarray(knots), degree, periodic, np.asarray(u))
        net = np.moveaxis(np.tensordot(matrix, net, axes=(1, place)), 0, place)
    return net[..., :-1] / net[..., -1:] if rational else net


def inside(shape, count=11):
    """Parameters from end to end of a curve's domain."""
    first, last = (float(end) for end in shape.domain)
    return np.linspace(first, last, count)


def _count(knots, degree, periodic):
    return len(knots) - 1 if periodic else len(knots) - degree - 1


def _matrix(knots, degree, periodic, u):
    count = len(knots) - 1
    if not periodic:
        return BSpline(knots, np.eye(len(knots) - degree - 1), degree)(u)
    turns, places = np.divmod(np.arange(-degree, count + degree + 1), count)
    continued = knots[places] + turns * (knots[-1] - knots[0])
    matrix = BSpline(continued, np.eye(count + degree), degree)(u)
    folded = np.zeros((len(u), count))
    for i in range(count + degree):
        folded[:, i % count] += matrix[:, i]
    return folded
