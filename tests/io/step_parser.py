"""A STEP reader of our own: B-spline surfaces and curves with numpy and scipy alone, no OCCT."""

import re
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline

_TOKEN = re.compile(r"'(?:[^']|'')*'|#\d+|[A-Z_][A-Z_0-9]*|\.[A-Z_]+\.|[-+]?\d+\.?\d*(?:E[-+]?\d+)?|[(),$*]")


def entities(path: Path) -> dict[str, list]:
    """Instance name -> list of (type, arguments); complex instances have several."""
    data = path.read_text(encoding="ascii").split("DATA;", 1)[1].split("ENDSEC;")[0]
    found = {}
    for name, text in re.findall(r"(#\d+)\s*=\s*((?:'(?:[^']|'')*'|[^;'])*);", data):
        tokens = _TOKEN.findall(text)
        body = tokens[1:-1] if tokens[0] == "(" else tokens
        parts = []
        while body:
            arguments, rest = _nested(body[1:])
            parts.append((body[0], arguments))
            body = rest
        found[name] = parts
    return found


def _nested(tokens: list[str]) -> tuple[list, list[str]]:
    """The list that begins with the first token, a parenthesis, and what follows it."""
    items, rest = [], tokens[1:]
    while rest[0] != ")":
        if rest[0] == "(":
            item, rest = _nested(rest)
            items.append(item)
        else:
            items.append(rest[0])
            rest = rest[1:]
        if rest[0] == ",":
            rest = rest[1:]
    return items, rest[1:]


def surfaces(path: Path) -> list["Surface"]:
    """All B-spline surfaces of a file, rational ones too, in its order."""
    data = entities(path)
    return [Surface(data, parts) for parts in data.values() if _has(parts, "B_SPLINE_SURFACE_WITH_KNOTS")]


def _has(parts: list, kind: str) -> bool:
    return any(name == kind for name, _ in parts)


class Surface:
    """One surface; call it with a parameter pair."""

    def __init__(self, data: dict[str, list], parts: list):
        found = dict(parts)
        if len(parts) == 1:
            (self.degree_u, self.degree_v, net), knots = parts[0][1][1:4], parts[0][1][8:12]
        else:
            (self.degree_u, self.degree_v, net) = found["B_SPLINE_SURFACE"][:3]
            knots = found["B_SPLINE_SURFACE_WITH_KNOTS"][:4]
        self.degree_u, self.degree_v = int(self.degree_u), int(self.degree_v)
        self.points = np.array([[[float(x) for x in data[p][0][1][1]] for p in row] for row in net])
        self.weights = np.ones(self.points.shape[:2])
        if "RATIONAL_B_SPLINE_SURFACE" in found:
            self.weights = np.array(found["RATIONAL_B_SPLINE_SURFACE"][0], dtype=float)
        self.knots_u = np.repeat(np.array(knots[2], dtype=float), np.array(knots[0], dtype=int))
        self.knots_v = np.repeat(np.array(knots[3], dtype=float), np.array(knots[1], dtype=int))

    def __call__(self, u: float, v: float) -> np.ndarray:
        net = np.concatenate([self.points * self.weights[..., None], self.weights[..., None]], axis=-1)
        x, y, z, w = BSpline(self.knots_v, BSpline(self.knots_u, net, self.degree_u)(u), self.degree_v)(v)
        return np.array([x, y, z]) / w
