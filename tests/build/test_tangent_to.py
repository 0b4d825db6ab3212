"""Surfaces bent to planes along their sides: theorems of paper 000, operators against plain formulas, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

KNOTS = js.clamped_knots(5, 3)
INSIDE = np.linspace(0, 1, 9)


def surface(seed=0, arch=0.4):
    """A bicubic sheet, arched so that no line is straight."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    z = arch * (1 - (2 * x - 1) ** 2 * 0.8 - (2 * y - 1) ** 2 * 0.6)
    return js.BSplineSurface(np.stack([x, y, z], -1) + 0.02 * rng.normal(size=(5, 5, 3)), KNOTS, KNOTS, 3, 3)


def tilted(seed=0, size=0.1):
    """A neighbour with the same boundary curves and corners: its normals on the sides are tilted amid them."""
    net = np.array(surface(seed).control_points)
    rng = np.random.default_rng(seed + 100)
    lift = size * rng.uniform(0.5, 1, (3, 3))
    lift[::2, ::2] = 0
    net[1:-1, 1:-1, 2] += lift
    return js.BSplineSurface(net, KNOTS, KNOTS, 3, 3)


def normal_of(shape, u, v):
    """S_u × S_v inside traced code."""
    return js.partials(shape, jnp.asarray(u), v).normal


def test_one_side_by_f_is_the_formula_of_the_paper():
    """(4.10) to (4.12), evaluated plainly, for the side u = 1."""
    base, target = surface(3), tilted(3)
    bent = js.tangent_to(base, u1=(target, "u1"), operator="scaling")
    u, v = np.meshgrid(INSIDE[1:-1], INSIDE[1:-1], indexing="ij")
    start, end = (np.asarray(base(np.full_like(v, x), v)) for x in (0.0, 1.0))
    e = (end - start) / np.linalg.norm(end - start, axis=-1, keepdims=True)
    n = np.asarray(js.normal(base, np.zeros_like(v), v))
    m = np.asarray(js.normal(target, np.ones_like(v), v))
    slope = np.asarray(base.derivative(np.ones_like(v), v, (1, 0)))
    dot = lambda a, b: np.sum(a * b, axis=-1, keepdims=True)
    h = dot(np.asarray(base(u, v)) - start, n) / dot(e, n)
    k = 1 / (1 - dot(slope, m) * dot(e, n) / (dot(slope, n) * dot(e, m)))
    plain = start + h * e + k * (np.asarray(base(u, v)) - start - h * e)
    assert np.abs(plain - np.asarray(base(u, v))).max() > 1e-3
    np.testing.assert_allclose(np.asarray(bent(u, v)), plain, rtol=0, atol=1e-12)


def test_normals_by_functions_arrays_and_curves_are_the_same_planes():
    base, target = surface(), tilted()
    at = jnp.linspace(0, 1, 81)
    samples = js.normal(target, jnp.ones(81), at)
    function = lambda v: 3.0 * normal_of(target, 1.0, v)
    plain = np.asarray(js.tangent_to(base, u1=(target, "u1"), operator="hermite").grid(INSIDE, INSIDE))
    assert np.abs(plain - np.asarray(base.grid(INSIDE, INSIDE))).max() > 1e-3
    turned = (js.reverse(target, "v"), "u1", True)
    curve = js.interpolate(samples, parameters="uniform")
    for given, allowed in ((function, 1e-14), (turned, 1e-14), (samples, 1e-6), (curve, 1e-6)):
        bent = js.tangent_to(base, u1=given, operator="hermite", tolerance=1e-3)
        np.testing.assert_allclose(np.asarray(bent.grid(INSIDE, INSIDE)), plain, rtol=0, atol=allowed)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"u0": (1.0, 0.0, 0.0), "operator": "no"}, r"`operator` must be one of auto, .*, got 'no'"),
        ({}, "At least one of `u0`"),
        ({"u0": 3.0}, r"`u0` must be normals \(n, 3\)"),
        (
            {"u0": (0.0, 0.3, 1.0)},
            r"`u0` must be normal to the side's curve within 1e-06 rad, \(4\.3\), and is off by 0\.\d+ rad",
        ),
        ({"u0": lambda v: jnp.zeros(3)}, "`u0` must give finite normals of length > 0"),
        ({"v1": (surface(), "w1")}, r"`v1` given by another surface must be \(surface, side\)"),
    ],
)
def test_bad_fields_are_refused(given, sentence):
    with pytest.raises(js.InputError, match=sentence):
        js.tangent_to(surface(), **given)


def test_planes_that_do_not_hold_the_boundary_curves_are_refused():
    base = surface()
    along = lambda v: js.partials(base, jnp.asarray(0.0), v).v
    off = lambda v: 3 * normal_of(base, 0.0, v) + jnp.cross(along(v), normal_of(base, 0.0, v))
    with pytest.raises(js.InputError, match=r"`u0` must at its ends .*\(4\.4\).*off by 0\.\d"):
        js.tangent_to(base, u0=off)
