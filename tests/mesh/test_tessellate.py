"""Triangles: areas, measured errors, seams, poles, trimming."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf.basis import clamped_knots
from jaxsurf.curve import BSplineCurve
from jaxsurf.differential import normal
from jaxsurf.mesh import Mesh, inside, points_at, tessellate
from jaxsurf.surface import AbstractSurface, BSplineSurface, Cylinder, Plane, Sphere, TrimmedSurface
from jaxsurf.surface._abstract import point_by_point

SPHERE = Sphere((3.0, 1.0, 2.0), 2.0)


class Saddle(AbstractSurface):
    """z = u v: its parameter lines are straight, so only the twist tells that it bends."""

    scale: jax.Array = eqx.field(converter=jnp.asarray, default=1.0)

    @property
    def domain(self):
        return (2.0, 5.0), (-1.0, 1.0)

    def point(self, u, v):
        return jnp.stack([u, v, self.scale * u * v])

    def grid_points(self, u, v):
        return point_by_point(self, u, v)


def wavy() -> BSplineSurface:
    u, v = np.meshgrid(np.linspace(10, 40, 9), np.linspace(-5, 15, 7), indexing="ij")
    net = np.stack([u, v, 3 * np.sin(u / 4) * np.cos(v / 5)], axis=-1)
    return BSplineSurface(net, clamped_knots(9, 3, (2.0, 5.0)), clamped_knots(7, 3), 3, 3)


def twice_areas(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def area(mesh: Mesh) -> float:
    return float(np.linalg.norm(twice_areas(mesh), axis=1).sum() / 2)


def distances(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Distance of each point from the nearest of many samples of the triangles, an independent oracle."""
    from scipy.spatial import KDTree

    weights = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12
    samples = np.einsum("wc,fcd->fwd", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
    return KDTree(samples).query(points)[0]


@pytest.mark.parametrize("tolerance", [0.03, 0.004])
def test_a_sphere_is_met_to_the_tolerance_and_its_area_to_what_follows_from_it(tolerance):
    mesh = tessellate(SPHERE, tolerance=tolerance)
    assert 0.1 * tolerance < mesh.max_error <= tolerance
    radii = np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1) - [3.0, 1.0, 2.0], axis=1)
    assert 2.0 - tolerance - 1e-12 <= radii.min() and radii.max() <= 2.0
    # A polyhedron inscribed in a sphere of radius r that is nowhere further than e from it has at least (1 -
    # e / r)^2 of its area.
    whole = 16 * np.pi
    assert whole * (1 - tolerance / 2) ** 2 < area(mesh) < whole


def test_the_stated_error_is_that_of_dense_sampling():
    surface = wavy()
    mesh = tessellate(surface, resolution=(14, 11))
    rng = np.random.default_rng(3)
    dense = points_at(surface, rng.uniform((2.0, 0.0), (5.0, 1.0), (40_000, 2)))
    found = distances(dense, mesh).max()
    spacing = np.sqrt(area(mesh) / len(mesh.faces)) / 12
    assert mesh.max_error <= found + spacing
    assert found <= 1.25 * mesh.max_error + spacing


def test_the_default_tolerance_is_a_thousandth_of_the_size():
    surface = wavy()
    mesh = tessellate(surface)
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    assert mesh.max_error <= 1.001e-3 * size
    assert len(mesh.faces) < 4000


def test_twist_without_bent_parameter_lines_is_seen():
    mesh = tessellate(Saddle(), tolerance=5e-3)
    assert 5e-4 < mesh.max_error <= 5e-3


def test_a_flat_sheet_needs_two_triangles():
    mesh = tessellate(Plane((5000.0, 0.0, 0.0), (0.0, 0.0, 1.0), size=40.0))
    assert len(mesh.faces) == 2 and mesh.max_error < 1e-9
    np.testing.assert_allclose(area(mesh), 1600.0)


@pytest.mark.parametrize("surface", [SPHERE, Cylinder((0.0, 0, 0), (0, 0, 1.0), 2.0, 9.0), wavy()], ids=type)
def test_no_triangle_is_degenerate_and_all_run_round_their_normals(surface):
    mesh = tessellate(surface)
    cross = twice_areas(mesh)
    edges = np.linalg.norm(np.diff(mesh.vertices[mesh.faces], axis=1, append=mesh.vertices[mesh.faces[:, :1]]), axis=2)
    assert (np.linalg.norm(cross, axis=1) > 1e-6 * edges.max(axis=1) ** 2).all()
    assert (np.einsum("fd,fd->f", cross, mesh.normals[mesh.faces].mean(axis=1)) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(points_at(surface, mesh.parameters), mesh.vertices, atol=1e-9)


def test_normals_are_those_of_the_surface_at_poles_too():
    mesh = tessellate(SPHERE, resolution=(9, 7))
    outward = (mesh.vertices - [3.0, 1.0, 2.0]) / 2.0
    sign = np.sign(np.sum(np.asarray(normal(SPHERE, 0.3, 0.2)) * (np.asarray(SPHERE(0.3, 0.2)) - [3, 1, 2])))
    np.testing.assert_allclose(mesh.normals, sign * outward, atol=1e-9)


def test_lines_lie_on_a_crease():
    net = np.array([[[x, y, abs(x - 1.0)] for y in (0.0, 4.0)] for x in (0.0, 1.0, 3.0)])
    mesh = tessellate(BSplineSurface(net, clamped_knots(3, 1), clamped_knots(2, 1), 1, 1))
    assert len(mesh.faces) == 4 and mesh.max_error < 1e-12


def polygon(corners) -> BSplineCurve:
    corners = np.array([*corners, corners[0]], dtype=float)
    return BSplineCurve(corners, clamped_knots(len(corners), 1, (1.0, 3.0)), 1)


def circle(center, radius, count=24) -> BSplineCurve:
    angle = np.linspace(0, -2 * np.pi, count)
    corners = np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners[-1] = corners[0]
    return BSplineCurve(corners, clamped_knots(count, 3), 3)


def test_a_trimmed_plane_has_the_area_of_its_loops():
    plane = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), size=10.0)
    (u0, u1), (v0, v1) = (tuple(map(float, side)) for side in plane.domain)
    at = lambda x, y: (u0 + x * (u1 - u0), v0 + y * (v1 - v0))
    outer = polygon([at(0.1, 0.1), at(0.9, 0.1), at(0.7, 0.9), at(0.1, 0.8)])
    hole = circle(at(0.4, 0.4), 0.15 * (u1 - u0))
    mesh = tessellate(TrimmedSurface(plane, (outer, hole)), tolerance=1e-3)
    ring = np.asarray(hole(jnp.linspace(0, 1, 4001)))
    x, y = ring[:, 0], ring[:, 1]
    hole_area = abs(0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / ((u1 - u0) * (v1 - v0)) * 100
    np.testing.assert_allclose(area(mesh), 53.0 - hole_area, rtol=1e-3)
    assert mesh.max_error <= 1e-3


def test_a_trimmed_sheet_ends_on_its_loops_and_keeps_the_tolerance():
    outer = polygon([(2.1, 0.05), (4.9, 0.05), (4.9, 0.95), (2.1, 0.95)])
    hole = circle((3.5, 0.5), 0.3)
    surface = TrimmedSurface(wavy(), (outer, hole))
    mesh = tessellate(surface, tolerance=0.02)
    assert mesh.max_error <= 0.02
    edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 2
    border = mesh.parameters[np.unique(edges[count == 1])]
    on_outer = np.minimum(np.abs(border - [2.1, 0.05]), np.abs(border - [4.9, 0.95])).min(axis=1) < 1e-12
    ring = np.asarray(hole(jnp.linspace(0, 1, 200_001)))
    from scipy.spatial import KDTree

    assert (on_outer | (KDTree(ring).query(border)[0] < 1e-5)).all()
    assert not inside(mesh.parameters[mesh.faces].mean(axis=1), [ring[::100]]).any()


def test_bad_requests_are_refused():
    with pytest.raises(InputError, match="`tolerance` must be a positive length, got -1"):
        tessellate(SPHERE, tolerance=-1.0)
    with pytest.raises(InputError, match="both fix the density"):
        tessellate(SPHERE, tolerance=0.1, resolution=(4, 4))
    with pytest.raises(InputError, match="`resolution` must be at least"):
        tessellate(SPHERE, resolution=(1, 4))
    with pytest.raises(InputError, match="not finite numbers"):
        tessellate(Saddle(scale=jnp.nan))


def test_a_mesh_checks_its_shapes():
    three = np.eye(3)
    with pytest.raises(InputError, match="`parameters` must have shape"):
        Mesh(three, np.array([[0, 1, 2]]), np.zeros((2, 2)), three, 0.0)
    with pytest.raises(InputError, match="`faces` must have shape"):
        Mesh(three, np.array([0, 1, 2]), np.zeros((3, 2)), three, 0.0)
    with pytest.raises(InputError, match="indices from 0 to 2, got 0 to 3"):
        Mesh(three, np.array([[0, 1, 3]]), np.zeros((3, 2)), three, 0.0)
