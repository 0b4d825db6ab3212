"""Networks with triangles, closed curves and corners."""

import numpy as np
from build.network_cases import largest_gap_of_edges, straight

import jaxsurf as js

FULL, TWO_ONE = "2 guides + 2 characters", "2 guides + 1 character"
ONE_TWO = "1 guide + 2 characters"


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
