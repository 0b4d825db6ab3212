"""Networks with missing edges: figure 1 of paper 000."""

import numpy as np
import pytest
from build.network_cases import character, guide, height, largest_gap_of_edges, largest_gap_on

import jaxsurf as js

FULL, TWO_ONE = "2 guides + 2 characters", "2 guides + 1 character"
ONE_TWO, ONE_ONE = "1 guide + 2 characters", "1 guide + 1 character"

FIGURE_1 = {
    "a character between two of three guides": (
        lambda: ([guide(0), guide(0.5), guide(1)], [character(0), character(0.5, 0, 0.5), character(1)]),
        [FULL] * 3,
    ),
    "a guide that does not reach everywhere": (
        lambda: ([guide(0), guide(0.5, 0, 0.5), guide(1)], [character(0), character(0.5), character(1)]),
        [FULL] * 3,
    ),
    "the last character missing": (
        lambda: ([guide(0), guide(0.5), guide(1)], [character(0), character(0.5)]),
        [FULL, TWO_ONE, FULL, TWO_ONE],
    ),
    "the last guide missing": (
        lambda: ([guide(0), guide(0.5)], [character(0), character(0.5), character(1)]),
        [FULL, FULL, ONE_TWO, ONE_TWO],
    ),
    "both missing": (
        lambda: ([guide(0), guide(0.5)], [character(0), character(0.5)]),
        [FULL, TWO_ONE, ONE_TWO, ONE_ONE],
    ),
    "a corner missing": (
        lambda: ([guide(0), guide(0.5), guide(1, 0, 0.5)], [character(0), character(0.5), character(1, 0, 0.5)]),
        [FULL, FULL, FULL, ONE_ONE],
    ),
}


@pytest.mark.parametrize("name", FIGURE_1)
def test_networks_with_missing_edges(name):
    """Figure 1 of paper 000: broken lines are not given."""
    curves, forms = FIGURE_1[name]
    network = js.network(*curves(), tolerance=1e-3)
    assert sorted(network.forms) == sorted(forms)
    parts = [part for edge in network.inner_edges() for part in (edge.first_part, edge.second_part)]
    cut = [part for part in parts if set(part) != {0.0, 1.0}]
    assert len(cut) == (2 if "between" in name or "reach" in name else 0)  # a curve that ends amid a longer side
    assert any(node.sides for node in network.nodes) == bool(cut)
    for part in cut:
        assert min(part) == 0 or max(part) == 1
        assert np.diff(sorted(part))[0] == pytest.approx(0.5, abs=0.05)
    free = [edge for edge in network.outer_edges() if not edge.given]
    missing = {FULL: 0, TWO_ONE: 1, ONE_TWO: 1, ONE_ONE: 2}
    assert len(free) == sum(missing[form] for form in network.forms)
    if name == "a guide that does not reach everywhere":
        assert largest_gap_of_edges(network, 4) < 1e-13
    if name == "both missing":
        grid = np.asarray(network.grid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0]))
        assert largest_gap_on(grid, network) < 1e-13
        middles = grid[:, 1, 1]
        assert np.abs(middles[:, 2] - height(middles[:, 0], middles[:, 1])).max() < 0.12


def test_open_cells_can_be_left_out():
    curves = FIGURE_1["a corner missing"][0]()
    assert js.network(*curves, tolerance=1e-3, open_cells=False).forms == (FULL,) * 3
