"""Knot operations leave the shape where it is."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from edit_cases import CURVES, SURFACES, curve, inside, points, surface

from jaxsurf._errors import InputError
from jaxsurf.curve import BSplineCurve, Circle, NURBSCurve
from jaxsurf.edit import clamp, elevate_degree, insert_knots, remove_knots, unrolled

CLOSE = {"rtol": 0, "atol": 1e-12}
NEW = [3.65, 4.95, 3.65]  # one of them twice


@pytest.fixture(params=CURVES)
def whole(request):
    return curve(request.param)


def same(a, b):
    assert [float(x) for x in a.domain] == [float(x) for x in b.domain]
    u = inside(a)
    np.testing.assert_allclose(points(b, u), points(a, u), **CLOSE)


def new_knots(shape):
    return NEW if shape.degree > 1 else NEW[:2]


def test_insertion_leaves_the_shape(whole):
    finer = insert_knots(whole, new_knots(whole))
    assert finer.knots.shape[0] == whole.knots.shape[0] + len(new_knots(whole))
    same(whole, finer)


def test_removal_undoes_insertion(whole):
    back = remove_knots(insert_knots(whole, new_knots(whole)), new_knots(whole)[::-1])
    np.testing.assert_array_equal(back.knots, whole.knots)
    np.testing.assert_allclose(back.control_points, whole.control_points, **CLOSE)


def test_elevation_leaves_the_shape(whole):
    higher = elevate_degree(whole, 2)
    assert higher.degree == whole.degree + 2
    same(whole, higher)


def test_clamping_leaves_the_shape_and_meets_its_ends(whole):
    held = clamp(whole)
    same(whole, held)
    ends = points(whole, inside(whole, 2))
    np.testing.assert_allclose(held.control_points[jnp.array([0, -1])], ends, **CLOSE)
    if getattr(whole, "periodic", False):
        assert not held.periodic
        np.testing.assert_array_equal(held.control_points[0], held.control_points[-1])


def test_unrolling_leaves_the_shape(whole):
    ordinary = unrolled(whole)
    assert not getattr(ordinary, "periodic", False)
    same(whole, ordinary)


def test_clamped_splines_are_clamped_already():
    shape = curve("polygon")
    assert clamp(shape) is shape


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("direction", ["u", "v"])
def test_surfaces_stay_under_every_knot_operation(name, direction):
    whole = surface(name)
    u = v = np.linspace(2, 5, 7)
    expected = points(whole, u, v)
    finer = insert_knots(whole, [3.65], direction)
    for changed in (
        finer,
        remove_knots(finer, 3.65, direction),
        elevate_degree(whole, direction=direction),
        clamp(whole, direction),
        clamp(whole),
        unrolled(whole),
    ):
        np.testing.assert_allclose(points(changed, u, v), expected, **CLOSE)


def test_removal_of_what_matters_is_refused_with_an_honest_measure():
    for name in ("rational cubic, full knot", "unclamped"):
        whole, u = curve(name), np.linspace(2, 5, 301)
        with pytest.raises(InputError, match="would move the shape by up to .* more than") as error:
            remove_knots(whole, 3.1)
        measure = float(str(error.value).split("up to ")[1].split(",")[0])
        coarse = remove_knots(whole, 3.1, tolerance=np.inf)
        moved = np.linalg.norm(points(coarse, u) - points(whole, u), axis=1).max()
        assert 0.01 < moved <= measure * 1.01


def test_knots_are_differentiable_under_insertion():
    points, knots = 3 + np.random.default_rng(0).normal(size=(4, 3)), jnp.asarray([2, 2, 2, 3.1, 5, 5, 5])

    def place(knots, new):
        return insert_knots(BSplineCurve(points, knots, 2), new).point(jnp.asarray(2.5)) @ jnp.arange(3.0)

    by_knots, by_new = jax.jit(jax.grad(place, argnums=(0, 1)))(knots, jnp.asarray([2.7]))
    direct = jax.jit(jax.grad(lambda k: BSplineCurve(points, k, 2).point(jnp.asarray(2.5)) @ jnp.arange(3.0)))(knots)
    np.testing.assert_allclose(by_knots, direct, **CLOSE)
    np.testing.assert_allclose(by_new, 0, atol=1e-12)


def test_known_knots_stay_known_under_jit():
    whole = curve("periodic")

    @jax.jit
    def worked(control_points):
        shape = eqx.tree_at(lambda s: s.control_points, whole, control_points)
        shape = remove_knots(insert_knots(shape, NEW), NEW[:1])
        return elevate_degree(clamp(shape)).control_points

    expected = elevate_degree(clamp(insert_knots(whole, NEW[1:]))).control_points
    np.testing.assert_allclose(worked(whole.control_points), expected, **CLOSE)


def test_single_precision_stays():
    whole = BSplineCurve(np.ones((5, 3), np.float32), np.array([0, 0, 0, 1, 2, 3, 3, 3.0]), 2)
    for changed in (insert_knots(whole, 1.5), elevate_degree(whole), remove_knots(whole, 1)):
        assert changed.control_points.dtype == changed.knots.dtype == np.float32


def traced_knots(function):
    shape = curve("unclamped")
    jax.jit(lambda k: function(eqx.tree_at(lambda s: s.knots, shape, k)))(shape.knots)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: insert_knots(curve("polygon"), [2.0]), r"must lie inside the domain \(2, 5\), got 2"),
        (lambda: insert_knots(curve("polygon"), [4.0]), "repeats the inner knot 4 2 times"),
        (lambda: insert_knots(curve("polygon"), [[3.0]]), r"`knots` must have shape \(m,\), got \(1, 1\)"),
        (lambda: remove_knots(curve("polygon"), 3.0), "3 is not among those left: 2.5, 4"),
        (lambda: remove_knots(curve("polygon"), [4.0, 4.0]), "4 is not among those left: 2.5"),
        (lambda: elevate_degree(curve("polygon"), -1), "`by` must be a whole number ≥ 0, got -1"),
        (
            lambda: insert_knots(surface("tube"), 3.0),
            '`direction` must be "u" or "v" for a surface, got None',
        ),
        (lambda: clamp(surface("tube"), "w"), '`direction` must be "u" or "v" for a surface, got \'w\''),
        (lambda: insert_knots(curve("polygon"), 3.0, "u"), "A curve has one direction; leave"),
        (lambda: traced_knots(clamp), "`clamp` needs knots whose values are known"),
        (lambda: traced_knots(elevate_degree), "`elevate_degree` needs knots whose values are known"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_other_shapes_are_no_splines():
    with pytest.raises(TypeError, match=r"clamp is not defined for Circle; `js.to_bspline` converts"):
        clamp(Circle([0, 0, 0], [0, 0, 1], 1))


def test_removal_that_would_make_weights_negative_is_refused():
    shape = NURBSCurve(np.eye(3)[[0, 1, 2, 0]], [100, 1e-3, 1e-3, 100.0], [0, 0, 0, 1, 2, 2, 2], 2)
    with pytest.raises(InputError, match="move the shape by up to inf|weights` must be positive"):
        remove_knots(shape, 1, tolerance=np.inf)
