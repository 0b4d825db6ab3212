"""OCCT as the oracle of constructions: pipes, revolutions, prisms, ruled surfaces, Coons fills and Gordon surfaces.

What it cannot judge: its smooth `ThruSections` takes parameters of its own and approximates, so of lofts only two sections
are compared; its Coons fills blend poles and not points, which is the same for one span a side alone.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.io._occt_geometry import space_curve, surface_arrays
from jaxsurf.io._occt_session import occt
from jaxsurf.io._spline_arrays import spline_arrays

SHARES = np.linspace(0, 1, 11)
RNG = np.random.default_rng(0)
A, B, C, D = np.array([[0.0, 0, 0], [3, 0, 1], [0, 2, 1], [3, 2.5, 0]])


def spline(start, end, count, degree, domain=(0, 1)):
    points = np.linspace(start, end, count) + 0.2 * RNG.normal(size=(count, 3))
    points[0], points[-1] = start, end
    return js.BSplineCurve(points, js.clamped_knots(count, degree, domain), degree)


def theirs(curve):
    return space_curve(spline_arrays(curve))


def ours(surface):
    """A Geom_BSplineSurface as ours."""
    arrays = surface_arrays(surface)
    (knots_u, knots_v), (degree_u, degree_v) = arrays.knots, arrays.degrees
    if arrays.weights is not None:
        return js.NURBSSurface(arrays.points, arrays.weights, knots_u, knots_v, degree_u, degree_v)
    return js.BSplineSurface(arrays.points, knots_u, knots_v, degree_u, degree_v)


def values(surface, first, second):
    """Points of any Geom_Surface on a grid of its own parameters."""
    at = lambda s, t: [getattr(surface.Value(float(s), float(t)), name)() for name in "XYZ"]
    return np.array([[at(s, t) for t in second] for s in first])


GUIDE = js.BSplineCurve([[0, 0, 0], [1, 0, 0], [2, 1, 0], [3, 1.5, 0], [3.5, 3, 0]], js.clamped_knots(5, 3), 3)
SECTION = js.BSplineCurve([[0, -0.5, 0], [0.2, -0.2, 0.5], [0, 0.3, 0.4], [0, 0.5, 0]], js.clamped_knots(4, 3), 3)


@pytest.mark.parametrize(
    ("trihedron", "rotation", "tolerance"),
    [
        ("GeomFill_IsCorrectedFrenet", "minimal", 1e-6),
        ("GeomFill_IsCorrectedFrenet", "guide", 1e-6),
        ("GeomFill_IsFixed", "fixed", 1e-13),
    ],
)
def test_sweeps_along_a_plane_guide_against_pipes(trihedron, rotation, tolerance):
    """OCCT approximates its pipe to the tolerance that it is given; a rigid one is exact. Its Frenet pipe turns over at an
    inflection, where ours is refused, and is not compared."""
    room = occt("GeomFill")
    pipe = room.GeomFill_Pipe(theirs(GUIDE), theirs(SECTION), getattr(room.GeomFill_Trihedron, trihedron))
    pipe.Perform(1e-6, False)
    swept = js.sweep(SECTION, GUIDE, rotation=rotation)
    np.testing.assert_allclose(swept.grid(SHARES, SHARES), ours(pipe.Surface()).grid(SHARES, SHARES), atol=tolerance)


def test_revolutions():
    profile, point, axis = spline(A, B, 6, 3, (2, 5)), np.array([1.0, -2, 0.5]), np.array([0.3, -0.5, 1.0])
    gp = occt("gp")
    line = gp.gp_Ax1(gp.gp_Pnt(*point.tolist()), gp.gp_Dir(*axis.tolist()))
    angles, u = np.linspace(0, 2 * np.pi, 9), np.linspace(2, 5, 8)
    found = values(occt("Geom").Geom_SurfaceOfRevolution(theirs(profile), line), angles, u)
    turned = js.revolve(profile, point, axis)
    np.testing.assert_allclose(turned.grid(u, angles), np.swapaxes(found, 0, 1), atol=1e-13)
    converter = occt("GeomConvert").GeomConvert
    rational = ours(
        converter.SurfaceToBSplineSurface_s(bounded(occt("Geom").Geom_SurfaceOfRevolution(theirs(profile), line)))
    )
    ends = np.array([0, 0.5, 1]) * 2 * np.pi
    np.testing.assert_allclose(turned.as_nurbs().grid(u, ends), np.swapaxes(rational.grid(ends, u), 0, 1), atol=1e-12)


def bounded(surface):
    return occt("Geom").Geom_RectangularTrimmedSurface(surface, 0.0, 2 * np.pi, 2.0, 5.0)


def test_prisms():
    profile, vector = spline(A, B, 6, 3, (2, 5)), np.array([0.3, -0.5, 2.0])
    length = float(np.linalg.norm(vector))
    prism = occt("Geom").Geom_SurfaceOfLinearExtrusion(theirs(profile), occt("gp").gp_Dir(*vector.tolist()))
    u = np.linspace(2, 5, 8)
    np.testing.assert_allclose(js.extrude(profile, vector).grid(u, SHARES), values(prism, u, SHARES * length), atol=1e-13)


def test_lofts_of_two_sections_against_ruled_surfaces():
    """Of unequal degrees and knots."""
    first, second = spline(A, B, 6, 3), spline(C, D, 5, 2)
    ruled = ours(occt("GeomFill").GeomFill.Surface_s(theirs(first), theirs(second)))
    np.testing.assert_allclose(js.loft([first, second]).grid(SHARES, SHARES), ruled.grid(SHARES, SHARES), atol=1e-13)


@pytest.mark.parametrize(("style", "blend"), [("Stretch", js.linear), ("Coons", js.smoothstep)])
def test_coons_patches_against_fills(style, blend):
    """OCCT blends poles with their numbers as parameters, in both styles. For sides of one cubic span that is the
    blend of points, linear or cubic; for more spans it is another surface (0.04 off on sides of length 3)."""
    v0, v1, u0, u1 = (spline(*ends, 4, 3) for ends in ((A, B), (C, D), (A, C), (B, D)))
    room = occt("GeomFill")
    kind = getattr(room.GeomFill_FillingStyle, f"GeomFill_{style}Style")
    filled = ours(room.GeomFill_BSplineCurves(*(theirs(c) for c in (v0, u1, v1, u0)), kind).Surface())
    patch = js.coons(u0, u1, v0, v1, blend=blend)
    np.testing.assert_allclose(patch.grid(SHARES, SHARES), filled.grid(SHARES, SHARES), atol=1e-13)


def test_gordon_surfaces():
    """OCCT 8 takes the same cubic interpolation for 4 × 4 curves that meet exactly (and comes out at degree 9)."""
    net = np.stack(np.meshgrid(np.arange(6.0), np.arange(7.0), indexing="ij"), axis=-1)
    net = np.concatenate([net, 0.4 * RNG.normal(size=(6, 7, 1))], axis=-1)
    whole = js.BSplineSurface(net, js.clamped_knots(6, 3), js.clamped_knots(7, 3), 3, 3)
    at = lambda basis, t: np.asarray(basis.row(jnp.asarray(t)))
    rows = [np.einsum("j,ijd->id", at(whole.basis_v, v), net) for v in (0.0, 0.3, 0.7, 1.0)]
    columns = [np.einsum("i,ijd->jd", at(whole.basis_u, u), net) for u in (0.0, 0.25, 0.6, 1.0)]
    u_curves = [js.BSplineCurve(points, whole.knots_u, 3) for points in rows]
    v_curves = [js.BSplineCurve(points, whole.knots_v, 3) for points in columns]
    arrays = []
    for curves in (u_curves, v_curves):
        array = occt("collections").Array1_Geom_Curve(1, len(curves))
        for i, curve in enumerate(curves, start=1):
            array.SetValue(i, theirs(curve))
        arrays.append(array)
    maker = occt("GeomFill").GeomFill_Gordon()
    maker.Init(*arrays, 1e-6)
    maker.Perform()
    assert maker.IsDone() and not maker.IsApproximate()
    found = js.gordon(u_curves, v_curves)
    np.testing.assert_allclose(found.grid(SHARES, SHARES), ours(maker.Surface()).grid(SHARES, SHARES), atol=1e-12)
