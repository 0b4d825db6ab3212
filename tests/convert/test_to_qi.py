"""QI shapes in place of others, and with more control tangents; and B-splines in place of QI shapes."""

import numpy as np
import pytest

import jaxsurf as js

RNG = np.random.default_rng(5)
PLACES = RNG.uniform(size=60)
DIRECTIONS = np.array([1.0, 0.4, -0.3]) + 0.4 * RNG.normal(size=(6, 4, 3))


def surface(degree_u=2, degree_v=2):
    spine = js.QICurve([1.0, 2.0, 3.0], 1.5, DIRECTIONS[0], 2)
    return js.QISurface(spine, DIRECTIONS[:4], [1.0, 1.4, 1.2, 1.9], degree_u, degree_v)


def distance(a, b, *places):
    return float(np.linalg.norm(np.asarray(a(*places)) - np.asarray(b(*places)), axis=-1).max())


def test_a_helix_is_approached_at_fourth_order():
    helix = js.Helix((1, 2, 3), (0, 0, 1), 1.0, 0.6, 1.0)
    length = float(js.arc_length(helix))
    errors = []
    for count in (5, 9, 17):
        found = js.to_qi(helix, count)
        at = js.parameter_at_length(helix, length * PLACES / 1)
        off = np.asarray(found.shape(found.shape.domain[1] * PLACES)) - np.asarray(helix(at))
        assert np.linalg.norm(off, axis=1).max() <= 1.1 * float(found.max_error)
        errors.append(float(found.max_error) / length)
    assert errors[2] < 1e-6
    assert np.log2(errors[0] / errors[1]) > 4 and np.log2(errors[1] / errors[2]) > 4


def test_a_qi_curve_is_found_again():
    curve = js.QICurve([1.0, 2.0, 3.0], 2.5, DIRECTIONS[:, 0], 3)
    found = js.to_qi(curve, 6)
    assert float(found.max_error) < 1e-9
    np.testing.assert_allclose(found.shape.tangents, curve.tangents, atol=1e-7)
    before, _ = js.split(curve, 0.4)
    assert float(js.to_qi(before, 8).max_error) < 1e-5


def test_what_has_no_tangents_is_refused():
    with pytest.raises(js.InputError, match="length"):
        js.to_qi(js.Line((1, 1, 1), (1, 1, 1)), 4)
    with pytest.raises(js.InputError, match="parameter plane"):
        js.to_qi(js.Line((1.0, 1.0), (2.0, 1.0)), 4)
    with pytest.raises(js.InputError, match="at least degree . 1 = 4, got 3"):
        js.to_qi(js.Line((1, 1, 1), (2, 1, 1)), 3)


def test_a_tangent_more_keeps_circular_arcs():
    curve = js.QICurve([1.0, 2.0, 3.0], 2.5, DIRECTIONS[:, 0], 1)
    found = js.insert_tangent(curve, 0.37)
    assert found.shape.tangents.shape == (7, 3)
    assert float(found.max_error) < 1e-14 and distance(found.shape, curve, PLACES) < 1e-14


@pytest.mark.parametrize("degree", [2, 3])
def test_a_tangent_more_changes_other_curves_by_what_is_said(degree):
    curve = js.QICurve([1.0, 2.0, 3.0], 2.5, DIRECTIONS[:, 0], degree)
    found = js.insert_tangent(curve, 0.37)
    said, off = float(found.max_error), distance(found.shape, curve, PLACES)
    assert 0.2 * said < off <= 1.1 * said < 1e-3
    # much nearer than a row of tangents that was not fitted
    assert found.shape.tangents.shape == (7, 3) and float(found.shape.length) == float(curve.length)


def test_a_row_or_a_column_more():
    whole = surface(2, 1)
    along_v = js.insert_tangent(whole, 0.4, "v")
    assert along_v.shape.tangents.shape == (4, 5, 3)
    assert float(along_v.max_error) < 1e-11 and distance(along_v.shape, whole, PLACES, PLACES[::-1]) < 1e-11
    along_u = js.insert_tangent(whole, 0.4, "u")
    said, off = float(along_u.max_error), distance(along_u.shape, whole, PLACES, PLACES[::-1])
    assert along_u.shape.tangents.shape == (5, 4, 3) and 0.2 * said < off <= 1.1 * said < 0.05


def test_bad_places_for_a_tangent():
    with pytest.raises(js.InputError, match="inside the domain"):
        js.insert_tangent(surface(), 1.0, "u")
    with pytest.raises(js.InputError, match='"u" or "v"'):
        js.insert_tangent(surface(), 0.5)
    with pytest.raises(js.InputError, match="belongs to surfaces"):
        js.insert_tangent(surface().spine, 0.5, "u")


def test_to_bspline_measures_its_error():
    curve = js.QICurve([1.0, 2.0, 3.0], 2.5, DIRECTIONS[:, 0], 3)
    found = js.to_bspline(curve, 1e-9)
    assert isinstance(found.shape, js.BSplineCurve) and float(found.max_error) <= 1e-9
    assert distance(found.shape, curve, PLACES) <= 1e-9
    whole = surface()
    found = js.to_bspline(whole, 1e-7)
    assert isinstance(found.shape, js.BSplineSurface) and float(found.max_error) <= 1e-7
    assert distance(found.shape, whole, PLACES, PLACES[::-1]) <= 1e-7
