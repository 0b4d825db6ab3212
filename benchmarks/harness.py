"""Medians of interleaved repeats, figures to reach, and the tables made of them."""

import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

PACKAGES = ("jaxsurf", "jax", "numpy", "scipy", "splinepy", "splipy", "ndsplines", "geomdl")


class Run(NamedTuple):
    """What is timed: a call that ends when its result is there, and how many items it works on.

    unit: where it is not `None`, the call returns the number that counts, in that unit, and is made once.
    """

    call: Callable[[], Any]
    items: int = 1
    unit: str | None = None


class Figure(NamedTuple):
    """What is to be reached.

    kind: "faster": `ours` does at least `bound` times the items per second of `other`; "at most": it takes at
    most `bound` times the time; "more": at most `bound` seconds more; "rate": at least `bound` million items per second;
    "seconds": it takes at most `bound` seconds; "first call": it is there after at most `bound` seconds, compiled and run;
    "below": what it measured is at most `bound`. The last four compare with no other.
    """

    kind: str
    ours: str
    other: str | None
    bound: float


class Row(NamedTuple):
    """One task, done by several; the value of `runs` is None for what is not installed. repeats: fewer for long tasks."""

    what: str
    runs: dict[str, Run | None]
    figures: Sequence[Figure]
    repeats: int | None = None


def run(rows: Sequence[Row], repeats: int) -> dict[str, Any]:
    """Time all rows; within a row the runs take turns, so that a busy moment hits all of them."""
    return {"machine": machine(), "repeats": repeats, "rows": [_run_row(row, row.repeats or repeats) for row in rows]}


def machine() -> dict[str, Any]:
    """The processor, the cores that may be used, and the versions of everything that takes part."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    return {
        "processor": _processor(),
        "cores": cores(),
        "system": platform.system(),
        "python": platform.python_version(),
        "versions": versions,
    }


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def write(path: Path, report: dict[str, Any]) -> None:
    """Keep the numbers as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(report, indent=1) + "\n")


def read(path: Path) -> dict[str, Any]:
    """The numbers of the last run."""
    if not path.exists():
        raise SystemExit(f"{path} is not there yet: run `python -m benchmarks {path.stem}` first.")
    return json.loads(path.read_text())


def table(report: dict[str, Any]) -> str:
    """A Markdown table: a line for every figure, and the machine."""
    lines = [
        "| what | time | first call | figure | reached | holds |",
        "|---|---|---|---|---|---|",
    ]
    for row in report["rows"]:
        times = "<br>".join(f"{label}: {_time(run)}" for label, run in row["runs"].items())
        first = "<br>".join(
            f"{label}: {run['first']:.2g} s"
            for label, run in row["runs"].items()
            if run and "first" in run and label in {f["ours"] for f in row["figures"]}
        )
        fewer = f" ({row['repeats']} repeats)" if row.get("repeats") not in (None, report["repeats"]) else ""
        for i, figure in enumerate(row["figures"]):
            what = (row["what"] + fewer, times, first) if i == 0 else ("", "", "")
            lines.append("| " + " | ".join([*what, _goal(figure), _reached(figure), _holds(figure)]) + " |")
    repeats = f"Medians of {report['repeats']} interleaved repeats, without the first call"
    lines += ["", f"{repeats}; {machine_line(report['machine'])}"]
    return "\n".join(lines)


def machine_line(machine: dict[str, Any]) -> str:
    """Processor, cores and versions in a line."""
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items() if version)
    return f"{machine['processor']}, {machine['cores']} cores; {versions}."


def refresh(readme: Path, name: str, text: str) -> bool:
    """Put a table into the block between `<!-- benchmark:name -->` and `<!-- /benchmark -->`; whether there is one."""
    start, end = f"<!-- benchmark:{name} -->", "<!-- /benchmark -->"
    page = readme.read_text() if readme.exists() else ""
    before, found, rest = page.partition(start)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        return False
    readme.write_text(f"{before}{start}\n{text}\n{end}{after}")
    return True


def _run_row(row: Row, repeats: int) -> dict[str, Any]:
    """Made in the order of the row: first calls, then what is measured once, then the timed ones in turns."""
    timed = {label: run for label, run in row.runs.items() if run and run.unit is None}
    times: dict[str, list[float]] = {label: [] for label in timed}
    first = {label: _timed(run.call) for label, run in timed.items()}
    runs: dict[str, Any] = {label: None for label in row.runs}
    for label, run in row.runs.items():
        if run and run.unit is not None:
            runs[label] = {"value": float(run.call()), "unit": run.unit}
    for _ in range(repeats if timed else 0):
        for label, run in timed.items():
            times[label].append(_timed(run.call))
    for label, run in timed.items():
        found = times[label]
        runs[label] = {"seconds": statistics.median(found), "fastest": min(found), "first": first[label], "items": run.items}
    judged = [_judge(figure, runs) for figure in row.figures]
    return {"what": row.what, "repeats": repeats if timed else None, "runs": runs, "figures": judged}


def _judge(figure: Figure, runs: dict[str, Any]) -> dict[str, Any]:
    ours, other = runs[figure.ours], runs[figure.other or figure.ours]
    judged = {**figure._asdict(), "reached": None, "holds": None}
    if ours is None or other is None:
        return judged
    if figure.kind == "below":
        reached = ours["value"]
        return {**judged, "reached": reached, "holds": reached <= figure.bound, "unit": ours["unit"]}
    a, b = ours["seconds"] / ours["items"], other["seconds"] / other["items"]
    kinds = {"faster": b / a, "at most": a / b, "more": a - b, "rate": 1e-6 / a, "first call": ours["first"], "seconds": a}
    reached = kinds[figure.kind]
    holds = reached >= figure.bound if figure.kind in ("faster", "rate") else reached <= figure.bound
    return {**judged, "reached": reached, "holds": holds}


def _timed(call: Callable[[], Any]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _time(run: dict[str, Any] | None) -> str:
    if run is None:
        return "not installed"
    if "value" in run:
        return f"{run['value']:.3g} {run['unit']}".rstrip()
    if run["seconds"] >= 10 and run["items"] == 1:
        return f"{run['seconds']:.3g} s"
    milliseconds = f"{1e3 * run['seconds']:.3g} ms"
    rate = run["items"] / run["seconds"] / 1e6
    return milliseconds if run["items"] == 1 else f"{milliseconds} ({rate:.3g} M/s)"


def _goal(figure: dict[str, Any]) -> str:
    pattern = {
        "faster": "≥ {:g} × {}",
        "at most": "≤ {:g} × {}",
        "more": "≤ {:g} s more than {}",
        "rate": "≥ {:g} M/s",
        "first call": "first call ≤ {:g} s",
        "seconds": "≤ {:g} s",
        "below": f"≤ {{:g}} {figure.get('unit', '')}".rstrip(),
    }
    return pattern[figure["kind"]].format(figure["bound"], figure["other"])


def _reached(figure: dict[str, Any]) -> str:
    if figure["reached"] is None:
        return "absent"
    if figure["kind"] == "below":
        return f"{figure['reached']:.3g} {figure['unit']}".rstrip()
    unit = {"more": "s", "first call": "s", "seconds": "s", "rate": "M/s"}.get(figure["kind"], "×")
    return f"{figure['reached']:.3g} {unit}" if unit == "M/s" else f"{figure['reached']:.2g} {unit}"


def _holds(figure: dict[str, Any]) -> str:
    return {None: "–", True: "yes", False: "**no**"}[figure["holds"]]
