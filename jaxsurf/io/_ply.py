"""Points from PLY files: the vertices, with every count of the header compared with what follows."""

from pathlib import Path
from typing import Any

import numpy as np

from ._ply_binary import read_binary
from ._ply_header import Element, Header, read_header
from ._rows import Part, Rows
from ._source import refusal
from ._text import parse_table, refuse_cut_end, text_lines

_CUT = "the file is cut or its counts are wrong, copy or export it again"


def read_ply(path: Path, data: Any, part: Part | None = None) -> Rows:
    """The x, y, z of the element `vertex`, whatever else stands around and between them; text or binary.

    part: of the vertices; those before and behind it are not kept, nor read from binary `data` that is mapped memory.
    """
    if data[:3] == b"\xef\xbb\xbf":
        data = data[3:]
    header = read_header(path, data)
    vertices = [element for element in header.elements if element.name == "vertex"]
    if len(vertices) != 1:
        raise refusal(path, f"expected one element 'vertex' in its PLY header, got {len(vertices)}; export it again")
    names = [property.name.lower() for property in vertices[0].properties]
    scalars = [property.name.lower() for property in vertices[0].properties if property.length_type is None]
    if any(scalars.count(axis) != 1 for axis in "xyz"):
        raise refusal(
            path,
            f"expected the vertex properties x, y and z, got {', '.join(names) or 'none'}; export it again",
        )
    columns = [names.index(axis) for axis in "xyz"]
    if header.order:
        return Rows(read_binary(path, data, header, columns, part or Part()))
    rows = _read_text(path, data, header, columns)
    return rows if part is None else rows._replace(points=rows.points[part.of(len(rows.points))])


def _read_text(path: Path, data: Any, header: Header, columns: list[int]) -> Rows:
    lines = text_lines(path, data[header.size :])
    numbers = [number for number, line in enumerate(lines, start=header.lines + 1) if line.strip()]
    rows = [line for line in lines if line.strip()]
    elements = [element for element in header.elements if element.properties]
    promised = sum(element.count for element in elements)
    if promised != len(rows):
        counts = " + ".join(f"{element.count} {element.name}" for element in elements)
        raise refusal(path, f"expected {promised} rows after its PLY header ({counts}), got {len(rows)}; {_CUT}")
    start, points, labels = 0, np.empty((0, 3)), []
    for element in elements:
        mine, theirs = rows[start : start + element.count], numbers[start : start + element.count]
        start += element.count
        if element.has_lists:
            cells = [_flat_cells(path, row, element, number) for row, number in zip(mine, theirs, strict=True)]
            if element.name == "vertex":
                mine = [" ".join(row[column] for column in columns) for row in cells]
                points, labels = parse_table(path, mine, theirs, columns=(0, 1, 2), width=3), theirs
        else:
            wanted = columns if element.name == "vertex" else ()
            width = len(element.properties)
            table = parse_table(path, mine, theirs, columns=wanted or (0,), width=width)
            points, labels = (table, theirs) if wanted else (points, labels)
    if rows and elements[-1].name == "vertex":
        refuse_cut_end(path, data[-2:], rows[-elements[-1].count :], numbers[-1])
    return Rows(points, lambda index: f"line {labels[index]}")


def _flat_cells(path: Path, row: str, element: Element, number: int) -> list[str]:
    """The first cell of every property; a list is as long as it says, and the row ends with the last one."""
    cells, at, first = row.split(), 0, []
    for property in element.properties:
        cell = cells[at] if at < len(cells) else ""
        first.append(cell)
        if property.length_type is None:
            at += 1
        elif cell.isascii() and cell.isdigit():
            at += 1 + int(cell)
        else:
            at = -1
            break
    if at != len(cells):
        raise refusal(
            path,
            f"expected {element.name} data as its PLY header says in line {number}, got {row.strip()[:60]!r}; {_CUT}",
        )
    return first
