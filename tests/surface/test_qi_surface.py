"""Quaternion integral surfaces against a second implementation and their laws."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import qi_reference as reference
from qi_reference import net, uneven
from scipy.interpolate import BSpline

import jaxsurf as js

START = np.array([0.7, -0.3, 0.4])
SPINE_KNOTS = np.array([2.0, 2.0, 2.0, 3.3, 5.0, 5.0, 5.0])
SPINE = (START, 2.5, np.array([[1.0, 0, 0], [1.0, 1.3, 0.2], [0.1, 2, 1], [-0.3, 0.4, 0.7]]), SPINE_KNOTS, 2)


def close(found, wanted, atol, what=""):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=atol, err_msg=what)


def spine(dtype: type = np.float64):
    start, length, tangents, knots, degree = SPINE
    return js.QICurve(start.astype(dtype), length, tangents, degree, knots)


def random_data(rng, shape, degrees, angle):
    """Tangents with neighbours at most `angle` degrees apart, lengths, and uneven knots."""
    tangents = net(rng, *shape, largest=angle) * rng.uniform(0.3, 3, (*shape, 1))
    knots = tuple(uneven(rng, n, degree) for n, degree in zip(shape, degrees, strict=True))
    return tangents, rng.uniform(1, 3, shape[1]), knots


def places(rng, count=24):
    """Ends, knots and places between; many at the end of u, where errors add up."""
    u, v = rng.uniform(2, 5, (2, count))
    u[: count // 3] = 5
    u[-1], v[-2:], v[:2] = 2, (2, 5), (2, 5)
    return u, v


# --- the points


CASES = [
    ((1, 1), (3, 3), 60),
    ((1, 2), (3, 3), 90),
    ((1, 3), (3, 4), 60),
    ((2, 1), (5, 4), 90),
    ((2, 2), (3, 3), 60),
    ((2, 3), (5, 4), 120),
    ((3, 1), (4, 3), 60),
    ((3, 2), (5, 4), 60),
    ((3, 3), (5, 4), 120),
]


@pytest.mark.parametrize("degrees, shape, angle", CASES)
def test_points_are_those_of_the_reference(degrees, shape, angle):
    rng = np.random.default_rng(10 * degrees[0] + degrees[1])
    tangents, lengths, knots = random_data(rng, shape, degrees, angle)
    u, v = places(rng)
    found = js.QISurface(spine(), tangents, lengths, *degrees, *knots)(u, v)
    wanted = reference.surface(SPINE, tangents, lengths, knots, degrees, u, v)
    close(found / lengths.max(), wanted / lengths.max(), 1e-12 if angle <= 90 else 1e-11)


DATA = random_data(np.random.default_rng(1), (5, 4), (3, 2), 60)


@pytest.fixture(scope="module")
def surface():
    tangents, lengths, knots = DATA
    return js.QISurface(spine(), tangents, lengths, 3, 2, *knots)


@pytest.fixture(scope="module")
def u_first():
    tangents, lengths, knots = DATA
    return js.QISurface(spine(), tangents, lengths, 3, 2, *knots, path="u first")


# --- its laws


def test_it_begins_at_the_initial_curve(surface, u_first):
    v = np.linspace(2, 5, 24)
    for shape in (surface, u_first):
        close(shape(np.full(24, 2.0), v), spine()(v), 1e-13)


def test_the_u_lines_have_constant_speed_and_the_blended_tangents(surface):
    rng = np.random.default_rng(2)
    tangents, lengths, knots = DATA
    u, v = rng.uniform(2, 5, (2, 24))
    slope = np.asarray(surface.derivative(u, v, (1, 0)))
    speed = BSpline(knots[1], lengths, 2)(v) / 3
    close(np.linalg.norm(slope, axis=1), speed, 1e-11)
    wanted = [
        reference.directions(reference.rows(tangents, knots[1], 2, t), knots[0], 3, np.array(s))
        for s, t in zip(u, v, strict=True)
    ]
    close(slope, speed[:, None] * np.array(wanted), 1e-11)


def test_a_grid_is_the_points(surface, u_first):
    u, v = np.linspace(2, 5, 6), np.linspace(2, 5, 4)
    pairs = [grid.ravel() for grid in np.meshgrid(u, v, indexing="ij")]
    for shape in (surface, u_first):
        grid = np.asarray(shape.grid(u, v))
        assert grid.shape == (6, 4, 3)
        close(grid.reshape(-1, 3), shape(*pairs), 1e-13)


def test_u_first_is_the_first_edge_moved_along_the_spine(u_first):
    tangents, lengths, knots = DATA
    u, v = places(np.random.default_rng(3))
    edge = reference.curve(np.zeros(3), lengths[0], tangents[:, 0], knots[0], 3, u)
    close(u_first(u, v), reference.curve(*SPINE, u=v) + edge, 1e-13)


def test_the_paths_agree_on_translation_surfaces_alone(surface, u_first):
    tangents, _, knots = DATA
    same, lengths = np.repeat(tangents[:, :1], 4, axis=1), np.full(4, 1.7)
    u, v = places(np.random.default_rng(4))
    angles = surface.angle_u, surface.angle_v  # of the surface: no new programs
    build = lambda path: js.QISurface(spine(), same, lengths, 3, 2, *knots, path=path, angles=angles)
    close(build("spine first")(u, v), build("u first")(u, v), 1e-12)
    assert np.max(np.abs(surface(u, v) - u_first(u, v))) > 0.1


def test_rotating_and_scaling_the_data_rotates_and_scales_the_surface(surface):
    tangents, lengths, knots = DATA
    start, length, own, spine_knots, degree = SPINE
    u, v = places(np.random.default_rng(5))
    turn = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))[0]
    turn = turn * np.linalg.det(turn)
    moved = js.QISurface(
        js.QICurve(turn @ start * 7, 7 * length, own @ turn.T, degree, spine_knots),
        tangents @ turn.T,
        7 * lengths,
        3,
        2,
        *knots,
    )
    close(moved(u, v) / 7, np.asarray(surface(u, v)) @ turn.T, 1e-13)


# --- derivatives by the data


def test_forward_reverse_and_differences_of_the_reference_agree():
    """On bent rows, on rows of which some are parallel, and on a flat surface."""
    rng = np.random.default_rng(7)
    degrees = (2, 1)
    tangents, lengths, knots = random_data(rng, (5, 3), degrees, 60)
    parallel = tangents.copy()
    parallel[1:4, :2] = tangents[1, 1]
    u, v = rng.uniform(2.1, 4.9, (2, 6))

    def value(points):
        return (points**2 / 8).mean() + points[..., 0].mean() * points[..., 1].mean()

    def own(data):
        tangents, lengths, *knots = data
        return value(js.QISurface(spine(), tangents, lengths, *degrees, *knots)(u, v))

    def oracle(data):
        tangents, lengths, *knots = data
        return value(reference.surface(SPINE, tangents, lengths, tuple(knots), degrees, u, v))

    @jax.jit
    def slopes(data, along):
        pulled = jax.grad(own)(data)
        return jax.jvp(own, (data,), (along,))[1], sum(jnp.sum(g * a) for g, a in zip(pulled, along, strict=True)), pulled

    for rows in (tangents, parallel, np.ones((5, 3, 3))):
        data = (rows, lengths, *knots)
        for i, piece in enumerate(data):
            along = [np.zeros_like(other) for other in data]
            along[i] = rng.normal(size=piece.shape)
            if i > 1:  # equal knots stay equal; the ends of v are those of the spine
                along[i] = along[i][np.unique(piece, return_inverse=True)[1]]
                along[i] = along[i] * ((piece > 2) & (piece < 5)) if i == 3 else along[i]
            moved = lambda h, data=data, along=along: oracle([x + h * a for x, a in zip(data, along, strict=True)])
            h = 5e-4
            difference = (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h)
            pushed, pulled, gradient = slopes(data, tuple(along))
            close(pushed, pulled, 1e-12)
            close(pulled, difference, 1e-9, f"{i}")
            assert all(np.all(np.isfinite(g)) for g in gradient)


# --- transformations


def test_construction_under_jit_and_vmap_is_as_accurate(surface):
    _, lengths, knots = DATA
    rng, traces = np.random.default_rng(8), []
    u, v = places(rng, 12)

    @jax.jit
    def points(tangents, lengths):
        traces.append(None)
        return jax.vmap(lambda t: js.QISurface(spine(), t, lengths, 3, 2, *knots)(u, v))(tangents)

    for scale in (1.0, 2.0):
        nets = np.stack([net(rng, 5, 4, 60) for _ in range(2)])
        found = points(nets, scale * lengths)
        for own, tangents in zip(found, nets, strict=True):
            close(own / scale, reference.surface(SPINE, tangents, scale * lengths, knots, (3, 2), u, v) / scale, 3e-12)
    assert len(traces) == 1


def test_single_precision_is_met():
    tangents, lengths, knots = DATA
    u, v = places(np.random.default_rng(9), 12)
    found = js.QISurface(spine(np.float32), tangents, lengths, 3, 2, *knots)(u, v)
    assert found.dtype == jnp.float32
    close(found, reference.surface(SPINE, tangents, lengths, knots, (3, 2), u, v), 2e-3)


# --- refusals


def at_angle(degrees, height=0.0):
    return [np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), height]


def build(**changes):
    arguments = {
        "tangents": np.ones((2, 2, 3)),
        "lengths": [1.0, 1.0],
        "degree_u": 1,
        "degree_v": 1,
        "knots_v": [2, 2, 5, 5],
    }
    arguments |= changes
    return js.QISurface(arguments.pop("spine", spine()), **arguments)


OPPOSITE = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 1, 0], [0, -1, 0.0]]])
ZERO = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0.0]]])
# rows turn from 0° to 170° and from −85° to −105°, opposite amid, and the second one a little later
BLENDED = np.array([[at_angle(0), at_angle(170)], [at_angle(-85 - 190 / 16), at_angle(-105 - 190 / 16)]])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: build(lengths=[1.0, 0.0]), r"`lengths` must be finite and positive, but lengths\[1\] is 0"),
        (lambda: build(lengths=[-2.0, 1.0]), r"`lengths` must be finite and positive, but lengths\[0\] is -2"),
        (lambda: build(lengths=[1.0, np.nan]), r"lengths\[1\] is nan"),
        (lambda: build(lengths=[1.0]), r"`lengths` must have shape \(2,\), one for each column of `tangents`, got \(1,\)"),
        (lambda: build(knots_v=[0, 0, 1, 1]), r"`spine` must have the domain of v, \[0, 1\], got \[2, 5\]"),
        (lambda: build(path="v first"), "`path` must be 'spine first' or 'u first', got 'v first'"),
        (lambda: build(tangents=np.ones((2, 3))), r"`tangents` must have shape \(n, m, 3\), got \(2, 3\)"),
        (lambda: build(tangents=np.ones((2, 2, 2))), r"`tangents` must have shape \(n, m, 3\), got \(2, 2, 2\)"),
        (lambda: build(tangents=np.ones((1, 2, 3))), "`n` must be at least degree . 1 = 2, got 1"),
        (lambda: build(tangents=np.ones((3, 2, 3)), knots_u=[0, 0, 1, 1]), "`knots_u` must have 5 knots"),
        (lambda: build(knots_v=[2, 2, 3, 5, 5]), "`knots_v` must have 4 knots"),
        (lambda: build(tangents=ZERO), r"not zero, but tangents\[1, 0\] is \[0.0, 0.0, 0.0\]"),
        (lambda: build(tangents=ZERO * np.nan), r"`tangents` must be finite"),
        (lambda: build(tangents=OPPOSITE), r"tangents\[0, 1\] and tangents\[1, 1\] are 180.0+° apart"),
        (lambda: build(tangents=BLENDED), "`tangents` become opposite between rows 0 and 1, near v = "),
        (lambda: build(tolerance=-1.0), "`tolerance` must be a number > 0, got -1"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(js.InputError, match=message):
        call()


def test_opposite_neighbours_along_v_are_named_by_their_place_in_the_net():
    with pytest.raises(js.InputError, match="opposite"):
        build(tangents=np.swapaxes(OPPOSITE, 0, 1))
