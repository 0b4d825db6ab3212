"""Curves joined end to end."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf._safe import norm
from jaxsurf.curve import AbstractCurve, Arc, BSplineCurve, CompositeCurve, Line, breaks

CLOSE = {"rtol": 0, "atol": 1e-12}


class Root(AbstractCurve):
    """(√u, 0, 0) on [0, 1]: no derivative at its start, NaN before it."""

    size: jax.Array

    @property
    def domain(self):
        return 0.0, 1.0

    def point(self, u):
        return self.size * jnp.stack([jnp.sqrt(u), 0 * u, 0 * u])


def pieces():
    return (
        BSplineCurve([[1, 1, 0], [3, 0, 0], [3, 2, 1]], [2, 2, 2.5, 5, 5], 1),
        Arc.through([3, 2, 1], [4, 3, 1], [5, 2, 1]),
        Line([5, 2, 1], [6, 6, 6]),
    )


def test_the_pieces_are_run_through_one_after_the_other():
    curve, (first, second, third) = CompositeCurve(pieces()), pieces()
    np.testing.assert_allclose(curve.breaks, [2, 5, 6, 7], **CLOSE)
    assert [float(end) for end in curve.domain] == [2, 7]
    u = np.array([0, 0.3, 0.9])
    expected = np.concatenate([first(2 + 3 * u), second(u), third(u), third([1.0])])
    place = curve(np.concatenate([2 + 3 * u, 5 + u, 6 + u, [7.0]]))
    np.testing.assert_allclose(place, expected, **CLOSE)
    np.testing.assert_allclose(curve.derivative([5.0])[0], second.derivative(0.0), **CLOSE)  # from the right
    np.testing.assert_allclose(breaks(curve), [2, 2.5, 5, *(5 + np.arange(1, 17) / 8)], **CLOSE)


def test_one_piece_is_itself():
    piece = pieces()[0]
    curve = CompositeCurve([piece])
    np.testing.assert_array_equal(curve.breaks, [2, 5])
    np.testing.assert_array_equal(curve([2.2, 4]), piece([2.2, 4]))


def test_gradients_are_finite_next_to_a_singular_piece():
    curve = CompositeCurve([Line([-1, 0, 0], [0, 0, 0]), Root(jnp.asarray(1.0)), Line([1, 0, 0], [2, 0, 0])])

    @jax.jit
    def value_and_slopes(curve, u):
        return jax.value_and_grad(lambda c, u: norm(c.point(u)), argnums=(0, 1))(curve, u)

    for u in (0.3, 2.0, 2.6):
        value, slopes = value_and_slopes(curve, jnp.asarray(u))
        assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves((value, slopes)))
        np.testing.assert_allclose(slopes[1], -1 if u < 1 else 1, **CLOSE)


def test_the_widest_type_wins():
    first, second = Line(np.zeros(3, np.float32), [1, 0, 0]), Line(np.array([1.0, 0, 0]), [2, 0, 0])
    curve = CompositeCurve([first, second])
    assert {leaf.dtype for leaf in jax.tree.leaves(curve)} == {np.dtype(np.float64)}
    narrow = CompositeCurve([first, Line(np.array([1, 0, 0], np.float32), [2, 0, 0])])
    assert narrow(0.5).dtype == narrow.breaks.dtype == np.float32


def test_ends_that_nearly_meet_are_allowed_on_request_and_not_looked_at_under_tracing():
    gap = [Line([0, 0, 0], [1, 0, 0]), Line([1, 0.01, 0], [2, 0, 0])]
    assert len(CompositeCurve(gap, tolerance=0.01).pieces) == 2
    assert eqx.filter_jit(lambda p: CompositeCurve(p).point(jnp.asarray(1.0)))(gap)[1] == 0.01


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ([Line([0, 0, 0], [1, 0, 0]), Line([1, 0.01, 0], [2, 0, 0])], r"`pieces\[0\]` ends 0.01 from where"),
        (
            [Line([0, 0, 0], [1, 0, 0]), Line([0, 0], [2, 0])],
            r"`pieces` must have one dimension, got \[3, 2\]",
        ),
        ([], "`pieces` must hold at least one curve, got none"),
        ([Line([0, 0, 0], [1, 0, 0]), "line"], r"`pieces\[1\]` must be a curve, got str"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(bad, message):
    with pytest.raises(InputError, match=message):
        CompositeCurve(bad)
