"""A fit by two processes against one, one core each: points shared out, sums exchanged.

How much two cores can do at once is the machine's: two processes that exchange nothing, each with half of the points, tell.
"""

import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .harness import Figure, Row, Run

POINTS = 500_000
STEPS = 5
ONE, TWO, APART = "one process of one core", "two processes of one core each", "two that exchange nothing"


def rows() -> list[Row]:
    """Five steps of a net of 20 × 20 control points, in double precision; the control points must agree to 1e-10."""
    teams = {ONE: _Team(1), TWO: _Team(2), APART: _Team(2, apart=True)}
    one, two = teams[ONE].solve(), teams[TWO].solve()
    assert np.abs(one - two).max() < 1e-10 * 14, np.abs(one - two).max()
    runs: dict[str, Run | None] = {name: Run(team.solve, POINTS) for name, team in teams.items()}
    what = f"{STEPS} steps of a fit of 20 × 20 control points to {POINTS:.0e} points"
    return [Row(what, runs, [Figure("faster", TWO, ONE, 1.6), Figure("faster", TWO, APART, 0.9)])]


class _Team:
    """Processes that solve when they are told to, and say when they are done."""

    def __init__(self, count: int, apart: bool = False):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"127.0.0.1:{free.getsockname()[1]}"
        root = Path(__file__).parents[1]
        self.members = [
            subprocess.Popen(
                [sys.executable, "-m", "benchmarks.processes", str(index), str(count), "" if apart else address],
                cwd=root,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            for index in range(count)
        ]

    def solve(self) -> np.ndarray:
        """All solve together; the control points that the first has found."""
        for member in self.members:
            assert member.stdin is not None
            member.stdin.write(b"solve\n")
            member.stdin.flush()
        nets = [self._answer(member) for member in self.members]
        return nets[0]

    @staticmethod
    def _answer(member: subprocess.Popen) -> np.ndarray:
        assert member.stdout is not None
        for line in member.stdout:
            if line.startswith(b"net "):  # compiled code may print too
                return np.frombuffer(bytes.fromhex(line[4:].decode().strip()))
        raise RuntimeError(f"A process of the benchmark has ended with the status {member.wait()}.")


def _member(index: int, count: int, address: str) -> None:
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[index % len(cores)]})
    import jax

    import jaxsurf as js
    from jaxsurf.fit import join_processes

    jax.config.update("jax_enable_x64", True)
    joined = count > 1 and address != ""
    if joined:
        join_processes(address, count, index)
    rng = np.random.default_rng(0)
    u, v = rng.uniform(size=(2, POINTS))
    height = 0.1 * np.sin(24 * u) + 2 * u * v
    points = np.stack([12 * u, 7 * v, height], -1) + 0.005 * rng.normal(size=(POINTS, 3))
    along, across = np.meshgrid(np.linspace(0, 12, 20), np.linspace(0, 7, 20), indexing="ij")
    knots = js.clamped_knots(20, 3)
    flat = js.BSplineSurface(np.stack([along, across, np.zeros_like(along)], -1), knots, knots, 3, 3)
    mine = lambda rows: np.array_split(rows, count)[index]
    cloud = js.shard_points(mine(points)) if joined else mine(points)
    start = mine(np.stack([u, v], -1))
    for _ in sys.stdin:
        found = js.fit(flat, cloud, start=start, sliding=0.1, rtol=0.0, max_steps=STEPS)
        sys.stdout.write(f"net {np.asarray(found.shape.control_points).tobytes().hex()}\n")
        sys.stdout.flush()


def _main(arguments: Sequence[str]) -> None:
    index, count, address = arguments
    _member(int(index), int(count), address)


if __name__ == "__main__":
    _main(sys.argv[1:])
