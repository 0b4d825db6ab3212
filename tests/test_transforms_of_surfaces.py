"""The transform grid for surfaces."""

import equinox as eqx
import jax
import numpy as np
import pytest
from cases import SURFACES, make, parameters
from shape_laws import *  # noqa: F403


@pytest.fixture(params=SURFACES, scope="module")
def case(request):
    yield make(request.param)
    jax.clear_caches()
    eqx.clear_caches()


def test_grid_is_the_points(shape):
    u, v = parameters(shape)
    grid, points = np.asarray(shape.grid(u, v[:-1])), np.asarray(shape(u, v))[:-1]
    assert grid.shape == (len(u), len(v) - 1, 3)
    np.testing.assert_allclose(grid[np.arange(len(points)), np.arange(len(points))], points, rtol=1e-13, atol=1e-13)
