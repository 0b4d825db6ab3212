"""Cloud fits that go on after they were cut off."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import jaxsurf as js
from jaxsurf._errors import InputError
from jaxsurf.fit import _checkpoint

SIZE = 14.0
OPTIONS: dict[str, Any] = {"spans": (3, 3), "tolerance": 0.012, "max_spans": 6, "holdout": 0.1, "loss": "huber"}


@pytest.fixture(autouse=True)
def _every_step(monkeypatch):
    monkeypatch.setattr(_checkpoint, "_EVERY", -1.0)


def sheet(count=700):
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0, [[12.0], [7.0]], (2, count))
    return np.stack([u, v, 0.03 * u * v - 0.05 * u**2 + 0.1 * np.sin(2 * u)], -1) + 0.005 * rng.normal(size=(count, 3))


class Cut:
    """A progress that stops at the n-th step of a fit, counted over all phases but the first two."""

    def __init__(self, at):
        self.at, self.seen = at, []

    def __call__(self, event):
        if event.snapshot is not None and event.phase != "unroll":
            self.seen.append((event.phase, event.snapshot.round, event.step))
        return len(self.seen) == self.at


@pytest.fixture(scope="module")
def whole():
    cut = Cut(None)
    return js.fit_cloud(sheet(), **OPTIONS, progress=cut), cut.seen


def places(seen):
    """Numbers of steps: one inside the first stage, one in a later round, one in a later stage, one in the check fit."""
    phases = [phase for phase, _, _ in seen]
    late = next(i for i, (phase, turn, step) in enumerate(seen) if turn == 1 and step == 2 and phase == phases[0])
    return {
        "first stage": 2,
        "second round": late + 1,
        "last stage": phases.index(phases[phases.index("hold-out") - 1]) + 2,
        "check fit": phases.index("hold-out") + 2,
    }


@pytest.mark.parametrize("place", ["first stage", "second round", "last stage", "check fit"])
def test_a_fit_that_was_cut_off_goes_on_to_the_same_surface(whole, tmp_path, place):
    found, seen = whole
    path = tmp_path / "part.checkpoint"
    cut = js.fit_cloud(sheet(), **OPTIONS, checkpoint=path, progress=Cut(places(seen)[place]))
    assert cut.stopped and path.exists()
    on = Cut(None)
    again = js.fit_cloud(sheet(), **OPTIONS, checkpoint=path, resume=True, progress=on)
    assert len(on.seen) <= len(seen) - places(seen)[place] + 1
    np.testing.assert_allclose(again.shape.control_points, found.shape.control_points, rtol=0, atol=1e-8 * SIZE)
    assert again.holdout is not None
    np.testing.assert_allclose(again.holdout.rms, found.holdout.rms, rtol=1e-6)
    assert [s.spans for s in again.stages] == [s.spans for s in found.stages]


def test_a_checkpoint_belongs_to_its_cloud_and_options(tmp_path):
    path = tmp_path / "part.checkpoint"
    js.fit_cloud(sheet(), spans=(2, 2), checkpoint=path, progress=Cut(1))
    refused: tuple[tuple[Any, dict[str, Any], str], ...] = (
        (sheet(701), {"spans": (2, 2)}, "number of points was 700, and is 701"),
        (sheet() + [0, 0, 1e-9], {"spans": (2, 2)}, "digest of the points was"),
        (sheet(), {"spans": (2, 3)}, r"spans was \[2, 2\], and is \[2, 3\]"),
        (sheet(), {"spans": (2, 2), "loss": "huber"}, "loss was squared, and is huber"),
        (jnp.asarray(sheet(), jnp.float32), {"spans": (2, 2)}, "digest of the points was"),
    )
    for points, options, match in refused:
        with pytest.raises(InputError, match=match):
            js.fit_cloud(points, **options, checkpoint=path, resume=True)


def test_without_a_checkpoint_there_is_nothing_to_go_on_from(tmp_path):
    with pytest.raises(InputError, match="`resume` found no checkpoint"):
        js.fit_cloud(sheet(), checkpoint=tmp_path / "none", resume=True)
    with pytest.raises(InputError, match="`resume` needs `checkpoint`"):
        js.fit_cloud(sheet(), resume=True)
    with pytest.raises(InputError, match="the folder .* does not exist"):
        js.fit_cloud(sheet(), checkpoint=tmp_path / "no" / "file")
    js.save(tmp_path / "other", {"a": 1})
    with pytest.raises(InputError, match="needs a checkpoint of this version"):
        js.fit_cloud(sheet(), checkpoint=tmp_path / "other", resume=True)
