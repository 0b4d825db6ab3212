"""Points spread over several devices, and what sums over them."""

import os
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import points_on, sheet
from scipy.interpolate import BSpline

import jaxsurf as js
from jaxsurf._errors import InputError
from jaxsurf.fit import Deviation, shard_points
from jaxsurf.fit._bending import bending_of
from jaxsurf.fit._cloud import left_out, sample_index
from jaxsurf.fit._linear import linear_fit
from jaxsurf.fit._quantile import compiled_quantile

SIZE = 12.0


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Four devices need a process of their own: their number is fixed before the first computation."""
    path = tmp_path_factory.mktemp("shards") / "results.npz"
    here = Path(__file__).parent
    flags = os.environ.get("XLA_FLAGS", "") + " --xla_force_host_platform_device_count=4"
    known = {"XLA_FLAGS": flags, "PYTHONPATH": os.pathsep.join([str(Path(js.__file__).parents[1]), *sys.path])}
    script = [sys.executable, str(here / "sharded_fits.py"), str(path)]
    done = subprocess.run(script, env={**os.environ, **known}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return np.load(path)


def test_a_fit_of_spread_points_is_that_of_points_on_one_device(results):
    """602 points: two shards, below, are full, four hold copies."""
    for name, atol in (("robust", 1e-10 * SIZE), ("feet", 1e-8), ("figures", 1e-10 * SIZE)):
        assert results[f"{name} 4"].shape == results[f"{name} 0"].shape
        np.testing.assert_allclose(results[f"{name} 4"], results[f"{name} 0"], rtol=0, atol=atol)


def test_a_cloud_fit_of_spread_points_is_that_of_points_on_one_device(results):
    assert results["cloud 0"].shape[0] > 6
    np.testing.assert_allclose(results["cloud 4"], results["cloud 0"], rtol=0, atol=1e-10 * SIZE)
    np.testing.assert_allclose(results["left out 4"], results["left out 0"], rtol=1e-9)


def test_an_array_that_lies_spread_already_is_taken_as_it_is(results):
    np.testing.assert_allclose(results["placed"], results["robust 0"], rtol=0, atol=1e-10 * SIZE)


def test_a_mesh_of_two_axes_is_refused(results):
    assert "must be spread over a mesh of one axis" in str(results["refusal"])


def test_points_that_cannot_be_spread():
    with pytest.raises(InputError, match=r"`points` must have shape \(N, 3\), got \(3,\)"):
        shard_points([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="at least one point in each of 1 processes"):
        shard_points(np.zeros((0, 3)))


# --- what sums over the points


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("q", [0.0, 0.3, 0.5, 0.95, 1.0])
def test_quantiles_are_those_of_numpy(q, dtype):
    rng = np.random.default_rng(2)
    values = np.abs(rng.normal(size=1001)).astype(dtype) * np.where(rng.uniform(size=1001) < 0.1, 0, 1).astype(dtype)
    counted = rng.uniform(size=1001) < 0.7
    found = compiled_quantile(jnp.asarray(values), jnp.asarray(counted), jnp.asarray(q, dtype))
    assert found.dtype == dtype
    np.testing.assert_allclose(found, np.quantile(values[counted], q), rtol=20 * np.finfo(dtype).eps, atol=0)


def test_figures_of_rows_that_are_partly_copies():
    signed = np.random.default_rng(3).normal(size=50)
    padded, counted = np.append(signed, [9.0, 9.0]), np.append(np.ones(50), [0.0, 0.0])
    plain, filled = Deviation(jnp.asarray(signed)), Deviation(jnp.asarray(padded), jnp.asarray(counted))
    assert filled.count == plain.count == 50
    for figure in (lambda d: d.rms, lambda d: d.max, lambda d: d.mean, lambda d: d.quantile(0.9)):
        np.testing.assert_allclose(figure(filled), figure(plain), rtol=1e-13)


def test_the_net_of_least_squares_at_known_parameters():
    """Against scipy's design matrices and a dense solve."""
    surface = sheet()
    (a, b), (c, d) = surface.domain
    u, v = np.random.default_rng(4).uniform(size=(2, 900)) * [[b - a], [d - c]] + [[a], [c]]
    points = np.asarray(surface(u, v)) + 0.01 * np.random.default_rng(5).normal(size=(900, 3))
    weights = np.random.default_rng(6).uniform(0, 2, 900)
    bending = np.asarray(bending_of(surface, (10.0, 6.0)))
    along = [
        BSpline.design_matrix(t, np.asarray(knots), 3).toarray() for t, knots in ((u, surface.knots_u), (v, surface.knots_v))
    ]
    design = np.einsum("ni,nj->nij", *along).reshape(900, -1)
    matrix = (design.T * weights) @ design / weights.sum() + 1e-6 * bending
    expected = np.linalg.solve(matrix, (design.T * weights) @ points / weights.sum())
    given = [jnp.asarray(x) for x in (points, np.stack([u, v], -1), weights, bending)]
    found = linear_fit(surface, given[0], given[1], given[2], given[3], 1e-6)
    np.testing.assert_allclose(found, expected.reshape(6, 6, 3), rtol=0, atol=1e-9)


def test_parts_of_the_points_left_out_are_those_of_the_whole():
    whole = left_out(1000, 0.2, 7)
    parts = [left_out(count, 0.2, 7, first) for first, count in ((0, 334), (334, 333), (667, 333))]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize(("count", "step"), [(10, 1), (200_000, 1), (200_001, 2), (1_000_000, 5)])
def test_the_sample_of_a_cloud_depends_on_its_size_alone(count, step):
    index = sample_index(count)
    assert len(index) <= 200_000 and index[1] - index[0] == step and index[-1] < count


def test_one_device_needs_no_spreading():
    points = points_on(sheet(), 50, seed=1)
    cloud = shard_points(points)
    assert cloud.mesh is None and cloud.count == 50
    np.testing.assert_array_equal(cloud.rows(cloud.points), points)
