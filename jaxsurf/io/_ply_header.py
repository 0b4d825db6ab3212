"""The header of a PLY file: which elements follow, how many, in what layout."""

import re
from pathlib import Path
from typing import Any, NamedTuple

from ._source import refusal

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST = 1 << 20  # bytes; a text header that goes on longer than this is not one


class Property(NamedTuple):
    """A number, or a list of numbers with its length before it (`length_type` is not None)."""

    name: str
    type: str
    length_type: str | None = None


class Element(NamedTuple):
    """`count` rows of the same properties."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(property.length_type is not None for property in self.properties)


class Header(NamedTuple):
    """Byte order ("<", ">" or "" for text), the elements in their order, the header's bytes and lines."""

    order: str
    elements: tuple[Element, ...]
    size: int
    lines: int


def read_header(path: Path, data: Any) -> Header:
    """Parse the header; `InputError` names the line that is not understood."""
    if data[:4] not in (b"ply\n", b"ply\r", b"ply "):
        raise refusal(path, f"expected a PLY file, which begins with 'ply', got {data[:12]!r}; check its suffix")
    end = re.compile(rb"(?:\r\n|\n|\r)end_header[ \t]*(\r\n|\n|\r|$)").search(data, 0, _LONGEST)
    if end is None:
        raise refusal(path, "expected the line 'end_header', got none; the file is cut or damaged, copy it again")
    size = end.end()
    if end.group(1) == b"\r\n" and data[end.start() : end.start() + 2] not in (b"\r\n", b"\ne"):
        size -= 1  # the header's lines end in CR alone: this LF is the first byte of the data
    lines = re.split(r"\r\n|\n|\r", data[: end.end()].decode("latin-1").rstrip())
    order, elements = None, []
    for number, line in enumerate(lines, start=1):
        match line.split():
            case [] | ["ply"] | ["end_header"] | ["comment" | "obj_info", *_]:
                pass
            case ["format", word, *_] if word in _ORDERS:
                order = _ORDERS[word]
            case ["element", name, count] if re.fullmatch(r"[0-9]+", count):
                elements.append((name, int(count), []))
            case ["property", "list", length, kind, name] if (
                elements and kind in _TYPES and _TYPES.get(length, "f")[0] != "f"
            ):
                elements[-1][2].append(Property(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1][2].append(Property(name, _TYPES[kind]))
            case _:
                raise refusal(path, f"line {number} of its PLY header is not understood: {line[:60]!r}; export it again")
    if order is None:
        raise refusal(path, "expected a line 'format ...' in its PLY header, got none; export it again")
    return Header(order, tuple(Element(name, count, tuple(rest)) for name, count, rest in elements), size, len(lines))
