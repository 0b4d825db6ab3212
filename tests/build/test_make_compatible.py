"""Normals turned as little as possible until all planes fit together at corners."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from build.tangency_cases import SIDES, at_odds, report, surface, tilted, to

import jaxsurf as js


def test_planes_at_odds_are_mended_so_that_all_are_met():
    base = surface()
    assert not report(base, **at_odds(), operator="gregory").compatible
    fields: Any = js.make_compatible(base, **at_odds())
    assert tuple(fields) == SIDES and set(fields.moved) == set(SIDES)
    assert all(1e-3 < angle < 0.5 for angle in fields.moved.values())
    found = report(base, **fields, operator="hermite")
    assert found.compatible and max(abs(corner.twist) for corner in found.corners) < 1e-12
    assert all(row.before > 0.02 and row.after < 1e-12 for row in found.sides)
    at = np.linspace(0, 1, 33)
    for side in SIDES:
        normals = np.asarray(fields[side](at))
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-14)
        fixed = np.full(33, float(side[1]))
        target = at_odds()[side][0]
        given = np.asarray(js.normal(target, *((fixed, at) if side[0] == "u" else (at, fixed))))
        turned = np.linalg.norm(np.cross(given, normals), axis=1).max()
        assert np.arcsin(turned) == pytest.approx(fields.moved[side], rel=1e-9)


def test_planes_that_fit_stay():
    fields: Any = js.make_compatible(surface(), **to(tilted(), "u0", "v1"))
    assert tuple(fields) == ("u0", "v1") and max(fields.moved.values()) < 1e-12


def test_normals_that_lean_along_a_side_and_off_at_its_ends_are_mended():
    base = surface()
    with pytest.raises(js.InputError, match="`u0` must"):
        js.tangent_to(base, u0=(0.3, 0.2, 1.0))
    fields: Any = js.make_compatible(base, u0=(0.3, 0.2, 1.0))
    (row,) = report(base, **fields, operator="hermite").sides
    assert row.off_side < 1e-12 and max(row.off_ends) < 1e-12 and row.after < 1e-12


def test_what_gives_no_normals_is_refused():
    with pytest.raises(js.InputError, match="`v0` must give finite normals"):
        js.make_compatible(surface(), v0=lambda u: jnp.full(3, jnp.nan))
    with pytest.raises(js.InputError, match="At least one of `u0`"):
        js.make_compatible(surface())
