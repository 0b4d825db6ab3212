"""Points from .las and .laz files, through laspy."""

import io
import struct
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from .._errors import import_optional
from ._rows import Rows
from ._source import guarded, refusal

_CUT = "the file is cut or damaged, copy or export it again"
_SHORTEST_HEADER = 227
_VLR, _EVLR = 54, 60  # bytes of the heads of (extended) variable length records


class _Promise(NamedTuple):
    """What the header says is in the file."""

    points: int
    start: int
    length: int
    compressed: bool


def read_las(path: Path, data: bytes) -> Rows:
    """All points with the file's scale and offset applied."""
    laspy = import_optional("laspy", extra="scan", purpose="reading .las and .laz files")
    promise = _checked_header(path, data)
    lazrs = None
    if promise.compressed:
        lazrs = import_optional("lazrs", extra="scan", purpose="reading compressed .las and .laz files")

    def read() -> np.ndarray:
        # Not the parallel backend: it allocates the chunk size of a damaged file and aborts.
        with laspy.open(io.BytesIO(data), laz_backend=laspy.LazBackend.Lazrs) as reader:
            if lazrs is not None and promise.points:
                _check_chunks(lazrs, path, data, promise, reader.header)
            return np.asarray(reader.read().xyz)

    points = guarded(path, "LAS", read)
    if len(points) != promise.points:
        raise refusal(path, f"expected {promise.points} points as its LAS header says, got {len(points)}; {_CUT}")
    return Rows(points)


def _checked_header(path: Path, data: bytes) -> _Promise:
    """Compare the header's counts with the file's length: laspy loops and allocates for whatever they say."""
    if not data.startswith(b"LASF"):
        raise refusal(path, f"expected a LAS file, which begins with 'LASF', got {data[:12]!r}; check its suffix")
    if len(data) < _SHORTEST_HEADER:
        raise refusal(path, f"expected a LAS header of {_SHORTEST_HEADER} bytes, got {len(data)}; {_CUT}")
    size, start, records, kind, length, points = struct.unpack_from("<HIIBHI", data, 94)
    if data[25] >= 4 and len(data) >= 255:
        extended_start, extended, points = struct.unpack_from("<QIQ", data, 235)
        if extended and extended_start + extended * _EVLR > len(data):
            raise refusal(path, f"its LAS header promises {extended} records behind its end; {_CUT}")
    if not _SHORTEST_HEADER <= size <= start <= len(data) or size + records * _VLR > start:
        raise refusal(path, f"its LAS header promises {records} records that do not fit; {_CUT}")
    compressed = bool(kind & 0xC0)
    if not compressed and start + points * length > len(data):
        raise refusal(
            path,
            f"expected {points * length} bytes for the {points} points of its LAS header, got {len(data) - start}; {_CUT}",
        )
    return _Promise(points, start, length, compressed)


def _check_chunks(lazrs: ModuleType, path: Path, data: bytes, promise: _Promise, header: Any) -> None:
    """Compare the table of chunks with the file: lazrs aborts the process where it cannot allocate."""
    table = int.from_bytes(data[promise.start : promise.start + 8], "little", signed=True)
    if table == -1:  # written to a stream: then the offset is at the end
        table = int.from_bytes(data[-8:], "little", signed=True)
    chunks = int.from_bytes(data[table + 4 : table + 8], "little")
    if not promise.start + 8 <= table <= len(data) - 8 or not 0 < chunks <= table:
        raise refusal(path, f"its table of LAZ chunks lies outside of it; {_CUT}")
    layout = lazrs.LazVlr(header.vlrs[header.vlrs.index("LasZipVlr")].record_data)
    if layout.item_size() != promise.length or layout.chunk_size() < 1:
        raise refusal(path, f"expected LAZ items of {promise.length} bytes, got {layout.item_size()}; {_CUT}")
    stream = io.BytesIO(data)
    stream.seek(promise.start)
    counts, sizes = zip(*lazrs.read_chunk_table(stream, layout), strict=True)
    room = table - promise.start - 8
    if any(size > room for size in sizes) or sum(sizes) != room:
        raise refusal(path, f"expected {sum(sizes)} bytes of LAZ chunks, got {room}; {_CUT}")
    if not sum(counts[:-1]) < promise.points <= sum(counts):
        raise refusal(path, f"expected {promise.points} LAZ points, got chunks of {sum(counts)}; {_CUT}")
