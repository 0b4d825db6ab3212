"""Points from PCD files (Point Cloud Library)."""

import io
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .._errors import import_optional
from ._rows import Part, Rows
from ._source import guarded, refusal
from ._text import parse_table, refuse_cut_end, text_lines

_CUT = "the file is cut or damaged, copy or export it again"
_KINDS = {"F4": "<f4", "F8": "<f8"} | {f"{sign}{size}": f"<{sign.lower()}{size}" for sign in "IU" for size in (1, 2, 4, 8)}
_LONGEST = 1 << 16  # bytes of the header


class _Header(NamedTuple):
    fields: list[str]
    kinds: list[str]
    counts: list[int]
    points: int
    encoding: str
    size: int
    lines: int


def read_pcd(path: Path, data: Any, part: Part | None = None) -> Rows:
    """The fields x, y and z; text, binary, and (with the package `pypcd4`) compressed.

    part: of the points; those before and behind it are not kept, nor read from binary `data` that is mapped memory.
    """
    rows = _read(path, data, part or Part())
    return rows if part is None or part.total else rows._replace(points=rows.points[part.of(len(rows.points))])


def _read(path: Path, data: Any, part: Part) -> Rows:
    header = _read_header(path, data)
    if any(header.fields.count(axis) != 1 for axis in "xyz"):
        raise refusal(path, f"expected the PCD fields x, y and z, got {' '.join(header.fields)}; export it again")
    if header.encoding == "ascii":
        return _read_text(path, data, header)
    record = np.dtype(
        {
            "names": [str(k) for k in range(len(header.fields))],
            "formats": [(kind, (count,)) for kind, count in zip(header.kinds, header.counts, strict=True)],
        }
    )
    promised = header.points * record.itemsize
    if header.encoding == "binary":
        there = len(data) - header.size
        if there < promised or data[header.size + promised :].strip(b"\r\n\0"):
            raise refusal(path, f"expected {promised} bytes for {header.points} PCD points, got {there}; {_CUT}")
        records = np.frombuffer(data, dtype=record, count=header.points, offset=header.size)[part.of(header.points)]
        axes = [records[str(header.fields.index(axis))][:, 0] for axis in "xyz"]
        return Rows(np.stack([axis.astype(np.float64) for axis in axes], axis=1))
    return Rows(_read_compressed(path, data[header.size :], header, promised))


def _read_header(path: Path, data: Any) -> _Header:
    entries, size, lines = {}, 0, 0
    for line in data[:_LONGEST].splitlines(keepends=True):
        size, lines = size + len(line), lines + 1
        key, *words = line.partition(b"#")[0].decode("latin-1").split() or [""]
        entries[key.upper()] = words
        if key.upper() == "DATA":
            break
    try:
        fields = [name.lower() for name in entries.get("FIELDS", entries.get("COLUMNS", []))]
        kinds = [_KINDS[kind + size] for kind, size in zip(entries["TYPE"], entries["SIZE"], strict=True)]
        counts = [int(count) for count in entries.get("COUNT", ["1"] * len(fields))]
        extent = math.prod(int(entries[key][0]) for key in ("WIDTH", "HEIGHT"))
        points = int(entries["POINTS"][0]) if "POINTS" in entries else extent
        (encoding,) = entries["DATA"]
        good = len(fields) == len(kinds) == len(counts) and min(counts, default=0) > 0 and points >= 0
    except (KeyError, ValueError, IndexError) as error:
        raise refusal(path, "its PCD header is not complete (FIELDS, SIZE, TYPE, WIDTH, HEIGHT, DATA); " + _CUT) from error
    if not good or encoding not in ("ascii", "binary", "binary_compressed"):
        raise refusal(path, f"its PCD header contradicts itself, or its DATA {encoding!r} is unknown; export it again")
    if points != extent:
        raise refusal(path, f"its PCD header promises {points} POINTS, but WIDTH x HEIGHT is {extent}; export it again")
    return _Header(fields, kinds, counts, points, encoding, size, lines)


def _read_text(path: Path, data: Any, header: _Header) -> Rows:
    lines = text_lines(path, data[header.size :])
    numbers = [number for number, line in enumerate(lines, start=header.lines + 1) if line.strip()]
    rows = [line for line in lines if line.strip()]
    if len(rows) != header.points:
        raise refusal(path, f"expected {header.points} PCD points as its header says, got {len(rows)} rows; {_CUT}")
    columns = [sum(header.counts[: header.fields.index(axis)]) for axis in "xyz"]
    points = parse_table(path, rows, numbers, columns=columns, width=sum(header.counts))
    if rows:
        refuse_cut_end(path, data[-2:], rows, numbers[-1])
    return Rows(points, lambda index: f"line {numbers[index]}")


def _read_compressed(path: Path, body: bytes, header: _Header, promised: int) -> np.ndarray:
    pypcd4 = import_optional("pypcd4", extra="scan", purpose="reading compressed .pcd files")
    packed, unpacked = (int.from_bytes(body[at : at + 4], "little") for at in (0, 4))
    if len(body) < 8 + packed or unpacked != promised:
        raise refusal(
            path,
            f"expected {promised} bytes for {header.points} PCD points, packed into {packed}, "
            f"got {unpacked} in {max(len(body) - 8, 0)}; {_CUT}",
        )
    # A header of our own: pypcd4 stops at comments that are not UTF-8, and we have checked what it says.
    names = " ".join(f"f{k}" for k in range(len(header.fields)))
    sizes = " ".join(kind[2:] for kind in header.kinds)
    kinds = " ".join(kind[1].upper() for kind in header.kinds)
    counts = " ".join(map(str, header.counts))
    head = (
        f"VERSION 0.7\nFIELDS {names}\nSIZE {sizes}\nTYPE {kinds}\nCOUNT {counts}\nWIDTH {header.points}\n"
        f"HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {header.points}\nDATA binary_compressed\n"
    )
    wanted = tuple(f"f{header.fields.index(axis)}" for axis in "xyz")

    def read() -> np.ndarray:
        cloud = pypcd4.PointCloud.from_fileobj(io.BytesIO(head.encode() + body))
        return np.stack([cloud.pc_data[name].astype(np.float64) for name in wanted], axis=1)

    return guarded(path, "PCD", read)
