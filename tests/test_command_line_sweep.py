"""`jaxsurf sweep`: curves in a TOML file, the surface in files of every kind."""

import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.cli import main

SPEC = """
rotation = "{rotation}"
[[guides]]
points = [[0, 0, 0], [1, 0, 0.5], [3, 0.2, 0.7], [5, 0, 0]]
[[guides]]
file = "second.csv"
[[characters]]
kind = "arc"
points = [[0, 0, 0], [0, 1, 0.6], [0, 2, 0]]
"""


@pytest.fixture
def folder(tmp_path):
    np.savetxt(tmp_path / "second.csv", [[0, 2, 0], [1, 2.4, 0.8], [3, 2.7, 1.1], [5, 2.2, 0]], delimiter=",")
    (tmp_path / "spec.toml").write_text(SPEC.format(rotation="guide"))
    return tmp_path


def test_a_sweep_is_made_and_written(folder, capsys):
    outputs = [folder / name for name in ("s.step", "s.jxs")]
    assert main(["sweep", str(folder / "spec.toml"), *(x for path in outputs for x in ("-o", str(path)))]) == 0
    said = capsys.readouterr().out
    assert "ChordGuideRotation" in said and "largest distance from guide 2" in said
    surface = js.load(outputs[1])
    assert isinstance(surface, js.Sweep) and outputs[0].stat().st_size > 1000
    np.testing.assert_allclose(surface(1.0, 0.0), [0, 2, 0], atol=1e-12)
    (read,) = js.io.read_step(outputs[0])
    corners = [[0, 0, 0], [0, 2, 0], [5, 0, 0], [5, 2.2, 0]]
    assert np.asarray(js.closest_point(read, np.array(corners)).distance).max() < 1e-5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"guide"', '"spiral"'), "`rotation` must be one of"),
        (("[[guides]]\npoints", "[[guides]]\nplaces"), "has the key 'places'"),
        (('kind = "arc"', 'kind = "bow"'), "`kind` in [[characters]] number 1"),
        (("[0, 1, 0.6], [0, 2, 0]]", "[0, 1, 0.6]]"), "takes 3 points, got 2"),
        (("[0, 1, 0.6], [0, 2, 0]]", "[0, 1, 0.6], [0, 3, 0]]"), "ends 1 from where `guides[1]` starts"),
        (("second.csv", "third.csv"), "third.csv"),
        (('rotation = "', "rotation = "), "is not TOML"),
        (("[[characters]]", "[[profiles]]"), "has the key 'profiles'"),
        (("[3, 0.2, 0.7]", "[3, 0.2]"), "must be a list of [x, y, z]"),
    ],
)
def test_bad_specs_get_one_sentence_and_write_nothing(folder, capsys, change, message):
    path = folder / "spec.toml"
    assert change[0] in path.read_text()
    path.write_text(path.read_text().replace(*change))
    assert main(["sweep", str(path), "-o", str(folder / "s.jxs")]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not (folder / "s.jxs").exists()


def test_a_missing_spec(tmp_path, capsys):
    assert main(["sweep", str(tmp_path / "none.toml"), "-o", str(tmp_path / "s.jxs")]) == 2
    assert "There is no file" in capsys.readouterr().err
