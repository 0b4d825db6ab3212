"""Text files as lines and tables of numbers."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ._source import refusal

_CUT = "the file is cut or damaged there; copy or export it again"


def text_lines(path: Path, data: bytes) -> list[str]:
    """The lines of a text file, whatever its byte order mark and line ends (LF, CRLF, CR).

    Bytes that are not ASCII occur in comments only, so they need no right decoding; binary data is refused.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        text = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    if "\0" in text:
        raise refusal(path, "expected text, got binary data; check that the suffix of the file is the right one")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.split("\n")  # not splitlines: it also splits at form feeds and Latin-1 bytes


def parse_table(
    path: Path,
    rows: Sequence[str],
    numbers: Sequence[int],
    *,
    columns: Sequence[int],
    width: int,
    delimiter: str | None = None,
) -> np.ndarray:
    """The wanted columns of rows that all have `width` columns, as float64 of shape (rows, columns).

    `numbers` are the rows' line numbers in the file; other columns may hold anything. Raises `InputError` at
    the first row with another width or with something that is not a number.
    """
    if delimiter is None:
        widths = np.fromiter((len(row.split()) for row in rows), dtype=np.int64, count=len(rows))
    else:
        widths = np.fromiter((row.count(delimiter) + 1 for row in rows), dtype=np.int64, count=len(rows))
    wrong = widths != width
    if wrong.any():
        first = int(wrong.argmax())
        raise refusal(path, f"expected {width} columns in line {numbers[first]}, got {widths[first]}; {_CUT}")
    if not rows:
        return np.empty((0, len(columns)))
    try:
        return np.loadtxt(rows, dtype=np.float64, delimiter=delimiter, usecols=tuple(columns), ndmin=2, comments=None)
    except (ValueError, OverflowError) as error:
        found = re.search(r"at row (\d+)", str(error))
        if found is None:
            raise refusal(path, "expected numbers in every row, got something else; export it again") from error
        first = int(found.group(1))
        what = rows[first].strip()
        what = what if len(what) <= 60 else what[:57] + "..."
        raise refusal(path, f"expected numbers in line {numbers[first]}, got {what!r}; correct or remove it") from error


def refuse_cut_end(path: Path, data: bytes, rows: Sequence[str], number: int, delimiter: str | None = None) -> None:
    """Refuse a last row that stops inside its last number.

    Half a number is a number too, so this is seen only when the file has no last line end and the rows before
    agree on more decimals than the last row has.
    """
    if data.endswith((b"\n", b"\r", b"\n\0", b"\0\n")) or len(rows) < 20:
        return
    decimals = [len(row.split(delimiter)[-1].strip().partition(".")[2]) for row in rows[-200:]]
    if len(set(decimals[:-1])) == 1 and decimals[-1] < decimals[0]:
        raise refusal(
            path,
            f"line {number}, the last, stops inside a number: expected {decimals[0]} decimals as before it, "
            f"got {decimals[-1]} and no line end; {_CUT}",
        )
