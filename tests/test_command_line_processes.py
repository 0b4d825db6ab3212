"""`jaxsurf fit` in several processes: the same surface, and what becomes of it when one dies. With real processes."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import jaxsurf as js
from jaxsurf.cli import main

SIZE = 14.0
PACKAGE = Path(js.__file__).parents[1]
OPTIONS = ("--spans", "4x3", "--loss", "huber")

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds workers by /proc")


def sheet(count=701):
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0, [[12.0], [7.0]], (2, count))
    return np.stack([u, v, 0.03 * u * v - 0.05 * u**2 + 0.1 * np.sin(2 * u)], -1) + 0.005 * rng.normal(size=(count, 3))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("processes")
    np.savetxt(folder / "sheet.xyz", sheet(), fmt="%.9f")
    return folder


def known(place) -> dict[str, str]:
    return {"XDG_CACHE_HOME": str(place / "cache"), "PYTHONPATH": os.pathsep.join([str(PACKAGE), *sys.path])}


def started(place, *arguments) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "jaxsurf", "fit", "sheet.xyz", *OPTIONS, *map(str, arguments)],
        cwd=place,
        env={**os.environ, **known(place)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(place, *arguments) -> tuple[int, str, str]:
    process = started(place, *arguments)
    out, err = process.communicate(timeout=300)
    return process.returncode, out, err


def net(place, name):
    return np.asarray(js.load(place / name).control_points)


def workers(parent: int) -> list[int]:
    """The process numbers of the children, in the order of their start."""
    with contextlib.suppress(FileNotFoundError):
        return [int(child) for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()]
    return []


def appearing(process, path) -> None:
    """Wait for a file of a running command."""
    while not path.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


@pytest.fixture(scope="module")
def alone(place):
    status, out, err = finished(place, "--save", "one.jxs")
    assert status == 0, err
    return out


@pytest.mark.parametrize("count", [2, 4])
def test_the_surface_is_that_of_one_process(place, alone, count):
    status, out, err = finished(place, "--save", "many.jxs", "--picture", "many.png", "--processes", count)
    assert status == 0, err
    np.testing.assert_allclose(net(place, "many.jxs"), net(place, "one.jxs"), rtol=0, atol=1e-10 * SIZE)
    figures = lambda text: [line for line in text.splitlines() if not line.startswith(("time", "wrote"))]
    assert figures(out) == figures(alone)
    assert (place / "many.png").exists() and not (place / "many.jxs.checkpoint").exists()


def test_a_killed_worker_is_told_and_the_fit_goes_on(place, alone):
    checkpoint = place / "killed.jxs.checkpoint"
    process = started(place, "--save", "killed.jxs", "--processes", 2)
    appearing(process, checkpoint)
    children = workers(process.pid)
    os.kill(children[1], signal.SIGKILL)
    begun = time.monotonic()
    out, err = process.communicate(timeout=60)
    assert time.monotonic() - begun < 60 and process.returncode == 1
    assert out == "" and not (place / "killed.jxs").exists() and checkpoint.exists()
    last = err.strip().splitlines()[-1]
    assert re.fullmatch(
        r"jaxsurf: Worker 1 of 2 was ended by the signal SIGKILL, and the others were stopped; the same command with "
        r"--resume goes on from the checkpoint 'killed.jxs.checkpoint'\.",
        last,
    )
    assert "Traceback" not in err
    assert not any(Path(f"/proc/{child}").exists() for child in children)
    # as many processes as one likes go on from there
    status, _, err = finished(place, "--save", "killed.jxs", "--resume")
    assert status == 0, err
    np.testing.assert_allclose(net(place, "killed.jxs"), net(place, "one.jxs"), rtol=0, atol=1e-8 * SIZE)
    assert not checkpoint.exists()


def test_ctrl_c_writes_the_best_surface_so_far(place, alone):
    process = started(place, "--save", "stopped.jxs", "--processes", 2)
    appearing(process, place / "stopped.jxs.checkpoint")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130 and "the best surface so far" in err
    assert net(place, "stopped.jxs").shape == (7, 6, 3)


def test_workers_refuse_what_one_process_refuses(place):
    np.savetxt(place / "bad.xyz", np.where(np.arange(300)[:, None] == 290, np.nan, sheet(300)))
    for arguments, match in (
        (("bad.xyz", "--processes", 2), r"Cannot read 'bad.xyz': .* in line 291 \(1 of 150 points"),
        (("none.xyz", "--processes", 2), "the file does not exist"),
        (("sheet.xyz", "--resume"), "`resume` found no checkpoint 'bad.jxs.checkpoint'"),
    ):
        process = subprocess.run(
            [sys.executable, "-m", "jaxsurf", "fit", *map(str, arguments), "--save", "bad.jxs"],
            cwd=place,
            env={**os.environ, **known(place)},
            capture_output=True,
            text=True,
        )
        assert process.returncode == 2 and process.stdout == ""
        (line,) = process.stderr.strip().splitlines()
        assert re.match("jaxsurf: ", line) and re.search(match, line)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (("--processes", "0"), "`--processes` must be at least 1, got 0"),
        (("--processes", "2", "--distributed"), "give one"),
        (("--processes", "2", "--family", "qi"), "belong to `--family bspline`, and the family is qi"),
    ],
)
def test_options_that_do_not_fit_are_refused(place, capsys, arguments, match):
    assert main(["fit", str(place / "sheet.xyz"), "--save", str(place / "no.jxs"), *arguments]) == 2
    assert re.search(match, capsys.readouterr().err)
