"""`jaxsurf join`: measuring ranges in files, one surface in files of every kind."""

import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    rng, path = np.random.default_rng(2), tmp_path_factory.mktemp("ranges")
    for name, ends in (("left", (0, 5)), ("right", (4, 9)), ("far", (20, 25))):
        x, y = rng.uniform(*ends, 300), rng.uniform(0, 5, 300)
        np.savetxt(path / f"{name}.xyz", np.stack([x, y, 0.8 * np.sin(0.5 * x) * np.cos(0.4 * y)], axis=-1))
    return path


def test_two_ranges_become_one_surface(folder, capsys):
    targets = [folder / name for name in ("part.step", "part.jxs")]
    given = [str(folder / f"{name}.xyz") for name in ("left", "right")]
    shown = [str(folder / name) for name in ("r.html", "p.png")]
    options = ["--spans", "4x4", "--align", "--report", shown[0], "--picture", shown[1]]
    assert main(["join", *given, *(x for path in targets for x in ("-o", str(path))), *options]) == 0
    said = capsys.readouterr().out
    assert "range 2 right.xyz: column, row" in said and "turned by" in said and "reference" in said
    assert "seam: " in said and "jumps" in said and "wrote " in said
    surface = js.load(targets[1])
    assert isinstance(surface, js.BSplineSurface)
    (read,) = js.io.read_step(targets[0])
    points = np.concatenate([np.loadtxt(path) for path in given])
    assert np.abs(np.asarray(js.closest_point(read, points).distance)).max() < 0.05
    text = (folder / "r.html").read_text()
    assert "Measuring ranges" in text and "right.xyz" in text and (folder / "p.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["left.xyz", "-o", "a.step"], "`jaxsurf join` needs two ranges or more, got 1; `jaxsurf fit` fits one"),
        (["left.xyz", "far.xyz", "-o", "a.step", "--spans", "4x4"], "Range 2 touches no other"),
        (["left.xyz", "none.xyz", "-o", "a.step"], "none.xyz"),
        (["left.xyz", "right.xyz"], "Nothing to write"),
        (["left.xyz", "right.xyz", "-o", "left.xyz"], "must end in one of"),
        (["left.xyz", "right.xyz", "-o", "a.step", "-o", "a.step"], "is named twice"),
        (["left.xyz", "right.xyz", "-o", "a.step", "--degree", "2"], "`degree` must be at least 3"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(folder, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(folder)
    assert main(["join", *arguments]) == 2
    *progress, said = capsys.readouterr().err.strip().splitlines()
    assert said.startswith("jaxsurf: ") and message in said and not any("jaxsurf:" in line for line in progress)
    assert not (folder / "a.step").exists()
