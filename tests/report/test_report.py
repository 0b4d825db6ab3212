"""Reports: what the page says, that it is safe, and that it needs nothing else."""

import hashlib
import html.parser
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf.report import Report, Table, provenance, report_html, write_report
from jaxsurf.report._histogram import histogram_svg
from jaxsurf.report._numbers import readable

PNG = b"\x89PNG\r\n\x1a\n" + b"rest"
NASTY = "<script>alert(\"x\")</script> & 'quoted'"
SVG = "{http://www.w3.org/2000/svg}"


def full_report() -> Report:
    return Report(
        title=NASTY,
        summary=[("points", 12345, ""), (NASTY, 0.0123456, "mm"), ("degrees", "3 × 3", NASTY)],
        deviations=np.random.default_rng(2).normal(0.0, 0.02, 5000),
        unit=NASTY,
        pictures=[(NASTY, PNG)],
        tables=[Table(NASTY, (NASTY, "rms"), [(NASTY, 0.5), ("b", None)])],
        provenance=[(NASTY, NASTY)],
        notes=[NASTY],
    )


class Tags(html.parser.HTMLParser):
    """Collects tags and checks that they nest."""

    def __init__(self):
        super().__init__()
        self.seen, self.open = [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_every_word_is_escaped_and_tags_nest():
    page = report_html(full_report())
    tags = Tags()
    tags.feed(page)
    assert tags.open == []
    assert "script" not in [tag for tag, _ in tags.seen]
    assert NASTY not in page and "&lt;script&gt;" in page
    for _, attributes in tags.seen:
        assert not any(name.startswith("on") for name in attributes)


def test_the_page_needs_nothing_from_outside():
    page = report_html(full_report())
    assert re.findall(r'(?:src|href)="(?!data:)', page) == []
    assert "url(" not in page and "@import" not in page
    assert 'src="data:image/png;base64,' in page


def test_figures_are_readable():
    page = report_html(full_report())
    assert "12,345" in page and "0.01235" in page
    for value, text in [
        (1234567, "1,234,567"),
        (-0.5, "−0.5000"),
        (0.0, "0"),
        (1.5e-7, "1.500e−7"),
        (9.99999, "10.00"),
        (True, "yes"),
        (None, "–"),
        ("as it is", "as it is"),
        (np.float64("nan"), "nan"),
        (np.int64(-7), "−7"),
        (45678.9, "45,679"),
    ]:
        assert readable(value) == text


def test_the_histogram_counts_every_point_on_its_side():
    values = np.concatenate([np.full(30, -0.015), np.full(10, 0.015), np.full(960, 0.004), [5.0]])
    tree = ElementTree.fromstring(histogram_svg(values, "mm"))
    counts = {"below": 0, "above": 0}
    for bar in tree.iter(f"{SVG}rect"):
        counts[bar.attrib["class"]] += int((bar[0].text or "").rsplit(": ", 1)[1].replace(",", ""))
    assert counts == {"below": 30, "above": 971}
    words = " ".join(text.text or "" for text in tree.iter(f"{SVG}text"))
    assert "signed deviation [mm]" in words and "1 beyond ±" in words


@pytest.mark.parametrize("values", [np.zeros(3), np.array([2.0]), np.array([-1e-9, 1e-9])])
def test_odd_deviations_still_make_a_histogram(values):
    assert ElementTree.fromstring(histogram_svg(values, "mm")).tag == f"{SVG}svg"


def test_a_report_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    write_report(path, full_report())
    first = path.read_text(encoding="utf-8")
    assert first.startswith("<!DOCTYPE html>") and first.rstrip().endswith("</html>")
    monkeypatch.setattr("jaxsurf.report._html.report_html", lambda report: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_report(path, full_report())
    assert path.read_text(encoding="utf-8") == first and list(tmp_path.iterdir()) == [path]
    with pytest.raises(InputError, match="does not exist; create it first"):
        write_report(tmp_path / "no" / "report.html", full_report())


def test_a_short_report_leaves_sections_out():
    page = report_html(Report("Bare"))
    assert "<h1>Bare</h1>" in page and "<h2>" not in page


def test_bad_content_is_refused():
    with pytest.raises(InputError, match=r"`pictures\[0\]` \('a'\) must be the bytes of a PNG file"):
        Report("t", pictures=[("a", b"GIF89a")])
    with pytest.raises(InputError, match=r"`deviations` must be finite numbers of shape \(n,\)"):
        Report("t", deviations=np.array([1.0, np.nan]))
    with pytest.raises(InputError, match=r"`rows\[1\]` of the table 'c' must have 2 cells, got 1"):
        Table("c", ("a", "b"), [(1, 2), (3,)])


def test_provenance_names_command_versions_and_the_input(tmp_path):
    path = tmp_path / "part 1.ply"
    path.write_bytes(b"ply\n" * 1000)
    rows = dict(provenance(input_path=path, command=["/usr/bin/jaxsurf", "fit", "part 1.ply"]))
    assert rows["command"] == "jaxsurf fit 'part 1.ply'"
    assert rows["SHA-256 of the input"] == hashlib.sha256(b"ply\n" * 1000).hexdigest()
    assert rows["input file"] == "part 1.ply" and {"jax", "numpy", "Python", "machine", "date"} <= set(rows)
    with pytest.raises(InputError, match="Cannot read .*No such file"):
        provenance(input_path=tmp_path / "none.ply")
