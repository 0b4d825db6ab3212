"""The gallery makes its pages, and what it measures holds."""

import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.cli import main
from jaxsurf.gallery import names, page


@pytest.fixture(scope="module")
def quaternion_integrals():
    return page("quaternion-integrals")


def test_figure_2_has_five_surfaces_that_keep_their_promises(quaternion_integrals):
    (table,) = quaternion_integrals.measured
    assert [row[0] for row in table.rows] == list("abcde")
    assert [row[1] for row in table.rows] == ["3 and 3 × 3"] * 4 + ["4 and 4 × 4"]
    for row in table.rows:
        speed_off, edge_off, gap, length = row[2:]
        assert speed_off < 1e-11 * length and edge_off < 1e-13 * length
    gaps = [row[4] for row in table.rows]
    assert gaps[0] < 1e-12 and gaps[2] < 1e-12  # a and c have equal columns: translation surfaces
    assert gaps[3] > 0.1 and gaps[4] > 0.01


def test_figure_2_differs_where_the_paper_says(quaternion_integrals):
    a, b, c, d, e = (quaternion_integrals.shapes[letter] for letter in "abcde")
    bend = lambda surface: float(surface.spine(0.5)[2] - (surface.spine(0.0)[2] + surface.spine(1.0)[2]) / 2)
    assert bend(c) > 0.1 and bend(b) == bend(c) and bend(a) < -0.1 and bend(d) == bend(a)
    np.testing.assert_array_equal(np.asarray(b.tangents)[:2], np.asarray(c.tangents)[:2])
    assert np.abs(np.asarray(b.tangents - c.tangents))[2].max() > 0.5
    assert e.tangents.shape == (4, 4, 3) and e.spine.tangents.shape == (4, 3)


def test_pictures_show_different_surfaces(quaternion_integrals):
    pictures = [pixels for _, _, pixels in quaternion_integrals.pictures]
    assert all(p.shape == pictures[0].shape and p.std() > 10 for p in pictures)
    for i, one in enumerate(pictures):
        for other in pictures[:i]:
            assert np.mean(np.abs(one.astype(float) - other)) > 1


def test_the_command_line_writes_pages(tmp_path, capsys):
    assert main(["gallery", "quaternion-integrals", "-o", str(tmp_path / "out")]) == 0
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"quaternion-integrals.html", *(f"quaternion-integrals-{letter}.png" for letter in "abcde")}
    assert "quaternion-integrals.html" in capsys.readouterr().out
    text = (tmp_path / "out" / "quaternion-integrals.html").read_text()
    assert text.count("data:image/png") == 5 and "3 and 3 × 3" in text


def test_figures_1_to_3_of_paper_003_keep_what_was_given():
    made = page("joins")
    (table,) = made.measured
    assert [row[0] for row in table.rows] == ["1", "2", "3"] and [row[1] for row in table.rows] == [4, 6, 6]
    moved, *jumps, bends = np.array([row[2:] for row in table.rows], float).T
    assert np.all(moved == 0) and np.max(jumps) < 1e-14
    assert bends[1] > 1 and bends[2] < 1e-14
    pictures = [pixels for _, _, pixels in made.pictures]
    green = [np.mean((p[..., 1] > p[..., 0] + 20.0) & (p[..., 1] > p[..., 2] + 20.0)) for p in pictures]
    assert green[0] == 0 and min(green[1:]) > 0.003  # arrows of second derivatives on joins


def test_unknown_pages_and_folders_that_cannot_be_made(tmp_path, capsys):
    assert main(["gallery", "cubism", "-o", str(tmp_path)]) == 2
    assert "quaternion-integrals" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(js.InputError, match="Cannot make the folder"):
        from jaxsurf.gallery import write_page

        write_page(tmp_path / "file" / "under", names()[0])


@pytest.fixture(scope="module")
def sweeps():
    return page("sweeps")


def test_figures_1_to_12_of_paper_000_are_there(sweeps):
    names = [file for file, _, _ in sweeps.pictures]
    assert {name.rstrip("abcdef") for name in names} == {"1", "2", "3", "4", "5", "9", "10", "11", "12"}
    assert all(pixels.std() > 5 for _, _, pixels in sweeps.pictures)
    assert sweeps.shapes["1"].forms.count("2 guides + 2 characters") == 4


def table(made, start):
    return next(t.rows for t in made.measured if t.caption.startswith(start))


def test_sweeps_of_figure_4_stay_on_their_guides(sweeps):
    distances = [value for row in table(sweeps, "Figure 4") for value in row[2:] if value is not None]
    assert len(distances) == 9 and max(distances) < 1e-14


def test_the_crease_of_figure_5_is_found_and_split(sweeps):
    (_, _, smooth, one), (_, _, folded, two) = table(sweeps, "Figure 5")
    assert smooth < 1e-6 and one == 1 and folded > 10 and two == 2


def test_figure_11_repairs_the_crease_and_keeps_the_guides(sweeps):
    (_, _, before, _, _), (_, _, after, moved, off) = table(sweeps, "Figure 11")
    assert before > 0.9 and after < 1e-12 and 0.01 < moved < 0.2 and off < 1e-12
    assert [type(part).__name__ for part in sweeps.shapes["11b"]] == ["TangentSurface"] * 2


def test_extended_coons_waves_where_the_sweep_does_not(sweeps):
    coons, swept = table(sweeps, "Figure 12")
    assert coons[2] > 0.5 and swept[2] == 0
    assert coons[4] > 10 * swept[4]
