"""Derivatives of sweeps by their control data: forward = reverse = differences, and finite where data are degenerate."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sweep_cases import OFF, UP, across, close, ends

import jaxsurf as js


class Leaning(eqx.Module):
    """A blending function with a parameter of its own."""

    lean: jax.Array

    def __call__(self, t):
        return t**2 * (3 - 2 * t) + self.lean * (t * (1 - t)) ** 2


def bezier(start, bend, seed):
    points = start + np.array([[0, 0, 0], [1.2, 0.1, bend], [2.5, 0.5, bend], [4, 0.2, 0.1]])
    return js.BSplineCurve(points + 0.2 * np.random.default_rng(seed).normal(size=(4, 3)), js.clamped_knots(4, 3, (2, 5)), 3)


GUIDES = bezier(OFF, 0.8, 1), bezier(OFF + np.array([0.1, 2.0, 0.3]), 0.5, 2)
CHARACTERS = [across(ends(GUIDES[0])[0], ends(GUIDES[1])[0], "arc"), across(ends(GUIDES[0])[1], ends(GUIDES[1])[1], "NURBS")]
TURNS = np.random.default_rng(5).normal(size=(4, 4)) * 0.4 + np.array([1.0, 0, 0, 0])
KINDS = {
    "fixed": ("fixed", 1),
    "guide": ("guide", 1),
    "minimal": (js.RotationMinimising(steps=8), 1),
    "frenet": ("frenet", 1),
    "up": (UP, 1),
    "orientations": (js.OrientationRotation([2.0, 3.0, 3.4, 5.0], TURNS), 1),
    "chord": ("chord", 2),
    "chord+guide": ("chord+guide", 2),
}
U, V = np.array([0.1, 0.4, 0.8, 0.6]), np.array([2.3, 2.9, 3.7, 4.6])


def data_of(surface):
    """Control data without knots, and the rest."""
    is_data = lambda path, leaf: eqx.is_inexact_array(leaf) and not any(getattr(key, "name", "") == "knots" for key in path)
    return eqx.partition(surface, jax.tree_util.tree_map_with_path(is_data, surface))


@pytest.mark.parametrize("kind", KINDS)
def test_forward_reverse_and_differences_agree(kind):
    rotation, count = KINDS[kind]
    surface = js.sweep(
        CHARACTERS,
        GUIDES[:count],
        rotation=rotation,
        blend=Leaning(jnp.asarray(0.3)),
        scale="chord" if kind == "chord" else True,
    )
    data, rest = data_of(surface)

    def value(data):
        points = eqx.combine(data, rest)(U, V)
        return jnp.mean(jnp.sin(points)) + jnp.mean(points**2) / 8

    @jax.jit
    def slopes(data, along):
        pulled = jax.tree.map(lambda g, a: jnp.sum(g * a), jax.grad(value)(data), along)
        return jax.jvp(value, (data,), (along,))[1], sum(jax.tree.leaves(pulled))

    at = jax.jit(value)
    leaves, tree = jax.tree.flatten(data)
    rng, h = np.random.default_rng(3), 3e-4
    for i, leaf in enumerate(leaves):
        along = [np.zeros(other.shape) for other in leaves]
        along[i] = rng.normal(size=leaf.shape)
        f = lambda h, along=along: float(at(tree.unflatten([x + h * a for x, a in zip(leaves, along, strict=True)])))
        pushed, pulled = slopes(data, tree.unflatten(along))
        close(pushed, pulled, 1e-12, f"{kind}, leaf {i} of shape {leaf.shape}")
        close(
            pulled, (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h), 1e-8, f"{kind}, leaf {i} of shape {leaf.shape}"
        )


def test_gradients_by_the_parameter_of_a_blend_are_its_closed_form():
    """S depends on it linearly: dS/dlean = (t (1 − t))² (S₂ − S₁), and it is not nothing."""
    make = lambda lean, v: js.sweep(CHARACTERS, GUIDES[0], rotation="fixed", blend=Leaning(lean))(U, v)
    slope = jax.jit(jax.jacfwd(make))(jnp.asarray(0.3), V)
    t = (V - 2) / 3
    first, second = (np.asarray(c(a + (b - a) * U)) for c, (a, b) in zip(CHARACTERS, ((0, 1), (1, 2)), strict=True))
    apart = (second - ends(GUIDES[0])[1]) - (first - ends(GUIDES[0])[0])
    close(slope, ((t * (1 - t)) ** 2)[:, None] * apart, 1e-14)
    assert np.max(np.abs(slope)) > 1e-2


STRAIGHT = js.Line(OFF, OFF + np.array([4.0, 0, 0]))
CURVED = js.Arc.through(OFF, OFF + np.array([1.0, 0, 0.7]), OFF + np.array([2.0, 0, 0.2]))
BESIDE = js.translate(STRAIGHT, (0.0, 2.0, 0.0))
FLAT = js.Line(OFF, OFF + np.array([0, 2.0, 0]))
POINT = js.Line(OFF, OFF)
DEGENERATE = {
    "straight, guide": ("guide", FLAT, STRAIGHT),
    "straight, minimal": (js.RotationMinimising(steps=4), FLAT, STRAIGHT),
    "straight, up": ("up", FLAT, STRAIGHT),
    "flat arc, frenet": ("frenet", FLAT, CURVED),
    "a point carried along": ("guide", POINT, CURVED),
    "parallel, chord": ("chord", FLAT, (STRAIGHT, BESIDE)),
    "parallel, chord+guide": ("chord+guide", FLAT, (STRAIGHT, BESIDE)),
    "two flat characters": ("guide", [FLAT, js.translate(FLAT, (4.0, 0, 0))], (STRAIGHT, BESIDE)),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_on_degenerate_data_gradients_are_finite_and_right(name):
    rotation, characters, guides = DEGENERATE[name]
    surface = js.sweep(characters, guides, rotation=rotation)
    u, v = np.array([0.0, 0.3, 1.0, 1.0]), np.array([0.0, 0.6, 0.5, 1.0])
    data, rest = data_of(surface)
    value = lambda data: jnp.sum(jnp.sin(eqx.combine(data, rest)(u, v)))
    value_and_slopes = jax.jit(jax.value_and_grad(value))
    gradient = value_and_slopes(data)[1]
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(gradient))
    leaves, tree = jax.tree.flatten(data)
    rng, h = np.random.default_rng(4), 1e-3
    along = [rng.normal(size=leaf.shape) for leaf in leaves]
    f = lambda h: float(value_and_slopes(tree.unflatten([x + h * a for x, a in zip(leaves, along, strict=True)]))[0])
    slope = sum(np.sum(np.asarray(g) * a) for g, a in zip(jax.tree.leaves(gradient), along, strict=True))
    close(slope, (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h), 1e-8)
