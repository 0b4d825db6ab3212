"""Points from Wavefront OBJ files: the vertices."""

import re
from pathlib import Path

import numpy as np

from ._rows import Rows
from ._source import refusal
from ._text import parse_table, refuse_cut_end, text_lines

_CUT = "the file is cut or damaged, copy or export it again"


def read_obj(path: Path, data: bytes) -> Rows:
    """The `v` lines in their order, used by faces or not; weights and colours are left aside."""
    rows, numbers, faces, last = [], [], [], ""
    for number, line in enumerate(text_lines(path, data), start=1):
        last = line.strip() or last
        if line.startswith(("v ", "v\t")):
            rows.append(line.partition("#")[0])
            numbers.append(number)
        elif line.startswith(("f ", "f\t")):
            faces.append(line[2:].partition("#")[0].removesuffix("\\"))
    if not rows:
        raise refusal(path, "expected lines 'v x y z', got none; check that it is a Wavefront OBJ file with points")
    width = len(rows[0].split())
    if width < 4:
        raise refusal(path, f"expected 3 coordinates in line {numbers[0]}, got {rows[0][:60]!r}; {_CUT}")
    points = parse_table(path, rows, numbers, columns=(1, 2, 3), width=width)
    if last == rows[-1].strip():
        refuse_cut_end(path, data, rows, numbers[-1])
    _check_faces(path, faces, len(rows))
    return Rows(points, lambda index: f"line {numbers[index]}")


def _check_faces(path: Path, faces: list[str], count: int) -> None:
    """Faces that name a vertex behind the last one show that vertices are missing."""
    corners = re.sub(r"/\S*", "", " ".join(faces)).split()
    try:
        highest = int(np.array(corners, dtype=np.int64).max()) if corners else 0
    except (ValueError, OverflowError) as error:
        raise refusal(path, f"expected vertex numbers in its faces, got something else; {_CUT}") from error
    if highest > count:
        raise refusal(path, f"its faces name vertex {highest}, but it has {count} vertices; {_CUT}")
