"""What every sweep promises: it starts at its first character, ends at its second one, and runs along its guides."""

import numpy as np
import pytest
from sweep_cases import GUIDES, carried, close, grid_places, sweep

WITHIN = 1e-13
ALONE = [(name, rotation) for name in GUIDES if name != "NURBS" for rotation in ("guide", "minimal")]
ALONE += [("B-splines", "fixed"), ("arcs", "frenet"), ("helices", "frenet"), ("NURBS", "up"), ("line and arc", "up")]
BOTH = [(name, "chord+guide", True) for name in GUIDES] + [
    (name, "chord", "chord") for name in GUIDES if name != "quaternion integrals"
]
BOTH += [("arcs", "chord", True), ("line and arc", "guide", "chord")]


def checked(case):
    """All boundaries that the sweep has, to 1e-13."""
    surface, characters, guides = case
    u, v = grid_places(surface)
    points = np.asarray(surface.grid(u, v))
    for character, row, name in zip(characters, (points[:, 0], points[:, -1]), ("first", "second"), strict=False):
        close(row, character(carried(u, surface.domain[0], character.domain)), WITHIN, f"{name} character")
    for guide, row, name in zip(guides, (points[0], points[-1]), ("first", "second"), strict=False):
        close(row, guide(carried(v, surface.domain[1], guide.domain)), WITHIN, f"{name} guide")


@pytest.mark.parametrize(("name", "rotation"), ALONE)
def test_with_one_guide_boundaries_are_the_characters_and_the_guide(name, rotation):
    checked(sweep(name, rotation, count=2))


@pytest.mark.parametrize(("name", "rotation", "scale"), BOTH)
def test_with_two_guides_boundaries_are_the_characters_and_the_guides(name, rotation, scale):
    checked(sweep(name, rotation, two=True, count=2, scale=scale))


@pytest.mark.parametrize("rotation", ["fixed", "guide", "minimal"])
def test_with_one_character_it_starts_at_it_and_runs_along_the_guide(rotation):
    checked(sweep("B-splines", rotation))


@pytest.mark.parametrize("scale", [True, "chord"])
def test_with_one_character_it_starts_at_it_and_runs_along_both_guides(scale):
    checked(sweep("helices", "guide", two=True, scale=scale))
