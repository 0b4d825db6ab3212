"""Points from PLY files: the vertices, with every count of the header compared with what follows."""

import itertools
import struct
from pathlib import Path

import numpy as np

from ._ply_header import Element, Header, read_header
from ._rows import Rows
from ._source import refusal
from ._text import parse_table, refuse_cut_end, text_lines

_CUT = "the file is cut or its counts are wrong, copy or export it again"


def read_ply(path: Path, data: bytes) -> Rows:
    """The x, y, z of the element `vertex`, whatever else stands around and between them; text or binary."""
    header = read_header(path, data)
    vertices = [element for element in header.elements if element.name == "vertex"]
    if len(vertices) != 1:
        raise refusal(path, f"expected one element 'vertex' in its PLY header, got {len(vertices)}; export it again")
    names = [property.name.lower() for property in vertices[0].properties]
    scalars = [property.name.lower() for property in vertices[0].properties if property.length_type is None]
    if any(scalars.count(axis) != 1 for axis in "xyz"):
        raise refusal(path, f"expected the vertex properties x, y and z, got {', '.join(names) or 'none'}; export it again")
    columns = [names.index(axis) for axis in "xyz"]
    return (_read_binary if header.order else _read_text)(path, data, header, columns)


def _read_text(path: Path, data: bytes, header: Header, columns: list[int]) -> Rows:
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
        refuse_cut_end(path, data, rows[-elements[-1].count :], numbers[-1])
    return Rows(points, lambda index: f"line {labels[index]}")


def _flat_cells(path: Path, row: str, element: Element, number: int) -> list[str]:
    """The first cell of every property; a list must be as long as it says, and the row end with its last property."""
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
            path, f"expected {element.name} data as its PLY header says in line {number}, got {row.strip()[:60]!r}; {_CUT}"
        )
    return first


def _read_binary(path: Path, data: bytes, header: Header, columns: list[int]) -> Rows:
    offset, points = header.size, np.empty((0, 3))
    for element in header.elements:
        if not element.properties or not element.count:
            continue
        # Every row has at least the bytes of its numbers and list lengths: a lying count stops here, unallocated.
        least = sum(np.dtype(property.length_type or property.type).itemsize for property in element.properties)
        if element.count * least > len(data) - offset:
            raise _too_short(path, element, element.count * least, len(data) - offset)
        wanted = columns if element.name == "vertex" else None
        table, offset = _binary_element(path, data, offset, element, header.order, wanted)
        points = points if table is None else table
    rest = data[offset:]
    if rest.strip(b"\r\n"):
        raise refusal(path, f"expected its end after the data that its PLY header lists, got {len(rest)} more bytes; {_CUT}")
    return Rows(points)


def _binary_element(
    path: Path, data: bytes, offset: int, element: Element, order: str, columns: list[int] | None
) -> tuple[np.ndarray | None, int]:
    """The wanted columns (None if none are) and the offset behind the element."""
    # Most lists are all of one length (triangles): then the rows are records and numpy reads them at once.
    layout, size = _record(path, data, offset, element, order)
    if offset + size * element.count <= len(data):
        records = np.frombuffer(data, dtype=layout, count=element.count, offset=offset)
        lengths = [f"length {k}" for k, property in enumerate(element.properties) if property.length_type is not None]
        if all((records[name] == records[name][0]).all() for name in lengths):
            table = None
            if columns is not None:
                table = np.stack([records[f"{k}"].astype(np.float64) for k in columns], axis=1)
            return table, offset + size * element.count
    elif not element.has_lists:
        raise _too_short(path, element, size * element.count, len(data) - offset)
    points = []
    for _ in itertools.repeat(None, element.count):
        layout, size = _record(path, data, offset, element, order)
        if columns is not None:
            record = np.frombuffer(data, dtype=layout, count=1, offset=offset)
            points.append([float(record[f"{k}"][0]) for k in columns])
        offset += size
    return (None if columns is None else np.array(points, dtype=np.float64)), offset


def _record(path: Path, data: bytes, offset: int, element: Element, order: str) -> tuple[np.dtype, int]:
    """The layout of the row that begins at `offset`, and its bytes."""
    names, formats, offsets, size = [], [], [], 0
    for k, property in enumerate(element.properties):
        if property.length_type is not None:
            kind = np.dtype(order + property.length_type)
            if offset + size + kind.itemsize > len(data):
                raise _too_short(path, element, size + kind.itemsize, len(data) - offset)
            length = struct.unpack_from(order + {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}[property.length_type], data, offset + size)[0]
            names.append(f"length {k}")
            formats.append(kind)
            offsets.append(size)
            size += kind.itemsize + max(length, 0) * np.dtype(property.type).itemsize
        else:
            names.append(f"{k}")
            formats.append(order + property.type)
            offsets.append(size)
            size += np.dtype(property.type).itemsize
    if offset + size > len(data):
        raise _too_short(path, element, size, len(data) - offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size}), size


def _too_short(path: Path, element: Element, expected: int, got: int):
    return refusal(
        path, f"expected at least {expected} more bytes of {element.name} data ({element.count} rows), got {got}; {_CUT}"
    )
