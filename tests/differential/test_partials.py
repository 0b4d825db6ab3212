"""Partial derivatives in one pass are those of separate calls."""

import jax
import numpy as np
import pytest
from cases import make
from differential_cases import assert_close, bicubic, cubic, difference

from jaxsurf._errors import InputError
from jaxsurf.differential import derivative, first_form, partials, second_form, second_partials
from jaxsurf.differential._cell_polynomials import cell_count
from jaxsurf.surface import Cylinder

U, V = np.linspace(2, 5, 5)[:, None], np.array([2.3, 4.1, 5])[None]


def test_partials_are_the_separate_derivatives():
    surface = bicubic()
    found = second_partials(surface, U, V)
    orders = {"u": (1, 0), "v": (0, 1), "uu": (2, 0), "uv": (1, 1), "vv": (0, 2)}
    assert_close(found.point, surface(U, V))
    for name, order in orders.items():
        assert_close(getattr(found, name), derivative(surface, U, V, order), 1e-11)
    first = partials(surface, U, V)
    assert_close(first.point, found.point)
    assert_close(first.u, found.u)
    assert_close(first.v, found.v)
    assert_close(partials(surface, 3.3, 2.9).u, difference(lambda t: surface(t, 2.9), 3.3), 1e-8)


def test_many_points_are_worked_on_in_chunks():
    surface, u = bicubic(), np.linspace(2, 5, 6001)
    assert_close(partials(surface, u, 3.0).v[::1000], partials(surface, u[::1000], 3.0).v)


@pytest.mark.parametrize("name", ["BSplineSurface", "BSplineSurface, periodic in v", "BSplineSurface, periodic in both"])
def test_partials_of_many_points_are_those_of_few(name):
    """With more points than knot cells the polynomials of the cells are used: breaks, ends and beyond them included."""
    surface = make(name).shape
    (a, b), (c, d) = ((float(start), float(end)) for start, end in surface.domain)
    u = np.concatenate([np.linspace(a, b, 31), [a - 0.1, b + 0.1, 3.1]])
    v = np.concatenate([np.linspace(c, d, 29), [c - 0.1, d + 0.1, 3.0]])
    assert u.size * v.size > cell_count(surface) > 1
    many, gradient = partials(surface, u[:, None], v[None]), jax.grad(lambda s: partials(s, u[:, None], v[None]).u.sum())
    for order, found in (((0, 0), many.point), ((1, 0), many.u), ((0, 1), many.v)):
        assert_close(found, surface.derivative(u[:, None], v[None], order), 1e-11)
    assert_close(many.normal, np.cross(many.u, many.v) / np.linalg.norm(np.cross(many.u, many.v), axis=-1)[..., None])
    slope = jax.grad(lambda s: s.derivative(u[:, None], v[None], (1, 0)).sum())(surface)
    for one, other in zip(jax.tree.leaves(gradient(surface)), jax.tree.leaves(slope), strict=True):
        assert_close(one, other, 1e-8 * (1 + np.max(np.abs(other))))


def test_derivative_of_curves_and_surfaces():
    curve, surface = cubic(), bicubic()
    assert_close(derivative(curve, 3.0), curve.derivative(3.0))
    assert_close(derivative(curve, 3.0, 2), curve.derivative(3.0, 2))
    assert_close(derivative(surface, 3.0, 2.5), surface.derivative(3.0, 2.5, (1, 0)))
    assert_close(derivative(surface, 3.0, 2.5, order=(0, 2)), surface.derivative(3.0, 2.5, (0, 2)))
    with pytest.raises(InputError, match=r"`derivative\(surface, u, v, order\)`, got 1 arguments"):
        derivative(surface, 3.0)
    with pytest.raises(InputError, match=r"`derivative\(curve, u, order\)`, got 2 arguments after it and `order`"):
        derivative(curve, 3.0, 1, order=1)


def test_forms_of_a_cylinder():
    tube = Cylinder([1.0, 2, 3], [0.0, 1, 1], 2.0, 5.0)
    first, second = first_form(tube, 0.7, 1.0), second_form(tube, 0.7, 1.0)
    assert_close([first.uu, first.uv, first.vv, first.determinant], [4, 0, 1, 4])
    assert_close([second.uu, second.uv, second.vv], [-2, 0, 0])  # outward normal: it bends away from it


def test_types_and_transforms():
    assert partials(bicubic(np.float32), 3.0, 2.5).u.dtype == np.float32
    surface = bicubic()
    mapped = jax.jit(jax.vmap(lambda u: partials(surface, u, 2.5).v))(U[:, 0])
    assert_close(mapped, partials(surface, U[:, 0], 2.5).v)
