"""The transform grid for surfaces."""

import equinox as eqx
import jax
import pytest
from cases import SURFACES, make
from shape_laws import *  # noqa: F403


@pytest.fixture(params=SURFACES, scope="module")
def case(request):
    yield make(request.param)
    jax.clear_caches()
    eqx.clear_caches()
