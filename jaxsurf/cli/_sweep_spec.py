"""Sweeps described in a TOML file."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError

_SETTINGS = ("rotation", "scale", "blend", "pairing", "move", "tolerance", "up")
_CURVE = ("points", "file", "kind", "degree", "closed")
_KINDS = ("through", "control", "line", "arc", "polyline")


def read_spec(path: str) -> tuple[list[Any], list[Any], dict[str, Any]]:
    """Characters, guides and the keywords of `js.sweep`. Raises `InputError` with the place in the file."""
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"There is no file {path!r}.") from None
    except (OSError, UnicodeDecodeError) as failure:
        raise InputError(f"Cannot read {path!r}: {failure}.") from None
    except tomllib.TOMLDecodeError as failure:
        raise InputError(f"{path!r} is not TOML: {failure}.") from None
    _refuse_unknown(data, (*_SETTINGS, "guides", "characters"), path)
    curves = {}
    for name in ("characters", "guides"):
        given = data.get(name)
        if not isinstance(given, list) or not given or not all(isinstance(entry, dict) for entry in given):
            raise InputError(f"{path!r} needs at least one table [[{name}]] with `points` or a `file`.")
        folder = Path(path).parent
        curves[name] = [_curve(entry, folder, f"[[{name}]] number {i + 1} of {path!r}") for i, entry in enumerate(given)]
    return curves["characters"], curves["guides"], _keywords(data, path)


def _keywords(data: dict[str, Any], path: str) -> dict[str, Any]:
    from ..build import Smoothstep, UpRotation

    found = {name: data[name] for name in ("rotation", "scale", "pairing", "move", "tolerance") if name in data}
    if "up" in data:
        if found.get("rotation") != "up":
            raise InputError(f'`up` in {path!r} belongs to rotation = "up"; add that, or leave `up` out.')
        found["rotation"] = UpRotation(data["up"])
    if "blend" in data:
        orders = {"linear": 0, "smoothstep": 1, "smoothstep2": 2, "smoothstep3": 3}
        if data["blend"] not in orders:
            raise InputError(f"`blend` in {path!r} must be one of {', '.join(orders)}, got {data['blend']!r}.")
        found["blend"] = Smoothstep(orders[data["blend"]])
    return found


def _curve(entry: dict[str, Any], folder: Path, where: str) -> Any:
    from ..basis import clamped_knots
    from ..convert import interpolate
    from ..curve import Arc, BSplineCurve, CompositeCurve, Line

    _refuse_unknown(entry, _CURVE, where)
    kind, degree, closed = entry.get("kind", "through"), entry.get("degree", 3), entry.get("closed", False)
    if kind not in _KINDS:
        raise InputError(f"`kind` in {where} must be one of {', '.join(_KINDS)}, got {kind!r}.")
    points = _points(entry, folder, where)
    wanted = {"line": 2, "arc": 3}.get(kind)
    if wanted is not None and len(points) != wanted:
        raise InputError(f"kind = {kind!r} in {where} takes {wanted} points, got {len(points)}.")
    try:
        if kind == "line":
            return Line(*points)
        if kind == "arc":
            return Arc.through(*points)
        if kind == "polyline":
            return CompositeCurve([Line(a, b) for a, b in zip(points[:-1], points[1:], strict=True)])
        if kind == "control":
            return BSplineCurve(points, clamped_knots(len(points), degree), degree)
        return interpolate(points, degree, closed=closed)
    except InputError as failure:
        raise InputError(f"{where}: {failure}") from failure


def _points(entry: dict[str, Any], folder: Path, where: str) -> np.ndarray:
    from ..io import read_points

    if ("points" in entry) == ("file" in entry):
        raise InputError(f"{where} needs `points` or a `file`, one of the two.")
    if "file" in entry:
        return read_points(folder / str(entry["file"]))
    try:
        points: np.ndarray = np.asarray(entry["points"], float)
    except (TypeError, ValueError):
        points = np.asarray([])
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"`points` in {where} must be a list of [x, y, z], got {str(entry['points'])[:60]}.")
    return points


def _refuse_unknown(data: dict[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in data:
        if key not in known:
            raise InputError(f"{where} has the key {key!r}; there are {', '.join(known)}.")
