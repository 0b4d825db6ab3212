"""QI curves and surfaces fitted to points."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from fit_cases import points_on, rms_distance

import jaxsurf as js
from jaxsurf.fit import numbers_of, peer_fit, qi_plane
from jaxsurf.io import read_points
from jaxsurf.quaternion._control import neighbour_angles

DATA = Path(__file__).parents[1] / "data"
COUNT = 1802  # points, as many as bunny_back has: one compiled program fits both
NOISE = 0.01
QUIET = 1e-7  # weight of the squared turns between control tangents, by which `fit` holds what no point determines


def arch():
    """Bent along both directions and twisted, 6 long and 4 to 5 wide, off the origin and not along the axes."""

    def leaning(a, b, tilt):
        a, b, tilt = np.radians([a, b, tilt])
        return np.array([np.cos(a) * np.cos(b), np.sin(b) + np.sin(tilt), np.sin(a)])

    rows = np.array([[leaning(a, b, t) for b, t in ((4, 0), (0, 5), (-6, 12))] for a in (35, 2, -30)])
    spine = np.array([[0, np.cos(np.radians(a)), np.sin(np.radians(a))] for a in (20, 0, -25)])
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    start = js.QICurve([20.0, -7, 3], 4.0, spine @ turn, 2)
    return js.QISurface(start, rows @ turn, [6.0, 6.5, 5.8], 2, 2)


@pytest.fixture(scope="module")
def found():
    surface = arch()
    points = points_on(surface, COUNT, 0)
    return surface, points, js.fit_qi(points + NOISE * np.random.default_rng(1).normal(size=points.shape))


def test_a_member_of_the_family_is_found_again_from_the_plane(found):
    """True distances to less than what noise must leave, σ √(P/N) for P control directions, with a margin of a half."""
    _, points, fit = found
    assert fit.deviation.rms < 1.05 * NOISE
    inside = rms_distance(fit.shape, points)
    assert inside < 1.5 * NOISE * np.sqrt(numbers_of(fit.shape) / len(points))


def test_tangents_are_unit_and_lengths_those_of_the_points(found):
    surface, _, fit = found
    np.testing.assert_allclose(np.linalg.norm(fit.shape.tangents, axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose(sorted(fit.shape.lengths), sorted(surface.lengths), rtol=0.08)
    assert fit.shape.tangents.shape == (3, 3, 3) and fit.shape.spine.tangents.shape == (3, 3)
    assert fit.coverage.share == 1


def test_it_begins_with_the_plane_of_the_points(found):
    _, points, _ = found
    plane = qi_plane(points, (4, 3))
    assert plane.tangents.shape == (4, 3, 3)
    net = np.asarray(plane.grid(np.linspace(0, 1, 5), np.linspace(0, 1, 5)))
    assert np.linalg.matrix_rank(net.reshape(-1, 3) - net[0, 0], tol=1e-9) == 2
    along_u, along_v = net[-1, 0] - net[0, 0], net[0, -1] - net[0, 0]
    assert abs(along_u @ along_v) < 1e-9 and np.linalg.norm(along_u) > np.linalg.norm(along_v)
    flat = np.column_stack([points - net[0, 0]]) @ np.stack([along_u / (along_u @ along_u), along_v / (along_v @ along_v)]).T
    assert flat.min() > -1e-9 and flat.max() < 1 + 1e-9


def test_a_curve_through_points():
    """Found exactly without bending; with the quiet weight w of `fit` no further off than √(w Σ turn²) of the size."""
    rng = np.random.default_rng(2)
    wanted = js.QICurve([1.0, 2, 3], 5.0, np.array([1.0, 0, 0]) + 0.5 * rng.normal(size=(6, 3)))
    points = np.asarray(wanted(np.append(rng.uniform(size=148), [0, 1])))  # without its ends a curve is found more slowly
    start = js.QICurve.line(wanted(0.0), wanted(1.0), 6, 3).replace(angle=np.radians(140))
    exact = js.fit(start, points, bending=0.0, rtol=1e-9, sliding=0.01)
    assert exact.deviation.rms < 1e-6 and abs(float(exact.shape.length) - 5) < 1e-4
    np.testing.assert_allclose(exact.shape.tangents, wanted.tangents, atol=1e-3)
    quiet = js.fit(start, points, rtol=1e-9)
    size = np.linalg.norm(np.ptp(points, axis=0))
    turns = neighbour_angles(np.asarray(wanted.tangents))
    assert exact.deviation.rms < quiet.deviation.rms < size * np.sqrt(QUIET * np.sum(turns**2))


def test_lengths_may_be_held(found):
    surface, points, _ = found
    start = qi_plane(points)
    fit = js.fit(start, points, free=lambda s: (s.tangents, s.spine.tangents, s.spine.start), rtol=1e-2, max_steps=4)
    np.testing.assert_array_equal(fit.shape.lengths, start.lengths)
    assert float(fit.shape.spine.length) == float(start.spine.length) and fit.deviation.rms < 1


def test_three_by_three_tangents_next_to_a_b_spline_with_as_many_numbers():
    points = read_points(DATA / "bunny_back.ply")
    fit = js.fit_qi(points)
    peer = peer_fit(points, fit.shape)
    numbers, of_peer = numbers_of(fit.shape), peer.shape.control_points.size
    assert numbers == 31 and numbers <= of_peer <= numbers + 6
    assert fit.deviation.rms < 1.02 * peer.deviation.rms
    size = np.linalg.norm(np.ptp(points, axis=0))
    assert fit.deviation.rms < 0.006 * size


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tangents": (2, 3)}, "`tangents` must be two whole numbers > `degree` = 2"),
        ({"tangents": (40, 50)}, "at least as many as the 2000 tangents, got 1802"),
        ({"holdout": 1.0}, r"`holdout` must be in \[0, 1\)"),
        ({"loss": "absolute"}, "`loss` must be"),
        ({"fairness": -1.0}, "`fairness`"),
    ],
)
def test_bad_options(found, options, message):
    with pytest.raises(js.InputError, match=message):
        js.fit_qi(found[1], **options)


def test_clouds_without_a_surface():
    line = np.linspace(0, 1, 50)[:, None] * np.array([1.0, 2, 3])
    with pytest.raises(js.InputError, match="points"):
        js.fit_qi(line)
    with pytest.raises(js.InputError, match="finite"):
        js.fit_qi(jnp.full((50, 3), jnp.nan))
