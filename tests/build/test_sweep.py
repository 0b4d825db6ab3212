"""Sweeps as shapes: saving, jit, vmap, single precision, grids, B-splines."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sweep_cases import OFF, UP, across, close, ends

import jaxsurf as js

TURNS = np.array([[1.0, 0, 0, 0], [0.9, 0.1, 0.2, 0], [0.8, 0.3, 0, 0.4]])


def bezier(points):
    return js.BSplineCurve(points, js.clamped_knots(4, 3, (2, 5)), 3)


POINTS = OFF + np.array([[0, 0, 0], [1.2, 0.1, 0.9], [2.5, 0.5, 0.6], [4, 0.2, 0.1]])
SECOND = OFF + np.array([[0.1, 2, 0.3], [1.2, 2.1, 0.9], [2.5, 1.7, 0.2], [4.2, 2.2, 0.4]])
PAIR = bezier(POINTS), bezier(SECOND)
CHARACTERS = [across(ends(PAIR[0])[i], ends(PAIR[1])[i], kind) for i, kind in enumerate(("arc", "NURBS"))]
KINDS = {
    "fixed": ("fixed", 1),
    "guide": ("guide", 1),
    "minimal": (js.RotationMinimising(steps=8), 1),
    "frenet": ("frenet", 1),
    "up": (UP, 1),
    "orientations": (js.OrientationRotation([2.0, 3.0, 5.0], TURNS), 1),
    "chord": ("chord", 2),
    "chord+guide": ("chord+guide", 2),
}
U, V = np.linspace(0, 1, 4), np.linspace(2, 5, 5)


@pytest.fixture(scope="module")
def surfaces():
    return {name: js.sweep(CHARACTERS, PAIR[:count], rotation=kind) for name, (kind, count) in KINDS.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_saving_and_loading_keeps_every_bit(surfaces, kind, tmp_path):
    js.save(tmp_path / "sweep.jxs", surfaces[kind])
    loaded = js.load(tmp_path / "sweep.jxs")
    assert jax.tree.structure(loaded) == jax.tree.structure(surfaces[kind])
    for before, after in zip(jax.tree.leaves(surfaces[kind]), jax.tree.leaves(loaded), strict=True):
        assert after.dtype == before.dtype and np.asarray(after).tobytes() == np.asarray(before).tobytes()


def test_functions_of_the_user_are_not_saved_and_it_is_said_in_one_sentence(tmp_path):
    kinds: list[dict[str, Any]] = [{"rotation": lambda v: jnp.eye(3) + 0 * v}, {"rotation": "fixed", "blend": lambda t: t}]
    for options in kinds:
        with pytest.raises(js.InputError, match=r"Cannot save `shape\..*function`: it is the function '<lambda>'"):
            js.save(tmp_path / "sweep.jxs", js.sweep(CHARACTERS, PAIR[0], **options))


@pytest.mark.parametrize("kind", KINDS)
def test_grid_call_jit_and_single_precision_agree(surfaces, kind):
    surface = surfaces[kind]
    points = np.asarray(surface.grid(U, V))
    close(surface(U[:, None], V[None, :]), points, 1e-14)
    single = jax.tree.map(lambda a: a.astype(jnp.float32) if eqx.is_inexact_array(a) else a, surface)
    found = single.grid(U, V)
    assert found.dtype == single.dtype == jnp.float32
    close(found, points, 1e-5)


def test_single_precision_in_gives_single_precision_out():
    low = lambda tree: jax.tree.map(lambda a: a.astype(jnp.float32) if eqx.is_inexact_array(a) else a, tree)
    kinds: list[tuple[int, dict[str, Any]]] = [(1, {}), (2, {"rotation": "chord", "scale": "chord"})]
    for count, options in kinds:
        surface = js.sweep(low(CHARACTERS), low(PAIR[:count]), **options)
        points = surface.grid(U, V)
        assert points.dtype == surface.dtype == jnp.float32
        close(points, js.sweep(CHARACTERS, PAIR[:count], **options).grid(U, V), 2e-5)


@pytest.mark.parametrize("kind", ["guide", "minimal", "chord+guide"])
def test_a_sweep_made_inside_jit_and_vmap_agrees_with_that_of_known_data(kind):
    rotation, count = KINDS[kind]
    shifts = np.array([[0.0, 0, 0], [0.1, 0.3, -0.2]])

    def points(shift):
        """The second control point of all guides is moved."""
        bent = [bezier(jnp.asarray(p).at[1].add(shift)) for p in (POINTS, SECOND)[:count]]
        return js.sweep(CHARACTERS, bent, rotation=rotation).grid(U, V)

    wanted = []
    for shift in shifts:
        moved = [p + np.eye(4)[1][:, None] * shift for p in (POINTS, SECOND)[:count]]
        wanted.append(js.sweep(CHARACTERS, [bezier(p) for p in moved], rotation=rotation).grid(U, V))
    close(jax.jit(jax.vmap(points))(shifts), wanted, 1e-13)


@pytest.mark.parametrize(("kind", "tolerance"), [("guide", 1e-5), ("chord+guide", 1e-4)])
def test_as_a_b_spline_it_is_within_the_tolerance(surfaces, kind, tolerance):
    found = js.to_bspline(surfaces[kind], tolerance)
    u, v = np.linspace(0, 1, 23), np.linspace(2, 5, 29)
    off = np.linalg.norm(np.asarray(found.shape.grid(u, v)) - np.asarray(surfaces[kind].grid(u, v)), axis=-1)
    assert off.max() <= tolerance and float(found.max_error) <= tolerance
