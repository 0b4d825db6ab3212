"""Numbers as people read them."""

import numbers

DIGITS = 4


def readable(value: object) -> str:
    """Integers with thousands separated, others to four significant digits, text as it is, `None` a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, numbers.Integral):
        return f"{int(value):,}".replace("-", "−")
    if isinstance(value, numbers.Real):
        return _real(float(value))
    return str(value)


def _real(value: float) -> str:
    if value != value or value in (float("inf"), float("-inf")):
        return str(value).replace("-", "−")
    if value == 0.0:
        return "0"
    if not 1e-4 <= abs(value) < 1e7:
        mantissa, exponent = f"{value:.{DIGITS - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}".replace("-", "−")
    text = f"{value:,.{max(0, DIGITS - 1 - _exponent(value))}f}"
    return text.replace("-", "−")


def _exponent(value: float) -> int:
    return int(f"{value:.{DIGITS - 1}e}".split("e")[1])
