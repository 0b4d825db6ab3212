"""One fit by several processes: who starts them, who watches them, what becomes of it when one dies."""

import argparse
import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from .._errors import InputError

LOST = 75  # exit status of a worker that was left alone by another one: may be started again
_WORKER = "JAXSURF_WORKER"  # set in processes that `--processes` has started
_GRACE = 2.0  # seconds to see which of several failed workers was the first
_LOOK = 0.05


def add_processes(parser: argparse.ArgumentParser) -> None:
    """The arguments of work in several processes, and of going on after it was cut off."""
    parser.add_argument("--processes", type=int, metavar="N", help="share the points out to N processes on this machine")
    parser.add_argument(
        "--distributed",
        action="store_true",
        help="this is one of several processes that srun, mpirun or Kubernetes has started; all see the same files",
    )
    parser.add_argument(
        "--checkpoint",
        metavar="FILE",
        help="keep there where the fit stands; with --processes, --distributed or --resume the default is the name of the "
        "first output and .checkpoint",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint of a fit that was cut off")


def checkpoint_of(options: argparse.Namespace) -> str | None:
    """The file that keeps where the fit stands, or `None`."""
    if options.processes is not None and options.processes < 1:
        raise InputError(f"`--processes` must be at least 1, got {options.processes}.")
    if options.processes is not None and options.distributed:
        raise InputError("`--processes` starts workers by itself, and `--distributed` joins those of a launcher: give one.")
    wanted = options.checkpoint or options.resume or options.distributed or (options.processes or 1) > 1
    if not wanted:
        return None
    if options.family != "bspline":
        raise InputError(
            "`--processes`, `--distributed`, `--checkpoint` and `--resume` belong to `--family bspline`, and the family is "
            f"{options.family}; leave them out."
        )
    first = next(filter(None, [*options.output, options.save, options.report, options.picture]))
    return options.checkpoint or f"{first}.checkpoint"


def is_parent(options: argparse.Namespace) -> bool:
    """Whether this process only starts and watches others."""
    return (options.processes or 1) > 1 and _WORKER not in os.environ


def is_member(options: argparse.Namespace) -> bool:
    """Whether this process works together with others."""
    return options.distributed or ((options.processes or 1) > 1 and _WORKER in os.environ)


def run_workers(arguments: Sequence[str], count: int, checkpoint: str | None) -> int:
    """Start `count` processes of this command, wait for them, and return the exit status of the first.

    If one dies the others are stopped at once, and one sentence names it, on standard error. Ctrl-C is passed on to the
    first worker, which stops at the best surface so far; a second one stops all.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    workers: list[subprocess.Popen] = []
    with tempfile.TemporaryFile("w+") as said, _passing_on(workers):
        try:
            for index in range(count):
                workers.append(_start(arguments, index, count, port, said))
            failed = _first_failed(workers)
            said.seek(0)
            last = next(reversed([line.strip() for line in said if line.strip()]), "")
        finally:
            for worker in workers:
                worker.kill()
            for worker in workers:
                worker.wait()
    if failed is None:
        return workers[0].returncode
    index, status = failed
    if index == 0 and status > 0 and status != LOST:
        return status  # the first worker has said why
    print(f"jaxsurf: {_obituary(index, count, status, last)}; {_way_on(checkpoint)}", file=sys.stderr)
    return 1


@contextlib.contextmanager
def as_worker(checkpoint: str | None) -> Iterator[bool]:
    """Join the other processes; gives whether this one writes and prints. A lost process ends this one."""
    from ..fit import any_process, join_processes, process_index

    with _own_output() as show:
        join_processes()
        leader = process_index() == 0
        show(leader)
        if _WORKER in os.environ:
            _end_with_parent()
            if not leader:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            yield leader
            any_process(False)  # nobody leaves before all is written
        except InputError as error:
            if leader:
                print(f"jaxsurf: {error}", file=sys.stderr)
            _leave(2)
        except Exception as error:
            if not _is_loss(error):
                raise
            if _WORKER not in os.environ:
                print(f"jaxsurf: another process of this run was lost; {_way_on(checkpoint)}", file=sys.stderr)
            _leave(LOST)


def _start(arguments: Sequence[str], index: int, count: int, port: int, said: IO[str]) -> subprocess.Popen:
    mine = {
        _WORKER: "1",
        "JAX_COORDINATOR_ADDRESS": f"127.0.0.1:{port}",
        "JAX_COORDINATOR_BIND_ADDRESS": f"127.0.0.1:{port}",
        "JAX_NUM_PROCESSES": str(count),
        "JAX_PROCESS_ID": str(index),
    }
    if len(gpus := _gpus()) >= count:
        mine["CUDA_VISIBLE_DEVICES"] = gpus[index]
    worker = subprocess.Popen(
        [sys.executable, "-m", "jaxsurf", *arguments],
        env={**os.environ, **mine},
        stdin=subprocess.DEVNULL,
        stderr=None if index == 0 else said,
        start_new_session=True,  # Ctrl-C comes to this process alone
    )
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        share = cores[index * len(cores) // count : (index + 1) * len(cores) // count] or [cores[index % len(cores)]]
        with contextlib.suppress(OSError):
            os.sched_setaffinity(worker.pid, share)
    return worker


def _gpus() -> list[str]:
    """The GPUs that this process may use."""
    named = os.environ.get("CUDA_VISIBLE_DEVICES")
    if named is not None:
        return [name for name in named.split(",") if name]
    folder = Path("/proc/driver/nvidia/gpus")
    return [str(i) for i in range(len(list(folder.iterdir())))] if folder.is_dir() else []


def _first_failed(workers: Sequence[subprocess.Popen]) -> tuple[int, int] | None:
    """Wait for all, or for one that fails: its number and exit status, negative for a signal."""
    while True:
        failed = [(i, worker.returncode) for i, worker in enumerate(workers) if worker.poll() not in (None, 0)]
        if failed and all(status in (LOST, 130) for _, status in failed):
            # those were left alone, or stopped on request: who is to blame comes to light soon
            until = time.monotonic() + _GRACE
            while time.monotonic() < until and any(worker.poll() is None for worker in workers):
                time.sleep(_LOOK)
            failed = [(i, worker.returncode) for i, worker in enumerate(workers) if worker.poll() not in (None, 0)]
        if failed:
            return min(failed, key=lambda each: (each[1] == LOST, each[1] > 0, each[0]))
        if all(worker.returncode == 0 for worker in workers):
            return None
        time.sleep(_LOOK)


@contextlib.contextmanager
def _passing_on(workers: Sequence[subprocess.Popen]) -> Iterator[None]:
    """The first Ctrl-C goes to the first worker, a second one ends all."""
    asked = []

    def on_interrupt(number: int, frame: object) -> None:
        if asked or not workers:
            raise KeyboardInterrupt
        asked.append(True)
        workers[0].send_signal(signal.SIGINT)

    def on_end(number: int, frame: object) -> None:
        raise SystemExit(128 + number)  # the workers end too

    handlers = {signal.SIGINT: on_interrupt, signal.SIGTERM: on_end}
    if hasattr(signal, "SIGHUP"):
        handlers[signal.SIGHUP] = on_end
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _obituary(index: int, count: int, status: int, last: str) -> str:
    if status < 0:
        try:
            how = f"was ended by the signal {signal.Signals(-status).name}"
        except ValueError:
            how = f"was ended by the signal {-status}"
    else:
        how = f"ended with the exit status {status}" + (f" ({last[:200].rstrip('.')})" if last else "")
    return f"Worker {index} of {count} {how}, and the others were stopped"


def _way_on(checkpoint: str | None) -> str:
    if checkpoint is not None and Path(checkpoint).exists():
        return f"the same command with --resume goes on from the checkpoint {checkpoint!r}."
    return "there was no checkpoint yet, so begin again."


def _is_loss(error: Exception) -> bool:
    """Whether an error of a collective operation means that another process is gone; the types of such errors vary."""
    words = ("Gloo", "NCCL", "UNAVAILABLE", "Connection reset", "Connection closed", "coordination service")
    return any(word in str(error) for word in words)


def _end_with_parent() -> None:
    """End when the process that watches is gone, in whatever way."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(LOST)

    threading.Thread(target=watch, daemon=True).start()


def _leave(status: int) -> None:
    """End without the farewell of `jax.distributed`, which waits for processes that may be gone."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


@contextlib.contextmanager
def _own_output() -> Iterator:
    """Keep what compiled code prints off the standard output; `show` says whether Python's own comes through."""
    kept, printed = os.dup(1), sys.stdout
    nowhere = os.open(os.devnull, os.O_WRONLY)
    printed.flush()
    os.dup2(nowhere, 1)

    def show(wanted: bool) -> None:
        sys.stdout = os.fdopen(os.dup(kept if wanted else nowhere), "w")

    try:
        yield show
    finally:
        sys.stdout.flush()
        sys.stdout = printed
        os.dup2(kept, 1)
