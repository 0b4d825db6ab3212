"""Surfaces bent to planes along their sides: operators against plain formulas, ways to give planes, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from build.tangency_cases import INSIDE, KNOTS, boundary_error, report, surface, tilted, to

import jaxsurf as js


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
    turned, found = (js.reverse(target, "v"), "u1", True), (js.reverse(target, "v"), "u1")
    curve = js.interpolate(samples, parameters="uniform")
    for given, allowed in ((function, 1e-14), (turned, 1e-14), (found, 1e-14), (samples, 1e-6), (curve, 1e-6)):
        bent = js.tangent_to(base, u1=given, operator="hermite", tolerance=1e-3)
        np.testing.assert_allclose(np.asarray(bent.grid(INSIDE, INSIDE)), plain, rtol=0, atol=allowed)


def test_gradients_by_the_net_are_those_of_differences():
    base, target = surface(), tilted()
    bent = js.tangent_to(base, **to(target, "u0", "v1"), operator="hermite")

    @jax.jit
    def value(shift):
        net = base.control_points.at[2, 2].add(shift).at[1, 2].add(0.3 * shift)
        shape = js.tangent_to(js.BSplineSurface(net, KNOTS, KNOTS, 3, 3), u0=bent.fields[0], v1=bent.fields[3])
        return shape.prepared().point(jnp.asarray(0.3), jnp.asarray(0.6))[2]

    gradient = jax.jit(jax.grad(value))(jnp.zeros(3))
    step = 1e-5
    differences = [(value(step * e) - value(-step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(gradient, differences, rtol=0, atol=1e-8)
    assert np.abs(gradient).max() > 0.1


def test_flat_sheets_are_refused_to_f_and_met_by_h():
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    flat = js.BSplineSurface(np.stack([x, y, 0 * x], -1), KNOTS, KNOTS, 3, 3)
    normal = lambda v: jnp.stack([jnp.sin(16 * v**2 * (1 - v) ** 2), 0 * v, jnp.cos(16 * v**2 * (1 - v) ** 2)])
    with pytest.raises(js.InputError, match=r"`u0` cannot be met by \"scaling\".*\(4\.14\).*hermite"):
        js.tangent_to(flat, u0=normal, operator="scaling")
    found = report(flat, u0=normal)
    assert found.operator == "hermite" and found.behaves < 1
    assert found.sides[0].before > 0.5 and found.sides[0].after < 1e-12


def test_a_triangular_sheet_is_met_by_h_and_refused_to_f_at_its_tip():
    net = np.array(surface().control_points)
    net[0] = net[0, 0]
    tip = js.BSplineSurface(net, KNOTS, KNOTS, 3, 3)
    net[2, 2] += [0, 0, 0.2]
    net[-2, 2] += [0, 0, 0.1]
    net[2, 1] += [0, 0, 0.1]
    target = js.BSplineSurface(net, KNOTS, KNOTS, 3, 3)
    given = to(target, "u1", "v0")
    found = report(tip, **given, operator="gregory")
    assert [side.before > 0.02 and side.after < 1e-12 for side in found.sides] == [True, True]
    assert boundary_error(js.tangent_to(tip, **given, operator="gregory"), tip) < 1e-13
    with pytest.raises(js.InputError, match="single point"):
        js.tangent_to(tip, u0=(0.0, 0.0, 1.0), operator="scaling")


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
        (
            {"v1": (surface(), "v0")},
            "`v1` must be given by a side that is the same curve .* but v0 of that surface is [0-9.]+ off",
        ),
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
