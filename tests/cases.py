"""Every kind of shape, at an awkward place: off the origin, domain [2, 5], uneven and repeated knots, weights ≠ 1.

A new shape is one function here, and receives every test of `shape_laws.py`.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import numpy as np

import jaxsurf as js
from jaxsurf.build._curved_surface import CurvedSurface
from jaxsurf.build._edge_fields import CurvatureField, CurveField
from jaxsurf.build._network_curves import NetworkEdge
from jaxsurf.build._tangent_surface import TangentSurface
from jaxsurf.curve import breaks


class Case(NamedTuple):
    """A shape, and shapes of its class whose data are degenerate but lawful, by what is degenerate."""

    shape: Any
    degenerate: dict[str, Any] = {}


Factory = Callable[[np.random.Generator], Case]
CURVES: dict[str, Factory] = {}
SURFACES: dict[str, Factory] = {}
"""By name: the class, then what is special about the case."""


def case(table: dict[str, Factory], name: str) -> Callable[[Factory], Factory]:
    """Decorator: put the factory of a case into a table."""
    return lambda factory: table.setdefault(name, factory)


@cache
def make(name: str) -> Case:
    """The case called `name`; the same numbers every time."""
    return (CURVES | SURFACES)[name](np.random.default_rng(sum(name.encode())))


def parameters(shape: Any) -> tuple[np.ndarray, ...]:
    """Places amid the spans between breaks, every span at least once: an array for each direction, equally long."""
    rng = np.random.default_rng(7)
    places = [a + rng.uniform(0.2, 0.8, len(a)) * b for a, b in ((d[:-1], np.diff(d)) for d in _breaks(shape))]
    return tuple(rng.permutation(np.resize(p, max(len(p) for p in places))) for p in places)


def corners(shape: Any) -> tuple[np.ndarray, ...]:
    """Nine places at the ends of the domain and at breaks: all pairs of three for a surface."""
    directions = _breaks(shape)
    if len(directions) == 1:
        return (np.resize(directions[0], 9),)
    pairs = np.meshgrid(*(d[[0, len(d) // 2, -1]] for d in directions), indexing="ij")
    return tuple(grid.reshape(-1) for grid in pairs)


def _breaks(shape: Any) -> tuple[np.ndarray, ...]:
    directions = breaks(shape)
    return tuple(np.asarray(d) for d in (directions if isinstance(directions, tuple) else (directions,)))


def clamped(degree: int, *inner: float) -> np.ndarray:
    """Knots on [2, 5] with full ends."""
    return np.array([2.0] * (degree + 1) + list(inner) + [5.0] * (degree + 1))


UNCLAMPED = np.array([0.0, 0.7, 1.1, 2.0, 2.6, 3.0, 3.1, 4.4, 5.0, 5.5, 5.9, 6.5])  # degree 3, domain [2, 5]
UNEVEN = clamped(3, 2.7, 3.1, 3.1, 4.4)
PERIODIC = np.array([2.0, 2.3, 3.0, 3.1, 4.2, 5.0])
SEAM = np.array([2.0, 2.9, 3.3, 4.1, 5.0])


def _points(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """A grid of points with a gap between neighbours, disturbed, off the origin."""
    steps = np.stack(np.meshgrid(*(np.arange(float(n)) for n in shape[:-1]), indexing="ij"), axis=-1)
    flat = np.zeros(shape)
    flat[..., : steps.shape[-1]] = steps[..., : shape[-1]]
    return np.array([7.0, -3.0, 4.0][: shape[-1]]) + flat + 0.4 * rng.normal(size=shape)


@case(CURVES, "BSplineCurve")
def _(rng: np.random.Generator) -> Case:
    points = _points(rng, 8, 3)
    doubled = points.copy()
    doubled[2:5] = doubled[2]
    return Case(
        js.BSplineCurve(points, UNEVEN, 3),
        {
            "one point": js.BSplineCurve(np.ones((8, 3)), UNEVEN, 3),
            "three points equal": js.BSplineCurve(doubled, UNEVEN, 3),
            "full inner knot": js.BSplineCurve(points, clamped(3, 3.1, 3.1, 3.1, 4.0), 3),
        },
    )


@case(CURVES, "BSplineCurve, not clamped")
def _(rng: np.random.Generator) -> Case:
    return Case(js.BSplineCurve(_points(rng, 8, 3), UNCLAMPED, 3))


@case(CURVES, "BSplineCurve, polygon in a plane")
def _(rng: np.random.Generator) -> Case:
    return Case(js.BSplineCurve(_points(rng, 5, 2), clamped(1, 2.2, 3.9, 4.1), 1))


@case(CURVES, "BSplineCurve, periodic")
def _(rng: np.random.Generator) -> Case:
    few = js.BSplineCurve(_points(rng, 2, 3), np.array([2.0, 2.9, 5.0]), 3, periodic=True)
    return Case(js.BSplineCurve(_points(rng, 5, 3), PERIODIC, 3, periodic=True), {"fewer points than knots": few})


@case(CURVES, "FreeKnotCurve")
def _(rng: np.random.Generator) -> Case:
    return Case(js.free_knots(js.BSplineCurve(_points(rng, 8, 3), UNEVEN, 3)))


@case(CURVES, "NURBSCurve")
def _(rng: np.random.Generator) -> Case:
    points, weights = _points(rng, 8, 3), rng.uniform(0.5, 2, 8)
    return Case(
        js.NURBSCurve(points, weights, UNEVEN, 3),
        {
            "one point": js.NURBSCurve(np.ones((8, 3)), weights, UNEVEN, 3),
            "weights of all sizes": js.NURBSCurve(points, np.logspace(-4, 4, 8), UNEVEN, 3),
        },
    )


@case(CURVES, "Line")
def _(rng: np.random.Generator) -> Case:
    start, end = rng.normal(size=(2, 3)) + 4
    return Case(js.Line(start, end), {"no length": js.Line(start, start)})


@case(CURVES, "Arc")
def _(rng: np.random.Generator) -> Case:
    center, start, normal = rng.normal(size=(3, 3)) + np.array([[5.0], [2.0], [0.0]])
    full, flat = (js.Arc(center, start, normal, angle) for angle in (2 * math.pi, 1e-9))
    return Case(js.Arc(center, start, normal, 1.3), {"whole circle": full, "nearly straight": flat})


@case(CURVES, "Circle")
def _(rng: np.random.Generator) -> Case:
    center, normal, start = rng.normal(size=(3, 3)) + np.array([[5.0], [0.0], [0.0]])
    return Case(js.Circle(center, normal, 1.7, start), {"down": js.Circle(center, (0, 0, -1), 1e-9, (1, 0, 0))})


@case(CURVES, "Helix")
def _(rng: np.random.Generator) -> Case:
    center, axis, start = rng.normal(size=(3, 3)) + np.array([[5.0], [0.0], [0.0]])
    flat = js.Helix(center, axis, 1.7, 0.0, 1.3, start)
    return Case(js.Helix(center, axis, 1.7, -0.6, 2.3, start), {"no pitch": flat})


def _directions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Directions of various lengths that wander on the sphere."""
    return rng.uniform(0.5, 2, (*shape, 1)) * (np.array([1.0, 0.5, -0.7]) + rng.normal(size=(*shape, 3)))


@case(CURVES, "QICurve")
def _(rng: np.random.Generator) -> Case:
    tangents = _directions(rng, 8)
    parallel = tangents.copy()
    parallel[2:6] = tangents[2] * np.array([[1.0], [2.0], [0.3], [1.0]])
    start = np.array([7.0, -3.0, 4.0])
    return Case(
        js.QICurve(start, 3.3, tangents, 3, UNEVEN),
        {
            "straight": js.QICurve(start, 3.3, np.ones((8, 3)), 3, UNEVEN),
            "parallel neighbours": js.QICurve(start, 3.3, parallel, 3, UNEVEN),
            "full inner knot": js.QICurve(start, 3.3, tangents, 3, clamped(3, 3.1, 3.1, 3.1, 4.0)),
        },
    )


@case(CURVES, "QICurve, not clamped")
def _(rng: np.random.Generator) -> Case:
    return Case(js.QICurve(rng.normal(size=3), 1e-3, _directions(rng, 8), 3, UNCLAMPED))


@case(CURVES, "CompositeCurve")
def _(rng: np.random.Generator) -> Case:
    points = _points(rng, 8, 3)
    corner, end = points[0] + np.array([-1.0, 2.0, 0.3]), points[0]
    arc = js.Arc.through(corner + np.array([-2.0, 0.1, 0.7]), corner + np.array([-1.0, 0.8, 0.2]), corner)
    pieces = [arc, js.Line(corner, end), js.BSplineCurve(points, UNEVEN, 3)]
    return Case(
        js.CompositeCurve(pieces),
        {"a piece without length": js.CompositeCurve([*pieces[:1], js.Line(corner, corner), *pieces[1:]])},
    )


@case(CURVES, "MappedCurve")
def _(rng: np.random.Generator) -> Case:
    circle = js.Circle(rng.normal(size=3), (0.3, -0.5, 1.0), 1.7)
    return Case(js.rotate(circle, (1, 2, -1), 0.8), {"flattened": js.scale(circle, (1e-9, 1.0, 1.0))})


@case(CURVES, "ReparametrisedCurve")
def _(rng: np.random.Generator) -> Case:
    helix = js.Helix(rng.normal(size=3) + 4, (0.3, -0.5, 1.0), 1.7, 0.6, 2.3)
    return Case(js.reverse(js.split(js.reparametrise(helix, (2, 5)), 3.2)[1]))


@case(SURFACES, "BSplineSurface")
def _(rng: np.random.Generator) -> Case:
    net = _points(rng, 8, 5, 3)
    pole = net.copy()
    pole[0] = pole[0, 0]
    knots_v = clamped(2, 2.9, 4.1)
    return Case(
        js.BSplineSurface(net, UNEVEN, knots_v, 3, 2),
        {
            "one point": js.BSplineSurface(np.ones((8, 5, 3)), UNEVEN, knots_v, 3, 2),
            "pole": js.BSplineSurface(pole, UNEVEN, knots_v, 3, 2),
        },
    )


@case(SURFACES, "BSplineSurface, periodic in v")
def _(rng: np.random.Generator) -> Case:
    return Case(js.BSplineSurface(_points(rng, 8, 5, 3), UNCLAMPED, PERIODIC, 3, 3, periodic_v=True))


@case(SURFACES, "BSplineSurface, periodic in both")
def _(rng: np.random.Generator) -> Case:
    net = _points(rng, 4, 5, 3)
    return Case(js.BSplineSurface(net, SEAM, PERIODIC, 2, 3, periodic_u=True, periodic_v=True))


@case(SURFACES, "FreeKnotSurface")
def _(rng: np.random.Generator) -> Case:
    return Case(js.free_knots(js.BSplineSurface(_points(rng, 8, 5, 3), UNEVEN, clamped(2, 2.9, 4.1), 3, 2)))


@case(SURFACES, "NURBSSurface")
def _(rng: np.random.Generator) -> Case:
    net, weights, knots_v = _points(rng, 8, 5, 3), rng.uniform(0.5, 2, (8, 5)), clamped(2, 2.9, 4.1)
    flat = np.ones((8, 5, 3))
    return Case(
        js.NURBSSurface(net, weights, UNEVEN, knots_v, 3, 2),
        {"one point": js.NURBSSurface(flat, weights, UNEVEN, knots_v, 3, 2)},
    )


@case(SURFACES, "Plane")
def _(rng: np.random.Generator) -> Case:
    point, normal = rng.normal(size=(2, 3)) + np.array([[5.0], [0.0]])
    return Case(js.Plane(point, normal, 3.0), {"down": js.Plane(point, (0, 0, -1), 1e-9)})


@case(SURFACES, "Sphere")
def _(rng: np.random.Generator) -> Case:
    center = rng.normal(size=3) + 4
    return Case(js.Sphere(center, 1.7), {"tiny": js.Sphere(center, 1e-9)})


@case(SURFACES, "Cylinder")
def _(rng: np.random.Generator) -> Case:
    center, axis, start = rng.normal(size=(3, 3)) + np.array([[5.0], [0.0], [0.0]])
    return Case(js.Cylinder(center, axis, 1.7, 2.4, start), {"thin": js.Cylinder(center, (0, 0, -1), 1e-9, 1.0)})


@case(SURFACES, "Cone")
def _(rng: np.random.Generator) -> Case:
    center, axis, start = rng.normal(size=(3, 3)) + np.array([[5.0], [0.0], [0.0]])
    return Case(js.Cone(center, axis, 1.7, -0.3, 2.4, start), {"apex": js.Cone(center, axis, 0.0, 0.3, 2.4, start)})


@case(SURFACES, "Torus")
def _(rng: np.random.Generator) -> Case:
    center, axis, start = rng.normal(size=(3, 3)) + np.array([[5.0], [0.0], [0.0]])
    return Case(js.Torus(center, axis, 2.7, 0.8, start), {"cuts itself": js.Torus(center, axis, 1.0, 1.0, start)})


@case(SURFACES, "TrimmedSurface")
def _(rng: np.random.Generator) -> Case:
    square = np.array([[2.5, 2.5], [4.5, 2.6], [4.4, 4.5], [2.6, 4.4], [2.5, 2.5]])
    loop = js.BSplineCurve(square, clamped(1, 2.5, 3.1, 4.2), 1)
    return Case(js.TrimmedSurface(make("BSplineSurface").shape, [loop]))


def _qi_surface(rng: np.random.Generator, tangents: np.ndarray, **options: Any) -> js.QISurface:
    n, m = tangents.shape[:2]
    spine = js.QICurve([7.0, -3.0, 4.0], 3.3, _directions(rng, 5), 2, clamped(2, 2.9, 4.1))
    return js.QISurface(spine, tangents, rng.uniform(1, 2, m), 3, 2, UNEVEN, clamped(2, 2.9, 4.0), **options)


@case(SURFACES, "QISurface")
def _(rng: np.random.Generator) -> Case:
    tangents = _directions(rng, 8, 5)
    parallel = tangents.copy()
    parallel[2:6, 1:4] = tangents[2, 1]
    return Case(
        _qi_surface(rng, tangents),
        {"flat": _qi_surface(rng, np.ones((8, 5, 3))), "parallel neighbours": _qi_surface(rng, parallel)},
    )


@case(SURFACES, "QISurface, u first")
def _(rng: np.random.Generator) -> Case:
    return Case(_qi_surface(rng, _directions(rng, 8, 5), path="u first"))


@case(SURFACES, "MappedSurface")
def _(rng: np.random.Generator) -> Case:
    torus = js.Torus(rng.normal(size=3), (0.3, -0.5, 1.0), 2.7, 0.8)
    return Case(js.rotate(torus, (1, 2, -1), 0.8), {"flattened": js.scale(torus, (1e-9, 1.0, 1.0))})


@case(SURFACES, "ReparametrisedSurface")
def _(rng: np.random.Generator) -> Case:
    cone = js.Cone(rng.normal(size=3) + 4, (0.3, -0.5, 1.0), 1.7, -0.3, 2.4)
    moved = js.reparametrise(cone, ((2, 5), (-1, 3)))
    return Case(js.transpose(js.reverse(js.split(moved, 3.2, "u")[1], "v")))


CORNERS = np.array([7.0, -3.0, 4.0]) + np.array([[0, 0, 0], [3.0, 0.2, 1], [-0.3, 2.5, 0.7], [3.4, 2.9, -0.4]])


def between(rng: np.random.Generator, start: np.ndarray, end: np.ndarray, knots: np.ndarray, degree: int) -> js.BSplineCurve:
    """A wavy curve from one point to another."""
    points = np.linspace(start, end, len(knots) - degree - 1)
    points[1:-1] += 0.3 * rng.normal(size=points[1:-1].shape)
    return js.BSplineCurve(points, knots, degree)


def four_sides(rng: np.random.Generator) -> tuple[Any, Any, Any, Any]:
    """Curves of all kinds between four corners: two of v, then two of u."""
    a, b, c, d = CORNERS
    first = between(rng, a, c, clamped(2, 2.9, 4.1), 2)
    last = js.Arc.through(b, (b + d) / 2 + np.array([0.6, 0, 0.3]), d)
    lower, upper = between(rng, a, b, UNEVEN, 3), between(rng, c, d, clamped(3, 2.2, 4.0), 3)
    weights = rng.uniform(0.5, 2, len(upper.control_points))
    return first, last, lower, js.NURBSCurve(upper.control_points, weights, upper.knots, 3)


@case(CURVES, "ByArcLength")
def _(rng: np.random.Generator) -> Case:
    return Case(js.ByArcLength(js.BSplineCurve(_points(rng, 6, 3), clamped(3, 2.9, 4.0), 3)))


@case(CURVES, "NetworkEdge")
def _(rng: np.random.Generator) -> Case:
    curve = js.BSplineCurve(_points(rng, 6, 3), clamped(3, 2.9, 4.0), 3)
    offsets = 0.05 * rng.normal(size=(3, 3))
    places, ends = jax.numpy.array([2.2, 3.5, 4.8]), jax.numpy.array([2.2, 4.8])
    return Case(NetworkEdge(curve, places, jax.numpy.asarray(offsets), ends))


@case(SURFACES, "Sweep")
def _(rng: np.random.Generator) -> Case:
    first, last, lower, upper = four_sides(rng)
    flat = js.Line(CORNERS[0], CORNERS[1])
    raised = js.translate(flat, (0.0, 0.0, 1.0))
    return Case(
        js.sweep((lower, upper), (first, last)),
        {"flat": js.sweep(js.Line(raised(0.0), flat(0.0)), (raised, flat), rotation="chord")},
    )


@case(SURFACES, "Sweep, without twist")
def _(rng: np.random.Generator) -> Case:
    first, _, lower, _ = four_sides(rng)
    along = lambda guide: js.sweep(lower, guide, rotation="minimal")
    return Case(along(first), {"straight guide": along(js.Line(CORNERS[0], CORNERS[2]))})


@case(SURFACES, "Coons")
def _(rng: np.random.Generator) -> Case:
    point = js.Line(CORNERS[0], CORNERS[0])
    return Case(js.coons(*four_sides(rng), blend=js.smoothstep), {"one point": js.coons(*[point] * 4)})


@case(SURFACES, "ExtendedCoons")
def _(rng: np.random.Generator) -> Case:
    first, _, lower, _ = four_sides(rng)
    tip = CORNERS[1]
    upper = between(rng, CORNERS[2], tip, clamped(3, 2.2, 4.0), 3)
    return Case(js.extended_coons(u0=first, u1=tip, v0=lower, v1=upper))


@case(SURFACES, "Extrusion")
def _(rng: np.random.Generator) -> Case:
    helix = js.Helix(rng.normal(size=3) + 4, (0.3, -0.5, 1.0), 1.7, 0.6, 2.3)
    return Case(js.extrude(helix, rng.normal(size=3)))


@case(SURFACES, "Revolution")
def _(rng: np.random.Generator) -> Case:
    a, b = CORNERS[:2]
    curve = between(rng, a, b, UNEVEN, 3)
    pole = js.revolve(js.Line(a, b), b, (0, 0, 1.0))
    return Case(js.revolve(curve, rng.normal(size=3) + 4, rng.normal(size=3), 2.3), {"pole": pole})


@case(SURFACES, "Loft")
def _(rng: np.random.Generator) -> Case:
    _, _, lower, _ = four_sides(rng)
    up = lambda curve, height: js.translate(curve, (0.0, 0.0, height))
    a, b = CORNERS[:2]
    arc = js.Arc.through(a, (a + b) / 2 + np.array([0, 0.6, 0.3]), b)
    return Case(js.loft([lower, up(js.Line(a, b), 1.0), up(arc, 2.0), up(lower, 3.3)], [2, 2.7, 3.9, 5]))


@case(SURFACES, "Gordon")
def _(rng: np.random.Generator) -> Case:
    net = make("BSplineSurface").shape
    u, v, points = np.array([2.0, 2.9, 3.8, 5.0]), np.array([2.0, 3.3, 5.0]), np.asarray(net.control_points)
    along_u = [js.BSplineCurve(np.einsum("j,ijd->id", row, points), net.knots_u, 3) for row in _rows(net.basis_v, v)]
    along_v = [js.BSplineCurve(np.einsum("i,ijd->jd", row, points), net.knots_v, 2) for row in _rows(net.basis_u, u)]
    return Case(js.gordon(along_u, along_v, u, v))


@case(SURFACES, "TangentSurface")
def _(rng: np.random.Generator) -> Case:
    normals = 0.5 * rng.normal(size=(2, 3)) + [0, 0, 3]
    field = CurveField(js.BSplineCurve(normals, js.clamped_knots(2, 1), 1))
    return Case(TangentSurface(make("BSplineSurface").shape, (field, None, None, None), "hermite"))


@case(SURFACES, "CurvedSurface")
def _(rng: np.random.Generator) -> Case:
    flat = make("TangentSurface").shape
    bends = np.stack([rng.uniform(-0.5, 0.5, 2), np.zeros(2), np.zeros(2)], axis=1)
    curves = js.BSplineCurve(bends, js.clamped_knots(2, 1), 1)
    field = CurvatureField(flat.fields[0], curves)
    return Case(CurvedSurface(flat.surface, (field, None, None, None), "hermite"))


def _rows(basis: js.BSplineBasis, places: np.ndarray) -> list[np.ndarray]:
    """Values of all functions at places."""
    return [np.asarray(row) for row in basis.matrix(jax.numpy.asarray(places))]
