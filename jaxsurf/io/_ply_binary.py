"""The body of a binary PLY file."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._ply_header import Element, Header
from ._rows import Part
from ._source import refusal

_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
_CUT = "the file is cut or its counts are wrong, copy or export it again"


def read_binary(path: Path, data: Any, header: Header, columns: Sequence[int], part: Part) -> np.ndarray:
    """The wanted columns of that part of the element `vertex`, float64 of shape (vertices, columns).

    Every element is walked through, so that a cut anywhere, or data that no element owns, is an error.
    """
    offset, points = header.size, np.empty((0, len(columns)))
    for element in header.elements:
        if not element.properties or not element.count:
            continue
        # Every row has at least its numbers and list lengths: a lying count stops here, unallocated.
        least = element.count * sum(_size(property.length_type or property.type) for property in element.properties)
        if least > len(data) - offset:
            raise _too_short(path, element, least, len(data) - offset)
        wanted = columns if element.name == "vertex" else ()
        table, offset = _read_element(path, data, offset, element, header.order, wanted, part)
        points = table if wanted else points
    rest = data[offset:]
    if rest.strip(b"\r\n"):
        raise refusal(
            path,
            f"expected its end after the data that its PLY header lists, got {len(rest)} more bytes; {_CUT}",
        )
    return points


def _read_element(
    path: Path, data: Any, offset: int, element: Element, order: str, columns: Sequence[int], part: Part
) -> tuple[np.ndarray, int]:
    """The wanted columns, and the offset behind the element."""
    first, end = _walk(path, data, offset, element, order, rows=1)
    size = end - offset
    # Mostly all lists have one length (triangles): then the rows are records, which numpy reads at once.
    if offset + size * element.count <= len(data):
        layout = np.dtype(
            {
                "names": [str(k) for k in range(len(first[0]))],
                "formats": [order + (property.length_type or property.type) for property in element.properties],
                "offsets": [place - offset for place in first[0]],
                "itemsize": size,
            }
        )
        records = np.frombuffer(data, dtype=layout, count=element.count, offset=offset)
        lengths = [str(k) for k, property in enumerate(element.properties) if property.length_type is not None]
        if all((records[name] == records[name][0]).all() for name in lengths):
            chosen = part.of(element.count) if columns else slice(0, 0)
            table = [records[str(k)][chosen].astype(np.float64) for k in columns]
            return np.stack(table or [np.empty(0)], axis=1), offset + size * element.count
    places, end = _walk(path, data, offset, element, order, rows=element.count)
    table = np.empty((element.count if columns else 0, len(columns)))
    for column, k in enumerate(columns):
        read = struct.Struct(order + _CODES[element.properties[k].type]).unpack_from
        table[:, column] = [read(data, row[k])[0] for row in places]
    return table[part.of(element.count)] if columns else table, end


def _walk(path: Path, data: Any, offset: int, element: Element, order: str, rows: int) -> tuple[list[list[int]], int]:
    """Where every property of every row begins, list by list, and the offset behind the last row."""
    steps = []
    for property in element.properties:
        length = struct.Struct(order + _CODES[property.length_type]) if property.length_type else None
        steps.append((length, _size(property.type)))
    start, places = offset, []
    try:
        for _ in range(rows):
            row = []
            for length, size in steps:
                row.append(offset)
                if length is None:
                    offset += size
                else:
                    items = length.unpack_from(data, offset)[0]
                    if items < 0:
                        raise refusal(path, f"a list of its {element.name} data has the length {items}; {_CUT}")
                    offset += length.size + size * items
            places.append(row)
    except struct.error:
        offset = max(offset, len(data) + 1)
    if offset > len(data):
        raise _too_short(path, element, offset - start, len(data) - start)
    return places, offset


def _size(kind: str) -> int:
    return int(kind[1:])


def _too_short(path: Path, element: Element, expected: int, got: int):
    return refusal(
        path,
        f"expected at least {expected} more bytes for {element.count} rows of {element.name} data, got {got}; {_CUT}",
    )
