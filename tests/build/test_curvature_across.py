"""Surfaces bent to planes and to normal curvatures across their sides."""

import numpy as np
import pytest
from build.tangency_cases import KNOTS, SIDES, boundary_error, report, surface, tilted, to

import jaxsurf as js


def neighbour(seed=0):
    """The same boundary curves and corners, other planes and curvatures amid the sides, of its own at corners too."""
    return tilted(seed, twisted=True)


@pytest.mark.parametrize(("sides", "operator"), [(("u1",), "auto"), (("v0", "v1"), "hermite"), (SIDES, "gregory")])
def test_planes_and_curvatures_of_a_neighbour_are_met(sides, operator):
    base, given = surface(2), to(neighbour(2), *sides)
    if sides == SIDES:  # two neighbours, which do not fit together at corners
        given |= to(tilted(2), "v0", "v1")
    found = report(base, **given, operator=operator, order=2)
    assert found.operator == (operator if operator != "auto" else "hermite")
    assert [row.side for row in found.sides] == list(sides)
    for row in found.sides:
        assert row.before > 0.05 and row.after < 1e-12
        assert row.bend_before > 0.1 and row.bend_after < 1e-10 * max(1.0, row.curvature)
        assert row.boundary < 1e-12  # the neighbour has the same boundary curves
    assert len(found.corners) == (4 if len(sides) == 4 else 0)
    if found.corners:
        assert not found.compatible and max(abs(corner.twist) for corner in found.corners) > 1e-3
        assert "corner u1 v0" in str(found)
    bent = js.tangent_to(base, **given, operator=operator, order=2)
    assert boundary_error(bent, base) < 1e-13


def test_the_gap_to_a_neighbour_beyond_as_continuity_measures_it():
    """An independent measure: exact feet, normals and curvatures of both surfaces along the edge that they share."""
    base = surface()
    net = np.asarray(base.control_points)
    first, second = net[-1] - net[-2], net[-2] - net[-3]
    beyond = np.stack([net[-1], net[-1] + first, net[-1] + 5 * first - second, *(net[-1] + x * first for x in (6, 7))])
    amid = np.array([0, 0, 1.0, 0, 0])[:, None] * [0, 0, 1.0]
    beyond[1:3] += 0.05 * amid, 0.2 * amid
    other = js.BSplineSurface(beyond, KNOTS, KNOTS, 3, 3)
    bent = js.tangent_to(base, u1=(other, "u0"), order=2)
    before, after = (js.continuity(shape, other, side_a="u1", side_b="u0") for shape in (base, bent))
    assert float(np.max(before.g1)) > 0.05 and float(np.max(before.g2)) > 0.05
    assert float(np.max(after.g1)) < 1e-9 and float(np.max(after.g2_relative)) < 1e-8


def test_prescribed_curvatures_by_number_numbers_and_function_are_the_same():
    base, target = surface(), tilted()
    at = np.linspace(0, 1, 9)
    with pytest.warns(js.GeometryWarning, match="move by up to"):
        one = js.tangent_to(base, **to(target, "u0"), order=2, curvature={"u0": 0.7})
    with pytest.warns(js.GeometryWarning, match="move by up to"):
        found = report(base, **to(target, "u0"), order=2, curvature={"u0": np.full(5, 0.7)})
    (row,) = found.sides
    assert row.after < 1e-12 and row.bend_after < 1e-10 and row.curvature == pytest.approx(0.7, abs=1e-12)
    assert row.bend_before > 0.1 and row.boundary > 1e-3
    moved = np.linalg.norm(np.asarray(one.grid(at, at)) - np.asarray(base.grid(at, at)), axis=-1)
    assert moved[:, [0, -1]].max() == pytest.approx(row.boundary, rel=0.01)  # where curves meet the side
    assert moved[[0, -1]].max() < 1e-13
    with pytest.warns(js.GeometryWarning):
        other = js.tangent_to(base, **to(target, "u0"), order=2, curvature={"u0": lambda v: 0.7 + 0 * v})
    np.testing.assert_allclose(np.asarray(other.grid(at, at)), np.asarray(one.grid(at, at)), rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"order": 3}, "`order` must be 1 .* or 2 .*, got 3"),
        ({"curvature": {"u0": 1.0}}, "`curvature` counts with `order=2` alone"),
        ({"order": 2, "operator": "scaling"}, "`operator` of order 2 must be auto, hermite or gregory, got 'scaling'"),
        ({"order": 2, "curvature": {"v0": 1.0}}, "`curvature` must be of sides with normals, .* got 'v0'"),
        ({"order": 2, "curvature": {"u0": np.zeros((2, 2))}}, r"`curvature` of u0 must be a number, numbers \(n,\)"),
    ],
)
def test_what_is_refused(options, sentence):
    with pytest.raises(js.InputError, match=sentence):
        js.tangent_to(surface(), **to(tilted(), "u0"), **options)


def test_planes_without_curvatures_are_refused_for_order_2():
    base = surface()
    samples = js.normal(tilted(), np.zeros(81), np.linspace(0, 1, 81))
    with pytest.raises(js.InputError, match="`u0` needs curvatures across it for `order=2`"):
        js.tangent_to(base, u0=samples, order=2, tolerance=1e-3)
