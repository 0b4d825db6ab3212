"""Other parameters, the same points."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from edit_cases import CURVES, SURFACES, curve, inside, points, surface

from jaxsurf._errors import InputError
from jaxsurf.curve import Arc, BSplineCurve, CompositeCurve, Line
from jaxsurf.curve._breaks import breaks
from jaxsurf.edit import ReparametrisedCurve, reparametrise, reverse, split, transpose
from jaxsurf.surface import BSplineSurface, Torus, TrimmedSurface

CLOSE = {"rtol": 0, "atol": 1e-12}


@pytest.fixture(params=CURVES)
def whole(request):
    return curve(request.param)


def ends(shape):
    return tuple(float(end) for end in shape.domain)


def arc():
    return Arc.through([1, 0, 2], [0, 1, 2.5], [-1, 0, 2])


def test_reversed_splines_run_backwards(whole):
    back = reverse(whole)
    assert type(back) is type(whole) and ends(back) == ends(whole)
    np.testing.assert_allclose(points(back, inside(whole)), points(whole, inside(whole)[::-1]), **CLOSE)


def test_reversing_twice_is_the_identity(whole):
    twice = reverse(reverse(whole))
    np.testing.assert_allclose(twice.control_points, whole.control_points, rtol=0, atol=1e-15)
    np.testing.assert_allclose(twice.knots, whole.knots, rtol=0, atol=1e-15)


@pytest.mark.parametrize("at", [2.4, 3.1, 4.99])
def test_the_parts_of_a_split_spline_agree_with_the_whole(whole, at):
    before, after = split(whole, at)
    assert ends(before) == (2, at) and ends(after) == (at, 5)
    for part in (before, after):
        np.testing.assert_allclose(points(part, inside(part)), points(whole, inside(part)), **CLOSE)
    np.testing.assert_allclose(before.control_points[-1], after.control_points[0], **CLOSE)


def test_another_domain_leaves_the_points(whole):
    moved = reparametrise(whole, (-1, 0.5))
    assert ends(moved) == (-1, 0.5)
    np.testing.assert_allclose(points(moved, inside(moved)), points(whole, inside(whole)), **CLOSE)


@pytest.mark.parametrize("name", SURFACES)
def test_surfaces_in_other_parameters(name):
    whole = surface(name)
    u = v = np.linspace(2, 5, 6)
    grid = points(whole, u, v)
    np.testing.assert_allclose(points(reverse(whole, "u"), u, v), grid[::-1], **CLOSE)
    np.testing.assert_allclose(points(reverse(whole, "v"), u, v), grid[:, ::-1], **CLOSE)
    np.testing.assert_allclose(points(transpose(whole), v, u), grid.swapaxes(0, 1), **CLOSE)
    moved = reparametrise(whole, ((0, 1), (-3, 3)))
    np.testing.assert_allclose(points(moved, np.linspace(0, 1, 6), np.linspace(-3, 3, 6)), grid, **CLOSE)
    before, after = split(whole, 3.5, "v")
    np.testing.assert_allclose(points(before, u, v[:3]), grid[:, :3], **CLOSE)
    np.testing.assert_allclose(points(after, u, v[3:]), grid[:, 3:], **CLOSE)
    before, after = split(whole, 3.5, "u")
    np.testing.assert_allclose(points(before, u[:3], v), grid[:3], **CLOSE)
    np.testing.assert_allclose(points(after, u[3:], v), grid[3:], **CLOSE)


def test_any_curve_can_be_changed():
    whole, u = arc(), np.linspace(0, 1, 7)
    place = whole(u)
    np.testing.assert_allclose(reverse(whole)(u), place[::-1], **CLOSE)
    np.testing.assert_allclose(reverse(reverse(whole))(u), place, **CLOSE)
    before, after = split(reverse(whole), 0.5)
    assert ends(before) == (0, 0.5) and ends(after) == (0.5, 1)
    np.testing.assert_allclose(before(u[:4]), place[:-5:-1], **CLOSE)
    np.testing.assert_allclose(after(u[3:]), place[3::-1], **CLOSE)
    moved = reparametrise(before, (10, 11))
    assert isinstance(moved, ReparametrisedCurve) and moved.curve is not before  # wrapped once, not thrice
    np.testing.assert_allclose(moved(10 + 2 * u[:4]), place[:-5:-1], **CLOSE)
    np.testing.assert_allclose(breaks(moved)[[0, -1]], [10, 11], **CLOSE)


def test_any_surface_can_be_changed():
    whole = Torus([0, 1, 2], [1, 1, 1], 3, 1)
    u, v = np.linspace(0, 2 * np.pi, 5), np.linspace(0, 2 * np.pi, 4)
    grid = whole.grid(u, v)
    np.testing.assert_allclose(reverse(whole, "v").grid(u, v), grid[:, ::-1], **CLOSE)
    other = reverse(transpose(whole), "u")
    np.testing.assert_allclose(other.grid(v, u), grid.swapaxes(0, 1)[::-1], **CLOSE)
    np.testing.assert_allclose(other(v[1], u[2]), grid[2, 2], **CLOSE)
    np.testing.assert_allclose(transpose(transpose(whole)).grid(u, v), grid, **CLOSE)
    before, after = split(transpose(whole), u[2], "v")
    np.testing.assert_allclose(before.grid(v, u[:3]), grid[:3].swapaxes(0, 1), **CLOSE)
    np.testing.assert_allclose(after.grid(v, u[2:]), grid[2:].swapaxes(0, 1), **CLOSE)
    moved = reparametrise(before, ((0, 1), (5, 6)))
    np.testing.assert_allclose(moved.grid([0.0], [5.0, 6.0])[0], grid[jnp.array([0, 2]), 0], **CLOSE)
    assert [len(places) for places in breaks(moved)] == [9, 5]


def test_composite_curves_stay_composite():
    whole = CompositeCurve([Line([3, 0, 2], [1, 0, 2]), arc()])
    u = np.linspace(0, 2, 9)
    place = whole(u)
    back = reverse(whole)
    np.testing.assert_allclose(back.breaks, [0, 1, 2], **CLOSE)
    np.testing.assert_allclose(back(u), place[::-1], **CLOSE)
    moved = reparametrise(whole, (2, 10))
    np.testing.assert_allclose(moved.breaks, [2, 6, 10], **CLOSE)
    before, after = split(whole, 1.5)
    assert (len(before.pieces), len(after.pieces)) == (2, 1)
    assert ends(before) == (0, 1.5) and ends(after) == (1.5, 2)
    np.testing.assert_allclose(after(u[6:]), place[6:], **CLOSE)
    np.testing.assert_allclose(before(u[:7]), place[:7], **CLOSE)
    before, after = split(whole, 1.0)
    assert (len(before.pieces), len(after.pieces)) == (1, 1)


def test_trimming_loops_follow_their_surface():
    sheet = BSplineSurface(np.zeros((3, 2, 3)), [0, 0, 1, 2, 2], [0, 0, 1, 1], 1, 1)
    corners = [[0.2, 0.1], [1.5, 0.1], [0.2, 0.8], [0.2, 0.1]]
    trimmed = TrimmedSurface(sheet, [BSplineCurve(corners, [0, 0, 1, 2, 3, 3], 1)])
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0, 2, 9), np.linspace(0.01, 1, 7)))
    expected = trimmed.contains(u, v)
    assert 0 < expected.sum() < expected.size
    changed = transpose(reparametrise(reverse(trimmed, "u"), ((1, 2), (5, 7))))
    np.testing.assert_array_equal(changed.contains(5 + 2 * v, 1 + (2 - u) / 2), expected)
    with pytest.raises(InputError, match="`split` does not cut trimming loops"):
        split(trimmed, 1.0, "u")


def test_a_traced_place_to_split_gives_the_same_points():
    whole = curve("unclamped")

    @jax.jit
    def halves(at):
        before, after = split(whole, at)
        return before.point((2 + at) / 2), after.point((at + 5) / 2)

    before, after = halves(3.3)
    np.testing.assert_allclose(jnp.stack([before, after]), points(whole, [2.65, 4.15]), **CLOSE)


def test_points_are_differentiable_in_the_new_domain():
    whole = curve("unclamped")
    slope = jax.jit(jax.grad(lambda b: reparametrise(whole, (0, b)).point(jnp.asarray(1.0))[0]))(4.0)
    expected = -3 / 16 * whole.derivative(2.75)[0]  # u = 2 + 3 · 1 / b
    np.testing.assert_allclose(slope, expected, rtol=1e-10)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: split(curve("polygon"), 5), r"`at` must lie inside the domain \(2, 5\), got 5"),
        (lambda: split(arc(), -1), r"`at` must lie inside the domain \(0, 1\), got -1"),
        (lambda: reparametrise(curve("polygon"), (1, 0)), r"`domain` must ascend, got \[1.0, 0.0\]"),
        (lambda: reparametrise(curve("polygon"), 3), r"`domain` must be \(a, b\), got 3"),
        (
            lambda: reparametrise(surface("tube"), (0, 1)),
            r"\(\(a, b\), \(c, d\)\), got \(0, 1\)",
        ),
        (lambda: reverse(surface("tube")), '`direction` must be "u" or "v" for a surface, got None'),
        (lambda: split(arc(), 0.5, "u"), "A curve has one direction; leave `direction` out, got 'u'"),
        (
            lambda: ReparametrisedCurve(arc(), [1, 2, 3], [0, 1]),
            r"`ends` must be two numbers, got",
        ),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize("verb", [reverse, transpose, lambda s: split(s, 1), lambda s: reparametrise(s, (0, 1))])
def test_what_is_no_shape_is_refused_by_name(verb):
    with pytest.raises(TypeError, match="is not defined for str"):
        verb("circle")
