"""Guides and characters for sweeps, at awkward places, and a second implementation of the formulas in numpy and scipy."""

import math
from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline

import jaxsurf as js


def close(found, wanted, atol, what: object = ""):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=atol, err_msg=str(what))


def worst(found, wanted) -> float:
    return float(np.max(np.abs(np.asarray(found) - np.asarray(wanted))))


def clamped(count: int, degree: int, first: float = 0.0, last: float = 1.0) -> np.ndarray:
    """Uneven knots with full ends."""
    inner = np.linspace(0, 1, count - degree + 1)[1:-1] ** 1.2
    return first + (last - first) * np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])


# --- guides: pairs that run side by side in the direction of x, about 2 apart in y, off the origin

OFF = np.array([3.0, -2.0, 1.5])
KNOTS = {"first": clamped(6, 3, 2.0, 5.0), "second": clamped(5, 3, -1.0, 0.5)}


def spline_points(which: str) -> np.ndarray:
    rng = np.random.default_rng({"first": 3, "second": 4}[which])
    count = {"first": 6, "second": 5}[which]
    line = np.linspace(0, 5, count)[:, None] * np.array([1.0, 0, 0])
    return OFF + line + (0 if which == "first" else np.array([0.1, 2.0, 0.3])) + 0.35 * rng.normal(size=(count, 3))


def spline(which: str) -> js.BSplineCurve:
    return js.BSplineCurve(spline_points(which), KNOTS[which], 3)


def tangent_continuous(offset: np.ndarray) -> js.CompositeCurve:
    """A line of length π and a quarter of a circle of radius 2, as fast as the line, on [0, 2]."""
    corner = offset + np.array([math.pi, 0, 0])
    return js.CompositeCurve(
        [js.Line(offset, corner), js.Arc(corner + np.array([0, 0, 2.0]), corner, (0.0, -1, 0), math.pi / 2)]
    )


@cache
def guides(name: str) -> tuple[Any, ...]:
    """Two guides by name; kinds with one guide take the first one."""
    rng = np.random.default_rng(sum(name.encode()))
    if name == "B-splines":
        return spline("first"), spline("second")
    if name == "NURBS":
        weights = [rng.uniform(0.5, 2, n) for n in (6, 5)]
        return tuple(
            js.NURBSCurve(spline_points(which), w, KNOTS[which], 3)
            for which, w in zip(("first", "second"), weights, strict=True)
        )
    if name == "quaternion integrals":
        tangents = np.array([1.0, 0, 0]) + 0.4 * rng.normal(size=(2, 6, 3))
        first = js.QICurve(OFF, 5.0, tangents[0], 3, KNOTS["first"])
        return first, js.QICurve(OFF + np.array([0.2, 2, 0.1]), 4.5, tangents[1], 2)
    if name == "lines":
        return js.Line(OFF, OFF + np.array([4.0, 0.3, 0.2])), js.Line(
            OFF + np.array([0, 2.0, 0.4]), OFF + np.array([4, 1.0, -0.5])
        )
    if name == "arcs":
        first = js.Arc(OFF, OFF + np.array([0.0, 0.2, -1.5]), (0.1, -1, 0), 2.0)
        center = OFF + np.array([0.3, 2, 0.1])
        return first, js.Arc(center, center + np.array([0.1, 0, -2]), (-0.1, -1, 0.2), 1.7)
    if name == "line and arc":
        return tangent_continuous(OFF), tangent_continuous(OFF + np.array([0.3, 2.0, 0]))
    if name == "helices":
        start = np.array([0.0, 0.2, -1.0])
        first = js.Helix(OFF, (0.1, 1.0, 0.2), 1.7, 0.6, 0.9, start)
        return first, js.Helix(OFF + np.array([0, 1.5, 0.1]), (0.0, 1.0, 0.3), 1.2, 0.8, 0.8, start)
    raise KeyError(name)


GUIDES = ["B-splines", "NURBS", "quaternion integrals", "lines", "arcs", "line and arc", "helices"]
ONE_GUIDE = ["fixed", "guide", "minimal", "frenet", "up"]
STRAIGHT = ("lines", "line and arc")
UP = js.UpRotation((0.2, 0.4, 1.0))


# --- characters


def ends(curve: Any) -> np.ndarray:
    a, b = curve.domain
    return np.asarray(curve(np.array([float(a), float(b)])))


def across(start: np.ndarray, end: np.ndarray, kind: str) -> Any:
    """A generic character from one point to another, of a kind and domain of its own."""
    middle, rise = (start + end) / 2, np.array([0.3, 0.1, 0.8])
    if kind == "B-spline":
        points = np.array([start, 0.7 * start + 0.3 * middle + rise, middle - rise / 2, end + rise / 3, end])
        return js.BSplineCurve(points, clamped(5, 3, -3.0, 4.0), 3)
    if kind == "NURBS":
        points = np.array([start, middle + rise, end - rise / 4, end])
        return js.NURBSCurve(points, [1.0, 0.6, 1.4, 0.9], clamped(4, 2, 1.0, 2.0), 2)
    if kind == "arc":
        return js.Arc.through(start, middle + rise, end)
    raise KeyError(kind)


def characters(pair: tuple[Any, ...], count: int) -> list[Any]:
    """Characters for one or two guides; with one they start on it."""
    first, last = (np.array([ends(g)[i] for g in pair]) for i in (0, 1))
    if len(pair) == 1:
        away = np.array([0.2, 1.7, 0.4])
        first, last = (np.array([p[0], p[0] + away]) for p in (first, last))
    return [across(*first, "B-spline"), across(*last, "NURBS")][:count]


class Case(NamedTuple):
    """A sweep and what it was made of."""

    surface: Any
    characters: list[Any]
    guides: tuple[Any, ...]


def sweep(name: str, rotation: Any, *, two: bool = False, count: int = 1, **options: Any) -> Case:
    """A sweep of generic characters along the guides called `name`."""
    pair = guides(name) if two else guides(name)[:1]
    rotation = UP if rotation == "up" else rotation
    made = characters(pair, count)
    return Case(js.sweep(made, pair, rotation=rotation, **options), made, pair)


def grid_places(surface: Any, m: int = 7, k: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Parameters in both directions, the ends among them, exactly."""
    (a, b), (c, d) = ((float(x), float(y)) for x, y in surface.domain)
    u, v = a + (b - a) * np.linspace(0, 1, m), c + (d - c) * np.linspace(0, 1, k)
    u[-1], v[-1] = b, d
    return u, v


def carried(t: np.ndarray, domain: Any, other: Any) -> np.ndarray:
    """Parameters of one domain in another."""
    (a, b), (c, d) = ((float(x), float(y)) for x, y in (domain, other))
    share = (np.asarray(t) - a) / (b - a)
    return (1 - share) * c + share * d


@eqx.filter_jit
def _turns(surface: Any, v: Any, index: int) -> Any:
    prepared = surface.prepared()
    known = jax.tree.map(lambda leaf: leaf[index], prepared.starts.known)
    return jax.vmap(lambda t: surface.rotation.matrix(prepared.table, known, prepared.guides.at(t)))(v)


def turns(surface: Any, v: Any, index: int = 0) -> np.ndarray:
    """R(v) of a sweep for one of its characters, (n, 3, 3)."""
    return np.asarray(_turns(surface, np.asarray(v, surface.dtype), index))


# --- a second implementation: plain numpy, guides as functions of one parameter with two derivatives


class Path(NamedTuple):
    """A guide as position and derivatives, (k, 3) at once: orders 0, 1, 2."""

    at: Any
    domain: tuple[float, float]


def spline_path(which: str) -> Path:
    knots = KNOTS[which]
    whole = BSpline(knots, spline_points(which), 3)
    return Path(lambda v: [whole(v), whole(v, 1), whole(v, 2)], (knots[0], knots[-1]))


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.sqrt(np.sum(a * a, axis=-1, keepdims=True))


def minimal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest rotation from a to b, unit: I + K + K² / (1 + ⟨a, b⟩)."""
    x, y, z = np.cross(a, b)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + k + k @ k / (1 + a @ b)


class Reference:
    """S(u, v) from the formulas of section 5, for one or two guides and characters given as functions of a share of u."""

    def __init__(self, paths, characters, rotation, scale=True, blend=lambda t: t * t * (3 - 2 * t), up=(0.2, 0.4, 1.0)):
        self.paths, self.characters, self.rotation, self.scale, self.blend = paths, characters, rotation, scale, blend
        self.up = unit(np.array(up))

    def jets(self, share):
        """Position, first and second derivative by the common parameter of all guides."""
        first = self.paths[0].domain
        rows = []
        for path in self.paths:
            rate = (path.domain[1] - path.domain[0]) / (first[1] - first[0])
            v = path.domain[0] + share * (path.domain[1] - path.domain[0])
            rows.append([x * rate**k for k, x in enumerate(path.at(v))])
        return rows

    def matrix(self, share, start):
        """R with scale from share `start` to `share`."""
        here, there = self.jets(share), self.jets(start)
        if len(self.paths) == 1:
            return self.turn(here, there)
        chords = [h[1][0] - h[0][0] for h in (here, there)]
        ratio = np.linalg.norm(chords[0]) / np.linalg.norm(chords[1])
        turn = self.turn(here, there)
        if self.scale == "chord":
            e = unit(chords[1])
            return turn @ (np.eye(3) + (ratio - 1) * np.outer(e, e))
        return ratio * turn if self.scale else turn

    def turn(self, here, there):
        if self.rotation == "fixed":
            return np.eye(3)
        if self.rotation == "chord":
            return minimal(*(unit(h[1][0] - h[0][0]) for h in (there, here)))
        if self.rotation == "guide" and len(self.paths) == 1:
            return minimal(*(unit(h[0][1]) for h in (there, here)))
        return self.frame(here) @ self.frame(there).T

    def frame(self, jet):
        position, velocity, bend = jet[0]
        t = unit(velocity)
        if self.rotation in ("guide", "chord+guide"):
            e = unit(jet[1][0] - position)
            whole = velocity + jet[1][1]
            f = unit(whole - (whole @ e) * e)
            return np.stack([e, f, np.cross(e, f)], axis=1)
        if self.rotation == "frenet":
            n = unit(bend - (bend @ t) * t)
            return np.stack([t, n, np.cross(t, n)], axis=1)
        level = unit(self.up - (self.up @ t) * t)
        return np.stack([t, level, np.cross(t, level)], axis=1)

    def points(self, shares_u, shares_v):
        """(m, k, 3)."""
        rows = []
        for share in shares_v:
            parts = []
            for i, character in enumerate(self.characters):
                anchor = self.jets(float(i))[0][0]
                if len(self.paths) == 2:
                    anchor = character(np.zeros(1))[0]
                parts.append((character(shares_u) - anchor) @ self.matrix(share, float(i)).T)
            phi = self.blend(share)
            whole = parts[0] if len(parts) == 1 else (1 - phi) * parts[0] + phi * parts[1]
            rows.append(self.jets(share)[0][0] + whole)
        return np.stack(rows, axis=1)


def transported(path: Path, side: np.ndarray, v: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Sides that do not turn about the tangent, U' = −⟨U, T'⟩ T, at ascending places from the start of the path."""
    edges = np.unique(np.concatenate([knots, v, np.linspace(v[0], v[-1], 65)]))

    def slope(t, u):
        _, velocity, bend = path.at(t)
        speed = np.linalg.norm(velocity)
        tangent = velocity / speed
        return -(u @ (bend - (bend @ tangent) * tangent)) / speed * tangent

    found = {edges[0]: side}
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        side = solve_ivp(slope, (low, high), side, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        found[high] = side
    return np.array([found[x] for x in v])
