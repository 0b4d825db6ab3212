"""Curvature variation: a number of the surface, not of its parameters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsurf.fit._fairness import curvature_variation

R, r = 3.0, 1.0


def ellipsoid(u, v):
    return jnp.stack([7 + 3 * jnp.cos(u) * jnp.cos(v), 2 * jnp.sin(u) * jnp.cos(v), jnp.sin(v) - 4])


def wave(u, v):
    return jnp.stack([u, v, jnp.sin(1.3 * u) * jnp.cos(v) + 0.2 * u * v])


def torus(u, v):
    ring = R + r * jnp.cos(v)
    return jnp.stack([ring * jnp.cos(u), ring * jnp.sin(u), r * jnp.sin(v)])


def sphere(u, v):
    return 2 * jnp.stack([jnp.cos(v) * jnp.cos(u), jnp.cos(v) * jnp.sin(u), jnp.sin(v)])


def cylinder(u, v):
    return jnp.stack([2 * jnp.cos(u), 2 * jnp.sin(u), v])


def plane(u, v):
    return jnp.stack([u, 2 * v, u - v + 1])


def other_parameters(surface):
    return lambda s, t: surface(s + 0.3 * jnp.sin(t) + 0.2 * s**2, 0.8 * t - 0.2 * s + 0.1 * s * t)


def derivatives(surface, u, v):
    """All partial derivatives up to the third order, by nested forward mode."""
    found = {}
    along_u = surface
    for i in range(4):
        both = along_u
        for j in range(4 - i):
            found[i, j] = both(u, v)
            both = jax.jacfwd(both, argnums=1)
        along_u = jax.jacfwd(along_u, argnums=0)
    return found


def square(surface):
    """|∇II|² as a compiled function of the parameters."""
    return jax.jit(lambda u, v: jnp.sum(curvature_variation(derivatives(surface, u, v)) ** 2))


def principal_curvatures(surface, u, v):
    du, dv = jax.jacfwd(surface, 0), jax.jacfwd(surface, 1)
    a, b = du(u, v), dv(u, v)
    normal = jnp.cross(a, b) / jnp.linalg.norm(jnp.cross(a, b))
    first = jnp.asarray([[a @ a, a @ b], [a @ b, b @ b]])
    mixed = jax.jacfwd(du, 1)(u, v) @ normal
    second = jnp.asarray([[jax.jacfwd(du, 0)(u, v) @ normal, mixed], [mixed, jax.jacfwd(dv, 1)(u, v) @ normal]])
    return first, jnp.linalg.solve(first, second)


def by_principal_curvatures(surface, u, v):
    """Σ (e_i κ_j)², those across counted three times: (∇II)_iij by Codazzi's equations. Not at umbilics."""

    def curvatures(u, v):
        _, operator = principal_curvatures(surface, u, v)
        mean, gauss = 0.5 * jnp.trace(operator), jnp.linalg.det(operator)
        root = jnp.sqrt(mean**2 - gauss)
        return jnp.stack([mean + root, mean - root])

    first, operator = principal_curvatures(surface, u, v)
    by_u, by_v = jax.jacfwd(curvatures, 0)(u, v), jax.jacfwd(curvatures, 1)(u, v)
    total = 0.0
    for i, kappa in enumerate(curvatures(u, v)):
        rest = operator - kappa * jnp.eye(2)
        along = jnp.stack([-rest[0, 1], rest[0, 0]])
        other = jnp.stack([-rest[1, 1], rest[1, 0]])
        along = jnp.where(along @ along > other @ other, along, other)
        along = along / jnp.sqrt(along @ first @ along)
        change = jnp.stack([by_u, by_v], -1) @ along
        total = total + change[i] ** 2 + 3 * change[1 - i] ** 2
    return total


@pytest.mark.parametrize("surface", [ellipsoid, wave, torus])
def test_it_is_the_change_of_the_principal_curvatures(surface):
    expected = jax.jit(lambda u, v: by_principal_curvatures(surface, u, v))
    for u, v in ((0.3, 0.7), (1.1, -0.4), (0.9, 0.2)):
        np.testing.assert_allclose(square(surface)(u, v), expected(u, v), rtol=1e-9)


@pytest.mark.parametrize("surface", [ellipsoid, wave, torus])
def test_it_does_not_depend_on_the_parameters(surface):
    s, t = 0.4, 0.6
    u, v = s + 0.3 * np.sin(t) + 0.2 * s**2, 0.8 * t - 0.2 * s + 0.1 * s * t
    again = square(other_parameters(surface))(s, t)
    np.testing.assert_allclose(again, square(surface)(u, v), rtol=1e-9)


def test_it_does_not_depend_on_the_place_and_falls_with_the_fourth_power_of_the_size():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    moved = lambda u, v: 5 * (turn @ wave(u, v)) + jnp.asarray([1.0, -2.0, 9.0])
    np.testing.assert_allclose(5**4 * square(moved)(0.4, 0.6), square(wave)(0.4, 0.6), rtol=1e-10)


def test_on_a_torus_it_is_the_change_of_the_smaller_curvature_around_the_tube():
    v = np.linspace(-3, 3, 13)
    change = -R * np.sin(v) / (r * (R + r * np.cos(v)) ** 2)  # of cos v / (R + r cos v), by arc length r v
    found = jax.vmap(lambda x: square(torus)(0.4, x))(jnp.asarray(v))
    np.testing.assert_allclose(found, 3 * change**2, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("surface", [sphere, cylinder, plane])
def test_it_vanishes_where_the_curvatures_are_constant(surface):
    for u, v in ((0.3, 0.7), (1.1, -0.4)):
        assert square(other_parameters(surface))(u, v) < 1e-24


def test_it_has_derivatives_at_umbilics():
    """Where principal directions are undefined the formula is none the worse: a sphere is a minimum."""
    dented = lambda x: lambda u, v: sphere(u, v) * (1 + x * jnp.sin(2 * u) * v)
    value = jax.jit(lambda x: jnp.sum(curvature_variation(derivatives(dented(x), 0.3, 0.7)) ** 2))
    assert abs(jax.grad(value)(0.0)) < 1e-12
    np.testing.assert_allclose(value(1e-3) / value(5e-4), 4, rtol=0.02)
