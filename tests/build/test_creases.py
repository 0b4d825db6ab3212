"""Creases: where the normal of a surface jumps, and the parts between."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js


def _figure_5(rotation="guide"):
    """A line and an arc, C¹, bent out of the plane of the tilted section that is swept along."""
    guide = js.CompositeCurve([js.Line([0.0, 0, 0], [2.0, 0, 0]), js.Arc([2.0, 1, 0], [2.0, 0, 0], [0, 0, 1], 1.2)])
    character = js.Arc([0.0, 0, -1], [0.0, 0, 0], [1.0, 0.0, 0], 0.8)
    return js.sweep(character, guide, rotation=rotation)


def _two_guides():
    """Figure 5 with two guides, of which both are lines and arcs, the breaks at different parameters."""
    first = js.CompositeCurve([js.Line([0.0, 0, 0], [2.0, 0, 0]), js.Arc([2.0, 0, 1], [2.0, 0, 0], [0, -1, 0], 1.0)])
    second = js.CompositeCurve([js.Line([0.0, 1, 0], [1.0, 1, 0]), js.Line([1.0, 1, 0], [3.0, 1, 0])])
    second = js.reparametrise(second, (0.0, 1.0))
    character = js.interpolate(np.array([[0.0, 0, 0], [0, 0.3, 0.3], [0, 0.7, 0.3], [0, 1, 0]]))
    return js.sweep(character, (first, second))


@pytest.fixture(scope="module")
def creased():
    return _two_guides()


def _angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def test_crease_of_figure_5_is_found_where_line_and_arc_meet(creased):
    found = js.creases(creased)
    assert found.parameters.shape == found.angles.shape == (1,)
    np.testing.assert_allclose(found.parameters, [1.0], atol=1e-12)
    u = np.linspace(0, 1, 400)
    below, above = (np.asarray(js.normal(creased, u, np.full(400, v))) for v in (1 - 1e-9, 1 + 1e-9))
    wanted = _angle(below, above).max()
    assert wanted > math.radians(1)
    np.testing.assert_allclose(found.angles, [wanted], rtol=2e-3)


def test_one_guide_and_fixed_sections():
    """With one guide what is found is what the normals say; fixed sections along a C¹ guide are smooth."""
    surface = _figure_5()
    found = js.creases(surface, angle=1e-3)
    u = np.linspace(0, 1, 200)
    below, above = (np.asarray(js.normal(surface, u, np.full(200, v))) for v in (1 - 1e-9, 1 + 1e-9))
    largest = _angle(below, above).max()
    assert len(found.parameters) == int(largest > 1e-3)
    assert js.creases(_figure_5("fixed")).parameters.shape == (0,)


def test_pieces_are_smooth_and_together_the_surface(creased):
    parts = js.split_at_creases(creased)
    assert len(parts) == 2
    (_, (a, b)), (_, (c, d)) = parts[0].domain, parts[1].domain
    assert float(b) == float(c) == pytest.approx(1.0)
    u = np.linspace(0, 1, 9)
    for part, (low, high) in zip(parts, ((a, b), (c, d)), strict=True):
        v = np.linspace(float(low), float(high), 7)
        np.testing.assert_allclose(part.grid(u, v), creased.grid(u, v), rtol=0, atol=1e-13)
        assert js.creases(part, angle=1e-6).parameters.shape == (0,)
    # the normals at the cut are each part's own
    inside = np.asarray(js.normal(creased, u, np.full(9, 1 - 1e-8)))
    np.testing.assert_allclose(js.normal(parts[0], u, np.full(9, float(b))), inside, atol=1e-6)
    assert _angle(inside, np.asarray(js.normal(parts[1], u, np.full(9, float(c))))).max() > math.radians(1)


def test_patches_of_a_network_are_split_at_the_creases_of_its_guides():
    first, second = (js.CompositeCurve(pieces) for pieces in _pieces())
    arch = lambda a, b: js.Arc.through(a, (a + b) / 2 + np.array([0, 0, 0.3]), b)
    across = [arch(np.asarray(first(v)), np.asarray(second(v))) for v in (0.0, 0.5, 1.7)]
    network = js.network([first, second], across)
    assert len(network.patches) == 3  # the last one beyond the last character
    parts = js.split_at_creases(network)
    assert len(parts) == 4
    assert [len(js.creases(part).parameters) for part in parts] == [0, 0, 0, 0]
    ends = [np.asarray(part(0.0, part.domain[1][k])) for part in parts for k in (0, 1)]
    np.testing.assert_allclose(ends[1:-1:2], ends[2::2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(ends[3], first(1.0), rtol=0, atol=1e-12)


def _pieces():
    """Lines and arcs, C¹; the second bends out of the plane of the first."""
    first = [js.Line([0.0, 0, 0], [2.0, 0, 0]), js.Arc([2.0, 0, 1], [2.0, 0, 0], [0, -1, 0], 1.0)]
    return first, [js.Line([0.0, 1, 0], [2.0, 1, 0]), js.Line([2.0, 1, 0], [4.0, 1, 0])]


def test_smooth_surfaces_have_no_crease_and_splines_are_split_exactly():
    net = np.stack(np.meshgrid(np.arange(4.0), np.arange(5.0), indexing="ij") + (np.zeros((4, 5)),), axis=-1)
    net[..., 2] = np.array([0, 0, 1, 0, 0])
    knots = np.array([0.0, 0, 0.25, 0.5, 0.75, 1, 1])
    surface = js.BSplineSurface(net, js.clamped_knots(4, 3), knots, 3, 1)
    found = js.creases(surface)
    np.testing.assert_allclose(found.parameters, [0.25, 0.5, 0.75])
    np.testing.assert_allclose(found.angles, [math.pi / 4, math.pi / 2, math.pi / 4], atol=1e-6)
    parts = js.split_at_creases(surface, angle=1.0)
    assert [type(part) for part in parts] == [js.BSplineSurface] * 2
    turned = js.creases(js.transpose(surface), direction="u")
    np.testing.assert_allclose(turned.parameters, found.parameters)
    assert len(js.split_at_creases(js.Sphere([0.0, 0, 0], 1.0))) == 1


def test_angles_are_differentiable_and_traced_surfaces_give_all_breaks(creased):
    def largest(height):
        arc = js.Arc(jnp.stack([2.0, 0.0, height]), [2.0, 0, 0], [0, -1.0, 0], 1.0)
        first = js.CompositeCurve([js.Line([0.0, 0, 0], [2.0, 0, 0]), arc])
        surface = _replaced(creased, first)
        return jnp.max(js.creases(surface).angles)

    slope = jax.grad(largest)(1.0)
    difference = (largest(1.0 + 1e-5) - largest(1.0 - 1e-5)) / 2e-5
    np.testing.assert_allclose(slope, difference, rtol=1e-4)


def _replaced(surface, guide):
    return eqx.tree_at(lambda s: s.guides.curves[0], surface, guide)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: js.creases(js.Line([0.0, 0, 0], [1.0, 0, 0])), "`surface` must be a surface, got Line"),
        (lambda s: js.creases(s, direction="w"), "`direction` must be"),
        (lambda s: js.creases(s, angle=-1), "`angle` must be a number"),
        (lambda s: jax.jit(js.split_at_creases)(s), "outside of `jit`"),
    ],
)
def test_bad_input_is_one_sentence(creased, call, message):
    with pytest.raises((js.InputError, TypeError), match=message):
        call(creased)
