"""Evaluation of splines, and the time until the library is there."""

import importlib
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline, NdBSpline

import jaxsurf as js

from .harness import Figure, Row, Run, cores

POINTS = 1_000_000
SIDE = 20  # control points in each direction
FEW = 2_000  # points for what is written in Python alone


def rows() -> list[Row]:
    """All tasks on the same bicubic net, in double precision."""
    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(0)
    knots = np.array(js.clamped_knots(SIDE, 3, (2.0, 5.0)))
    knots[5:-5] += 0.02 * rng.normal(size=len(knots) - 10)
    net = rng.normal(size=(SIDE, SIDE, 3))
    places = rng.uniform(2.0, 5.0, size=(POINTS, 2))
    return [
        _scattered(net, knots, places),
        _with_normals(net, knots, places),
        _gradient(net, knots, places),
        _grid(net, knots),
        _many(knots, places, rng),
        _curve(net[0], knots, places[:, 0]),
        _start(),
    ]


def _scattered(net: np.ndarray, knots: np.ndarray, places: np.ndarray) -> Row:
    surface = js.BSplineSurface(net, knots, knots, 3, 3)
    u, v = jnp.asarray(places.T)
    nd = NdBSpline((knots, knots), net, 3)
    return Row(
        f"{POINTS:.0e} scattered points of a bicubic, {SIDE} × {SIDE} net",
        {
            "jaxsurf": _jax(lambda: surface(u, v), POINTS),
            "splinepy": _splinepy(net, knots, lambda s: s.evaluate(places, nthreads=cores())),
            "scipy NdBSpline": Run(lambda: nd(places), POINTS),
            "ndsplines": _ndsplines(net, knots, places),
            "geomdl": _geomdl(net, knots, places[:FEW]),
        },
        [Figure("faster", "jaxsurf", "splinepy", 8), Figure("faster", "jaxsurf", "scipy NdBSpline", 3)],
    )


def _with_normals(net: np.ndarray, knots: np.ndarray, places: np.ndarray) -> Row:
    surface = js.BSplineSurface(net, knots, knots, 3, 3)
    u, v = jnp.asarray(places.T)

    @eqx.filter_jit
    def all_at_once(surface: Any, u: Any, v: Any) -> Any:
        found = js.partials(surface, u, v)
        return found, found.normal

    def three_calls(s: Any) -> None:
        s.evaluate(places, nthreads=cores())
        for order in ([1, 0], [0, 1]):
            s.derivative(places, order, nthreads=cores())

    return Row(
        "the same: points, both partial derivatives and normals",
        {
            "jaxsurf": _jax(lambda: all_at_once(surface, u, v), POINTS),
            "splinepy, three calls, no normals": _splinepy(net, knots, three_calls),
        },
        [Figure("faster", "jaxsurf", "splinepy, three calls, no normals", 8)],
    )


def _gradient(net: np.ndarray, knots: np.ndarray, places: np.ndarray) -> Row:
    u, v = jnp.asarray(places.T)
    total = lambda net: jnp.sum(js.BSplineSurface(net, knots, knots, 3, 3)(u, v))
    value, gradient = jax.jit(total), jax.jit(jax.grad(total))
    points = jax.jit(lambda net: js.BSplineSurface(net, knots, knots, 3, 3)(u, v))
    array = jnp.asarray(net)
    return Row(
        "reverse gradient of the sum of all points by the net",
        {
            "gradient": _jax(lambda: gradient(array), POINTS),
            "the points": _jax(lambda: points(array), POINTS),
            "the sum": _jax(lambda: value(array), POINTS),
        },
        [Figure("at most", "gradient", "the points", 6)],
    )


def _grid(net: np.ndarray, knots: np.ndarray) -> Row:
    surface = js.BSplineSurface(net, knots, knots, 3, 3)
    u = np.linspace(2.0, 5.0, 1000)

    def peer(splipy: Any) -> Callable[[], Any]:
        basis = splipy.BSplineBasis(4, knots)
        other = splipy.Surface(basis, basis, net.transpose(1, 0, 2).reshape(-1, 3))
        return lambda: other(u, u)

    return Row(
        "a grid of 1000 × 1000 points",
        {"jaxsurf": _jax(lambda: surface.grid(u, u), u.size**2), "Splipy": _peer("splipy", peer, u.size**2)},
        [Figure("faster", "jaxsurf", "Splipy", 1)],
    )


def _many(knots: np.ndarray, places: np.ndarray, rng: np.random.Generator) -> Row:
    nets = jnp.asarray(rng.normal(size=(1000, SIDE, SIDE, 3)))
    u, v = jnp.asarray(places.T)
    surface = lambda net: js.BSplineSurface(net, knots, knots, 3, 3)
    many = jax.jit(jax.vmap(lambda net, u, v: surface(net)(u, v)))
    one = surface(nets[0])
    rows_u, rows_v = u.reshape(1000, -1), v.reshape(1000, -1)
    return Row(
        f"1000 surfaces, {POINTS // 1000} points each, one `vmap`",
        {
            "1000 surfaces": _jax(lambda: many(nets, rows_u, rows_v), POINTS),
            "one surface": _jax(lambda: one(u, v), POINTS),
        },
        [Figure("faster", "1000 surfaces", "one surface", 0.7)],
    )


def _curve(points: np.ndarray, knots: np.ndarray, places: np.ndarray) -> Row:
    curve, other = js.BSplineCurve(points, knots, 3), BSpline(knots, points, 3)
    u = jnp.asarray(places)
    return Row(
        f"{POINTS:.0e} points of a cubic curve",
        {
            "jaxsurf": _jax(lambda: curve(u), POINTS),
            "scipy BSpline": Run(lambda: other(places), POINTS),
        },
        [Figure("faster", "jaxsurf", "scipy BSpline", 1)],
    )


def _start() -> Row:
    python = lambda *arguments: Run(
        lambda: subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    )
    return Row(
        "a new process",
        {
            "import jaxsurf": python("-c", "import jaxsurf"),
            "import jax, equinox, optimistix": python("-c", "import jax, equinox, optimistix"),
            "jaxsurf --help": python("-m", "jaxsurf", "--help") if find_spec("jaxsurf.__main__") else None,
        },
        [
            Figure("at most", "import jaxsurf", "import jax, equinox, optimistix", 1.2),
            Figure("more", "jaxsurf --help", "import jaxsurf", 0.3),
        ],
    )


def _jax(call: Callable[[], Any], items: int) -> Run:
    return Run(lambda: jax.block_until_ready(call()), items)


def _peer(module: str, make: Callable[[Any], Callable[[], Any]], items: int) -> Run | None:
    """The run of another library, or None where it is not installed."""
    if find_spec(module) is None:
        return None
    return Run(make(importlib.import_module(module)), items)


def _splinepy(net: np.ndarray, knots: np.ndarray, call: Callable[[Any], Any]) -> Run | None:
    def make(splinepy: Any) -> Callable[[], Any]:
        spline = splinepy.BSpline(
            degrees=[3, 3],
            knot_vectors=[knots.tolist(), knots.tolist()],
            control_points=net.transpose(1, 0, 2).reshape(-1, 3),
        )
        return lambda: call(spline)

    return _peer("splinepy", make, POINTS)


def _ndsplines(net: np.ndarray, knots: np.ndarray, places: np.ndarray) -> Run | None:
    def make(ndsplines: Any) -> Callable[[], Any]:
        spline = ndsplines.NDSpline([knots, knots], net, [3, 3])
        return lambda: spline(places)

    return _peer("ndsplines", make, len(places))


def _geomdl(net: np.ndarray, knots: np.ndarray, places: np.ndarray) -> Run | None:
    def make(_: Any) -> Callable[[], Any]:
        surface = importlib.import_module("geomdl.BSpline").Surface(normalize_kv=False)
        surface.degree_u = surface.degree_v = 3
        surface.set_ctrlpts(net.reshape(-1, 3).tolist(), SIDE, SIDE)
        surface.knotvector_u = surface.knotvector_v = knots.tolist()
        pairs = places.tolist()
        return lambda: surface.evaluate_list(pairs)

    return _peer("geomdl", make, len(places))
