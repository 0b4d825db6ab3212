"""Values and derivatives of the basis functions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from knot_cases import CASES, DEGREES, ORDINARY, PERIODIC, A, B, expected, make, places, tables

import jaxsurf as js
from jaxsurf.basis import BSplineBasis, collocation_matrix, cumulative_local, cumulative_row, local_values

every_case = pytest.mark.parametrize("name, degree", CASES)


@every_case
def test_partition_of_unity(name, degree):
    values, derivatives = tables(name, degree)
    # beyond the ends of a short span the functions are large, and cancel
    assert np.all(np.abs(values.sum(axis=1) - 1) <= 1e-15 * degree * (4 + np.abs(values).sum(axis=1)))
    largest = np.max(np.abs(derivatives), axis=(0, 2))
    assert np.all(np.abs(derivatives[:, 1:].sum(axis=2)) <= 1e-12 * (1 + largest[1:]))


@every_case
def test_values_and_derivatives_are_those_of_scipy(name, degree):
    basis, u = make(name, degree), places(name, degree)
    values, derivatives = tables(name, degree)
    wanted = expected(np.asarray(basis.knots), degree, basis.periodic, u)
    np.testing.assert_allclose(values, wanted[:, 0], rtol=0, atol=1e-12 * np.max(np.abs(wanted[:, 0])))
    for order in range(wanted.shape[1]):
        atol = 1e-12 * max(1, np.max(np.abs(wanted[:, order])))
        np.testing.assert_allclose(derivatives[:, order], wanted[:, order], rtol=0, atol=atol)


@every_case
def test_values_within_the_domain_are_not_negative(name, degree):
    inside = (places(name, degree) >= A) & (places(name, degree) <= B)
    assert tables(name, degree)[0][inside].min() >= -1e-15


@pytest.mark.parametrize("degree", DEGREES)
def test_clamped_functions_start_and_end_at_one(degree):
    knots = js.clamped_knots(degree + 3, degree, (A, B))
    values = collocation_matrix(knots, degree, jnp.array([A, B]))
    np.testing.assert_allclose(values, np.eye(degree + 3)[[0, -1]], rtol=0, atol=2 * np.finfo(float).eps)


def test_spans_are_half_open_and_the_last_is_closed():
    """A degree-1 basis with a doubled polygon corner jumps nowhere, but its slope does: from the right inside,
    from the left at the end."""
    basis = BSplineBasis(jnp.array([2.0, 2.0, 3.0, 5.0, 5.0]), 1)
    first = jax.vmap(lambda u: basis.local(u)[0])(jnp.array([2.0, np.nextafter(3.0, 0), 3.0, 5.0, 6.0, 1.0]))
    np.testing.assert_array_equal(first, [0, 0, 1, 1, 1, 0])


@pytest.mark.parametrize("name", PERIODIC)
def test_periodic_parameters_are_wrapped(name):
    basis = make(name, 3)
    u = jnp.array([A, 2.4, 3.1, 4.95])
    turned = [collocation_matrix(basis.knots, 3, u + 3.0 * turns, periodic=True) for turns in range(-2, 3)]
    once = collocation_matrix(basis.knots, 3, u, periodic=True)
    np.testing.assert_allclose(turned, np.repeat(once[None], 5, axis=0), rtol=0, atol=1e-13)


def test_many_knots_are_searched_alike():
    """Beyond 256 inner knots the span is found by bisection."""
    rng = np.random.default_rng(1)
    inner = np.sort(np.repeat(rng.uniform(A, B, 150), 2))
    knots = np.concatenate([[A] * 4, inner, [B] * 4])
    u = np.concatenate([inner[::7], [A, B, A - 1e-3, B + 1e-3], rng.uniform(A, B, 20)])
    values = collocation_matrix(jnp.asarray(knots), 3, jnp.asarray(u))
    wanted = expected(knots, 3, False, u)[:, 0]
    np.testing.assert_allclose(values, wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))


@pytest.mark.parametrize("name", ORDINARY)
def test_values_from_neighbouring_knots_are_the_local_ones(name):
    basis = make(name, 3)

    @jax.vmap
    def both(u):
        first, near, u = basis.near(u)
        return basis.local(u)[0] - first, jnp.stack(basis.local(u)[1]), jnp.stack(local_values(list(near), 3, u))

    shift, values, others = both(jnp.asarray(places(name, 3)))
    np.testing.assert_array_equal(shift, 0)
    np.testing.assert_allclose(values, others, rtol=0, atol=1e-12 * float(jnp.max(jnp.abs(others))))


@pytest.mark.parametrize("name", ORDINARY)
@pytest.mark.parametrize("degree", [1, 3])
def test_cumulative_values_are_sums_from_the_back(name, degree):
    basis, u = make(name, degree), jnp.asarray(places(name, degree))
    sums = np.cumsum(tables(name, degree)[0][:, ::-1], axis=1)[:, ::-1]
    rows = jax.jit(jax.vmap(lambda s: cumulative_row(basis, s)))(u)
    np.testing.assert_allclose(rows, sums, rtol=0, atol=1e-13 * np.max(np.abs(sums)))
    first, between = jax.jit(jax.vmap(lambda s: cumulative_local(basis, s)))(u)
    for at, row in enumerate(sums):
        start, stop = int(first[at]), int(first[at]) + degree
        atol = 1e-12 * max(1, np.max(np.abs(row)))
        np.testing.assert_allclose(row[:start], 1, rtol=0, atol=atol)
        np.testing.assert_allclose(row[start:stop], [b[at] for b in between], rtol=0, atol=atol)
        np.testing.assert_allclose(row[stop:], 0, rtol=0, atol=atol)


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_cumulative_values_begin_at_zero_and_end_at_one(degree):
    basis = make("uneven", degree)
    for u, value in ((A, 0), (B, 1)):
        _, between = cumulative_local(basis, jnp.array(u))
        np.testing.assert_allclose(between, value, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", [*ORDINARY, *PERIODIC])
@pytest.mark.parametrize("degree", [1, 3])
def test_derivatives_by_the_knots_are_finite_and_slopes(name, degree):
    """At places of all kinds finite; slopes at places between knots, by the knots that stand alone."""
    basis = make(name, degree)
    weights = jnp.asarray(np.random.default_rng(4).normal(size=basis.size))
    total = jax.jit(
        lambda knots, u: jnp.sum(jnp.sin(collocation_matrix(knots, degree, u, periodic=basis.periodic) @ weights))
    )
    gradient = jax.jit(jax.grad(total))
    assert np.all(np.isfinite(gradient(basis.knots, jnp.asarray(places(name, degree)))))
    u = jnp.array([2.15, 2.8, 3.55, 4.7])
    pulled = gradient(basis.knots, u)
    distinct, where, times = np.unique(basis.knots, return_index=True, return_counts=True)
    for i in where[times == 1]:
        moved = [total(basis.knots.at[i].add(h), u) for h in (-2e-4, -1e-4, 1e-4, 2e-4)]
        slope = (moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / 12e-4
        np.testing.assert_allclose(pulled[i], slope, rtol=1e-7, atol=1e-8)
    # repeated knots moved together keep their multiplicity
    for value in distinct[times > 1]:
        along = jnp.asarray(basis.knots == value, dtype=float)
        moved = [total(basis.knots + h * along, u) for h in (-2e-4, -1e-4, 1e-4, 2e-4)]
        slope = (moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / 12e-4
        np.testing.assert_allclose(jnp.sum(pulled * along), slope, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("name", ["uneven", "periodic"])
def test_single_precision_stays_single(name):
    basis = make(name, 3)
    single = BSplineBasis(basis.knots.astype(jnp.float32), 3, basis.periodic)
    values = single.matrix(jnp.asarray(places(name, 3), jnp.float32))
    assert values.dtype == jnp.float32
    inside = (places(name, 3) >= A) & (places(name, 3) <= B)
    smooth = np.abs(np.asarray(values) - tables(name, 3)[0])[inside]
    assert smooth.max() < 1e-5


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_rows_of_derivatives_are_those_of_forward_mode(degree):
    knots = np.concatenate([np.zeros(degree), [0.0, 0.4, 0.5, 0.9, 1.5], np.full(degree, 1.5)])
    basis = BSplineBasis(jnp.asarray(knots), degree)
    once = jax.jacfwd(basis.row)
    for u in (0.0, 0.3, 0.5, 1.5):
        first, rows = basis.derivatives(jnp.asarray(u), 2)
        for row, plain in zip(rows, (basis.row, once, jax.jacfwd(once)), strict=True):
            np.testing.assert_allclose(row, plain(jnp.asarray(u))[first : first + degree + 1], rtol=1e-12, atol=1e-10)
