"""Reports as one HTML file that needs nothing else."""

import base64
import numbers
import os
from collections.abc import Iterable
from html import escape

from .._atomic import replacing
from ._histogram import histogram_svg
from ._numbers import readable
from ._report import Report, Table
from ._style import STYLE


def write_report(path: str | os.PathLike, report: Report) -> None:
    """Write the report as one HTML file: pictures and drawings inside, no scripts, nothing fetched.

    The file appears whole or not at all. Raises `InputError` if it cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(report_html(report), encoding="utf-8")


def report_html(report: Report) -> str:
    """The report as the text of an HTML page; every word of it is escaped."""
    body = [f"<h1>{escape(report.title)}</h1>"]
    body += [f'<p class="note-box">{escape(note)}</p>' for note in report.notes]
    if report.summary:
        body.append(_section("Figures", _summary(report.summary)))
    if report.deviations is not None:
        body.append(_section("Signed deviations", histogram_svg(report.deviations, report.unit)))
    if report.pictures:
        body.append(_section("Pictures", "".join(_picture(*picture) for picture in report.pictures)))
    body += [_section(table.caption, _table(table)) for table in report.tables]
    if report.provenance:
        body.append(_section("How it was made", _provenance(report.provenance)))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(report.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


def _section(heading: str, content: str) -> str:
    return f"<section>\n<h2>{escape(heading)}</h2>\n{content}\n</section>"


def _summary(rows: Iterable[tuple[str, object, str]]) -> str:
    cells = (
        f'<tr><th scope="row">{escape(label)}</th><td class="number">{escape(readable(value))}</td>'
        f'<td class="unit">{escape(unit)}</td></tr>'
        for label, value, unit in rows
    )
    return f'<div class="scroll"><table><tbody>{"".join(cells)}</tbody></table></div>'


def _table(table: Table) -> str:
    numeric = [all(_is_number(row[i]) for row in table.rows) for i in range(len(table.columns))]
    kind = ['class="number"' if is_number else "" for is_number in numeric]
    head = "".join(f'<th scope="col" {k}>{escape(name)}</th>' for name, k in zip(table.columns, kind, strict=True))
    rows = (
        "<tr>" + "".join(f"<td {k}>{escape(readable(cell))}</td>" for cell, k in zip(row, kind, strict=True)) + "</tr>"
        for row in table.rows
    )
    head = f"<thead><tr>{head}</tr></thead>"
    return f'<div class="scroll"><table>{head}<tbody>{"".join(rows)}</tbody></table></div>'


def _is_number(cell: object) -> bool:
    return cell is None or isinstance(cell, numbers.Real)


def _picture(caption: str, png: bytes) -> str:
    data = base64.b64encode(png).decode("ascii")
    words = escape(caption, quote=True)
    image = f'<img src="data:image/png;base64,{data}" alt="{words}">'
    return f"<figure>{image}<figcaption>{words}</figcaption></figure>"


def _provenance(rows: Iterable[tuple[str, str]]) -> str:
    cells = (f'<tr><th scope="row">{escape(label)}</th><td>{escape(text)}</td></tr>' for label, text in rows)
    return f'<table class="made"><tbody>{"".join(cells)}</tbody></table>'
