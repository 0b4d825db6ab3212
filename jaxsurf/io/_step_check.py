"""Whether a STEP file is whole, found out before OCCT translates it: on a damaged file it can crash."""

import os
import re

from ._source import refusal

_STRINGS_AND_COMMENTS = re.compile(rb"'[^']*'|/\*.*?\*/", re.DOTALL)
_INSTANCE = re.compile(rb"#(\d+)(\s*=)?")
_FACE = re.compile(rb"=\s*(?:ADVANCED_FACE|FACE_SURFACE)\s*\(")

_NEEDED = {"StepGeom", "StepShape", "StepRepr", "StepBasic"}


def check_whole(path: str | os.PathLike, data: bytes) -> int:
    """Refuse files that are no STEP file, cut, or lack lines; returns the number of faces in the file."""
    if not data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"ISO-10303-21"):
        raise refusal(path, "it does not begin with ISO-10303-21, so it is no STEP file; export it as STEP")
    if b"END-ISO-10303-21" not in data:
        raise refusal(path, "the line END-ISO-10303-21 is missing, so the STEP file is cut; export or copy it again")
    plain = _STRINGS_AND_COMMENTS.sub(b"", data)
    defined, used = set(), set()
    for number, equals in _INSTANCE.findall(plain):
        (defined if equals else used).add(int(number))
    missing = used - defined
    if missing:
        raise refusal(path, f"it refers to #{min(missing)}, which is missing; the STEP file is damaged, copy it again")
    return len(_FACE.findall(plain))


def check_entities(path: str | os.PathLike, model) -> None:
    """Refuse a STEP model with entities that OCCT could not take in: translating them can crash.

    Missing names are forgiven, since many systems leave them out, and faults in dimensions and colours too.
    """
    for number in range(1, model.NbEntities() + 1):
        if model.IsErrorEntity(number):
            check = model.Check(number, True)
            faults = [check.Fail(i).ToCString() for i in range(1, check.NbFails() + 1)]
            serious = [fault for fault in faults if "(name)" not in fault]
            room, _, kind = type(model.Value(number)).__name__.partition("_")
            if serious and room in _NEEDED:
                raise refusal(
                    path,
                    f"OCCT says of a {kind} {serious[0]!r}; the STEP file is damaged, copy it again",
                )
