"""Known members of many families, disturbed starts and noisy points to recover them from, and how well that can be done."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from fit_cases import KNOTS

import jaxsurf as js
from jaxsurf.basis import periodic_knots
from jaxsurf.curve import AbstractCurve

NOISE = 0.01  # a thousandth of the size, which is about 10 for all


class Truth(NamedTuple):
    """A member of a family, how many points it is recovered from, its free arrays, and how far they are off at the start."""

    member: Any
    count: int
    free: Callable[[Any], Any]
    depth: float

    def start(self, rng: np.random.Generator) -> Any:
        """The member with all that is free disturbed."""
        moved = lambda x: x + self.depth * jnp.asarray(rng.normal(size=x.shape))
        return eqx.tree_at(self.free, self.member, replace_fn=moved)

    def dented(self, rng: np.random.Generator, depth: float) -> Any:
        """The member with its control points moved up and down only."""
        net = np.array(self.member.control_points)
        net[..., 2] += depth * rng.normal(size=net.shape[:-1])
        return eqx.tree_at(lambda s: s.control_points, self.member, jnp.asarray(net))

    def parameters(self, rng: np.random.Generator, margin: float = 0.0, count: int | None = None) -> tuple[np.ndarray, ...]:
        """Random ones, `margin` of the domain free at each border."""
        domain = self.member.domain
        ends = [domain] if isinstance(self.member, AbstractCurve) else domain
        draw = lambda a, b: float(a) + float(b - a) * rng.uniform(margin, 1 - margin, count or self.count)
        return tuple(draw(*map(np.asarray, pair)) for pair in ends)

    def measured(self, rng: np.random.Generator) -> np.ndarray:
        """Points at random parameters, with noise in all directions."""
        exact = np.asarray(self.member(*self.parameters(rng)))
        return exact + NOISE * rng.normal(size=exact.shape)

    def seen(self) -> float:
        """How many free numbers the points determine, where the start says already where the truth is to within `depth`.

        With singular values s of the movements of the points across the shape, by free numbers in units of their depth, it
        is Σ s² / (s² + σ²): of the best linear estimator that knows this much, σ √(seen / N) is the rms error.
        """
        at = tuple(map(jnp.asarray, self.parameters(np.random.default_rng(0))))
        moved = lambda free: eqx.tree_at(self.free, self.member, free)(*at)
        jacobians = jax.tree.leaves(jax.jit(jax.jacfwd(moved))(self.free(self.member)))
        moves = np.concatenate([np.asarray(j).reshape(self.count, 3, -1) for j in jacobians], axis=-1)
        derivatives = jax.jit(jax.vmap(jax.jacfwd(lambda t: self.member.point(*t))))(jnp.stack(at, axis=-1))
        along = np.linalg.qr(np.asarray(derivatives))[0]
        across = moves - np.einsum("nik,njk,njp->nip", along, along, moves)
        s = self.depth * np.linalg.svd(across.reshape(3 * self.count, -1), compute_uv=False)
        return float(np.sum(s**2 / (s**2 + NOISE**2)))


def _points(shape: Any) -> Any:
    return shape.control_points


def _net(side: int, roughness: float) -> np.ndarray:
    """Control points of a bent sheet, off the origin, 10 × 6."""
    u, v = np.meshgrid(np.linspace(20, 30, side), np.linspace(-8, -2, side), indexing="ij")
    height = 5 - 0.06 * (u - 25) ** 2 + roughness * np.random.default_rng(3).normal(size=u.shape)
    return np.stack([u, v, height], -1)


def _spline(net: Any) -> js.BSplineCurve:
    return js.BSplineCurve(np.array(net, float), js.clamped_knots(len(net), 3), 3)


def _net_6x6() -> Truth:
    return Truth(js.BSplineSurface(_net(6, 0.2), KNOTS, js.clamped_knots(6, 3), 3, 3), 720, _points, 0.1)


def _net_8x8() -> Truth:
    return Truth(js.BSplineSurface(_net(8, 0.1), js.clamped_knots(8, 3), js.clamped_knots(8, 3), 3, 3), 1280, _points, 0.1)


def _nurbs() -> Truth:
    weights = np.random.default_rng(5).uniform(0.7, 1.4, size=(6, 6))
    surface = js.NURBSSurface(_net(6, 0.2), weights, KNOTS, js.clamped_knots(6, 3), 3, 3)
    return Truth(surface, 720, lambda s: (s.control_points, s.weights), 0.1)


def _curve() -> Truth:
    net = np.stack([np.linspace(0, 10, 10), *np.random.default_rng(7).normal(size=(2, 10))], -1)
    return Truth(_spline(net), 400, _points, 0.2)


def _closed_curve() -> Truth:
    angle = 2 * np.pi * np.arange(10) / 10
    net = np.stack([5 * np.cos(angle), 4 * np.sin(angle), np.cos(2 * angle)], -1) + [7, -3, 4]
    return Truth(js.BSplineCurve(net, periodic_knots(10, 3), 3, periodic=True), 400, _points, 0.2)


def _qi_curve() -> Truth:
    turned = np.array([1.0, 0, 0]) + 0.5 * np.random.default_rng(2).normal(size=(6, 3))
    member = js.QICurve([1.0, 2, 3], 10.0, turned, 3).replace(angle=2.5)
    return Truth(member, 320, lambda s: (s.tangents, s.length, s.start), 0.1)


def _qi_surface() -> Truth:
    def leaning(a: float, b: float, tilt: float) -> np.ndarray:
        a, b, tilt = np.radians([a, b, tilt])
        return np.array([np.cos(a) * np.cos(b), np.sin(b) + np.sin(tilt), np.sin(a)])

    rows = np.array([[leaning(a, b, t) for b, t in ((4, 0), (0, 5), (-6, 12))] for a in (35, 2, -30)])
    spine = np.array([[0, np.cos(np.radians(a)), np.sin(np.radians(a))] for a in (20, 0, -25)])
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    start = js.QICurve([20.0, -7, 3], 6.0, spine @ turn, 2).replace(angle=2.5)
    member = js.QISurface(start, rows @ turn, [9.0, 9.7, 8.7], 2, 2).replace(angles=(2.5, 2.5))
    return Truth(member, 620, lambda s: (s.tangents, s.lengths, s.spine.tangents, s.spine.length, s.spine.start), 0.05)


def _two_guides() -> Truth:
    guides = [
        _spline([[10, 0, 5], [13, 0, 6.5], [15, 2, 7], [18, 3, 5], [20, 3, 4]]),
        _spline([[10, 4, 5], [12.5, 4.5, 6.5], [15, 6, 7.5], [18, 7, 6], [20, 6, 3]]),
    ]
    member = js.sweep(_spline([[10, 0, 5], [10, 1, 7], [10.3, 3, 6.2], [10, 4, 5]]), guides)
    return Truth(member, 720, lambda s: [c.control_points for c in (*s.guides.curves, *s.characters)], 0.1)


def _plane() -> Truth:
    return Truth(js.Plane([1.0, 2, 3], [1.0, 1, 2], 10.0), 200, lambda s: (s.origin, s.normal), 0.1)


def _sphere() -> Truth:
    return Truth(js.Sphere([7.0, -3, 4], 5.0), 200, lambda s: (s.center, s.radius), 0.3)


def _cylinder() -> Truth:
    member = js.Cylinder([7.0, -3, 4], [1.0, 2, 2], 3.0, 9.0)
    return Truth(member, 250, lambda s: (s.center, s.axis, s.radius), 0.1)


def _torus() -> Truth:
    member = js.Torus([7.0, -3, 4], [1.0, 2, 2], 4.0, 1.5)
    return Truth(member, 350, lambda s: (s.center, s.axis, s.major_radius, s.minor_radius), 0.1)


TRUTHS = {
    "B-spline surface, 6 × 6": _net_6x6,
    "B-spline surface, 8 × 8": _net_8x8,
    "NURBS surface, free weights": _nurbs,
    "B-spline curve": _curve,
    "closed B-spline curve": _closed_curve,
    "QI curve": _qi_curve,
    "QI surface": _qi_surface,
    "sweep along two guides": _two_guides,
    "plane": _plane,
    "sphere": _sphere,
    "cylinder": _cylinder,
    "torus": _torus,
}
