"""Breaks: concrete on concrete data, knots with repetitions on traced data."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differential_cases import assert_close, bicubic, cubic

from jaxsurf.curve import BSplineCurve, Circle, breaks
from jaxsurf.surface import Sphere


def test_knots_inside_the_domain_without_repetitions():
    assert_close(breaks(cubic()), [2, 2.7, 4.1, 5], 0)
    assert isinstance(breaks(cubic()), np.ndarray)
    unclamped = BSplineCurve(np.zeros((4, 3)), np.arange(8.0), 3)
    assert_close(breaks(unclamped), [3, 4], 0)
    periodic = BSplineCurve(np.zeros((4, 3)), [1.0, 2, 4, 5, 7], 3, periodic=True)
    assert_close(breaks(periodic), [1, 2, 4, 5, 7], 0)
    along_u, along_v = breaks(bicubic())
    assert_close(along_u, along_v, 0)


def test_other_shapes_are_split_in_eight():
    assert_close(breaks(Circle([0.0, 0, 0], [0.0, 0, 1], 2.0)), np.linspace(0, 2 * np.pi, 9))
    along_u, along_v = breaks(Sphere([0.0, 0, 0], 2.0))
    assert len(along_u) == len(along_v) == 9


def test_traced_breaks_are_all_knots_of_the_domain():
    found = jax.jit(breaks)(cubic())
    assert_close(found, jnp.array([2, 2.7, 2.7, 4.1, 5]), 0)


def test_something_else_is_refused():
    with pytest.raises(TypeError, match="`breaks` knows no rule for int"):
        breaks(3)
