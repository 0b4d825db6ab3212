"""Surfaces bent to planes along their sides: theorems of paper 000, operators against plain formulas, refusals."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.build._edge_fields import EdgeField
from jaxsurf.build._tangency_facts import outcome

KNOTS = js.clamped_knots(5, 3)
SIDES = ("u0", "u1", "v0", "v1")
INSIDE = np.linspace(0, 1, 9)


def surface(seed=0, arch=0.4):
    """A bicubic sheet, arched so that no line is straight."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    z = arch * (1 - (2 * x - 1) ** 2 * 0.8 - (2 * y - 1) ** 2 * 0.6)
    return js.BSplineSurface(np.stack([x, y, z], -1) + 0.02 * rng.normal(size=(5, 5, 3)), KNOTS, KNOTS, 3, 3)


def tilted(seed=0, size=0.1, slopes=0.0, arch=0.4):
    """A neighbour with the same boundary curves: the surface with its inner control points moved, so that its normals on a
    side are tilted, but not at the corners. slopes: of the tilt at the ends, which break the corner conditions."""
    base = surface(seed, arch)
    net = np.array(base.control_points)
    rng = np.random.default_rng(seed + 100)
    net[1:-1, 1:-1] += size * rng.uniform(0.5, 1, (3, 3, 1)) * [0, 0, 1]
    if not slopes:  # twists, and with them the slopes of normals at corners, stay as they are
        for i in (1, -2):
            for j in (1, -2):
                net[i, j] = base.control_points[i, j]
    return js.BSplineSurface(net, KNOTS, KNOTS, 3, 3)


def angles(bent):
    """Largest angles to the given planes: of the surface as it was, and bent."""
    done = outcome(bent)
    return (max(float(jnp.max(x)) for x in found.values()) for found in (done.before, done.after))


def boundary_error(bent, base):
    """On the outline of a grid of points."""
    off = np.abs(np.asarray(bent.grid(INSIDE, INSIDE)) - np.asarray(base.grid(INSIDE, INSIDE)))
    return max(off[[0, -1]].max(), off[:, [0, -1]].max())


def normal_of(shape, u, v):
    """S_u × S_v inside traced code."""
    return js.partials(shape, jnp.asarray(u), v).normal


def to(target, *sides) -> Any:
    return {side: (target, side) for side in sides}


@pytest.mark.parametrize(("sides", "operator"), [(("u1",), "hermite"), (("v0", "v1"), "scaling"), (SIDES, "gregory")])
def test_planes_are_met_and_boundaries_kept(sides, operator):
    base = surface()
    bent = js.tangent_to(base, **to(tilted(), *sides), operator=operator)
    before, after = angles(bent)
    assert bent.operator == operator and before > 0.05 and after < 1e-12
    assert boundary_error(bent, base) < 1e-13


def test_the_opposite_side_keeps_its_planes():
    base = surface()
    bent = js.tangent_to(base, u1=(tilted(), "u1"), operator="scaling")
    assert next(angles(js.build.TangentSurface(bent, (EdgeField.of_side(base, "u0"), None, None, None), "hermite"))) < 1e-12


def test_auto_takes_f_where_lines_behave_and_gregory_where_corners_do_not():
    base = surface()
    assert js.tangent_to(base, **to(tilted(), "u0", "u1")).operator == "scaling"
    assert js.tangent_to(base, **at_odds()).operator == "gregory"


def at_odds():
    """Planes whose slopes at the corners belong to two different surfaces."""
    return {**to(tilted(slopes=1.0), "u0", "u1"), **to(tilted(), "v0", "v1")}


def test_violated_corners_leave_what_the_report_predicts_and_gregory_nothing():
    base = surface()
    with pytest.warns(js.GeometryWarning, match="gregory"):
        report = js.tangency_report(base, **at_odds(), operator="hermite")
    assert not report.compatible and max(abs(c.twist) for c in report.corners) > 0.1
    rows = {side.side: side for side in report.sides}
    assert max(rows[s].predicted for s in ("u0", "u1")) > 1e-3
    for side in SIDES:
        assert rows[side].before > 0.05
        assert abs(rows[side].after - rows[side].predicted) < 1e-6 * (1e-6 + rows[side].predicted)
    gregory = js.tangent_to(base, **at_odds(), operator="gregory")
    assert max(list(angles(gregory))[1:]) < 1e-12 and boundary_error(gregory, base) < 1e-13
    assert "u0 v1" in str(report)


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


def test_slopes_of_k_vanish_exactly_where_twists_are_kept():
    """Theorems 1 and 2: k'(1) = 0 if and only if M'(1) is the slope of the surface's own normal."""
    kept = js.tangency_report(surface(), **to(tilted(), "u1"), operator="scaling").sides[0]
    broken = js.tangency_report(surface(), **to(tilted(slopes=1.0), "u1"), operator="scaling").sides[0]
    assert np.abs(kept.slopes_of_k).max() < 1e-11 < 1e-2 < np.abs(broken.slopes_of_k).max()


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


def test_gradients_by_the_net_are_those_of_differences():
    base, target = surface(), tilted()
    bent = js.tangent_to(base, **to(target, "u0", "v1"), operator="hermite")

    def value(shift):
        moved = js.translate(base, (0.0, 0.0, 0.0))
        net = moved.control_points.at[2, 2].add(shift).at[1, 2].add(0.3 * shift)
        shape = js.build.TangentSurface(js.BSplineSurface(net, KNOTS, KNOTS, 3, 3), bent.fields, "hermite")
        return shape.prepared().point(jnp.asarray(0.3), jnp.asarray(0.6))[2]

    value = jax.jit(value)
    gradient = jax.jit(jax.grad(value))(jnp.zeros(3))
    step = 1e-5
    differences = [(value(step * e) - value(-step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(gradient, differences, rtol=0, atol=1e-8)
    assert np.abs(gradient).max() > 0.1


def test_flat_and_ruled_sheets_are_refused_to_f_and_met_by_h():
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), indexing="ij")
    flat = js.BSplineSurface(np.stack([x, y, 0 * x], -1), KNOTS, KNOTS, 3, 3)
    normal = lambda v: jnp.stack([jnp.sin(16 * v**2 * (1 - v) ** 2), 0 * v, jnp.cos(16 * v**2 * (1 - v) ** 2)])
    with pytest.raises(js.InputError, match=r"`u0` cannot be met by \"scaling\".*\(4\.14\).*hermite"):
        js.tangent_to(flat, u0=normal, operator="scaling")
    bent = js.tangent_to(flat, u0=normal)
    assert bent.operator == "hermite" and float(jnp.max(outcome(bent).after["u0"])) < 1e-12


def test_a_triangular_sheet_is_met_by_h_and_refused_to_f_at_its_tip():
    base = surface()
    net = np.array(base.control_points)
    net[0] = net[0, 0]
    tip = js.BSplineSurface(net, KNOTS, KNOTS, 3, 3)
    target = np.array(net)
    target[2, 2] += [0, 0, 0.2]
    target = js.BSplineSurface(target, KNOTS, KNOTS, 3, 3)
    bent = js.tangent_to(tip, u1=(target, "u1"), v0=(target, "v0"), operator="gregory")
    assert list(angles(bent))[1] < 1e-12 and boundary_error(bent, tip) < 1e-13
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
