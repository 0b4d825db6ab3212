"""Fits of nets and closest points: how fast, against which peers, how time and memory grow, and many at once."""

import importlib
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

import jaxsurf as js

from .harness import Figure, Row, Run, cores

SIDE = 20  # control points in each direction
NOISE = 1e-3  # of a sheet of side 1
KNOWN, UNKNOWN, MANY = 300_000, 100_000, 1_000_000
SIZES = (30_000, 100_000, 300_000, 1_000_000)
SCANS, FEWER_SCANS = 1000, 200  # nets, and QI surfaces, which take ten times as long each
SCAN_POINTS, LOOPED = 500, 20
FEET = 100_000


def rows() -> list[Row]:
    """A bicubic sheet of 20 × 20 control points and noisy clouds of it, in double precision."""
    jax.config.update("jax_enable_x64", True)
    return [_known(), _unknown(), _memory(), _slope(), _closest(), *_many()]


def _net(roughness: float = 0.02) -> np.ndarray:
    x, y = np.meshgrid(*[np.linspace(0, 1, SIDE)] * 2, indexing="ij")
    z = 0.3 * np.sin(2 * x + y) + roughness * np.random.default_rng(0).normal(size=x.shape)
    return np.stack([x, y, z], axis=-1)


def _sheet(net: np.ndarray) -> js.BSplineSurface:
    return js.BSplineSurface(net, *[js.clamped_knots(SIDE, 3)] * 2, 3, 3)


def _cloud(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the sheet with noise, and their parameters."""
    rng = np.random.default_rng(1)
    places = rng.uniform(size=(count, 2))
    return np.asarray(_sheet(_net())(*places.T)) + NOISE * rng.normal(size=(count, 3)), places


def _smoothed() -> js.BSplineSurface:
    """The sheet without its roughness."""
    return _sheet(_net(0.0))


def _fitted(points: np.ndarray, **options: Any) -> Callable[[], Any]:
    start = _smoothed()
    return lambda: jax.block_until_ready(js.fit(start, points, **options).shape.control_points)


def _known() -> Row:
    points, places = _cloud(KNOWN)

    def peer() -> np.ndarray:
        knots = np.asarray(js.clamped_knots(SIDE, 3))
        along_u, along_v = (BSpline.design_matrix(t, knots, 3) for t in places.T)
        design = _row_products(along_u, along_v)
        return spsolve((design.T @ design).tocsc(), design.T @ points)

    return Row(
        f"a net of {SIDE} × {SIDE} to {KNOWN:.0e} points of known parameters",
        {"jaxsurf": Run(_fitted(points, parameters=places)), "scipy, sparse normal equations": Run(peer)},
        [Figure("seconds", "jaxsurf", None, 0.5), Figure("faster", "jaxsurf", "scipy, sparse normal equations", 3)],
    )


def _row_products(a: Any, b: Any) -> csr_matrix:
    """The sparse matrix whose rows are the Kronecker products of those of two with equally many entries in each."""
    count, n, m = a.shape[0], a.shape[1], b.shape[1]
    values = a.data.reshape(count, -1)[:, :, None] * b.data.reshape(count, -1)[:, None, :]
    indices = a.indices.reshape(count, -1)[:, :, None] * m + b.indices.reshape(count, -1)[:, None, :]
    return csr_matrix((values.ravel(), indices.ravel(), np.arange(count + 1) * values[0].size), shape=(count, n * m))


def _unknown() -> Row:
    few, many = f"{UNKNOWN:.0e} points", f"{MANY:.0e} points"
    return Row(
        f"a net of {SIDE} × {SIDE} to points of unknown parameters, from a smooth sheet to convergence",
        {few: Run(_fitted(_cloud(UNKNOWN)[0])), many: Run(_fitted(_cloud(MANY)[0]))},
        [Figure("seconds", few, None, 10.0), Figure("at most", many, few, 10.0)],
        repeats=3,
    )


def _memory() -> Row:
    labels = {count: f"{count:.0e} points" for count in (UNKNOWN, MANY, 10 * MANY)}
    runs: dict[str, Run | None] = {label: Run(lambda n=n: _peak(n), unit="MB") for n, label in labels.items()}
    figures = [Figure("below", labels[MANY], None, 2048.0)]
    return Row("the same: most memory of a process that does nothing else, cloud and all", runs, figures)


def _peak(count: int) -> float:
    """Most memory of a new process that fits so many points, three steps long."""
    command = [sys.executable, "-m", __name__, str(count)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=Path(__file__).parents[1])
    return float(done.stdout.split()[-1])


def _slope() -> Row:
    def measured() -> float:
        seconds = []
        for count in SIZES:
            points, places = _cloud(count)
            call = _fitted(points, start=places, max_steps=5, rtol=1e-14)
            call()
            seconds.append(min(_timed(call) for _ in range(3)))
        return float(np.polyfit(np.log(SIZES), np.log(seconds), 1)[0])

    what = f"how time grows from {SIZES[0]:.0e} to {SIZES[-1]:.0e} points, five steps of the solver"
    return Row(what, {"slope": Run(measured, unit="(log-log)")}, [Figure("below", "slope", None, 1.05)])


def _timed(call: Callable[[], Any]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _closest() -> Row:
    surface = _sheet(_net())
    queries = _cloud(FEET)[0] + 0.02 * np.random.default_rng(2).normal(size=(FEET, 3))
    ours = lambda: jax.block_until_ready(js.closest_point(surface, queries))
    label = "splinepy `proximities`"
    runs: dict[str, Run | None] = {"jaxsurf": Run(ours, FEET), label: None}
    figures = [Figure("faster", "jaxsurf", label, 3)]
    if find_spec("splinepy") is not None:
        knots = np.asarray(js.clamped_knots(SIDE, 3)).tolist()
        net = _net().transpose(1, 0, 2).reshape(-1, 3)
        spline = importlib.import_module("splinepy").BSpline([3, 3], [knots, knots], net)
        feet = lambda: np.asarray(spline.proximities(queries, nthreads=cores()))

        def excess() -> float:
            theirs = np.linalg.norm(np.asarray(surface(*feet().T)) - queries, axis=1)
            return float(np.max(np.abs(np.asarray(ours().distance)) - theirs))

        runs[label] = Run(feet, FEET)
        runs["most that a foot of ours is farther than theirs"] = Run(excess, unit="of the side")
        figures.append(Figure("below", "most that a foot of ours is farther than theirs", None, 1e-9))
    return Row(f"closest points of {FEET:.0e} on that net, 0.02 off", runs, figures)


def _many() -> list[Row]:
    """Scans of members that are bent a little differently."""
    rng = np.random.default_rng(3)
    plane = js.QISurface.plane((0, 0, 0), (1, 0, 0), (0, 0.8, 0), (3, 3), 2)
    plane = plane.replace(spine=plane.spine.replace(angle=1.5), angles=(1.5, 1.5))
    x, y = np.meshgrid(*[np.linspace(0, 1, 6)] * 2, indexing="ij")
    flat = js.BSplineSurface(np.stack([x, y, 0 * x], -1), *[js.clamped_knots(6, 3)] * 2, 3, 3)
    families = {
        "3 × 3 control tangents": (plane, lambda s: s.tangents, 0.2, FEWER_SCANS),
        "6 × 6 control points": (flat, lambda s: s.control_points, 0.05, SCANS),
    }
    found = []
    for name, (start, where, depth, count) in families.items():
        clouds = _scans(start, where, depth, count, rng)
        at_once = lambda start=start, clouds=clouds: jax.block_until_ready(js.fit_many(start, clouds).deviation.signed)
        one = lambda start=start, cloud=clouds[:1]: jax.block_until_ready(js.fit_many(start, cloud).deviation.signed)
        looped = lambda one=one, start=start, clouds=clouds: [one(start, clouds[k : k + 1]) for k in range(LOOPED)]
        loop = f"a loop over {LOOPED} of them"
        runs: dict[str, Run | None] = {"all in one call": Run(at_once, count), loop: Run(looped, LOOPED)}
        what = f"{count} scans of {SCAN_POINTS} points, a surface of {name} to each"
        found.append(Row(what, runs, [Figure("faster", "all in one call", loop, 5.0)], repeats=3))
    return found


def _scans(start: Any, where: Callable[[Any], Any], depth: float, count: int, rng: np.random.Generator) -> jax.Array:
    """Noisy points of as many members as there are scans."""
    moved = where(start) + depth * jnp.asarray(rng.normal(size=(count, *where(start).shape)))
    places = jnp.asarray(rng.uniform(size=(2, count, SCAN_POINTS)))
    one = lambda control, u, v: eqx.tree_at(where, start, control)(u, v)
    points = jax.jit(lambda c, u, v: jax.lax.map(lambda row: one(*row), (c, u, v)))(moved, *places)
    return points + NOISE * jnp.asarray(rng.normal(size=points.shape))


def _peak_of_this_process(count: int) -> float:
    import resource

    jax.config.update("jax_enable_x64", True)
    _fitted(_cloud(count)[0], max_steps=3)()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    print(_peak_of_this_process(int(sys.argv[1])))
