"""Blending functions."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import betainc
from sweep_cases import close, sweep

import jaxsurf as js

T = np.linspace(0, 1, 21)


@pytest.mark.parametrize("order", range(7))
def test_smoothsteps_are_the_integrals_of_t_and_one_minus_t_to_their_order(order):
    close(js.Smoothstep(order)(jnp.asarray(T)), betainc(order + 1, order + 1, T), 2e-15)


@pytest.mark.parametrize("order", range(4))
def test_derivatives_of_smoothsteps_vanish_at_both_ends_up_to_their_order_and_no_further(order):
    slope, ends = js.Smoothstep(order), np.array([0.0, 1.0])
    for _ in range(order):
        slope = jax.grad(slope)
        close(jax.vmap(slope)(ends), 0, 1e-11)
    assert np.all(np.abs(jax.vmap(jax.grad(slope))(ends)) > 0.9 * math.factorial(order + 1))


def test_smoothstep_is_the_cubic_and_linear_the_share():
    close(js.smoothstep(jnp.asarray(T)), 3 * T**2 - 2 * T**3, 4e-16)
    close(js.linear(jnp.asarray(T)), T, 0)


def test_blends_of_one_order_are_equal_and_compile_once():
    traces = []

    @eqx.filter_jit
    def value(blend, t):
        traces.append(None)
        return blend(t)

    for blend in (js.smoothstep, js.Smoothstep(1), js.Smoothstep()):
        value(blend, jnp.asarray(0.3))
    assert len(traces) == 1


def test_a_blend_chooses_between_the_sweeps_of_both_characters():
    """The linear one: the middle between both at v half way."""
    both = sweep("B-splines", "fixed", count=2, blend=js.linear)
    (one, other), (guide,) = both.characters, both.guides
    u, middle = np.linspace(-3, 4, 5), np.asarray(guide(3.5))
    first = middle + np.asarray(one(u)) - np.asarray(guide(2.0))
    second = middle + np.asarray(other(1 + (u + 3) / 7)) - np.asarray(guide(5.0))
    close(both.surface(u, np.full(5, 3.5)), (first + second) / 2, 1e-14)


@pytest.mark.parametrize(
    ("blend", "message"),
    [
        (0.5, r"`blend` must be a function on \[0, 1\] such as `js.smoothstep`, got float"),
        (lambda t: t + 0.1, "`blend` must be 0 at 0, got 0.1"),
        (lambda t: 0.8 * t, "`blend` must be 1 at 1, got 0.8"),
        (lambda t: t + jnp.sin(2 * math.pi * t), "`blend` must stay between 0 and 1, got values from -0.2.* to 1.2"),
        (lambda t: t / 0 * 0, r"`blend` must give one finite number for one number, got shape \(\)"),
        (lambda t: jnp.stack([t, t]), r"`blend` must give one finite number for one number, got shape \(2,\)"),
        (lambda t, s: t, "`blend` must give one number for one number; it failed with: .*argument"),
    ],
)
def test_bad_blends_are_refused_in_one_sentence(blend, message):
    with pytest.raises(js.InputError, match=message):
        sweep("B-splines", "fixed", count=2, blend=blend)


@pytest.mark.parametrize("order", [-1, 7])
def test_orders_of_smoothsteps_beyond_the_table_are_refused(order):
    with pytest.raises(js.InputError, match=f"`order` of a smoothstep must be a whole number from 0 to 6, got {order}"):
        js.Smoothstep(order)
