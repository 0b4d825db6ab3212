"""Repaired creases: both parts touch along each of them, and little else moves. Figure 11 is tested with the gallery."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.io._occt_session import occt

N = 64
SHARES = np.linspace(0, 1, N)
KINKED = np.array([0.0, 0, 0.5, 1, 1])


def roof(height=0.5, ends=0.0, knots=KINKED):
    """Ridges and valleys at the inner knots of v, flat at both ends but for `ends`."""
    net = np.stack(np.meshgrid(np.arange(5.0), np.linspace(0, 2, len(knots) - 2), indexing="ij"), axis=-1)
    net = np.concatenate([net, np.zeros((*net.shape[:2], 1))], axis=-1)
    net[:, 1::2, 2] = height * np.array([ends, ends, 1, ends, ends])[:, None]
    net[2, :, 1] += 0.3
    return js.BSplineSurface(net, js.clamped_knots(5, 4), knots, 4, 1)


def sides(surface):
    """Points and derivatives on the sides v = first, v = last, u = first and u = last, (4, N, …)."""
    (a, b), (c, d) = ((float(x), float(y)) for x, y in surface.domain)
    zero, one = 0 * SHARES, 1 + 0 * SHARES
    u, v = np.concatenate([SHARES, SHARES, zero, one]), np.concatenate([zero, one, SHARES, SHARES])
    found = js.partials(surface, (1 - u) * a + u * b, (1 - v) * c + v * d)  # as many places as the conversion asks for
    return jax.tree.map(lambda x: np.asarray(x).reshape(4, N, 3), found)


def angles(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(np.asarray(a) * np.asarray(b), axis=-1))


def gap(before, after):
    """The largest angle between normals over the seam from one part to the next; the points are the same."""
    np.testing.assert_allclose(before.point[1], after.point[0], rtol=0, atol=1e-12)
    return angles(before.normal[1], after.normal[0]).max()


@pytest.fixture(scope="module")
def ridge() -> Any:
    return js.smooth_creases(roof())


def test_parts_touch_and_keep_their_boundary(ridge):
    assert float(js.creases(roof()).angles[0]) > 0.1
    bent = [sides(part) for part in ridge]
    assert gap(*bent) < 1e-12
    for part, there in zip(ridge, bent, strict=True):
        (a, b), (c, d) = ((float(x), float(y)) for x, y in part.domain)
        corners = np.asarray(part.surface.grid(a + (b - a) * SHARES, c + (d - c) * SHARES))
        wanted = corners[:, 0], corners[:, -1], corners[0], corners[-1]
        np.testing.assert_allclose(there.point, wanted, rtol=0, atol=1e-12)
    # the side beyond the crease keeps its tangent planes as well
    u, v = np.linspace(0, 1, 33), np.zeros(33)
    ends = np.array([0, -1])
    assert angles(bent[0].normal[0][ends], js.normal(ridge[0].surface, u, v)[ends]).max() < 1e-12


def test_a_network_gives_the_parts_of_its_patches():
    network = js.network([js.Line([0.0, y, 0], [1.0, y, 0.2 * y]) for y in (0.0, 1.0)], [js.Line([0.0, 0, 0], [0.0, 1, 0])])
    (part,), (patch,) = js.smooth_creases(network), network.patches
    np.testing.assert_array_equal(part(0.3, 0.6), patch(0.3, 0.6))


def test_a_kink_of_the_rim_is_rounded_and_parts_between_creases_are_bent_at_both_ends():
    """The creases stay as curves; the rims, which have the kinks too, do not."""
    surface = roof(ends=0.5, knots=np.array([0.0, 0, 0.25, 0.5, 0.75, 1, 1]))
    assert js.creases(surface).angles.min() > 0.1
    parts: Any = js.smooth_creases(surface)
    bent = [sides(part) for part in parts]
    assert len(bent) == 4
    for k in range(3):
        assert gap(bent[k], bent[k + 1]) < 1e-12
    for part, there in zip(parts, bent, strict=True):
        (_, _), (c, d) = part.domain
        rim = np.asarray(part.surface.grid(SHARES, float(c) + (float(d) - float(c)) * SHARES))
        np.testing.assert_allclose(there.point[:2], (rim[:, 0], rim[:, -1]), rtol=0, atol=1e-12)
        assert 0.003 < np.abs(there.point[2:] - rim[[0, -1]]).max() < 0.1


def test_a_ring_with_rows_of_u_stays_smooth_where_it_closes():
    turns = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=-1)
    net = np.stack([ring, 2 * ring + [0, 0, 1], 2 * ring + [0, 0.3, 3]])
    tube = js.BSplineSurface(net, KINKED, np.arange(7.0), 1, 3, periodic_v=True)
    before, after = (sides(part) for part in js.smooth_creases(tube, direction="u"))
    np.testing.assert_allclose(before.point[3], after.point[2], rtol=0, atol=1e-12)
    assert angles(before.normal[3], after.normal[2]).max() < 1e-12
    for part in (before, after):
        np.testing.assert_allclose(part.point[0], part.point[1], rtol=0, atol=1e-12)
        assert angles(part.normal[0], part.normal[1]).max() < 1e-12


def test_without_creases_the_surface_itself_comes_back():
    plane = roof(height=0.0)
    (same,) = js.smooth_creases(plane)
    assert same is plane
    assert len(js.smooth_creases(roof(), angle=3.0)) == 1


def test_gradients_of_parts(ridge):
    """By the control points of the surface beneath, its planes kept; forward, reverse and by differences."""
    part = ridge[0]
    base = part.surface.control_points
    step = jnp.asarray(np.random.default_rng(0).normal(size=base.shape))

    def height(points):
        return eqx.tree_at(lambda s: s.surface.control_points, part, points).point(jnp.array(0.4), jnp.array(0.35))[2]

    slope = jnp.vdot(jax.jit(jax.grad(height))(base), step)
    value = jax.jit(height)
    difference = (value(base + 1e-6 * step) - value(base - 1e-6 * step)) / 2e-6
    np.testing.assert_allclose(slope, difference, rtol=1e-7)


def test_a_fold_is_refused():
    with pytest.raises(js.InputError, match=r"folds back by 1[5-7]\d° at v = 0.5, u = 0.5, .* more than 150°"):
        js.smooth_creases(roof(height=40.0))


def faces(path):
    """The geometry of the faces of a STEP file, as OCCT reads it."""
    reader = occt("STEPControl").STEPControl_Reader()
    assert reader.ReadFile(str(path)) == occt("IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone
    reader.TransferRoots()
    explorer = occt("TopExp").TopExp_Explorer(reader.OneShape(), occt("TopAbs").TopAbs_ShapeEnum.TopAbs_FACE)
    found = []
    while explorer.More():
        found.append(occt("BRep").BRep_Tool.Surface_s(occt("TopoDS").TopoDS.Face(explorer.Current())))
        explorer.Next()
    return found


def occt_normal(surface, u, v):
    at = occt("GeomLProp").GeomLProp_SLProps(surface, u, v, 1, 1e-12).Normal()
    return np.array([at.X(), at.Y(), at.Z()])


def test_the_seam_in_a_step_file_as_occt_measures_it(ridge, tmp_path):
    """A spline within 1e-5 of each part would be off by 1e-4 rad; that it keeps its planes is part of its conversion."""
    found = [js.to_bspline(part, 1e-5) for part in ridge]
    assert max(float(x.max_error) for x in found) <= 1e-5
    js.io.write_step(tmp_path / "roof.step", [x.shape for x in found])
    first, second = faces(tmp_path / "roof.step")
    api = occt("GeomAPI")
    off = []
    for u in SHARES:
        foot = api.GeomAPI_ProjectPointOnSurf(first.Value(float(u), 0.5), second)
        assert foot.LowerDistance() < 1e-9
        a, b = occt_normal(first, float(u), 0.5), occt_normal(second, *foot.LowerDistanceParameters())
        off.append(float(angles(a, b)))
    assert max(off) < 1e-6


def test_planes_that_a_spline_does_not_keep_are_told(ridge, monkeypatch):
    monkeypatch.setattr("jaxsurf.build._smooth_creases._ROUNDS", 1)
    with pytest.warns(js.GeometryWarning, match=r"keeps the planes along v1 within .* higher `degree`"):
        assert float(js.to_bspline(ridge[0], 1e-5).max_error) <= 1e-5


def test_parts_are_saved_and_loaded(ridge, tmp_path):
    js.save(tmp_path / "part.jxs", ridge[1])
    read = js.load(tmp_path / "part.jxs")
    jax.tree.map(np.testing.assert_array_equal, read, ridge[1])
