"""Smooth networks about nodes of any valence, with curves that end amid sides, and of order 2."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from build.network_cases import along_side, character, guide, sheet, star

import jaxsurf as js
from jaxsurf.build._network import patches_of_stacks, stacked_patches
from jaxsurf.build._network_topology import SIDES
from jaxsurf.differential._partials import second_partials_at

SHARES = np.linspace(0, 1, 9)[1:-1]
PLACES = [along_side((0, side), (0.0, 1.0), SHARES) for side in SIDES]


@eqx.filter_jit
def _partials_on_sides(stacks):
    u, v = jnp.asarray(PLACES).swapaxes(0, 1)
    one = lambda patch: jax.vmap(jax.vmap(lambda s, t: second_partials_at(patch, s, t)))(u, v)
    return [eqx.filter_vmap(lambda patch: one(patch.prepared()))(stack) for stack in stacks]


def gaps(network):
    """Over all inner edges, which are whole sides: the largest angle between tangent planes, and the largest difference of
    normal curvatures across, relative to curvatures above 1."""
    found = {}
    for members, partials in zip(patches_of_stacks(network), _partials_on_sides(stacked_patches(network)), strict=True):
        for row, patch in enumerate(members):
            for k, side in enumerate(SIDES):
                found[patch, side] = [np.asarray(getattr(partials, name)[row, k]) for name in ("u", "v", "uu", "uv", "vv")]
    angle, bend = 0.0, 0.0
    for edge in network.inner_edges():
        one, other = found[edge.first], found[edge.second]
        if edge.reversed:
            other = [x[::-1] for x in other]
        m, n = (_unit(np.cross(x[0], x[1])) for x in (one, other))
        angle = max(angle, np.linalg.norm(np.cross(m, n), axis=1).max())
        across = _unit(np.cross(m, one[1] if edge.first[1][0] == "u" else one[0]))
        bends = [_bend(x, m, across) for x in (one, other)]
        bend = max(bend, (np.abs(bends[0] - bends[1]) / np.maximum(1, np.abs(bends[0]))).max())
    return angle, bend


def _unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def _bend(partials, normal, direction):
    """The normal curvature in a direction, which is α S_u + β S_v."""
    s_u, s_v, s_uu, s_uv, s_vv = partials
    shares = [
        np.linalg.lstsq(np.stack([a, b], axis=1), d, rcond=None)[0] for a, b, d in zip(s_u, s_v, direction, strict=True)
    ]
    a, b = np.array(shares).T[:, :, None]
    return np.sum((a * a * s_uu + 2 * a * b * s_uv + b * b * s_vv) * normal, axis=1)


@pytest.mark.parametrize("kinds", ["ggc", "ggcgc", "gcgcgc"])
def test_planes_are_common_about_nodes_of_any_valence(kinds):
    network = star(kinds, len(kinds))
    valence = max(node.valence for node in network.nodes if node.inner)
    assert valence == len(kinds) == len(network.inner_edges())
    smooth = network.smooth()
    assert gaps(network)[0] > 0.05
    assert gaps(smooth)[0] < 1e-12
    report: Any = js.tangency_report(smooth)
    assert [patch.patch for patch in report.patches] == list(range(len(kinds)))
    assert all(patch.before > 1e-3 and patch.after < 1e-12 and 0 < patch.relative < 0.1 for patch in report.patches)
    # the vertex enclosure condition is one of nodes of even valence
    assert len(report.unsolved) == (len(kinds) == 6) and str(report).count("Gregory's form") == len(report.unsolved)
    at = np.linspace(0, 1, 5)
    moved = np.linalg.norm(np.asarray(smooth.grid(at, at)) - np.asarray(network.grid(at, at)), axis=-1)
    assert moved[:, [0, -1]].max() < 1e-12 and 1e-3 < moved.max() < 0.1


def test_planes_are_common_beside_a_curve_that_ends_amid_a_side():
    network = js.network(
        [guide(0), guide(0.5, 0, 0.5), guide(1)], [character(0), character(0.5), character(1)], tolerance=1e-3
    )
    normal = eqx.filter_jit(lambda patch, u, v: js.partials(patch.prepared(), u, v).normal)

    def largest(made):
        patches, found = made.patches, 0.0
        for edge in made.inner_edges():
            sides = ((edge.first, edge.first_part), (edge.second, edge.second_part))
            m, n = (np.asarray(normal(patches[s[0]], *along_side(s, part, SHARES))) for s, part in sides)
            found = max(found, np.linalg.norm(np.cross(m, n), axis=1).max())
        return found

    assert largest(network) > 0.05
    assert largest(network.smooth()) < 1e-12
    with pytest.raises(js.InputError, match=r"`order=2` needs curves that end at the corners .* amid side \w\d of patch \d"):
        network.smooth(order=2)


def test_curvatures_of_a_sheet_are_common_too():
    network = sheet(3, 3)
    smooth = network.smooth(order=2)
    before, after = gaps(network), gaps(smooth)
    assert before[0] > 1e-2 and before[1] > 0.1
    assert after[0] < 1e-12 and after[1] < 1e-10
    report: Any = js.tangency_report(smooth)
    assert all(patch.bend_before > 0.05 and patch.bend_after < 1e-10 for patch in report.patches)
    assert len(report.patches) == 4 and not report.unsolved
    at = np.linspace(0, 1, 5)
    moved = np.linalg.norm(np.asarray(smooth.grid(at, at)) - np.asarray(network.grid(at, at)), axis=-1)
    assert moved[:, [0, -1]].max() < 1e-12 and moved[:, :, [0, -1]].max() < 1e-12
    assert 1e-4 < moved.max() < 0.05


def test_what_cannot_be_smooth_is_refused():
    with pytest.raises(js.InputError, match=r"`surface` must be a smooth network, got one as it was made"):
        js.tangency_report(sheet(3, 3))
    with pytest.raises(js.InputError, match="`order` must be 1 for common tangent planes or 2 .*, got 3"):
        sheet(3, 3).smooth(order=3)
    with pytest.raises(js.InputError, match=r"`order=2` needs curves whose normal curvatures at a node .* take `order=1`"):
        star("ggcgc", 0).smooth(order=2)
    bent = js.network([guide(0), guide(0.5), guide(1)], [character(0), _kinked()], tolerance=1e-3)
    with pytest.raises(
        js.InputError, match=r"needs a plane at each node .* corner .* of patch \d `\w+\[\d\]` is off it by [\d.]+°"
    ):
        bent.smooth()


def _kinked():
    """Two characters in one, with a corner upwards on the middle guide."""
    halves = [character(1, 0, 0.5), character(1, 0.5, 1)]
    sag = lambda x: (x % 0.5) * (0.5 - x % 0.5)  # none at 0, 0.5 and 1
    nets = [np.array(half.control_points) for half in halves]
    nets = [net + sag(net[:, :1]) * [0, 0, 1.0] for net in nets]
    return js.CompositeCurve([js.BSplineCurve(net, half.knots, half.degree) for net, half in zip(nets, halves, strict=True)])


def test_gradients_of_a_smooth_network_are_those_of_differences():
    network = sheet(3, 2)

    @jax.jit
    def value(shift):
        curve: Any = network.guides[1]
        moved = js.BSplineCurve(curve.control_points.at[5].add(shift), curve.knots, curve.degree)
        changed = eqx.tree_at(lambda n: n.guides[1], network, moved)
        grid = changed.smooth().grid(jnp.asarray([0.3, 0.9]), jnp.asarray([0.4]))
        return jnp.sum(grid @ jnp.asarray([0.2, -0.5, 1.0]))

    gradient = jax.jit(jax.grad(value))(jnp.zeros(3))
    step = 1e-5
    differences = [(value(step * e) - value(-step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(gradient, differences, rtol=0, atol=1e-7)
    assert np.abs(gradient).max() > 0.1
