"""Points from text with one point in a row: .xyz, .txt, .asc, .pts, .csv."""

import re
from collections.abc import Sequence
from pathlib import Path

from ._rows import Rows
from ._source import refusal
from ._text import parse_table, refuse_cut_end, text_lines

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")


def read_text(path: Path, data: bytes) -> Rows:
    """One point in a row, columns apart by white space, commas, semicolons or tabs.

    `#` and `//` begin comments. A first row of names says which columns are x, y and z, otherwise they are
    the first three; a first row of one integer is the number of points (.pts) and is checked.
    """
    rows, numbers = _without_comments(text_lines(path, data))
    if rows and re.fullmatch(r"\d+", rows[0]):
        rows, numbers = _without_count(path, rows, numbers)
    columns, names = (0, 1, 2), None
    if rows and _is_header(rows[0]):
        header = re.sub(r"\s*[\[(][^])]*[])]", "", rows[0])  # "X [mm]" is x: units are the user's business
        names = _cells(header, _delimiter(header))
        columns = _named_columns(path, names, numbers[0])
        rows, numbers = rows[1:], numbers[1:]
    if not rows:
        raise refusal(path, "it holds no points; export it again")
    if any('"' in row for row in (rows[0], rows[-1])):
        rows = [_without_quotes(path, row, number) for row, number in zip(rows, numbers, strict=True)]
    delimiter = _delimiter(rows[0])
    _refuse_decimal_comma(path, rows[0], delimiter, numbers[0])
    width = len(_cells(rows[0], delimiter))
    if names is not None and width != len(names):
        raise refusal(path, f"expected {len(names)} columns in line {numbers[0]} as in the header, got {width}")
    if width < 3:
        raise refusal(
            path,
            f"expected at least 3 columns (x, y, z) in line {numbers[0]}, got {width}: {rows[0][:60]!r}; "
            "export one point in a row",
        )
    points = parse_table(path, rows, numbers, columns=columns, width=width, delimiter=delimiter)
    refuse_cut_end(path, data, rows, numbers[-1], delimiter)
    return Rows(points, lambda index: f"line {numbers[index]}")


def _without_comments(lines: Sequence[str]) -> tuple[list[str], list[int]]:
    rows, numbers = [], []
    for number, line in enumerate(lines, start=1):
        if "#" in line or "//" in line:
            line = line.partition("#")[0].partition("//")[0]
        line = line.strip()
        if line:
            rows.append(line)
            numbers.append(number)
    return rows, numbers


def _without_count(path: Path, rows: list[str], numbers: list[int]) -> tuple[list[str], list[int]]:
    promised, rows, numbers = int(rows[0]), rows[1:], numbers[1:]
    if promised != len(rows):
        raise refusal(
            path,
            f"expected {promised} points as its first row says, got {len(rows)}; the file is cut or damaged",
        )
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
