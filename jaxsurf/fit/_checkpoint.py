"""A cloud fit that can go on after it was cut off: where it stands, in one file."""

import hashlib
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import check_writable
from .._errors import InputError
from .._progress import Event, Progress
from ..io import load, save
from . import _processes as processes
from ._sharded_points import ShardedPoints
from ._snapshot import Snapshot

_EVERY = 1.0  # seconds that lie at least between two files in one phase
_VERSION = 1


class Checkpoint:
    """Keeps the state of a cloud fit in a file, written whole or not at all by process 0.

    state: what a phase begins with; a snapshot of its solver is added as it goes on. The file also says which cloud and
    which options it belongs to.
    """

    def __init__(self, path: str | os.PathLike | None, belongs_to: dict[str, Any]):
        self.path = None if path is None else Path(path)
        self.belongs_to, self.state, self.last = belongs_to, {}, 0.0
        if self.path is not None:
            check_writable(self.path)

    def begin(self, state: dict[str, Any], snapshot: Snapshot | None) -> None:
        """A phase begins, or goes on."""
        self.state = state
        self._write(snapshot)

    def keep(self, snapshot: Snapshot | None) -> None:
        """The solver has made a step."""
        if self.state and snapshot is not None and time.monotonic() - self.last > _EVERY:
            self._write(snapshot)

    def read(self) -> tuple[dict[str, Any], Snapshot | None]:
        """The state in the file, and the snapshot in it.

        Raises `InputError` if there is none, or if it belongs to another cloud or to other options.
        """
        if self.path is None:
            raise InputError("`resume` needs `checkpoint`, the file to go on from; name it.")
        if not self.path.exists():
            raise InputError(f"`resume` found no checkpoint {str(self.path)!r} to go on from; begin without it.")
        saved = load(self.path)
        if not isinstance(saved, dict) or saved.get("version") != _VERSION:
            raise InputError(f"`resume` needs a checkpoint of this version, and {str(self.path)!r} is none; begin anew.")
        for name, ours in self.belongs_to.items():
            theirs = saved["belongs_to"].get(name)
            if theirs != ours:
                raise InputError(
                    f"`resume` needs the cloud and the options with which {str(self.path)!r} was begun: {name} was "
                    f"{theirs}, and is {ours}."
                )
        snapshot = saved["snapshot"]
        return saved["state"], None if snapshot is None else Snapshot(**snapshot)

    def _write(self, snapshot: Snapshot | None) -> None:
        if self.path is not None and processes.process_index() == 0:
            state = {"version": _VERSION, "belongs_to": self.belongs_to, "state": self.state}
            save(self.path, {**state, "snapshot": None if snapshot is None else snapshot._asdict()})
        self.last = time.monotonic()


class Watched:
    """The caller's progress, remembering a wish to stop; never the silent default itself, so that every fit of a cloud is
    stepped by the same compiled function.

    together: from where on the wish of one process is that of all; keep: is told of every snapshot.
    """

    def __init__(self, progress: Progress):
        self.progress, self.stop, self.together = progress, False, False
        self.keep: Any = None

    def __call__(self, event: Event) -> bool:
        if self.keep is not None:
            self.keep(event.snapshot)
        self.stop = bool(self.progress(event)) or self.stop
        if self.together:
            self.stop = processes.any_process(self.stop)
        return self.stop


def cloud_mark(cloud: ShardedPoints, sample: np.ndarray) -> dict[str, Any]:
    """What tells a cloud from another, however it is spread: the number of points, and a digest of box and sample."""
    rows = cloud.rows(cloud.points)
    box = np.stack([rows.min(axis=0), -rows.max(axis=0)])
    box = box if cloud.alone else processes.gathered(box).min(axis=0)
    digest = hashlib.sha256(np.ascontiguousarray(box).tobytes() + np.ascontiguousarray(sample).tobytes()).hexdigest()
    return {"number of points": cloud.count, "digest of the points": digest[:16]}
