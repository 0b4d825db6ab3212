"""The transform grid for curves."""

import equinox as eqx
import jax
import pytest
from cases import CURVES, make
from shape_laws import *  # noqa: F403


@pytest.fixture(params=CURVES, scope="module")
def case(request):
    yield make(request.param)
    jax.clear_caches()
    eqx.clear_caches()
