"""B-spline surfaces on awkward knots, against scipy and splinepy."""

from itertools import product

import numpy as np
import pytest
from knot_cases import ORDINARY, PERIODIC, A, B, expected, make, places

import jaxsurf as js

PAIRS = list(product([*ORDINARY, *PERIODIC], [("uneven", 2), ("periodic", 3), ("unclamped", 1), ("one span", 5)]))


def surface_of(u: tuple[str, int], v: tuple[str, int]) -> tuple[js.BSplineSurface, np.ndarray]:
    a, b = make(*u), make(*v)
    net = np.random.default_rng(u[1] + 7 * v[1]).normal(size=(a.size, b.size, 3)) + [4.0, -7.0, 2.0]
    return js.BSplineSurface(net, a.knots, b.knots, a.degree, b.degree, a.periodic, b.periodic), net


@pytest.mark.parametrize("name, other", PAIRS)
def test_points_grids_and_partials_are_those_of_scipy(name, other):
    surface, net = surface_of((name, 3), other)
    u, v = places(name, 3), places(*other)
    in_u = expected(np.asarray(surface.knots_u), 3, surface.periodic_u, u)
    in_v = expected(np.asarray(surface.knots_v), other[1], surface.periodic_v, v)
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 3)):
        wanted = np.einsum("an,bm,nmx->abx", in_u[:, i], in_v[:, j], net)
        terms = np.max(np.einsum("an,bm,nmx->abx", np.abs(in_u[:, i]), np.abs(in_v[:, j]), np.abs(net)))
        if "one control point" in name:  # its functions cancel each other before they meet the net
            terms = max(terms, (2 * 3 / (B - A)) ** i * np.max(np.sum(np.abs(in_v[:, j]), axis=1)) * np.max(np.abs(net)))
        found = surface(u[:, None], v) if (i, j) == (0, 0) else surface.derivative(u[:, None], v, (i, j))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * max(1, terms))
        if (i, j) == (0, 0):
            np.testing.assert_allclose(surface.grid(u, v), wanted, rtol=0, atol=1e-12 * max(1, terms))


@pytest.mark.parametrize("name", ["one span", "uneven", "inner knots of every multiplicity"])
def test_points_and_partials_are_those_of_splinepy(name):
    import splinepy

    surface, net = surface_of((name, 3), ("uneven", 2))
    knots = [np.asarray(k).tolist() for k in (surface.knots_u, surface.knots_v)]
    flat = net.transpose(1, 0, 2).reshape(-1, 3)
    other = splinepy.BSpline(degrees=[3, 2], knot_vectors=knots, control_points=flat)
    at = np.random.default_rng(3).uniform(A, B, (60, 2))
    np.testing.assert_allclose(surface(at[:, 0], at[:, 1]), other.evaluate(at), rtol=0, atol=1e-12)
    for order in ((1, 0), (0, 1), (1, 1)):
        wanted = other.derivative(at, list(order))
        found = surface.derivative(at[:, 0], at[:, 1], order)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))


REFUSED = {
    "a table": ((np.zeros((4, 3)), [0.0], [0.0], 1, 1), r"`control_points` must have shape \(n, m, 3\), got \(4, 3\)"),
    "a plane": ((np.zeros((2, 2, 2)), [0.0], [0.0], 1, 1), r"`control_points` must have shape \(n, m, 3\), got \(2, 2, 2\)"),
    "knots": ((np.zeros((2, 2, 3)), [0.0, 0, 1, 1], [0.0, 0, 1], 1, 1), "`knots_v` must have 4 knots"),
}


@pytest.mark.parametrize("arguments, message", REFUSED.values(), ids=REFUSED)
def test_bad_input_is_refused_in_one_sentence(arguments, message):
    with pytest.raises(js.InputError, match=message):
        js.BSplineSurface(*arguments)
