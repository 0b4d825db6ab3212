"""Making and checking knots."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from knot_cases import ORDINARY, PERIODIC, A, B, make

import jaxsurf as js
from jaxsurf.basis import check_knots

REFUSED = {
    "degree": (dict(knots=[2, 5], degree=0, count=1), r"goes with `knots` must be at least 1, got 0"),
    "too few": (
        dict(knots=[2, 2, 3, 5, 5], degree=1, count=4),
        r"must have 6 knots \(n \+ degree \+ 1\) for n=4 .* degree 1, got shape \(5,\)",
    ),
    "a table": (dict(knots=[[2, 2], [5, 5]], degree=1, count=2), r"must have 4 knots .* got shape \(2, 2\)"),
    "too few, periodic": (
        dict(knots=[2, 3, 5], degree=1, count=3, periodic=True),
        r"must have 4 knots \(periodic, n \+ 1\) for n=3 .* got shape \(3,\)",
    ),
    "few points": (
        dict(knots=[2, 2, 2, 5, 5, 5], degree=3, count=2),
        r"`knots` of degree 3 needs at least 4 control points, got 2",
    ),
    "not a number": (dict(knots=[2, 2, np.nan, 5, 5], degree=1, count=3), r"must be finite, got nan at index 2"),
    "infinite": (dict(knots=[2, 2, 3, 5, np.inf], degree=1, count=3), r"must be finite, got inf at index 4"),
    "falling": (
        dict(knots=[2, 2, 4, 3, 5, 5], degree=1, count=4),
        r"must ascend, but knot 3 \(3\) is below knot 2 \(4\); sort them",
    ),
    "no domain": (
        dict(knots=[2, 2, 2, 2], degree=1, count=2),
        r"must span a domain of positive length, got \[2, 2\]",
    ),
    "no domain, periodic": (
        dict(knots=[2, 2], degree=1, count=1, periodic=True),
        r"must span a domain of positive length, got \[2, 2\]",
    ),
    "inner": (
        dict(knots=[2, 2, 2, 3, 3, 3, 5, 5, 5], degree=2, count=6),
        r"repeats the inner knot 3 3 times; degree 2 allows 2: remove 1 of them",
    ),
    "start": (
        dict(knots=[2, 2, 2, 2, 5, 5, 5], degree=2, count=4),
        r"repeats the end knot 2 4 times; degree 2 allows 3: remove 1 of them",
    ),
    "end": (
        dict(knots=[1, 2, 3, 5, 5, 5, 5], degree=1, count=5),
        r"repeats the end knot 5 4 times; degree 1 allows 2: remove 2 of them",
    ),
    "end, periodic": (
        dict(knots=[2, 2, 3, 5], degree=2, count=3, periodic=True),
        r"repeats the end knot 2 2 times; degree 2 allows 1: remove 1 of them",
    ),
    "another name": (
        dict(knots=[2, 2, np.nan, 5, 5], degree=1, count=3, name="knots_v"),
        r"`knots_v` must be finite",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_knots_that_define_no_spline_are_refused(kind):
    arguments, message = REFUSED[kind]
    with pytest.raises(ValueError, match=message):
        check_knots(**arguments | {"knots": jnp.asarray(arguments["knots"], dtype=float)})


@pytest.mark.parametrize("name", [*ORDINARY, *PERIODIC])
@pytest.mark.parametrize("degree", [1, 3, 5])
def test_awkward_but_lawful_knots_are_taken(name, degree):
    basis = make(name, degree)
    check_knots(basis.knots, degree, basis.size, periodic=basis.periodic)
    assert basis.domain == (A, B)


def test_traced_knots_are_checked_by_shape_alone():
    def count(knots):
        check_knots(knots, 1, 3)
        return knots.size

    assert jax.jit(count)(jnp.array([5.0, 4.0, 3.0, 2.0, 1.0])) == 5
    with pytest.raises(ValueError, match="must have 5 knots"):
        jax.jit(count)(jnp.array([5.0, 4.0, 3.0]))


@pytest.mark.parametrize("n, degree", [(2, 1), (4, 3), (9, 3), (7, 5)])
def test_made_knots_are_lawful_and_even(n, degree):
    made = {
        "clamped": js.clamped_knots(n, degree, (A, B)),
        "uniform": js.uniform_knots(n, degree, (A, B)),
        "periodic": js.periodic_knots(n, degree, (A, B)),
    }
    for kind, knots in made.items():
        periodic = kind == "periodic"
        check_knots(knots, degree, n, periodic=periodic)
        domain = (knots[0], knots[-1]) if periodic else (knots[degree], knots[n])
        np.testing.assert_allclose(domain, (A, B), rtol=1e-15)
        spans = np.diff(knots if periodic else knots[degree : n + 1])
        np.testing.assert_allclose(spans, spans[0], rtol=1e-13)
    assert np.all(made["clamped"][: degree + 1] == A) and np.all(made["clamped"][-degree - 1 :] == B)
    np.testing.assert_allclose(np.diff(made["uniform"]), 3.0 / (n - degree), rtol=1e-13)


@pytest.mark.parametrize(
    "make_knots, arguments, message",
    [
        (js.clamped_knots, (3, 3), "`n` must be at least degree . 1 = 4, got 3"),
        (js.uniform_knots, (3, 3), "`n` must be at least degree . 1 = 4, got 3"),
        (js.clamped_knots, (3, 0), "`degree` must be at least 1, got 0"),
        (js.uniform_knots, (3, 0), "`degree` must be at least 1, got 0"),
        (js.periodic_knots, (0, 3), "`n` and `degree` must be at least 1, got n=0 and degree=3"),
        (js.periodic_knots, (3, 0), "`n` and `degree` must be at least 1, got n=3 and degree=0"),
        (js.clamped_knots, (4, 3, (5, 2)), r"`domain` must be two finite ascending numbers, got \(5, 2\)"),
        (js.uniform_knots, (4, 3, (2, np.inf)), "`domain` must be two finite ascending numbers"),
        (js.periodic_knots, (4, 3, (2, 2)), "`domain` must be two finite ascending numbers"),
    ],
)
def test_knots_that_cannot_be_made_are_refused(make_knots, arguments, message):
    with pytest.raises(ValueError, match=message):
        make_knots(*arguments)
