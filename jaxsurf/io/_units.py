"""Units of length in CAD files."""

from .._errors import InputError

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
OCCT_UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "INCH"}


def check_unit(unit: str) -> str:
    """Return the name of a known unit of length; `inch` is another word for `in`."""
    name = "in" if unit == "inch" else unit
    if name not in MILLIMETRES:
        known = ", ".join(repr(known) for known in MILLIMETRES)
        raise InputError(f"`unit` must be one of {known}, got {unit!r}.")
    return name
