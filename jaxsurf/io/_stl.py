"""Points from STL files: the corners of the facets, each once."""

from pathlib import Path

import numpy as np

from ._rows import Rows
from ._source import refusal
from ._text import parse_table, text_lines

_CUT = "the file is cut or damaged, copy or export it again"
_HEAD = 84  # 80 bytes of anything and the number of facets
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, data: bytes) -> Rows:
    """The corners of all facets in the order of their first mention; exactly equal ones are one point."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    # Many binary files begin with "solid" too, so their length decides, then the bytes that no text has.
    facets = int.from_bytes(data[80:_HEAD], "little") if len(data) >= _HEAD else -1
    fits = len(data) == _HEAD + facets * _FACET.itemsize
    if not fits and data[:512].lstrip()[:5].lower() == b"solid" and b"\0" not in data[:1024]:
        return _first_mentions(_read_text(path, data))
    if len(data) < _HEAD:
        raise refusal(path, f"expected an STL header of {_HEAD} bytes, got {len(data)}; {_CUT}")
    if not fits:
        raise refusal(
            path,
            f"expected {_HEAD + facets * _FACET.itemsize} bytes for the {facets} facets of its STL header, "
            f"got {len(data)}; {_CUT}",
        )
    corners = np.frombuffer(data, dtype=_FACET, offset=_HEAD)["corners"].reshape(-1, 3)
    return _first_mentions(Rows(corners, lambda index: f"facet {index // 3 + 1}"))


def _read_text(path: Path, data: bytes) -> Rows:
    begun, ended, rows, numbers, last, number = 0, 0, [], [], "", 0
    for number, line in enumerate(text_lines(path, data), start=1):
        words = line.split(None, 1)
        if not words:
            continue
        last = words[0].lower()
        if last == "vertex":
            rows.append(words[1] if len(words) > 1 else "")
            numbers.append(number)
        elif last == "facet":
            begun += 1
        elif last == "endfacet":
            ended += 1
            if begun != ended or len(rows) != 3 * ended:
                raise refusal(path, f"expected 3 corners in the facet that ends in line {number}; {_CUT}")
    if begun != ended or last not in ("endsolid", "end"):
        raise refusal(path, f"expected the line 'endsolid' at its end, got {last!r} in a file of {number} lines; {_CUT}")
    points = parse_table(path, rows, numbers, columns=(0, 1, 2), width=3)
    return Rows(points, lambda index: f"line {numbers[index]}")


def _first_mentions(rows: Rows) -> Rows:
    points = rows.points
    order = np.lexsort(points.T)  # stable, so the first of equal rows is the first in the file
    ordered = points[order]
    fresh = np.ones(len(points), dtype=bool)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)  # NaN differs from itself: it stays, to be refused
    kept = np.sort(order[fresh])
    return Rows(points[kept], lambda index: rows.label(int(kept[index])))
