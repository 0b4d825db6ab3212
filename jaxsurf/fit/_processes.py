"""Several processes that work on one fit: how they find each other, and what they tell each other."""

import os
from typing import Any

import jax
import numpy as np

from .._errors import InputError

_HEARTBEAT = 40  # seconds without a sign of life after which a process counts as lost


def join_processes(address: str | None = None, count: int | None = None, index: int | None = None) -> None:
    """Join the processes of this run by `jax.distributed`; call it in each of them before anything is computed.

    address: "host:port" of process 0; count: how many processes; index: which one this is. What is `None` comes from
    the variables JAX_COORDINATOR_ADDRESS, JAX_NUM_PROCESSES and JAX_PROCESS_ID, or else from the launcher, which JAX
    knows by itself: SLURM, Open MPI, Kubernetes. On CPUs the processes talk by gloo, on NVIDIA GPUs by NCCL. A process
    that dies ends all others within a minute.

    Raises `InputError` if it is not known who is in the run.
    """
    address = address or os.environ.get("JAX_COORDINATOR_ADDRESS")
    count = _number("JAX_NUM_PROCESSES") if count is None else count
    index = _number("JAX_PROCESS_ID") if index is None else index
    jax.config.update("jax_cpu_collectives_implementation", "gloo")
    try:
        jax.distributed.initialize(address, count, index, heartbeat_timeout_seconds=_HEARTBEAT)
    except (ValueError, RuntimeError) as error:
        raise InputError(
            f"The processes of this run cannot be joined ({str(error).splitlines()[0].strip(' .')}); start them with srun, "
            "mpirun or a Kubernetes job, or set JAX_COORDINATOR_ADDRESS, JAX_NUM_PROCESSES and JAX_PROCESS_ID."
        ) from error


def process_index() -> int:
    """Which process this is; 0 writes and prints."""
    return jax.process_index()


def process_count() -> int:
    """How many processes work together."""
    return jax.process_count()


def gathered(values: Any) -> np.ndarray:
    """What each process has, equally large in all, along a new first axis; all processes must call it together."""
    values = np.asarray(values)
    if process_count() == 1:
        return values[None]
    from jax.experimental import multihost_utils

    return np.asarray(multihost_utils.process_allgather(values, tiled=False))


def summed(values: Any) -> np.ndarray:
    """The sum over the processes; all must call it together."""
    return gathered(values).sum(axis=0)


def any_process(wish: bool) -> bool:
    """Whether one of the processes says yes; all must call it together."""
    return bool(gathered(np.asarray(wish, np.int32)).any())


def same_error(error: InputError | None) -> InputError | None:
    """The error of the first process that has one, in every process; all must call it together."""
    room = np.zeros(2000, np.uint8)
    text = np.frombuffer(str(error or "").encode()[: len(room)], np.uint8)
    room[: len(text)] = text
    said = [bytes(row).rstrip(b"\0").decode(errors="ignore") for row in gathered(room)]
    return next((InputError(sentence) for sentence in said if sentence), None)


def from_first(tree: Any) -> Any:
    """The numpy arrays of process 0, in every process; all must call it together."""
    return jax.tree.map(lambda values: gathered(values)[0], tree)


def _number(variable: str) -> int | None:
    text = os.environ.get(variable)
    if text is None:
        return None
    if not text.isdigit():
        raise InputError(f"The variable {variable} must be a whole number ≥ 0, got {text!r}.")
    return int(text)
