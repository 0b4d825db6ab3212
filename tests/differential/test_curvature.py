"""Curvatures of surfaces whose curvatures are known."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differential_cases import assert_close, bicubic, difference

from jaxsurf.differential import curvature, normal
from jaxsurf.surface import BSplineSurface, Cone, Cylinder, Plane, Sphere, Torus

POLE = math.pi / 2
V = np.array([0.3, 1.2, -0.8])
TUBE = 3 + 0.7 * np.cos(V)
KNOWN = {  # smaller and larger principal curvature; outward normals, so that convex is negative
    "plane": (Plane([1.0, 2, 3], [1.0, 2, 2]), np.zeros((3, 2))),
    "sphere": (Sphere([1.0, 2, 3], 2.5), np.full((3, 2), -0.4)),
    "cylinder": (Cylinder([1.0, 2, 3], [0.0, 1, 1], 2.0, 5.0), np.tile([-0.5, 0], (3, 1))),
    "torus": (
        Torus([1.0, 2, 3], [1.0, 1, 0], 3.0, 0.7),
        np.stack([np.full(3, -1 / 0.7), -np.cos(V) / TUBE], axis=1),
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_curvatures(name):
    surface, principal = KNOWN[name]
    found = curvature(surface, np.array([0.4, 2.0, 3.0]), V)
    assert_close(found.principal, principal)
    assert_close(found.mean, principal.mean(axis=1))
    assert_close(found.gaussian, principal.prod(axis=1))


def test_directions_are_unit_orthogonal_and_principal():
    surface, u, v = bicubic(), np.linspace(2.1, 4.9, 5), np.linspace(4.9, 2.1, 5)
    found = curvature(surface, u, v)
    gram = jnp.einsum("nia,nja->nij", found.directions, found.directions)
    assert_close(gram, np.tile(np.eye(2), (5, 1, 1)))
    # a step along a principal direction turns the normal along it, by -κ
    for i, (s, t) in enumerate(zip(u, v, strict=True)):
        basis = np.stack([surface.derivative(s, t, (1, 0)), surface.derivative(s, t, (0, 1))], axis=1)
        for k, d in zip(found.principal[i], found.directions[i], strict=True):
            du, dv = np.linalg.lstsq(basis, d, rcond=None)[0]
            turn = difference(lambda h, s=s, t=t, du=du, dv=dv: normal(surface, s + h * du, t + h * dv), 0.0)
            assert_close(turn, -k * d, 1e-7)


def test_reversing_the_normal_changes_the_sign():
    surface = bicubic()
    turned = BSplineSurface(surface.control_points[::-1], [7 - t for t in surface.knots_u[::-1]], surface.knots_v, 3, 3)
    there, back = curvature(surface, 2.5, 3.3), curvature(turned, 4.5, 3.3)
    assert_close(back.mean, -there.mean)
    assert_close(back.principal, -there.principal[::-1])
    assert_close(back.gaussian, there.gaussian)


def test_gradients_at_umbilics_are_finite_and_those_of_the_mean():
    by_radius = jax.jit(jax.jacfwd(lambda r: curvature(Sphere([1.0, 2, 3], r), 0.4, V)))(2.0)
    assert_close(by_radius.principal, np.full((3, 2), 0.25))
    assert_close(by_radius.gaussian, np.full(3, -0.25))
    knots = [0, 0, 0, 1, 1, 1]
    x, y = np.meshgrid([0, 0.5, 1], [0, 0.5, 1], indexing="ij")
    flat = jnp.asarray(np.stack([x, y, 0 * x], axis=-1))
    everything = lambda net: curvature(BSplineSurface(net, knots, knots, 2, 2), 0.3, 0.6)
    gradient = jax.jit(jax.jacfwd(everything))(flat)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient))
    bulge = difference(lambda z: everything(flat.at[1, 1, 2].set(z)).mean, 0.0)
    assert_close(gradient.mean[1, 1, 2], bulge, 1e-8)


@pytest.mark.parametrize("dtype, close", [(np.float64, 1e-8), (np.float32, 3e-3)])
def test_a_pole_has_the_curvature_of_its_surroundings(dtype, close):
    ball = Sphere(np.array([1, 2, 3], dtype), dtype(2.5))
    found = curvature(ball, np.array([0.3, 2, 4], dtype), np.array([POLE, -POLE, 0.2], dtype))
    assert found.mean.dtype == dtype
    assert_close(found.principal, np.full((3, 2), -0.4), close)
    assert_close(found.gaussian, np.full(3, 0.16), close)


def test_gradients_at_a_pole_are_finite():
    ball = Sphere([1.0, 2, 3], 2.5)
    for leaf in jax.tree.leaves(jax.jit(jax.jacrev(lambda v: curvature(ball, 0.3, v)))(POLE)):
        assert np.isfinite(leaf).all()


def test_the_apex_of_a_cone_is_finite():
    cone = Cone([1.0, 2, 3], [0.0, 0, 1], 0.0, 0.4, 2.0)
    for leaf in jax.tree.leaves(curvature(cone, [0.3, 1.0], [0.0, 1.0])):
        assert np.isfinite(leaf).all()


def test_transforms_agree():
    torus = KNOWN["torus"][0]
    eager = curvature(torus, 0.5, V)
    traced = jax.jit(jax.vmap(lambda v: curvature(torus, 0.5, v)))(jnp.asarray(V))
    assert_close(traced.principal, eager.principal)
    assert_close(traced.directions, eager.directions)
