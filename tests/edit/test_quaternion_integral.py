"""QI shapes under the edits that keep them what they are."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js

RNG = np.random.default_rng(11)
PLACES = RNG.uniform(size=40)
DIRECTIONS = np.array([1.0, 0.4, -0.3]) + 0.5 * RNG.normal(size=(6, 5, 3))


def curve(degree=3):
    return js.QICurve([1.0, 2.0, 3.0], 2.5, DIRECTIONS[:, 0], degree)


def surface():
    spine = js.QICurve([1.0, 2.0, 3.0], 1.5, DIRECTIONS[0], 2)
    return js.QISurface(spine, DIRECTIONS, RNG.uniform(1, 2, 5), 3, 2)


SHAPES = {"curve": (curve, (PLACES,)), "surface": (surface, (PLACES, PLACES[::-1]))}


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize(
    "move",
    [
        lambda s: js.translate(s, (3, -1, 2)),
        lambda s: js.rotate(s, (1, 2, -1), 0.7, (5, 0, 1)),
        lambda s: js.scale(s, 2.5, (1, 1, 0)),
        lambda s: js.scale(s, -0.5),
        lambda s: js.mirror(s, (0, 1, 1), (1, 1, 0)),
    ],
    ids=["translate", "rotate", "scale", "point reflection", "mirror"],
)
def test_similarities_keep_the_class_and_move_every_point(kind, move):
    make, places = SHAPES[kind]
    shape = make()
    moved = move(shape)
    assert type(moved) is type(shape)
    points = np.asarray(shape(*places))
    frame = np.asarray(move(js.BSplineCurve(points, js.clamped_knots(len(points), 3), 3)).control_points)
    np.testing.assert_allclose(moved(*places), frame, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", SHAPES)
def test_other_maps_are_wrapped_around(kind):
    make, places = SHAPES[kind]
    shape = make()
    stretched = js.scale(shape, (1.0, 1.0, 2.0))
    assert type(stretched).__name__.startswith("Mapped")
    np.testing.assert_allclose(stretched(*places), np.asarray(shape(*places)) * [1, 1, 2], rtol=0, atol=1e-12)


def test_edits_can_be_traced():
    turned = lambda angle: js.rotate(curve(), (0, 0, 1), angle)(0.7)[0]
    slope = jax.grad(turned)(0.4)
    np.testing.assert_allclose(slope, (turned(0.4 + 1e-6) - turned(0.4 - 1e-6)) / 2e-6, rtol=1e-8)


def test_another_domain_keeps_the_points():
    c, s = curve(), surface()
    moved = js.reparametrise(c, (2, 5))
    assert isinstance(moved, js.QICurve) and [float(x) for x in moved.domain] == [2, 5]
    np.testing.assert_allclose(moved(2 + 3 * PLACES), c(PLACES), rtol=0, atol=1e-12)
    moved = js.reparametrise(s, ((1, 2), (3, 7)))
    assert isinstance(moved, js.QISurface)
    np.testing.assert_allclose(moved(1 + PLACES, 7 - 4 * PLACES), s(PLACES, 1 - PLACES), rtol=0, atol=1e-12)


@pytest.mark.parametrize("degree", [1, 3])
def test_the_reverse_has_the_same_points(degree):
    c = curve(degree)
    back = js.reverse(c)
    assert isinstance(back, js.QICurve) == (degree == 1)
    np.testing.assert_allclose(back(1 - PLACES), c(PLACES), rtol=0, atol=1e-12)


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("at", [0.07, 0.2, 0.55])  # 0.2 is a knot of degree 1
def test_parts_are_parts(degree, at):
    c = curve(degree)
    parts = js.split(c, at)
    for part, places in zip(parts, (PLACES * at, at + PLACES * (1 - at)), strict=True):
        assert isinstance(part, js.QICurve) == (degree == 1)
        np.testing.assert_allclose(part(places), c(places), rtol=0, atol=1e-12)
    assert float(parts[0].domain[1]) == float(parts[1].domain[0]) == at


def test_replaced_control_data_are_checked_and_made_ready():
    c = curve()
    longer = c.replace(length=5.0, start=(0, 0, 0))
    np.testing.assert_allclose(longer(PLACES), 2 * (np.asarray(c(PLACES)) - [1, 2, 3]), rtol=0, atol=1e-12)
    wild = c.replace(tangents=np.array([[1, 0, 0], [-1, 0.05, 0]] * 3, float))
    assert wild.angle > c.angle and wild.layout > c.layout
    with pytest.raises(js.InputError, match=r"tangents\[1\].*tangents\[2\]"):
        c.replace(tangents=np.array([[1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 0, 0]], float), knots=js.clamped_knots(4, 3))
    with pytest.raises(js.InputError, match="positive"):
        c.replace(length=-1)


def test_under_tracing_it_stays_as_ready_as_it_was():
    c = curve()
    traced = jax.jit(lambda t: c.replace(tangents=t)(jnp.asarray(PLACES)))(c.tangents)
    np.testing.assert_allclose(traced, c(PLACES), rtol=0, atol=1e-13)
