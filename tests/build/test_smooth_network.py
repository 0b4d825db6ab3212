"""Networks with common tangent planes along inner edges."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from build.network_cases import along_side

import jaxsurf as js
from jaxsurf.build._network import stacked_patches
from jaxsurf.build._network_topology import SIDES
from jaxsurf.build._seams import seams_of

SHARES = np.linspace(0, 1, 9)


def sheet(seed):
    """Isolines of z = 0.4 sin(ax + b) cos(cy + d) + 0.1 xy, four by four, about unit patches."""
    a, b, c, d = np.random.default_rng(seed).uniform(0.3, 1.2, 4)
    t = np.linspace(0, 3, 13)

    def line(x, y):
        return js.interpolate(np.stack([x, y, 0.4 * np.sin(a * x + b) * np.cos(c * y + d) + 0.1 * x * y], axis=1))

    fixed = [np.full(13, float(i)) for i in range(4)]
    return js.network([line(x, t) for x in fixed], [line(t, y) for y in fixed], tolerance=1e-3)


@eqx.filter_jit
def normals_on_sides(network):
    """Unit normals of all patches (p, 4, n, 3) on u0, u1, v0, v1; all patches are of one form."""
    (stack,) = stacked_patches(network)
    u, v = jnp.asarray([along_side((0, side), (0.0, 1.0), SHARES) for side in SIDES]).swapaxes(0, 1)

    def one(patch):
        return js.partials(patch.prepared(), u, v).normal

    return eqx.filter_vmap(one)(stack)


def largest_angle(network):
    """Over all inner edges, radians; their sides run alike."""
    normals = np.asarray(normals_on_sides(network))
    edges = network.inner_edges()
    assert len(edges) == 12 and not any(edge.reversed for edge in edges)
    pairs = [[normals[patch, SIDES.index(side)] for patch, side in (edge.first, edge.second)] for edge in edges]
    return max(float(np.linalg.norm(np.cross(*pair), axis=-1).max()) for pair in pairs)


@pytest.mark.parametrize("seed", range(4))
def test_inner_edges_of_a_sheet_become_smooth_and_hardly_move(seed):
    network = sheet(seed)
    before, after = network, network.smooth()
    assert after.order == 1 and after.forms == before.forms
    moved = np.asarray(after.grid(SHARES, SHARES)) - np.asarray(before.grid(SHARES, SHARES))
    assert np.abs(moved[:, [0, -1]]).max() < 1e-13 and np.abs(moved[:, :, [0, -1]]).max() < 1e-13
    assert 1e-5 < np.linalg.norm(moved, axis=-1).max() < 0.01  # of patches of unit size
    if seed == 0:
        assert largest_angle(before) > 1e-3
    assert largest_angle(after) < 1e-12


def test_node_equations_are_those_of_the_theory():
    """Four patches about a node have one free number and one condition; an edge that comes to the rim has one free."""
    seams = seams_of(sheet(0).topology)
    matrix, inverse, free = seams.equations()
    assert len(seams.joints) == 16 and len(seams.edges) == 12  # the corners at the four inner nodes
    np.testing.assert_allclose(matrix @ free, 0, atol=1e-12)
    assert free.shape[1] == 4 + 8  # a twist at each inner node, a slope at each end on the rim
    alternating = np.tile([1.0, -1.0], 2)
    for node in range(len(seams.corners)):
        ends = np.flatnonzero(seams.nodes == node)
        if len(ends) == 4:
            rows = [row for row, joint in enumerate(seams.joints) if joint.ends[0] in ends]
            own = matrix[rows][:, ends]
            assert np.linalg.matrix_rank(own) == 3
            assert sorted(np.abs(np.linalg.svd(own)[2][-1])) == pytest.approx(sorted(np.abs(alternating) / 2))
    wanted = matrix @ np.random.default_rng(0).normal(size=matrix.shape[1])
    np.testing.assert_allclose(matrix @ (inverse @ wanted), wanted, atol=1e-12)
