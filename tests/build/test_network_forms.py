"""Networks with missing edges, triangles, rings."""

import numpy as np
import pytest
from build.network_cases import character, guide, height, largest_gap_of_edges, straight

import jaxsurf as js

FULL, TWO_ONE = "2 guides + 2 characters", "2 guides + 1 character"
ONE_TWO, ONE_ONE = "1 guide + 2 characters", "1 guide + 1 character"

FIGURE_1 = {
    "a character between two of three guides": (
        lambda: ([guide(0), guide(0.5), guide(1)], [character(0), character(0.5, 0, 0.5), character(1)]),
        [FULL] * 3,
    ),
    "a guide that does not reach everywhere": (
        lambda: ([guide(0), guide(0.5, 0, 0.5), guide(1)], [character(0), character(0.5), character(1)]),
        [FULL] * 3,
    ),
    "the last character missing": (
        lambda: ([guide(0), guide(0.5), guide(1)], [character(0), character(0.5)]),
        [FULL, TWO_ONE, FULL, TWO_ONE],
    ),
    "the last guide missing": (
        lambda: ([guide(0), guide(0.5)], [character(0), character(0.5), character(1)]),
        [FULL, FULL, ONE_TWO, ONE_TWO],
    ),
    "both missing": (
        lambda: ([guide(0), guide(0.5)], [character(0), character(0.5)]),
        [FULL, TWO_ONE, ONE_TWO, ONE_ONE],
    ),
    "a corner missing": (
        lambda: ([guide(0), guide(0.5), guide(1, 0, 0.5)], [character(0), character(0.5), character(1, 0, 0.5)]),
        [FULL, FULL, FULL, ONE_ONE],
    ),
}


@pytest.mark.parametrize("name", FIGURE_1)
def test_networks_with_missing_edges(name):
    """Figure 1 of paper 000: broken lines are not given."""
    curves, forms = FIGURE_1[name]
    network = js.network(*curves(), tolerance=1e-3)
    assert sorted(network.forms) == sorted(forms)
    parts = [part for edge in network.inner_edges() for part in (edge.first_part, edge.second_part)]
    cut = [part for part in parts if set(part) != {0.0, 1.0}]
    assert len(cut) == (2 if "between" in name or "reach" in name else 0)  # a curve that ends amid a longer side
    assert any(node.sides for node in network.nodes) == bool(cut)
    for part in cut:
        assert min(part) == 0 or max(part) == 1
        assert np.diff(sorted(part))[0] == pytest.approx(0.5, abs=0.05)
    free = [edge for edge in network.outer_edges() if not edge.given]
    missing = {FULL: 0, TWO_ONE: 1, ONE_TWO: 1, ONE_ONE: 2}
    assert len(free) == sum(missing[form] for form in network.forms)
    if name in ("both missing", "a guide that does not reach everywhere"):
        assert largest_gap_of_edges(network, 4) < 1e-13
        middles = np.asarray(network.grid([0.5], [0.5]))[:, 0, 0]
        assert np.abs(middles[:, 2] - height(middles[:, 0], middles[:, 1])).max() < 0.12


def test_open_cells_can_be_left_out():
    curves = FIGURE_1["a corner missing"][0]()
    assert js.network(*curves, tolerance=1e-3, open_cells=False).forms == (FULL,) * 3


def test_guides_that_meet_make_triangles():
    left, right = straight([0.0, 0, 0], [1.0, 2, 0.5]), straight([2.0, 0, 0], [1.0, 2, 0.5])
    network = js.network(
        [left, js.reverse(right)], [straight([2.0, 0, 0], [0.0, 0, 0]), straight([0.5, 1, 0.25], [1.5, 1, 0.25])]
    )
    assert sorted(network.forms) == [TWO_ONE, FULL]
    triangle = network.patches[network.forms.index(TWO_ONE)]
    tip = np.asarray(triangle.grid([0.0, 0.5, 1.0], [1.0]))[:, 0]
    np.testing.assert_allclose(tip, np.array([[1.0, 2, 0.5]] * 3), atol=1e-13)
    assert largest_gap_of_edges(network, 4) < 1e-13
    assert sorted(node.valence for node in network.nodes) == [2, 2, 2, 3, 3]


def test_characters_that_meet_are_the_guides_of_their_triangle():
    left, right = straight([0.0, 0, 0], [1.0, 2, 0.5]), straight([2.0, 0, 0], [1.0, 2, 0.5])
    network = js.network(straight([0.0, 0, 0], [2.0, 0, 0]), [left, right])
    assert network.forms == (TWO_ONE,)
    assert [curve for curve, *_ in network.topology.cells[0][0]] == [
        1,
        2,
    ]  # numbers of characters come after those of guides


def test_meridians_and_an_equator_make_a_sphere_with_one_side_out():
    meridian = lambda t: js.Arc.through([0, 0, -1.0], [np.cos(t), np.sin(t), 0.0], [0, 0, 1.0])
    network = js.network([meridian(t) for t in (0.2, 1.8, 3.3, 4.9)], js.Circle([0.0, 0, 0], [0, 0, 1.0], 1.0))
    assert network.forms == (TWO_ONE,) * 8
    assert len(network.inner_edges()) == 12 and not network.outer_edges()
    assert [node.valence for node in network.nodes] == [4] * 6 and all(node.inner for node in network.nodes)
    patches = network.patches
    outward = [np.sum(np.asarray(js.normal(p, 0.5, 0.3)) * np.asarray(p(0.5, 0.3))) for p in patches]
    assert len(set(np.sign(outward))) == 1 and np.abs(outward).min() > 0.9


def test_rings_and_rods_make_a_tube():
    ring = lambda z: js.interpolate(
        np.stack([f(np.linspace(0.4, 0.4 + 2 * np.pi, 17)[:-1]) for f in (np.cos, np.sin, lambda t: 0 * t + z)], axis=1),
        closed=True,
    )
    rod = lambda t: straight([np.cos(t), np.sin(t), 0.0], [np.cos(t), np.sin(t), 2.0])
    rings = [ring(0.0), ring(2.0)]
    # one rod is where the rings start: the seam is no obstacle
    three = js.network([rod(t) for t in (0.4, 2.4, 4.5)], rings, tolerance=1e-2)
    assert three.forms == (FULL,) * 3 and len(three.inner_edges()) == 3
    one = js.network(rod(2.0), rings, tolerance=1e-2)
    assert one.forms == (ONE_TWO,)
    (edge,) = one.inner_edges()
    assert (edge.first, edge.second) == ((0, "u0"), (0, "u1"))
    assert largest_gap_of_edges(one, 4) < 1e-13
    assert len(one.outer_edges()) == 2


def test_a_corner_of_a_guide_at_a_node_is_left_alone():
    bent = lambda y: js.CompositeCurve([js.Line([0.0, y, 0], [1.0, y, 0]), js.Line([1.0, y, 0], [2.0, y, 1.0])])
    across = [js.Line([x, 0.0, z], [x, 1.0, z]) for x, z in ((0.0, 0.0), (1.0, 0.0), (2.0, 1.0))]
    network = js.network([bent(0.0), bent(1.0)], across)
    flat, steep = network.patches
    np.testing.assert_allclose(flat.grid([0.2, 0.7], [0.9, 1.0])[..., 2], 0, atol=1e-13)
    np.testing.assert_allclose(np.abs(js.normal(flat, 0.5, 1.0)), [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(np.abs(js.normal(steep, 0.5, 0.0)), np.array([1, 0, 1]) / np.sqrt(2), atol=1e-9)
