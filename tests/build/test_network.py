"""Full networks: shared edges, all curves met, one compilation per form."""

import numpy as np
import pytest
from build.network_cases import character, guide, height, largest_gap_of_edges, largest_gap_on, sheet, side_of

import jaxsurf as js
from jaxsurf.build import NetworkEdge, _network

SHARES = np.linspace(0, 1, 9)
FULL = "2 guides + 2 characters"


@pytest.fixture(scope="module")
def small():
    return sheet(3, 3)


@pytest.mark.parametrize("count", [3, 10])
def test_full_networks_share_edges_and_compile_once(count, monkeypatch, request):
    network = request.getfixturevalue("small") if count == 3 else sheet(10, 10)
    made = []
    original = _network._patch
    monkeypatch.setattr(_network, "_patch", lambda *a: made.append(1) or original(*a))
    grid = np.asarray(network.grid(SHARES, SHARES))
    assert len(made) == len(network.classes()) == 1
    assert grid.shape == ((count - 1) ** 2, 9, 9, 3)
    assert set(network.forms) == {FULL}
    edges = network.inner_edges()
    assert len(edges) == 2 * (count - 1) * (count - 2)
    assert largest_gap_on(grid, network) < 1e-13
    assert len(network.outer_edges()) == 4 * (count - 1)
    assert all(edge.given for edge in network.outer_edges())
    # near the sheet of which the curves are, the nearer the more of them there are
    assert np.abs(grid[..., 2] - height(grid[..., 0], grid[..., 1])).max() < 0.045 / (count - 1) ** 2
    assert sorted(node.valence for node in network.nodes) == [2] * 4 + [3] * 4 * (count - 2) + [4] * (count - 2) ** 2
    assert [node.inner for node in network.nodes if node.valence == 4] == [True] * (count - 2) ** 2
    assert all(len(node.corners) == node.valence for node in network.nodes if node.inner)
    # all guides and characters are met: on patches' edges there are points of each curve
    places = grid.reshape(-1, 3)
    for curve in (*network.guides, *network.characters):
        feet = js.closest_point(curve, places)
        near = np.asarray(feet.parameters)[np.asarray(feet.distance) < 2e-5]
        assert len(near) >= 9 * (count - 1)
        np.testing.assert_allclose([near.min(), near.max()], curve.domain, atol=1e-6)


def test_patches_are_sweeps_and_the_rows_of_the_grid(small):
    grid = np.asarray(small.grid(SHARES, SHARES))
    patches = small.patches
    assert [type(patch) for patch in patches] == [js.Sweep] * 4
    for patch, points in zip(patches, grid, strict=True):
        np.testing.assert_allclose(patch.grid(SHARES, SHARES), points, rtol=0, atol=1e-13)
        assert patch.domain == ((0.0, 1.0), (0.0, 1.0))
    # with guides and characters in their order: u across the guides, v along them
    assert np.all(np.diff(grid[..., 0], axis=1) > 0) and np.all(np.diff(grid[..., 1], axis=2) > 0)
    normals = np.stack([np.asarray(js.normal(patch, 0.5, 0.5)) for patch in patches])
    assert np.all(normals[:, 2] > 0.5)


def test_edges_between_nodes_keep_tangent_and_curvature_of_the_character():
    lifted = js.network([guide(x) for x in (0, 0.5, 1)], [character(y, lift=0.004) for y in (0, 0.5, 1)], tolerance=0.01)
    assert all(0.002 < gap.distance < 0.0040001 for gap in lifted.gaps)
    assert lifted.largest_gap == max(gap.distance for gap in lifted.gaps)
    assert largest_gap_of_edges(lifted) < 1e-13
    patch, other = lifted.patches[0], lifted.patches[2]
    assert isinstance(patch, js.build.Sweep) and isinstance(other, js.build.Sweep)
    edge, after, kept = patch.characters[1], other.characters[1], patch.guides.curves[0]
    assert isinstance(edge, NetworkEdge) and isinstance(after, NetworkEdge) and isinstance(kept, NetworkEdge)
    ends = [float(edge.ends[1]), float(after.ends[0])]
    for order in (1, 2):
        wanted = lifted.characters[1].derivative(ends[0], order)
        for piece, place in ((edge, 1.0), (after, 0.0)):
            width = float(piece.ends[1] - piece.ends[0])
            np.testing.assert_allclose(piece.derivative(place, order) / width**order, wanted, atol=1e-9)
    np.testing.assert_allclose(edge(1.0), lifted.guides[1](lifted.gaps[4].parameters[0]), atol=1e-14)
    np.testing.assert_array_equal(kept.offsets, 0)  # guides keep their place


def test_order_and_direction_of_curves_do_not_matter(small):
    guides, characters = small.guides, small.characters
    mixed = js.network(
        [js.reverse(guides[2]), guides[0], js.reverse(guides[1])],
        [characters[1], js.reverse(characters[0]), characters[2]],
        tolerance=1e-3,
    )
    assert len(mixed.inner_edges()) == 4 and set(mixed.forms) == {FULL}
    assert largest_gap_of_edges(mixed) < 1e-13
    normals = np.stack([np.asarray(js.normal(patch, 0.5, 0.5)) for patch in mixed.patches])
    assert np.all(normals[:, 2] * normals[0, 2] > 0)  # one side up
    for patch in mixed.patches:  # the same four sheets
        middle = np.asarray(patch(0.5, 0.5))
        assert min(np.linalg.norm(middle - np.asarray(other(0.5, 0.5))) for other in small.patches) < 0.01


def test_patches_convert_to_splines_that_still_meet(small):
    """Within the tolerance, and no further from each other than both are off."""
    tolerance = 1e-4
    grid = np.asarray(small.grid(SHARES, SHARES))
    splines = []
    for patch, points in zip(small.patches[:2], grid, strict=False):
        found = js.to_bspline(patch, tolerance)
        splines.append(np.asarray(found.shape.grid(SHARES, SHARES)))
        off = np.linalg.norm(splines[-1] - points, axis=-1).max()
        assert 0 < off <= 1.05 * float(found.max_error) and float(found.max_error) <= tolerance
    (edge,) = [edge for edge in small.inner_edges() if {edge.first[0], edge.second[0]} == {0, 1}]
    one, other = (side_of(splines[patch], side) for patch, side in (edge.first, edge.second))
    assert np.abs(one - (other[::-1] if edge.reversed else other)).max() <= 2 * tolerance
