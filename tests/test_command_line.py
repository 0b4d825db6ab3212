"""The command line: what it writes, prints and returns, and how it refuses."""

import contextlib
import io
import os
import re
import runpy
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache

import jaxsurf as js
from jaxsurf._errors import InputError
from jaxsurf._progress import Event
from jaxsurf.cli import main
from jaxsurf.cli._progress_bar import watching

FORMATS = runpy.run_path(str(Path(__file__).parent / "io" / "cloud_files.py"))["FORMATS"]
NOISE = 0.005
OPTIONS = ("output", "spans", "tolerance", "quantile", "max-spans", "degree", "smooth", "loss", "holdout", "trim")
OPTIONS += ("unit", "report", "picture", "save", "quiet", "family", "tangents", "rotation")
OPTIONS += ("processes", "distributed", "checkpoint", "resume")
CACHE = (
    "jax_enable_x64",
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)


def sheet(count=600):
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0, [[12.0], [7.0]], (2, count))
    return np.stack([u, v, 0.03 * u * v - 0.05 * u**2], -1) + NOISE * rng.normal(size=(count, 3))


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """A cache of compiled programs of its own, and afterwards the settings as they were."""
    folder = tmp_path_factory.mktemp("cache")
    before = {name: getattr(jax.config, name) for name in CACHE}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        compilation_cache.reset_cache()
        yield folder
    for name, value in before.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()


class Run(NamedTuple):
    status: Any
    out: str
    err: str


def run(*arguments) -> Run:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = stop.code
    return Run(status, out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def cloud(tmp_path_factory):
    path = tmp_path_factory.mktemp("cloud") / "sheet.xyz"
    np.savetxt(path, sheet())
    return path


# --- what is written


@pytest.fixture(scope="module")
def fitted(cloud, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fitted")
    names = {"--save": "s.jxs", "--picture": "d.png", "--report": "r.html", "-o": "s.step"}
    files = [part for option, name in names.items() for part in (option, folder / name)]
    return folder, run("fit", cloud, "--spans", "3x3", *files)


def test_a_fit_writes_every_file_that_was_named(fitted):
    folder, done = fitted
    assert done.status == 0
    assert sorted(path.name for path in folder.iterdir()) == ["d.png", "r.html", "s.jxs", "s.step"]
    assert (folder / "d.png").read_bytes().startswith(b"\x89PNG")
    step = (folder / "s.step").read_text()
    assert step.startswith("ISO-10303-21") and "B_SPLINE_SURFACE" in step and "MILLI" in step
    report = (folder / "r.html").read_text()
    assert "Surface fitted to sheet.xyz" in report and report.rstrip().endswith("</html>")


def test_the_saved_surface_meets_the_points(fitted):
    surface = js.load(fitted[0] / "s.jxs")
    assert surface.control_points.shape == (6, 6, 3)
    distance = np.asarray(js.closest_point(surface, sheet()).distance)
    assert np.sqrt(np.mean(distance**2)) < NOISE


def test_the_summary_names_every_figure(fitted):
    folder, done = fitted
    lines = [" ".join(line.split()) for line in done.out.splitlines()]
    for line in ("points 600", "control points 6 × 6 = 36", "degree 3 × 3", "spans 3 × 3"):
        assert line in lines
    for label in ("rms deviation", "largest deviation", "95% of the points within"):
        (line,) = [line for line in lines if re.match(label + r" [\d.]+ mm", line)]
        assert 0 < float(line.split()[-2]) < 6 * NOISE and line.endswith(" mm")
    assert any(line.startswith("rms deviation of") and "points left out" in line for line in lines)
    assert lines[-1] == "wrote " + ", ".join(str(folder / name) for name in ("s.step", "s.jxs", "d.png", "r.html"))


def test_progress_goes_to_the_other_stream(fitted):
    phases = [line.split(":")[0] for line in fitted[1].err.splitlines()]
    assert list(dict.fromkeys(phases)) == ["parametrise", "unroll", "fit 3 × 3 spans", "hold-out"]


SUFFIXES = (".stp", ".igs", ".iges", ".3dm", ".jxs", ".stl", ".obj", ".ply", ".glb")


def test_every_kind_of_file_quietly(cloud, tmp_path):
    targets = [tmp_path / f"s{suffix}" for suffix in SUFFIXES]
    outputs = [part for target in targets for part in ("-o", target)]
    assert run("fit", cloud, "--spans", "3x3", "--holdout", 0, "--quiet", *outputs) == (0, "", "")
    assert all(target.stat().st_size > 200 for target in targets)


def test_trimmed_faces_and_other_units(cloud, tmp_path):
    target = tmp_path / "s.step"
    done = run("fit", cloud, "--spans", "3x3", "--holdout", 0, "--trim", "--unit", "in", "-o", target)
    assert done.status == 0 and "rms deviation" in done.out and " in\n" in done.out
    assert "INCH" in target.read_text().upper()


def test_a_tolerance_out_of_reach_is_said(cloud, tmp_path):
    options = ("--spans", "3x3", "--max-spans", 3, "--tolerance", 1e-6, "--holdout", 0)
    done = run("fit", cloud, *options, "-o", tmp_path / "s.step")
    assert done.status == 0 and "The tolerance was not met: 0" in done.out


# --- quaternion integral surfaces


@pytest.fixture(scope="module")
def fitted_qi(cloud, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fitted_qi")
    names = {"--save": "s.jxs", "--report": "r.html", "-o": "s.step"}
    files = [part for option, name in names.items() for part in (option, folder / name)]
    return folder, run("fit", cloud, "--family", "qi", "--tangents", "3x3", "--holdout", 0, *files)


def printed(done, label):
    """The figure that the summary prints after a label."""
    (line,) = [line for line in done.out.splitlines() if line.startswith(label)]
    return float(line[len(label) :].split()[0])


def test_a_qi_surface_meets_the_points_as_near_as_is_printed(fitted_qi):
    folder, done = fitted_qi
    assert done.status == 0
    surface = js.load(folder / "s.jxs")
    assert isinstance(surface, js.QISurface) and surface.tangents.shape == (3, 3, 3)
    distance = np.asarray(js.closest_point(surface, sheet()).distance)
    rms = np.sqrt(np.mean(distance**2))
    assert abs(rms - printed(done, "rms deviation  ")) < 1e-3 * rms  # four digits are printed


def test_a_qi_surface_is_written_to_cad_and_reported_with_its_peer(fitted_qi):
    folder, done = fitted_qi
    assert sorted(path.name for path in folder.iterdir()) == ["r.html", "s.jxs", "s.step"]
    assert "B_SPLINE_SURFACE" in (folder / "s.step").read_text()
    lines = [" ".join(line.split()) for line in done.out.splitlines()]
    for line in ("control tangents 3 × 3, and 3 of the initial curve", "degree 2 × 2", "numbers that shape it 31"):
        assert line in lines
    assert printed(done, "rms deviation of a B-spline with 36 numbers") > 0
    report = (folder / "r.html").read_text()
    assert "3 × 3, and 3 of the initial curve" in report and "B-spline with 36 numbers" in report


# --- sweeps


@pytest.fixture(scope="module")
def fitted_sweep(cloud, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fitted_sweep")
    names = {"--save": "s.jxs", "--report": "r.html", "-o": "s.step"}
    files = [part for option, name in names.items() for part in (option, folder / name)]
    return folder, run("fit", cloud, "--family", "sweep", "--rotation", "fixed", "--holdout", 0, *files)


def test_the_file_of_a_sweep_meets_the_points_as_near_as_is_printed(fitted_sweep):
    """The file is as near to the sweep as 0.001 of its rms deviation."""
    folder, done = fitted_sweep
    assert done.status == 0
    (spline,) = js.io.read_step(folder / "s.step")
    distance = np.asarray(js.closest_point(spline, sheet()).distance)
    rms = np.sqrt(np.mean(distance**2))
    assert abs(rms - printed(done, "rms deviation  ")) < 2e-3 * rms  # four digits are printed


def test_the_kinds_of_sweeps_that_were_tried_are_printed_and_reported_the_best_first(fitted_sweep):
    folder, done = fitted_sweep
    pattern = r"tried fixed, 1 × 1 along the (longer|shorter) side: rms ([\d.]+) mm, 27 numbers"
    tried = [match for match in map(re.compile(pattern).fullmatch, done.out.splitlines()) if match]
    assert sorted(match[1] for match in tried) == ["longer", "shorter"]
    assert printed(done, "rms deviation  ") == float(tried[0][2]) <= float(tried[1][2])
    lines = [" ".join(line.split()) for line in done.out.splitlines()]
    for line in ("rotation of the sections Fixed", "control points of the guides 5", "numbers that shape it 27"):
        assert line in lines
    report = (folder / "r.html").read_text()
    assert "Kinds of sweeps that were tried" in report and "the shorter side" in report
    assert sorted(path.name for path in folder.iterdir()) == ["r.html", "s.jxs", "s.step"]


def test_the_surface_that_is_saved_is_the_sweep_of_the_file(fitted_sweep):
    folder, done = fitted_sweep
    (spline,) = js.io.read_step(folder / "s.step")
    surface = js.load(folder / "s.jxs")
    assert isinstance(surface, js.Sweep) and len(surface.guides.curves) == len(surface.characters) == 1
    shares = np.linspace(0, 1, 5)
    off = np.linalg.norm(np.asarray(surface.grid(shares, shares)) - np.asarray(spline.grid(shares, shares)), axis=-1)
    assert 0 < off.max() < 1e-3 * printed(done, "rms deviation  ")


# --- help


def test_help_lists_every_option():
    done = run("fit", "--help")
    assert done.status == 0 and done.err == ""
    for option in OPTIONS:
        assert f"--{option}" in done.out
    for command in ("fit", "sweep", "gallery", "bench"):
        assert f"    {command} " in run("--help").out


def test_version():
    assert run("--version") == (0, f"jaxsurf {version('jaxsurf')}\n", "")


# --- refusals

DATA = sheet(60)


def spoiled(row):
    points = DATA.copy()
    points[16] = row
    return points


def text(points):
    return "".join(" ".join(f"{x:.6f}" for x in point) + "\n" for point in points)


CLOUDS = {
    "empty": ("c.xyz", "", "the file is empty"),
    "nothing but words": ("c.xyz", "x y z\n", "holds no points"),
    "NaN": ("c.xyz", text(spoiled([1, np.nan, 2])), "expected finite coordinates, got .* in line 17 "),
    "too few": ("c.xyz", text(DATA), "at least as many as the 121 control points of 8 × 8 spans of degree 3, got 60"),
    "duplicates": ("c.xyz", text(np.tile(DATA[:3], (50, 1))), "at least 4 distinct points, got 3 distinct ones"),
    "a line": ("c.xyz", text(np.linspace(0, 9, 200)[:, None] * [1, 2, 3]), "all 200 lie on one line"),
    "suffix": ("c.foo", text(DATA), "expected a suffix among .xyz .txt .* got '.foo'"),
}


def refused(message, folder, *arguments):
    """One line on stderr, nothing on stdout, status 2, and no file more than before."""
    before = sorted(folder.rglob("*"))
    done = run("fit", *arguments)
    assert done.status == 2 and done.out == ""
    (line,) = done.err.splitlines()
    assert line.startswith("jaxsurf: ") and line.endswith(".")
    with pytest.raises(InputError, match=message):
        raise InputError(line)
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("name, content, message", CLOUDS.values(), ids=CLOUDS)
def test_clouds_without_a_surface(tmp_path, name, content, message):
    cloud = tmp_path / name
    cloud.write_text(content)
    refused(message, tmp_path, cloud, "-o", tmp_path / "s.step")


def test_a_missing_cloud(tmp_path):
    refused("does not exist; check the name", tmp_path, tmp_path / "none.xyz", "-o", tmp_path / "s.step")


@pytest.mark.parametrize("name", FORMATS)
def test_cut_clouds_of_every_format(tmp_path, name):
    suffix, build, _, seen_everywhere = FORMATS[name]
    content = build(DATA)
    cloud = tmp_path / f"cloud{suffix}"
    # rows of text that are whole make a file: only a row that is cut can be seen
    cloud.write_bytes(content[: 2 * len(content) // 3] if seen_everywhere else content[:-3])
    refused(f"Cannot read '{tmp_path}", tmp_path, cloud, "-o", tmp_path / "s.step")


@pytest.mark.parametrize("name", FORMATS)
def test_empty_clouds_of_every_format(tmp_path, name):
    cloud = tmp_path / f"cloud{FORMATS[name][0]}"
    cloud.touch()
    refused("the file is empty", tmp_path, cloud, "-o", tmp_path / "s.step")


ARGUMENTS = {
    "no output": ((), "Nothing to write: give -o FILE, --report, --picture or --save"),
    "unknown suffix": (("-o", "{}/s.dwg"), r"`-o` '.*s.dwg' must end in one of .step, .stp"),
    "no suffix": (("-o", "{}/s"), "must end in one of .step"),
    "picture": (("--picture", "{}/d.bmp"), "'.*d.bmp' must end in .png or .svg or .pdf"),
    "report": (("--report", "{}/r.txt"), "'.*r.txt' must end in .html or .htm"),
    "save": (("--save", "{}/s.step"), "'.*s.step' must end in .jxs"),
    "missing folder": (("-o", "{}/none/s.step"), "the folder '.*none' does not exist; create it first"),
    "a folder": (("-o", "{}/folder.step"), "it is a folder; give the name of a file"),
    "named twice": (("-o", "{}/s.step", "-o", "{}/../{name}/s.step"), "is named twice"),
    "the cloud itself": (("-o", "{}/c.ply"), "is named twice: .* other than the cloud"),
    "trimmed 3dm": (("-o", "{}/s.3dm", "--trim"), "`--trim` needs a STEP or IGES file"),
    "unit": (("-o", "{}/s.step", "--unit", "furlong"), "unit.*furlong"),
    "loss": (("-o", "{}/s.step", "--loss", "hubert"), "`loss` must be one of .* got 'hubert'"),
    "spans": (("-o", "{}/s.step", "--spans", "0x3"), "--spans: expected two whole numbers such as 8x8, got '0x3'"),
    "one span": (("-o", "{}/s.step", "--spans", "8"), "--spans: expected two whole numbers"),
    "tolerance": (("-o", "{}/s.step", "--tolerance", "-1"), "`tolerance` must be a length > 0"),
    "quantile": (("-o", "{}/s.step", "--quantile", "2"), "`quantile` must be in"),
    "degree": (("-o", "{}/s.step", "--degree", "9"), "`degree` must be from 1 to 7"),
    "more spans than points": (("-o", "{}/s.step", "--spans", "80x60"), "the 5229 control points of 80 × 60 spans"),
    "no number": (("-o", "{}/s.step", "--degree", "three"), "--degree: invalid int value: 'three'"),
    "holdout": (("-o", "{}/s.step", "--holdout", "1"), r"`holdout` must be in \[0, 1\)"),
    "most spans": (("-o", "{}/s.step", "--max-spans", "0"), "`max_spans` must be at least 1"),
    "smoothing": (("-o", "{}/s.step", "--smooth", "-1"), "`fairness`.* must be ≥ 0"),
    "smoothing NaN": (("-o", "{}/s.step", "--smooth", "nan"), "`fairness`.* must be ≥ 0"),
    "spans of qi": (
        ("-o", "{}/s.step", "--family", "qi", "--spans", "3x3"),
        "`--spans` belongs to `--family bspline`, and the family is qi",
    ),
    "tangents of a B-spline": (("-o", "{}/s.step", "--tangents", "3x3"), "`--tangents` belongs to `--family qi`"),
    "few tangents": (
        ("-o", "{}/s.step", "--family", "qi", "--tangents", "2x3"),
        r"`tangents` must be two whole numbers > `degree` = 2 such as .* got \(2, 3\)",
    ),
    "rotation": (
        ("-o", "{}/s.step", "--family", "sweep", "--rotation", "fixed", "--rotation", "spiral"),
        "`--rotation` must be one of fixed, chord, .* got 'spiral'",
    ),
    "rotation of a B-spline": (("-o", "{}/s.step", "--rotation", "fixed"), "`--rotation` belongs to `--family sweep`"),
    "degree of a sweep": (("-o", "{}/s.step", "--family", "sweep", "--degree", "2"), "`--degree` of `--family sweep` is 3"),
    "family": (("-o", "{}/s.step", "--family", "nurbs"), "--family: invalid choice: 'nurbs'"),
    "unknown option": (("-o", "{}/s.step", "--smoth", "1"), "unrecognized arguments: --smoth 1"),
}


@pytest.mark.parametrize("arguments, message", ARGUMENTS.values(), ids=ARGUMENTS)
def test_arguments_that_cannot_be_followed(tmp_path, arguments, message):
    (tmp_path / "folder.step").mkdir()
    cloud = tmp_path / "c.ply"
    points = sheet(200)
    cloud.write_bytes(FORMATS["ply little"][1](points))
    filled = [argument.replace("{}", str(tmp_path)).replace("{name}", tmp_path.name) for argument in arguments]
    refused(message, tmp_path, cloud, *filled)


def test_a_command_is_needed():
    done = run()
    assert done.status == 2 and done.out == "" and "COMMAND" in done.err


def test_a_missing_package_is_named_before_the_work(cloud, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)
    refused(r"`OCP` is needed .* `pip install 'jaxsurf\[cad\]'`", tmp_path, cloud, "-o", tmp_path / "s.step")


def test_our_own_mistakes_show_where_they_happened(cloud, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("a mistake")

    monkeypatch.setattr(sys.modules["jaxsurf.fit"], "fit_cloud", broken)
    with pytest.raises(RuntimeError, match="a mistake"):
        run("fit", cloud, "-o", tmp_path / "s.step")


# --- Ctrl-C


def test_the_second_interrupt_ends_at_once(cloud, tmp_path, monkeypatch):
    def impatient(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["jaxsurf.fit"], "fit_cloud", impatient)
    done = run("fit", cloud, "-o", tmp_path / "s.step")
    assert done.status == 130 and "interrupted before there was a surface; nothing was written" in done.err
    assert list(tmp_path.iterdir()) == []


def test_the_first_interrupt_is_a_wish(capsys):
    before = signal.getsignal(signal.SIGINT)
    with watching(quiet=True) as progress:
        assert not progress(Event("fit", 1, 60, 0.1))
        os.kill(os.getpid(), signal.SIGINT)
        assert progress(Event("fit", 2, 60, 0.1))
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            progress(Event("fit", 3, 60, 0.1))
    assert signal.getsignal(signal.SIGINT) is before
    assert "press Ctrl-C again" in capsys.readouterr().err


def test_the_bar_of_a_terminal_shows_phase_step_and_rms():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen = Terminal()
    with contextlib.redirect_stderr(screen), watching() as progress:
        for event in (Event("unroll", 1, 6, 0.25), Event("unroll", 2, 6, 0.125), Event("fit", 1, 60, 0.0625)):
            assert not progress(event)
    for shown in ("unroll: 1/6", "rms 0.25", "unroll: 2/6", "rms 0.125", "fit: 1/60", "rms 0.0625"):
        assert shown in screen.getvalue()


def test_ctrl_c_writes_the_best_surface_so_far(cloud, cache, tmp_path):
    target = tmp_path / "s.step"
    command = [sys.executable, "-m", "jaxsurf", "fit", str(cloud), "--spans", "3x3", "-o", str(target)]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "XDG_CACHE_HOME": str(cache)},
    ) as process:
        assert process.stderr is not None
        first = process.stderr.readline()  # the handler is in place when the first phase is announced
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=300)
    assert first.startswith("parametrise") and process.returncode == 130
    assert "stopping after this step" in err and "stopped on request" in err.splitlines()[-1]
    assert "The fit was stopped on request" in out and "B_SPLINE_SURFACE" in target.read_text()


def test_a_cache_that_cannot_be_kept_is_no_obstacle(tmp_path, monkeypatch):
    from jaxsurf.cli._cache import keep_compilations

    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    before = jax.config.values["jax_compilation_cache_dir"]
    keep_compilations()
    assert jax.config.values["jax_compilation_cache_dir"] == before
