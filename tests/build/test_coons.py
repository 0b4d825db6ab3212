"""Coons patches, plain and extended."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

A, B, C, D = np.array([[7.0, -3, 4], [10, -2.8, 5], [6.7, -0.5, 4.7], [10.4, -0.1, 3.6]])  # corners (u, v) = 00, 10, 01, 11
SHARES = np.linspace(0, 1, 13)


def spline(start, end, inner, degree, domain, seed):
    """A B-spline that wanders from one point to another."""
    knots = np.concatenate([np.full(degree + 1, domain[0]), inner, np.full(degree + 1, domain[1])])
    count = len(knots) - degree - 1
    points = np.linspace(start, end, count) + 0.3 * np.random.default_rng(seed).normal(size=(count, 3))
    points[0], points[-1] = start, end
    return js.BSplineCurve(points, knots, degree)


U0 = spline(A, C, [2.9, 4.1], 2, (2, 5), 1)
U1 = spline(B, D, [0.2, 0.5, 0.5], 3, (0, 1), 2)
V0 = spline(A, B, [2.7, 3.1, 3.1, 4.4], 3, (2, 5), 3)
V1 = spline(C, D, [-1.0], 4, (-2, 1), 4)
ARC = js.Arc.through(B, (B + D) / 2 + np.array([0.6, 0, 0.3]), D)


def places(curve, shares=SHARES):
    a, b = (float(end) for end in curve.domain)
    return a + shares * (b - a)


def translated(one, other, corner):
    """The sums of points of two curves that share a corner."""
    return np.asarray(one)[:, None] + (np.asarray(other) - corner)[None]


def off_sides(surface, sides):
    """The largest distance from each side that is a curve or a point."""
    (a, b), (c, d) = surface.domain
    u, v = a + SHARES * (b - a), c + SHARES * (d - c)
    found = dict(u0=surface(a, v), u1=surface(b, v), v0=surface(u, c), v1=surface(u, d))
    wanted = {name: side(places(side)) if isinstance(side, js.AbstractCurve) else side for name, side in sides.items()}
    return {name: float(np.abs(np.asarray(found[name]) - np.asarray(wanted[name])).max()) for name in sides}


@pytest.mark.parametrize("blend", [js.linear, (js.Smoothstep(2), lambda t: t * t)])
def test_all_four_sides_are_met(blend):
    sides: dict[str, Any] = dict(u0=U0, u1=ARC, v0=V0, v1=V1)
    patch = js.coons(**sides, blend=blend)
    assert patch.domain == (V0.domain, U0.domain)
    assert max(off_sides(patch, sides).values()) < 1e-13


def test_straight_sides_give_the_bilinear_patch():
    patch = js.coons(js.Line(A, C), js.Line(B, D), js.Line(A, B), js.Line(C, D))
    s, t = SHARES[:, None, None], SHARES[None, :, None]
    wanted = (1 - s) * (1 - t) * A + s * (1 - t) * B + (1 - s) * t * C + s * t * D
    np.testing.assert_allclose(patch.grid(SHARES, SHARES), wanted, atol=1e-13)


def test_sides_moved_in_parallel_give_the_translation_surface():
    patch = js.coons(U0, js.translate(U0, B - A), V0, js.translate(V0, C - A), blend=js.smoothstep)
    u, v = places(V0), places(U0)
    wanted = translated(V0(u), U0(v), A)
    np.testing.assert_allclose(patch.grid(u, v), wanted, atol=1e-13)


def test_cubic_blending_takes_the_derivatives_across_from_the_neighbours():
    """With φ' = 0 at the ends S_u on u = first is (1 − ψ) v0' + ψ v1': what two such patches side by side share."""
    patch = js.coons(U0, ARC, V0, V1, blend=js.smoothstep)
    v = places(U0)
    psi = np.asarray(js.smoothstep(jnp.asarray(SHARES)))[:, None]
    wanted = (1 - psi) * np.asarray(V0.derivative([2.0])) + psi * np.asarray(
        V1.derivative([-2.0])
    )  # domains of the same length
    np.testing.assert_allclose(patch.derivative(2.0, v, (1, 0)), wanted, atol=1e-12)


def test_splines_convert_to_one_spline_exactly():
    patch = js.coons(U0, U1, V0, V1, blend=(js.smoothstep, js.linear))
    found = js.to_bspline(patch, 1e-9)
    assert float(found.max_error) < 1e-13
    assert (found.shape.degree_u, found.shape.degree_v) == (4, 3)
    u, v = places(V0, np.linspace(0, 1, 57)), places(U0, np.linspace(0, 1, 44))
    np.testing.assert_allclose(found.shape.grid(u, v), patch.grid(u, v), atol=1e-13)


def test_other_sides_convert_within_the_tolerance():
    found = js.to_bspline(js.coons(js.Line(A, C), ARC, js.Line(A, B), js.Line(C, D)), 1e-3)
    assert 0 < float(found.max_error) <= 1e-3


@pytest.mark.parametrize(
    ("change", "advice"),
    [
        (dict(u1=js.reverse(ARC)), "reverse `u1` with `js.reverse`"),
        (dict(u0=js.reverse(U0), v1=js.reverse(V1)), "reverse `u0` and `v1`"),
        (dict(u0=ARC, u1=U0), "reverse `v0` and `v1`"),
        (dict(u1=js.translate(ARC, (0, 0, 0.25))), "0.25 apart .* move the ends together"),
    ],
)
def test_corners_that_do_not_meet_are_refused(change, advice):
    with pytest.raises(js.InputError, match=advice):
        js.coons(**(dict(u0=U0, u1=ARC, v0=V0, v1=V1) | change))


def test_bad_arguments_are_refused():
    with pytest.raises(js.InputError, match="`v1` must be a curve, got ndarray"):
        js.coons(U0, ARC, V0, C)
    with pytest.raises(js.InputError, match="`u0` must be a curve in space"):
        js.coons(js.Line([0, 0], [1, 1]), ARC, V0, V1)
    with pytest.raises(js.InputError, match="`blend` must be one function or a pair"):
        js.coons(U0, ARC, V0, V1, blend=(js.linear,) * 3)
    with pytest.raises(js.InputError, match="`blend` must be 1 at 1"):
        js.coons(U0, ARC, V0, V1, blend=lambda t: t / 2)
    with pytest.raises(js.InputError, match="At least two of"):
        js.extended_coons(u0=U0, v0=A)
    with pytest.raises(js.InputError, match="`u1` must be a curve, a point"):
        js.extended_coons(U0, "B", V0)
    with pytest.raises(js.InputError, match="At the corner u = last, v = first `u1` and `v0`"):
        js.extended_coons(U0, D, V0)


def test_a_gap_within_the_tolerance_is_shared():
    patch = js.coons(U0, js.translate(ARC, (0, 0, 1e-3)), V0, V1, tolerance=1e-3)
    off = off_sides(patch, dict(u0=U0, v0=V0))
    assert max(off.values()) == pytest.approx(5e-4, rel=1e-6)


TRIANGLE: dict[str, Any] = dict(u0=U0, u1=B, v0=V0, v1=spline(C, B, [0.5], 3, (0, 1), 6))


def test_extended_patches_meet_points_and_curves():
    triangle = js.extended_coons(**TRIANGLE)
    assert max(off_sides(triangle, TRIANGLE).values()) < 1e-13
    lens: dict[str, Any] = dict(u0=A, u1=B, v0=V0, v1=spline(A, B, [0.5], 3, (0, 1), 6))
    assert max(off_sides(js.extended_coons(**lens), lens).values()) < 1e-13


def test_sides_left_out_follow_from_the_others():
    u, v = places(V0), places(U0)
    np.testing.assert_allclose(js.extended_coons(u0=U0, v0=V0).grid(u, v), translated(V0(u), U0(v), A), atol=1e-13)
    moved = js.extended_coons(u1=U1, v1=V1)  # the corner that they share is D
    np.testing.assert_allclose(moved.grid(places(V1), places(U1)), translated(V1(places(V1)), U1(places(U1)), D), atol=1e-13)
    ruled = js.extended_coons(v0=V0, v1=V1, blend=js.linear)
    t = SHARES[None, :, None]
    wanted = (1 - t) * np.asarray(V0(u))[:, None] + t * np.asarray(V1(places(V1)))[:, None]
    np.testing.assert_allclose(ruled.grid(u, SHARES), wanted, atol=1e-13)
    three = js.extended_coons(u0=U0, v0=V0, v1=V1)
    assert off_sides(three, dict(u0=U0, v0=V0, v1=V1, u1=js.Line(B, D)))["u1"] < 1e-13


def test_a_side_left_out_moves_with_the_others():
    """Only what was given is control data."""
    three = js.extended_coons(u0=U0, v0=V0, v1=V1)
    assert len(jax.tree.leaves(three)) == 6
    moved = eqx.tree_at(lambda s: s.v0.control_points, three, V0.control_points + 0.2)
    np.testing.assert_allclose(moved(5.0, 2.0), B + 0.2, atol=1e-13)


def test_a_triangle_of_splines_converts_exactly():
    found = js.to_bspline(js.extended_coons(**TRIANGLE), 1e-9)
    assert float(found.max_error) < 1e-13


def loss(patch):
    (a, b), (c, d) = patch.domain
    u, v = a + jnp.asarray([0, 0.3, 1.0]) * (b - a), c + jnp.asarray([0, 0.6, 1.0]) * (d - c)
    return jnp.sum(jnp.sin(patch.grid(u, v)))


@eqx.filter_jit
def slopes(value, data, along, h=1e-6):
    """Along a direction: in reverse mode, in forward mode, by differences; one program."""
    gradient = jax.grad(value)(data)
    pulled = sum(jnp.sum(g * a) for g, a in zip(jax.tree.leaves(gradient), jax.tree.leaves(along), strict=True))
    moved = jax.vmap(lambda step: value(jax.tree.map(lambda x, a: x + step * a, data, along)))(jnp.asarray([h, -h]))
    return pulled, jax.jvp(value, (data,), (along,))[1], (moved[0] - moved[1]) / (2 * h)


MAKERS = {
    "four curves": lambda s: js.coons(s["u0"], s["u1"], s["v0"], s["v1"], blend=js.smoothstep),
    "triangle": lambda s: js.extended_coons(u0=s["u0"], u1=s["corner"], v0=s["v0"]),
}


@pytest.mark.parametrize("kind", MAKERS)
def test_derivatives_by_all_sides_agree_and_are_finite(kind):
    """Forward, reverse and differences, with all knots too, degenerate sides included; built inside `jit`."""
    make, sides = MAKERS[kind], dict(u0=U0, u1=ARC, v0=V0, v1=V1, corner=jnp.asarray(B))
    data, static = eqx.partition(sides, eqx.is_inexact_array)
    value = lambda data: loss(make(eqx.combine(data, static)))
    rng = np.random.default_rng(3)
    along = jax.tree.map(lambda x: jnp.asarray(rng.normal(size=x.shape)), data)
    pulled, pushed, difference = slopes(value, data, along)
    np.testing.assert_allclose(pushed, pulled, rtol=1e-10)
    np.testing.assert_allclose(pulled, difference, rtol=1e-6)


def test_saving_single_precision_and_vmap(tmp_path):
    patch = js.extended_coons(**TRIANGLE)
    js.save(tmp_path / "patch.jxs", patch)
    assert eqx.tree_equal(js.load(tmp_path / "patch.jxs"), patch)
    single = jax.tree.map(lambda x: x.astype(jnp.float32) if eqx.is_inexact_array(x) else x, patch)
    points = single.grid([2.0, 3.0, 5.0], [2.0, 4.0])
    assert points.dtype == jnp.float32
    exact = patch.grid([2.0, 3.0, 5.0], [2.0, 4.0])
    np.testing.assert_allclose(points, exact, atol=1e-5)
    assert js.extended_coons(u0=single.u0, u1=list(B), v0=single.v0).dtype == jnp.float32
    pair = jax.tree.map(lambda x: jnp.stack([x, 2 * x]), patch)
    both = eqx.filter_jit(eqx.filter_vmap(lambda s: s.point(s.domain[0][0], s.domain[1][0])))(pair)
    np.testing.assert_allclose(both, np.stack([A, 2 * A]), atol=1e-13)
