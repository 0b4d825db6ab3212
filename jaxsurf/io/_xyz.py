"""Points from text with one point in a row: .xyz, .txt, .asc, .pts, .csv."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ._rows import Part, Rows
from ._source import refusal
from ._text import parse_table, refuse_cut_end, text_lines

_BLOCK = 1 << 24  # bytes of text that are looked at together where a part is wanted
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")


class _Layout(NamedTuple):
    """What the first rows say: how many stand before the points, which columns are x, y, z, and how cells are told apart."""

    skipped: int
    columns: tuple[int, int, int]
    width: int
    delimiter: str | None
    quoted: bool


def read_text(path: Path, data: Any, part: Part | None = None) -> Rows:
    """One point in a row, columns apart by white space, commas, semicolons or tabs.

    `#` and `//` begin comments. A first row of names says which columns are x, y and z, otherwise they are
    the first three; a first row of one integer is the number of points (.pts) and is checked.
    part: of the points; the file, which may be mapped memory, is then walked through in blocks, and only that part kept.
    """
    if part is not None and data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        whole = read_text(path, data[:])  # a block of UTF-16 is not known by its bytes
        return whole._replace(points=whole.points[part.of(len(whole.points))])
    if part is None:
        rows, numbers = _without_comments(text_lines(path, data))
        last, first = rows[-1:], 0
        layout = _layout(path, rows, numbers, len(rows), *last)
        chosen = slice(layout.skipped, None)
    else:
        blocks, total, last = _blocks(path, data)
        layout = _layout(path, *_rows_between(path, data, blocks, 0, 3), total, *last)
        kept = part.of(total - layout.skipped)
        rows, numbers = _rows_between(path, data, blocks, kept.start + layout.skipped, kept.stop + layout.skipped)
        chosen, first = slice(None), kept.start
    rows, numbers = rows[chosen], numbers[chosen]
    if layout.quoted:
        rows = [_without_quotes(path, row, number) for row, number in zip(rows, numbers, strict=True)]
    reading = {"columns": layout.columns, "width": layout.width, "delimiter": layout.delimiter}
    points = parse_table(path, rows, numbers, **reading)
    if rows and rows[-1:] == last:
        refuse_cut_end(path, data[-2:], rows, numbers[-1], layout.delimiter)
    return Rows(points, lambda index: f"line {numbers[index - first]}")


def _layout(path: Path, rows: list[str], numbers: list[int], total: int, last: str = "") -> _Layout:
    """Read the first of `total` rows; last: the last of all."""
    skipped = 0
    if rows and re.fullmatch(r"\d+", rows[0]):
        skipped = 1
        if int(rows[0]) != total - 1:
            raise refusal(
                path,
                f"expected {int(rows[0])} points as its first row says, got {total - 1}; the file is cut or damaged",
            )
    columns, names = (0, 1, 2), None
    if len(rows) > skipped and _is_header(rows[skipped]):
        header = re.sub(r"\s*[\[(][^])]*[])]", "", rows[skipped])  # "X [mm]" is x: units are the user's business
        names = _cells(header, _delimiter(header))
        columns = _named_columns(path, names, numbers[skipped])
        skipped += 1
    if total <= skipped:
        raise refusal(path, "it holds no points; export it again")
    first, number = rows[skipped], numbers[skipped]
    quoted = '"' in first or '"' in last
    if quoted:
        first = _without_quotes(path, first, number)
    delimiter = _delimiter(first)
    _refuse_decimal_comma(path, first, delimiter, number)
    width = len(_cells(first, delimiter))
    if names is not None and width != len(names):
        raise refusal(path, f"expected {len(names)} columns in line {number} as in the header, got {width}")
    if width < 3:
        raise refusal(
            path,
            f"expected at least 3 columns (x, y, z) in line {number}, got {width}: {first[:60]!r}; "
            "export one point in a row",
        )
    return _Layout(skipped, columns, width, delimiter, quoted)


def _without_comments(lines: Sequence[str], before: int = 0) -> tuple[list[str], list[int]]:
    rows, numbers = [], []
    for number, line in enumerate(lines, start=before + 1):
        if "#" in line or "//" in line:
            line = line.partition("#")[0].partition("//")[0]
        line = line.strip()
        if line:
            rows.append(line)
            numbers.append(number)
    return rows, numbers


def _delimiter(row: str) -> str | None:
    return next((mark for mark in ";," if mark in row), None)


def _cells(row: str, delimiter: str | None) -> list[str]:
    return [cell.strip() for cell in row.split(delimiter)]


def _is_header(row: str) -> bool:
    # A row of names has no number in it; a damaged row of numbers has at least one and stays an error.
    return not any(_NUMBER.fullmatch(cell) for cell in re.split(r"[\s;,\"]+", row) if cell)


def _named_columns(path: Path, names: list[str], number: int) -> tuple[int, int, int]:
    plain = [name.strip('"').strip().lower() for name in names]
    if any(plain.count(axis) != 1 for axis in "xyz"):
        raise refusal(
            path,
            f"expected columns named x, y and z (each once) in line {number}, got {', '.join(names)[:80]!r}; "
            "rename the columns or remove the row of names",
        )
    return plain.index("x"), plain.index("y"), plain.index("z")


def _without_quotes(path: Path, row: str, number: int) -> str:
    if re.search(r'"\s*[-+]?\d+,\d+\s*"', row):
        raise _decimal_comma(path, row, number)
    return row.replace('"', "")


def _refuse_decimal_comma(path: Path, row: str, delimiter: str | None, number: int) -> None:
    cells = _cells(row, ";" if delimiter == ";" else None)
    if len(cells) >= 3 and any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells):
        raise _decimal_comma(path, row, number)


def _decimal_comma(path: Path, row: str, number: int):
    return refusal(
        path,
        f"expected decimal points, got decimal commas in line {number}: {row[:60]!r}; export it with decimal points",
    )


class _Block(NamedTuple):
    """Bytes of whole lines; how many lines and rows stand before them, and how many rows are in them."""

    start: int
    end: int
    lines: int
    before: int
    count: int


def _blocks(path: Path, data: Any) -> tuple[list[_Block], int, list[str]]:
    """The blocks of a text, the number of its rows, and the last of them."""
    blocks, start, lines, total, last = [], 0, 0, 0, []
    while start < len(data):
        end = data.find(b"\n", min(start + _BLOCK, len(data)) - 1) + 1 or len(data)
        block = text_lines(path, data[start:end])
        rows, _ = _without_comments(block)
        blocks.append(_Block(start, end, lines, total, len(rows)))
        start, lines, total, last = end, lines + len(block) - 1, total + len(rows), rows[-1:] or last
    return blocks, total, last


def _rows_between(path: Path, data: Any, blocks: list[_Block], first: int, stop: int) -> tuple[list[str], list[int]]:
    """The rows from `first` to before `stop`, without comments, and their line numbers."""
    rows, numbers = [], []
    for block in blocks:
        if block.before < stop and first < block.before + block.count:
            chosen = slice(max(first - block.before, 0), stop - block.before)
            mine, theirs = _without_comments(text_lines(path, data[block.start : block.end]), block.lines)
            rows += mine[chosen]
            numbers += theirs[chosen]
    return rows, numbers
