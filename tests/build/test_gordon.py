"""Gordon surfaces."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

NET = np.stack(np.meshgrid(np.arange(6.0), np.arange(7.0), indexing="ij"), axis=-1)
NET = np.concatenate([NET, np.random.default_rng(4).normal(size=(6, 7, 1))], axis=-1)
WHOLE = js.BSplineSurface(NET, js.clamped_knots(6, 3, (2, 5)), js.clamped_knots(7, 3), 3, 3)
US, VS = np.array([2, 2.7, 3.5, 4.2, 5]), np.array([0, 0.3, 0.6, 1.0])
U, V = np.linspace(2, 5, 13), np.linspace(0, 1, 11)


def along_u(v):
    return js.BSplineCurve(np.einsum("j,ijd->id", WHOLE.basis_v.row(jnp.asarray(v)), NET), WHOLE.knots_u, 3)


def along_v(u):
    return js.BSplineCurve(np.einsum("i,ijd->jd", WHOLE.basis_u.row(jnp.asarray(u)), NET), WHOLE.knots_v, 3)


U_CURVES, V_CURVES = [along_u(v) for v in VS], [along_v(u) for u in US]


def off_curves(surface, u_curves=U_CURVES, v_curves=V_CURVES):
    on_u = [np.abs(surface(U, v) - np.asarray(c(U))).max() for c, v in zip(u_curves, VS, strict=True)]
    on_v = [np.abs(surface(u, V) - np.asarray(c(V))).max() for c, u in zip(v_curves, US, strict=True)]
    return max(on_u + on_v)


@pytest.fixture(scope="module")
def network():
    return js.gordon(U_CURVES, V_CURVES, US, VS)


def test_every_curve_is_met(network):
    assert off_curves(network) < 1e-12
    assert float(network.gap) < 1e-14 and network.gaps.shape == (5, 4)
    np.testing.assert_allclose(network(U[:11], V), np.asarray(network.grid(U, V))[range(11), range(11)], atol=1e-13)


def test_curves_of_other_kinds_and_domains():
    """A network on a cylinder: arcs across, lines along, the second family reparametrised evenly."""
    cylinder = js.Cylinder((0, 0, 0), (0, 0, 1), 2.0, 3.0)
    arcs = [js.Arc((0, 0, z), (2, 0, z), (0, 0, 1), 1.5) for z in (0.0, 1.2, 3.0)]
    lines = [js.Line(cylinder(a, 0.0), cylinder(a, 3.0)) for a in (0.0, 0.9, 1.5)]
    lines[1] = js.reparametrise(lines[1], (7, 9))
    surface = js.gordon(arcs, lines)
    np.testing.assert_allclose(surface.u_parameters, [0, 0.6, 1], atol=1e-12)
    np.testing.assert_allclose(surface.v_parameters, [0, 0.4, 1], atol=1e-12)
    wanted = np.asarray(cylinder(1.5 * np.linspace(0, 1, 7)[:, None], np.linspace(0, 3, 5)))
    np.testing.assert_allclose(surface.grid(np.linspace(0, 1, 7), np.linspace(0, 1, 5)), wanted, atol=1e-12)


def test_two_and_two_curves_are_a_coons_patch():
    ends = [U_CURVES[0], U_CURVES[-1]], [V_CURVES[0], V_CURVES[-1]]
    surface = js.gordon(*ends)
    patch = js.coons(*ends[1], *ends[0])
    np.testing.assert_allclose(surface.grid(U, V), patch.grid(U, V), atol=1e-13)


def test_crossings_are_found_and_splines_convert_exactly(network):
    found = js.gordon(U_CURVES, V_CURVES)
    np.testing.assert_allclose(found.u_parameters, US, atol=1e-12)
    np.testing.assert_allclose(found.v_parameters, VS, atol=1e-12)
    assert float(found.gap) < 1e-12
    spline = js.to_bspline(network, 1e-9)
    assert float(spline.max_error) < 1e-13 and type(spline.shape) is js.BSplineSurface


def test_what_hangs_over_is_left_out():
    inner = [along_u(v) for v in (0.1, 0.3, 0.6, 0.9)], [along_v(u) for u in (2.2, 2.7, 3.5, 4.8)]
    found = js.gordon(*inner)
    np.testing.assert_allclose(np.asarray(found.domain), [[2.2, 4.8], [0.1, 0.9]], atol=1e-12)
    given = js.gordon(*inner, [2.2, 2.7, 3.5, 4.8], [0.1, 0.3, 0.6, 0.9])
    u, v = np.linspace(2.2, 4.8, 6), np.linspace(0.1, 0.9, 5)
    np.testing.assert_allclose(given.grid(u, v), found.grid(u, v), atol=1e-12)
    np.testing.assert_allclose(given(u, 0.3), inner[0][1](u), atol=1e-12)


def test_gaps_within_the_tolerance_are_accepted_and_reported():
    curves = [U_CURVES[0], js.translate(U_CURVES[1], (0, 0, 0.01)), *U_CURVES[2:]]
    surface = js.gordon(curves, V_CURVES, US, VS, tolerance=0.01)
    assert float(surface.gap) == pytest.approx(0.01)
    assert off_curves(surface, curves) == pytest.approx(0.005, rel=0.05)
    with pytest.raises(js.InputError, match=r"`u_curves\[1\]` and `v_curves\[\d\]` are 0.01 apart where they should cross"):
        js.gordon(curves, V_CURVES, US, VS)


UNEVEN = js.interpolate(U_CURVES[1](2 + 3 * np.linspace(0, 1, 60) ** 1.5), parameters="uniform")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((U_CURVES[:1], V_CURVES), "`u_curves` must be at least 2 curves, got 1"),
        ((U_CURVES, [*V_CURVES[:4], 7]), r"`v_curves\[4\]` must be a curve, got int"),
        ((U_CURVES, V_CURVES, US), "Give both `u_parameters` and `v_parameters`"),
        ((U_CURVES, V_CURVES, VS, US), r"`u_parameters` must have shape \(5,\), one for each of `v_curves`, got \(4,\)"),
        ((U_CURVES, V_CURVES, US[::-1], VS), "`u_parameters` must ascend"),
        ((U_CURVES, V_CURVES, US + 1, VS), r"`u_parameters` must lie in the domain \[2, 5\]"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(js.InputError, match=message):
        js.gordon(*arguments)


def test_networks_that_do_not_fit_are_refused():
    """With few curves: looking for crossings takes its time."""
    ends, across = [U_CURVES[0], U_CURVES[-1]], [V_CURVES[0], V_CURVES[2], V_CURVES[-1]]
    with pytest.raises(js.InputError, match=r"`u_curves\[1\]` meets .*: turn it with `js.reverse`, or give `v_curves`"):
        js.gordon([ends[0], js.reverse(ends[1])], across)
    with pytest.raises(js.InputError, match="give `v_curves` in the order in which they cross"):
        js.gordon(ends, [across[1], across[0], across[2]])
    with pytest.raises(js.InputError, match=r"`v_curves\[1\]` meets `u_curves\[1\]` at .* crossings at equal parameters"):
        js.gordon([ends[0], UNEVEN, ends[1]], across, tolerance=1e-4)
    with pytest.raises(js.InputError, match="Crossings cannot be looked for on traced curves"):
        eqx.filter_eval_shape(lambda c: js.gordon(c, across), ends)


def test_derivatives_by_all_curves_and_parameters_agree():
    """Forward, reverse and differences; built inside `jit`, with all knots traced."""
    curves = [U_CURVES[0], U_CURVES[2], U_CURVES[3]], [V_CURVES[0], V_CURVES[-1]]
    parts = (*curves, jnp.asarray(US[[0, -1]]), jnp.asarray(VS[[0, 2, 3]]))
    data, static = eqx.partition(parts, eqx.is_inexact_array)
    u, v = np.array([2.1, 2.9, 4.4]), np.array([0.1, 0.4, 0.8])
    value = lambda data: jnp.sum(jnp.sin(js.gordon(*eqx.combine(data, static)).grid(u, v)))
    along = jax.tree.map(lambda x: jnp.asarray(0.1 * np.random.default_rng(2).normal(size=x.shape)), data)

    @jax.jit
    def slopes(data, along):
        gradient = jax.grad(value)(data)
        moved = jax.vmap(lambda h: value(jax.tree.map(lambda x, a: x + h * a, data, along)))(jnp.asarray([1e-6, -1e-6]))
        return gradient, jax.jvp(value, (data,), (along,))[1], (moved[0] - moved[1]) / 2e-6

    gradient, pushed, difference = slopes(data, along)
    pulled = sum(np.sum(g * a) for g, a in zip(jax.tree.leaves(gradient), jax.tree.leaves(along), strict=True))
    np.testing.assert_allclose(pushed, pulled, rtol=1e-10)
    np.testing.assert_allclose(pulled, difference, rtol=1e-6)


def test_files_and_single_precision(network, tmp_path):
    js.save(tmp_path / "a.jxs", network)
    assert eqx.tree_equal(js.load(tmp_path / "a.jxs"), network)
    single = jax.tree.map(lambda x: x.astype(jnp.float32), network)
    points = single.grid(U, V)
    assert points.dtype == jnp.float32
    np.testing.assert_allclose(points, network.grid(U, V), atol=1e-4)
