"""A histogram of signed deviations as SVG."""

from html import escape

import numpy as np
from jaxtyping import Float

from ._numbers import readable

WIDTH, HEIGHT = 720, 300
LEFT, RIGHT, TOP, BOTTOM = 58, 36, 30, 52
BINS = 60
QUANTILE = 0.995


def histogram_svg(deviations: Float[np.ndarray, "n"], unit: str) -> str:
    """Counts of deviations in 60 bins, symmetric about 0, blue below and red above, the rms marked.

    The axis ends at the 99.5 % quantile of |deviation|; what lies beyond is counted in the outermost bins,
    and a line of text says how many that are. Colours come from the page by `currentColor` and classes, so
    that it suits light and dark.
    """
    values = np.asarray(deviations, dtype=np.float64)
    reach, step = _axis(float(np.quantile(np.abs(values), QUANTILE)) or float(np.abs(values).max()) or 1.0)
    counts, edges = np.histogram(np.clip(values, -reach, reach), bins=BINS, range=(-reach, reach))
    rms = float(np.sqrt(np.mean(values**2)))
    beyond = int((np.abs(values) > reach).sum())
    top = _rounded_up(int(counts.max()))
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" xmlns="http://www.w3.org/2000/svg" '
        f'aria-label="{escape(f"Histogram of {len(values):,} signed deviations in {unit}", quote=True)}">'
    ]
    for level in (0, top / 4, top / 2, 3 * top / 4, top):
        y = _y(level, top)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{readable(int(level))}</text>')
    for count, start, end in zip(counts.tolist(), edges[:-1], edges[1:], strict=True):
        x, width = _x(start, reach), _x(end, reach) - _x(start, reach)
        side = "below" if end <= reach * 1e-12 else "above"
        tip = f"{readable(float(start))} to {readable(float(end))} {unit}: {readable(int(count))}"
        parts.append(
            f'<rect class="{side}" x="{x + 0.5:.2f}" y="{_y(count, top):.2f}" width="{width - 1:.2f}" '
            f'height="{_y(0, top) - _y(count, top):.2f}"><title>{escape(tip)}</title></rect>'
        )
    for tick in np.arange(-np.floor(reach / step + 1e-9), np.floor(reach / step + 1e-9) + 1) * step:
        x = _x(tick, reach)
        label = "0" if abs(tick) < step / 2 else f"{tick:+.6g}".replace("-", "−")
        parts.append(f'<line class="axis" x1="{x:.1f}" x2="{x:.1f}" y1="{_y(0, top):.1f}" y2="{_y(0, top) + 5:.1f}"/>')
        parts.append(f'<text x="{x:.1f}" y="{_y(0, top) + 19:.1f}" text-anchor="middle">{label}</text>')
    for mark in (-rms, rms):
        if abs(mark) < reach:
            x = _x(mark, reach)
            parts.append(f'<line class="rms" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP - 6}" y2="{_y(0, top):.1f}"/>')
    if rms < reach:
        note = f"rms ±{readable(rms)} {unit}"
        parts.append(f'<text x="{_x(rms, reach) + 6:.1f}" y="{TOP + 18}" class="note">{escape(note)}</text>')
    parts.append(f'<line class="axis" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{_y(0, top):.1f}" y2="{_y(0, top):.1f}"/>')
    parts.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 8}" text-anchor="middle">'
        f"signed deviation [{escape(unit)}]</text>"
    )
    parts.append(f'<text x="2" y="{TOP - 12}">points</text>')
    if beyond:
        text = f"{readable(beyond)} beyond ±{reach:.6g}, in the outermost bars"
        parts.append(f'<text x="{WIDTH - RIGHT}" y="{TOP - 12}" text-anchor="end" class="note">{escape(text)}</text>')
    return "".join(parts) + "</svg>"


def _x(value: float, reach: float) -> float:
    return LEFT + (value + reach) / (2 * reach) * (WIDTH - LEFT - RIGHT)


def _y(count: float, top: float) -> float:
    return HEIGHT - BOTTOM - count / top * (HEIGHT - TOP - BOTTOM)


def _axis(reach: float) -> tuple[float, float]:
    """A reach of whole ticks, and the distance of ticks: at most five on a side."""
    rough = reach / 5
    power = 10.0 ** np.floor(np.log10(rough))
    step = next(s for s in (1, 2, 2.5, 5, 10) if s * power >= rough * (1 - 1e-9)) * power
    return float(np.ceil(reach / step - 1e-9) * step), float(step)


def _rounded_up(count: int) -> int:
    """A multiple of four, so that the quarters are whole, with two leading digits."""
    power = 10 ** max(0, len(str(max(count, 1))) - 2)
    return 4 * power * -(-max(count, 4) // (4 * power))
