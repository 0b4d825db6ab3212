"""Networks as functions of their curves: gradients, crossings that follow, types, files."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from build.network_cases import character, guide, sheet

import jaxsurf as js

SHARES = np.linspace(0, 1, 9)
FULL = "2 guides + 2 characters"


@pytest.fixture(scope="module")
def pair():
    return sheet(2, 2)


def _functional(network):
    shares = jnp.linspace(0, 1, 5)
    grid = network.grid(shares, shares)
    return jnp.mean(jnp.sin(3 * grid)) + jnp.mean(grid**2)


def test_gradients_by_guides_and_characters(pair):
    """Curves that cross amid each other, so that the crossings move along both with the control points."""
    network = js.network(
        [guide(0.2), guide(0.8)], [character(0.2, lift=0.002), character(0.8)], tolerance=1e-2, open_cells=False
    )
    assert network.forms == (FULL,)
    rng = np.random.default_rng(4)
    of = lambda n: [curve.control_points for curve in (*n.guides, *n.characters)]
    points = [np.asarray(p) for p in of(network)]
    alongs = [rng.normal(size=p.shape) for p in points]

    def value(points):
        return _functional(eqx.tree_at(of, network, list(points)))

    pulled = jax.jit(jax.grad(value))(points)
    pushed = jax.jit(lambda p, a: jax.jvp(value, (p,), (a,)))
    at = lambda p: pushed(p, alongs)[0]
    for k in range(4):
        along = [a if i == k else np.zeros_like(a) for i, a in enumerate(alongs)]
        forward = float(pushed(points, along)[1])
        reverse = sum(float(np.sum(np.asarray(g) * a)) for g, a in zip(pulled, along, strict=True))
        moved = lambda h, along=along: float(at([p + h * a for p, a in zip(points, along, strict=True)]))
        difference = (8 * (moved(1e-4) - moved(-1e-4)) - (moved(2e-4) - moved(-2e-4))) / 1.2e-3
        assert abs(forward) > 1e-4
        np.testing.assert_allclose(forward, reverse, rtol=1e-10)
        np.testing.assert_allclose(forward, difference, rtol=1e-6)


def test_crossings_follow_changed_curves(pair):
    """Moved control points: the network made anew has the same patches."""
    lift = lambda curve: js.translate(curve, [0.0, 0.0, 0.3])
    changed = eqx.tree_at(lambda n: n.guides, pair, tuple(lift(g) for g in pair.guides))
    changed = eqx.tree_at(lambda n: n.characters, changed, tuple(lift(c) for c in pair.characters))
    np.testing.assert_allclose(
        changed.grid(SHARES, SHARES), pair.grid(SHARES, SHARES) + np.array([0, 0, 0.3]).reshape(1, 1, 1, 3), atol=1e-12
    )


def test_single_precision_and_files(pair, tmp_path):
    js.save(tmp_path / "network.jxs", pair)
    loaded = js.load(tmp_path / "network.jxs")
    assert bool(eqx.tree_equal(loaded, pair))
    js.save(tmp_path / "patches.jxs", pair.patches)
    np.testing.assert_array_equal(js.load(tmp_path / "patches.jxs")[0](0.3, 0.4), pair.patches[0](0.3, 0.4))
    single = jax.tree.map(lambda x: x.astype(jnp.float32) if eqx.is_inexact_array(x) else x, (pair.guides, pair.characters))
    network = js.network(*single, tolerance=1e-3)
    grid = network.grid(SHARES, SHARES)
    assert grid.dtype == jnp.float32
    np.testing.assert_allclose(grid, pair.grid(SHARES, SHARES), atol=2e-6)
