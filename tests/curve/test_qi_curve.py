"""Quaternion integral curves against a second implementation, closed forms, clothoids and helices."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pyclothoids
import pytest
import qi_reference as reference
from qi_reference import clamped, uneven, uniform, walk
from scipy.optimize import brentq

import jaxsurf as js
from jaxsurf.quaternion import rotate

KINDS = {
    "clamped": lambda rng, n, degree: clamped(n, degree),
    "uniform": lambda rng, n, degree: uniform(n, degree),
    "uneven": lambda rng, n, degree: uneven(rng, n, degree),
    "uneven, not clamped": lambda rng, n, degree: uneven(rng, n, degree, full=False),
}
START = np.array([0.7, -0.3, 0.4])
FULL = np.array([2.0] * 4 + [2.7, 3.1, 3.1, 4.4] + [5.0] * 4)  # degree 3, 8 tangents
OPEN = np.array([0.0, 0.7, 1.1, 2.0, 2.6, 3.0, 3.1, 4.4, 5.0, 5.5, 5.9, 6.5])


def close(found, wanted, atol, what=""):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=atol, err_msg=what)


def places(rng, knots):
    """Thirty parameters: knots, ends and places between."""
    return np.resize(np.concatenate([rng.uniform(2, 5, 12), np.unique(np.clip(knots, 2, 5))]), 30)


def rotation(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


# --- the points


def test_the_reference_is_right_to_more_digits_than_it_is_used_for():
    """Cubic Bézier shares and Rodrigues' formula in 30 digits."""
    mpmath.mp.dps = 30
    tangents = reference.unit(walk(np.random.default_rng(0), 4, 170))
    knots = clamped(4, 3)

    def direction(t):
        a, b, c = 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3
        q = [mpmath.mpf(x) for x in tangents[0]]
        for share, one, other in zip((a + b + c, b + c, c), tangents, tangents[1:], strict=False):
            one, other = (mpmath.matrix([mpmath.mpf(x) for x in v]) for v in (one, other))
            axis = [one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2] for i in range(3)]
            sine = mpmath.sqrt(sum(x * x for x in axis))
            angle = share * mpmath.atan2(sine, sum(one[i] * other[i] for i in range(3)))
            k = [x / sine for x in axis]
            along = sum(k[i] * q[i] for i in range(3)) * (1 - mpmath.cos(angle))
            cross = [k[i - 2] * q[i - 1] - k[i - 1] * q[i - 2] for i in range(3)]
            q = [mpmath.cos(angle) * q[i] + mpmath.sin(angle) * cross[i] + along * k[i] for i in range(3)]
        return q

    for end in (0.37, 1.0):
        wanted = np.array([mpmath.quad(lambda t, i=i: direction(t)[i], [0, end / 2, end]) for i in range(3)], float)
        close(reference.integral(tangents, knots, 3, 2 + 3 * end), wanted, 2e-15)


@pytest.mark.parametrize(
    "degree, count, angle",
    [
        (1, 2, 170),
        (1, 12, 60),
        (2, 3, 170),
        (2, 12, 90),
        (3, 4, 170),
        (3, 12, 60),
        (3, 7, 170),
        (4, 9, 120),
        (5, 6, 90),
        (5, 12, 170),
    ],
)
def test_points_are_those_of_the_reference(degree, count, angle):
    rng = np.random.default_rng(100 * degree + count)
    for kind, make in KINDS.items():
        knots, tangents, length = make(rng, count, degree), walk(rng, count, angle), rng.uniform(0.5, 20)
        u = places(rng, knots)
        found = js.QICurve(START, length, tangents, degree, knots)(u)
        wanted = reference.curve(START, length, tangents, knots, degree, u)
        close(found / length, wanted / length, 1e-13, kind)


def test_degree_one_is_circular_arcs():
    """Of span lengths h and turning angles φ: r = l h / φ; the ends of the arcs follow from chords."""
    rng = np.random.default_rng(1)
    for angle in (70, 170):
        tangents, length = reference.unit(walk(rng, 7, angle)), 3.3
        knots = uneven(rng, 7, 1)
        curve = js.QICurve(START, length, tangents, 1, knots)
        at, spans = np.array(START), np.diff(knots[1:-1])
        share = np.array([0.0, 0.3, 0.7, 1.0])
        for a, b, left, span in zip(tangents, tangents[1:], knots[1:], spans, strict=False):
            phi = math.acos(a @ b)
            normal = reference.unit(b - (a @ b) * a)
            radius = length * span / 3 / phi
            turned = phi * share[:, None]
            wanted = at + radius * (np.sin(turned) * a + (1 - np.cos(turned)) * normal)
            close(curve(left + share * span) / length, wanted / length, 2e-15)
            at = wanted[-1]


def test_two_equal_tangents_more_are_a_line_and_a_half_turn_is_a_half_circle():
    close(js.QICurve(START, 2.0, np.ones((5, 3)), 3)(0.25), START + 0.5 / math.sqrt(3), 1e-15)
    half = js.QICurve([0.0, 0, 0], math.pi, [[1, 0, 0], [0, 1, 0], [-1.0, 0, 0]], 1)
    close(half(0.5), [1, 1, 0], 1e-15)
    close(half(1), [0, 2, 0], 1e-15)


def test_degree_two_in_a_plane_is_the_clothoid_of_a_clothoid_library():
    """The heading is quadratic in arc length; control tangents point along its polar form."""
    rng = np.random.default_rng(2)
    spans_needed, s = [], np.linspace(0, 1, 21)
    for _ in range(100):
        (x0, y0, x1, y1), (first, last) = rng.uniform(-3, 3, 4), rng.uniform(-math.pi, math.pi, 2)
        clothoid = pyclothoids.Clothoid.G1Hermite(x0, y0, first, x1, y1, last)
        length = clothoid.length
        a, b = clothoid.KappaStart * length, clothoid.dk * length**2
        for spans in (1, 4):
            knots = np.concatenate([[0, 0], np.linspace(0, 1, spans + 1), [1, 1]])
            left, right = knots[1:-2], knots[2:-1]
            heading = first + a * (left + right) / 2 + b * left * right / 2
            if np.max(np.abs(np.diff(heading))) < math.radians(175):
                break
        spans_needed.append(spans)
        tangents = np.stack([np.cos(heading), np.sin(heading), np.zeros(spans + 2)], axis=-1)
        curve = js.QICurve([x0, y0, 0], length, tangents, 2, knots, angle=math.pi)
        wanted = np.array([[clothoid.X(t * length), clothoid.Y(t * length), 0] for t in s])
        close(curve(s) / length, wanted / length, 1e-13)
        close(curve(1)[:2] / length, np.array([x1, y1]) / length, 1e-13)
    assert 20 < spans_needed.count(1) < 80


def test_helices_are_approached_with_the_fourth_order_at_least():
    """Control tangents on a small circle and even knots: a screw moves the curve on itself, so it meets a helix at knots.

    Its latitude is found such that the screw has the helix' pitch.
    """
    climb, errors, counts = math.radians(30), [], np.array([5, 9, 17])
    for turn in counts:
        steps = np.arange(turn + 3) - 1
        knots = np.arange(-3, turn + 4) / turn

        def tangents(latitude, angle=2 * math.pi * steps / turn):
            level = np.full_like(angle, math.sin(latitude))
            return np.stack([*(math.cos(latitude) * np.array([np.cos(angle), np.sin(angle)])), level], axis=-1)

        def slope(latitude, knots=knots, turn=turn, tangents=tangents):
            step = reference.integral(tangents(latitude), knots, 3, 1 / turn)
            wide = math.sin(math.pi / turn) * math.cos(climb) / math.pi
            return step[2] * wide - math.hypot(*step[:2]) * math.sin(climb) / turn

        latitude = brentq(slope, climb - 0.3, climb + 0.1, xtol=1e-14)
        rise = reference.integral(tangents(latitude), knots, 3, 1 / turn)[2]
        s = np.linspace(0, 1, 201)
        wanted = np.stack([np.sin(2 * math.pi * s), 1 - np.cos(2 * math.pi * s)]) * math.cos(climb) / (2 * math.pi)
        wanted = np.stack([*wanted, s * math.sin(climb)], axis=-1)
        curve = js.QICurve([0.0, 0, 0], math.sin(climb) / turn / rise, tangents(latitude), 3, knots)
        errors.append(np.max(np.linalg.norm(curve(s) - wanted, axis=1)))
    orders = np.diff(np.log(errors)) / -np.diff(np.log(counts))
    assert np.all(orders > 4) and errors[0] < 8e-4 and errors[1] < 1.2e-5 and errors[2] < 1e-6, (orders, errors)


# --- its laws


@pytest.fixture(scope="module")
def shape():
    return js.QICurve(START, 3.3, walk(np.random.default_rng(3), 8, 150), 3, FULL)


def test_the_speed_is_constant_and_the_tangent_the_blended_one(shape):
    u = np.linspace(2, 5, 31)
    slope = shape.derivative(u)
    close(np.linalg.norm(slope, axis=1), 1.1, 1e-14)
    close(slope, 1.1 * reference.directions(np.asarray(shape.tangents), FULL, 3, u), 1e-14)
    first, last = np.asarray(shape.tangents)[[0, -1]]
    close(shape.derivative([2, 5]), 1.1 * np.array([first, last]), 1e-14)
    close(js.arc_length(shape), 3.3, 1e-12)
    polygon = np.diff(shape(np.linspace(2.4, 3.9, 2001)), axis=0)
    close(np.sum(np.linalg.norm(polygon, axis=1)), 1.1 * 1.5, 1e-5)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_curvature_and_torsion_are_the_closed_form(degree):
    rng = np.random.default_rng(4)
    knots = uneven(rng, 9, degree)
    tangents, length = walk(rng, 9, 110), 2.2
    curve = js.QICurve(START, length, tangents, degree, knots)
    edges = np.unique(knots)
    u = np.resize(np.concatenate([edges[:-1] + share * np.diff(edges) for share in (0.13, 0.62)]), 16)
    curvature, torsion = np.array([reference.curvature_and_torsion(length, tangents, knots, degree, t) for t in u]).T
    ours = {"closed form": (curve.curvature(u), curve.torsion(u))}
    if degree == 2:
        ours["derivatives"] = js.curve_curvature(curve, u), js.torsion(curve, u)
    for kind, (bend, twist) in ours.items():
        np.testing.assert_allclose(bend, curvature, rtol=1e-11, atol=1e-11, err_msg=kind)
        np.testing.assert_allclose(twist, torsion, rtol=1e-10, atol=1e-10, err_msg=kind)


def test_derivatives_up_to_the_degree_are_continuous_and_the_next_one_jumps():
    curve = js.QICurve(START, 2.0, walk(np.random.default_rng(5), 6, 80), 2, clamped(6, 2))
    knot = float(curve.knots[3])
    for order, least, most in ((2, 0, 1e-7), (3, 1e-2, 1e2)):
        before, after = curve.derivative(np.array([knot - 1e-10, knot]), order)
        assert least <= float(jnp.max(jnp.abs(before - after))) < most


def test_rotating_and_scaling_the_data_rotates_and_scales_the_curve(shape):
    turn, u = rotation(np.random.default_rng(6)), np.linspace(2, 5, 13)
    turned = js.QICurve(turn @ START, shape.length, shape.tangents @ turn.T, 3, FULL)
    close(turned(u), shape(u) @ turn.T, 1e-14)
    longer = js.QICurve(START, 7 * shape.length, shape.tangents, 3, FULL)
    at = np.asarray(shape(u))
    close(longer(u), START + 7 * (at - START), 5e-14)
    # the lengths of tangents are of no account, and the curve backwards is that of the tangents backwards
    stretched = js.QICurve(START, shape.length, np.asarray(shape.tangents) * np.arange(1.0, 9.0)[:, None], 3, FULL)
    close(stretched(u), shape(u), 1e-14)
    mirrored = js.QICurve(START, shape.length, np.asarray(shape.tangents) * np.array([1.0, 1, -1]), 3, FULL)
    close(mirrored(u), START + (at - START) * np.array([1.0, 1, -1]), 1e-14)


def test_q_and_minus_q_give_one_curve(shape):
    tangents = np.asarray(shape.tangents)
    q = reference.quaternions(tangents, FULL, 3, np.array([2.3, 4.1]))
    v0 = np.array([[0.0, 1, 0, 0]] * 2)
    for sign in (1, -1):
        sandwich = reference.product(reference.product(sign * q, v0), sign * q * np.array([1.0, -1, -1, -1]))
        close(shape.derivative([2.3, 4.1]) / 1.1, sandwich[:, 1:], 1e-14)
        close(rotate(jnp.asarray(sign * q), jnp.asarray(v0[:, 1:])), sandwich[:, 1:], 1e-14)


# --- derivatives by the data


def value(start, length, tangents, knots, u, degree=3):
    points = js.QICurve(start, length, tangents, degree, knots, angle=math.pi)(u)
    return jnp.mean(jnp.sin(points)) + jnp.mean(points**2) / 8


def independent(start, length, tangents, knots, u, degree=3):
    points = reference.curve(start, length, tangents, knots, degree, u)
    return np.mean(np.sin(points)) + np.mean(points**2) / 8


@jax.jit
def _slopes(data, along, u):
    at = lambda *d: value(*d, u=u)
    pulled = jax.grad(at, argnums=(0, 1, 2, 3))(*data)
    return jax.jvp(at, data, along)[1], sum(jnp.sum(g * a) for g, a in zip(pulled, along, strict=True))


@jax.jit
def _second(data, along, u):
    """The gradient of a curve of degree 2, and its change along a direction."""
    return jax.jvp(jax.grad(lambda d: value(*d, u=u, degree=2)), (data,), (along,))


def difference(f, h):
    """Of the fourth order, of values on one side only: knots that are equal part, but must not change places."""
    values = [np.asarray(f(k * h)) for k in range(5)]
    return sum(c * value for c, value in zip((-25, 48, -36, 16, -3), values, strict=True)) / (12 * h)


def _data(degree):
    rng = np.random.default_rng(7)
    bent = walk(rng, 8, 150)
    parallel = bent.copy()
    parallel[2:6] = bent[2] * np.array([[1.0], [2.0], [0.3], [1.0]])
    ones = np.ones((8, 3))
    ends, triple = ([2.0] * (degree + 1), [5.0] * (degree + 1)), [3.1] * degree
    full = np.concatenate([ends[0], triple, np.linspace(3.1, 5, 9 - 2 * degree)[1:-1], ends[1]])
    double = np.concatenate([ends[0], [3.1, 3.1], np.linspace(3.1, 5, 7 - degree)[1:-1], ends[1]])
    even = uniform(8, degree)
    return {
        "bent": (bent, double),
        "bent, not clamped": (bent, even),
        "parallel neighbours": (parallel, double),
        "straight": (ones, double),
        "straight, not clamped": (ones, even),
        "full inner knot": (parallel, full),
    }


def _directions(rng, tangents, knots):
    """One for each piece of data; equal knots part in ascending order."""
    zero = [np.zeros(3), np.zeros(()), np.zeros_like(tangents), np.zeros_like(knots)]
    for i, piece in enumerate(zero):
        along = rng.normal(size=piece.shape)
        if i == 3:
            along = along[np.lexsort((along, knots))]
        yield (*zero[:i], along, *zero[i + 1 :])


NAMES = list(_data(3))
AMID = np.array([2.1, 2.35, 2.9, 3.3, 3.7, 4.2, 4.7])


@pytest.mark.parametrize("name", NAMES)
def test_forward_reverse_and_differences_of_the_reference_agree(name):
    rng = np.random.default_rng(8)
    data = (START, np.array(3.3), *_data(3)[name])
    for i, along in enumerate(_directions(rng, *data[2:])):
        moved = lambda h, along=along: independent(*(x + h * a for x, a in zip(data, along, strict=True)), u=AMID)
        pushed, pulled = _slopes(data, along, AMID)
        close(pushed, pulled, 1e-13)
        close(pulled, difference(moved, 3e-4), 1e-9, f"{name}, {i}")


@pytest.mark.parametrize("name", NAMES)
def test_second_derivatives_are_slopes_of_the_first(name):
    """Along a direction that leaves equal knots equal."""
    rng = np.random.default_rng(9)
    data = (START, np.array(3.3), *_data(2)[name])
    along = [np.sum(a, axis=0) for a in zip(*_directions(rng, *data[2:]), strict=True)]
    which = np.unique(data[3], return_inverse=True)[1]
    along[3] = along[3][which]
    along = tuple(along)

    def numbers(derivative):
        """One after the other, equal knots together."""
        return np.concatenate([*(np.ravel(d) for d in derivative[:3]), np.bincount(which, derivative[3])])

    gradient, change = _second(data, along, AMID)
    at = lambda h: tuple(x + h * a for x, a in zip(data, along, strict=True))
    close(numbers(change), difference(lambda h: numbers(_second(at(h), along, AMID)[0]), 3e-4), 1e-6)
    slope = sum(np.sum(g * a) for g, a in zip(gradient, along, strict=True))
    close(slope, difference(lambda h: independent(*at(h), u=AMID, degree=2), 3e-4), 1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_finite_at_ends_and_knots(name):
    for degree, derivatives in ((3, _slopes), (2, _second)):
        data = (START, np.array(3.3), *_data(degree)[name])
        u = np.resize(np.unique(np.clip(data[3], 2, 5)), 7)
        for leaf in jax.tree.leaves(derivatives(data, data, u)):
            assert np.all(np.isfinite(leaf))


# --- transformations


def test_construction_under_jit_vmap_and_grad_is_as_accurate(shape):
    rng = np.random.default_rng(10)
    traces = []

    def points(tangents, length, u):
        traces.append(None)
        return js.QICurve(START, length, tangents, 3, FULL)(u)

    u = np.linspace(2, 5, 17)
    jitted = jax.jit(points)
    several = np.stack([walk(rng, 8, 90) for _ in range(3)])
    wanted = np.stack([reference.curve(START, 1 + i, t, FULL, 3, u) for i, t in enumerate(several)])
    found = np.stack([jitted(t, 1.0 + i, u) for i, t in enumerate(several)])
    assert len(traces) == 1
    concrete = np.stack([js.QICurve(START, 1 + i, t, 3, FULL)(u) for i, t in enumerate(several)])
    lengths = np.array([1.0, 2, 3])
    scale = lengths[:, None, None]
    close(found / scale, wanted / scale, 1e-13)
    close(concrete / scale, wanted / scale, 1e-13)
    close(jax.vmap(points, (0, 0, None))(several, lengths, u), found, 1e-14)
    close(jax.jit(jax.grad(lambda l: jnp.sum(points(several[0], l, u))))(1.0), np.sum(wanted[0] - START), 1e-12)


def test_the_curve_itself_under_jit_is_compiled_once():
    rng, traces = np.random.default_rng(11), []

    @eqx.filter_jit
    def point(curve, u):
        traces.append(None)
        return curve(u)

    for _ in range(3):
        tangents = walk(rng, 8, 80)
        curve = js.QICurve(START, 2.0, tangents, 3, OPEN)
        close(point(curve, 3.3), reference.curve(START, 2.0, tangents, OPEN, 3, np.array([3.3]))[0], 1e-13)
    assert len(traces) == 1


def test_single_precision_is_met():
    rng = np.random.default_rng(12)
    for degree, angle in ((3, 170),):
        tangents, knots = walk(rng, 8, angle).astype(np.float32), clamped(8, degree).astype(np.float32)
        curve = js.QICurve(START.astype(np.float32), 2, tangents, degree, knots)
        u = np.linspace(2, 5, 17, dtype=np.float32)
        wanted = reference.curve(START, 2, tangents.astype(float), knots.astype(float), degree, u.astype(float))
        assert curve(u).dtype == curve.derivative(u).dtype == jnp.float32
        close(curve(u), wanted, 2e-6)


# --- refusals

ZIGZAG = [[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -2], [1, 0, 0]]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: js.QICurve(START, 1, ZIGZAG), r"tangents\[2\] and tangents\[3\] are 180.0+° apart"),
        (lambda: js.QICurve(START, 1, [[1, 0, 0], [-1, 1e-8, 0]], 1), r"tangents\[0\] and tangents\[1\] are 17"),
        (
            lambda: js.QICurve(START, 1, [[1, 0, 0], [0, 0, 0], [0, 1, 0]], 1),
            r"not zero, but tangents\[1\] is \[0.0, 0.0, 0.0\]",
        ),
        (lambda: js.QICurve(START, 1, [[1, 0, 0], [0, np.nan, 0]], 1), r"`tangents` must be finite .* tangents\[1\]"),
        (lambda: js.QICurve(START, 1, [[np.inf, 0, 0], [0, 1, 0]], 1), r"`tangents` must be finite .* tangents\[0\]"),
        (lambda: js.QICurve(START, 1, np.ones((4, 2))), r"`tangents` must have shape \(n, 3\), got \(4, 2\)"),
        (lambda: js.QICurve(START, 1, np.ones(3)), r"`tangents` must have shape \(n, 3\), got \(3,\)"),
        (lambda: js.QICurve(START, 1, np.ones((1, 4, 3))), r"`tangents` must have shape \(n, 3\), got \(1, 4, 3\)"),
        (lambda: js.QICurve(START[:2], 1, np.ones((4, 3))), r"`start` must have shape \(3,\), got \(2,\)"),
        (lambda: js.QICurve([0, np.nan, 0], 1, np.ones((4, 3))), "`start` must be finite"),
        (lambda: js.QICurve(START, -1, np.ones((4, 3))), "`length` must be positive, got -1"),
        (lambda: js.QICurve(START, 0, np.ones((4, 3))), "`length` must be positive, got 0"),
        (lambda: js.QICurve(START, np.inf, np.ones((4, 3))), "`length` must be finite"),
        (lambda: js.QICurve(START, [1, 2], np.ones((4, 3))), r"`length` must be one number, got shape \(2,\)"),
        (lambda: js.QICurve(START, 1, np.ones((3, 3))), "`n` must be at least degree . 1 = 4, got 3"),
        (lambda: js.QICurve(START, 1, np.ones((4, 3)), 0), "`degree` must be at least 1, got 0"),
        (lambda: js.QICurve(START, 1, np.ones((3, 3)), 3, clamped(4, 3)), "`knots` must have 7 knots"),
        (lambda: js.QICurve(START, 1, np.ones((5, 3)), 3, FULL), "`knots` must have 9 knots"),
        (lambda: js.QICurve(START, 1, np.ones((8, 3)), 3, FULL[::-1]), "`knots` must ascend"),
        (lambda: js.QICurve(START, 1, np.ones((4, 3)), tolerance=0), "`tolerance` must be a number > 0, got 0"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call, message):
    with pytest.raises(js.InputError, match=message):
        call()


def test_a_bad_shape_is_refused_under_jit_too():
    with pytest.raises(js.InputError, match=r"`tangents` must have shape \(n, 3\)"):
        jax.jit(lambda t: js.QICurve(START, 1.0, t)(0.5))(np.ones((4, 2)))
