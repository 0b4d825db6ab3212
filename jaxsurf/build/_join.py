"""Splines extended and joined by pseudo-vertices, without a change of what is joined."""

import warnings
from dataclasses import dataclass
from functools import reduce
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import as_float, concrete, is_concrete
from .._errors import GeometryWarning, InputError
from ..convert import to_bspline
from ..curve import AbstractCurve, BSplineCurve
from ..edit import reverse, transpose
from ..edit._spline_axis import SplineAxis, concrete_knots, spline_axis, with_axis
from ..surface import AbstractSurface, BSplineSurface
from ._edge_fields import points_on
from ._join_axes import closed as closed_axis, extended, joined, turned
from ._ribbons import SIDES
from ._same_knots import as_spline, same_knots

CURVATURES = ("match", "zero", "tangent")
BRIDGES = ("shortest", "fairest")

_ACCURACY = 1e-9  # of the size: what is no B-spline is converted within this distance


def extend(curve: Any, start: Any = None, end: Any = None) -> BSplineCurve:
    """A B-spline curve with pseudo-vertices: each adds a segment at its end, and the given segments stay.

    start, end: pseudo-vertices (3,) or (k, 3), in the order of the curve's control points. If neither is given both ends get
    one, such that the second derivative vanishes there: natural ends. Knots go on in the spacing of the end segment; clamped
    ends are first written on such knots, which changes control points, not points. Source: paper 003, section 2.
    """
    spline = _spline(curve, "curve")
    axis = spline_axis(spline)
    both = start is None and end is None
    axis = extended(axis, _vertices(end, "end", axis), both)
    first = _vertices(start, "start", axis)
    axis = turned(extended(turned(axis), None if first is None else first[::-1], both))
    return with_axis(spline, axis)


def segment(curve: Any, number: int) -> BSplineCurve:
    """Segment C_i(t*) of a B-spline curve alone: its `degree + 1` control points, over t* from 0 to 1.

    number: 0 for the first span of the domain, −1 for the last; spans of length 0 do not count. Source: paper 003, (2).
    """
    spline = _spline(curve, "curve")
    knots, degree = concrete_knots(spline_axis(spline), "segment").astype(np.float64), spline.degree
    spans = [i for i in range(degree, len(knots) - degree - 1) if knots[i + 1] > knots[i]]
    if not -len(spans) <= number < len(spans):
        raise InputError(f"`number` must be a segment from 0 to {len(spans) - 1} of the {len(spans)}, got {number}.")
    at = spans[number]
    own = (knots[at - degree : at + degree + 2] - knots[at]) / (knots[at + 1] - knots[at])
    return BSplineCurve(spline.control_points[at - degree : at + 1], early(jnp.asarray, own, spline.knots.dtype), degree)


def join(
    a: Any,
    *others: Any,
    curvature: str = "match",
    edges: tuple[str, str] = ("u1", "u0"),
    bridge: bool | str = False,
    length: float | None = None,
    closed: bool = False,
    tolerance: float | None = None,
) -> Any:
    """One B-spline curve or surface of several, one after the other, with a part between each two; all are kept.

    curvature: "tangent" makes the whole C¹: one pseudo-vertex each, A_{n+1} = B₁ + 2B₀ − 2A_n and B₋₁ = A_{n−1} + 2A_n − 2B₀
    if cubic and uniform; "match" C², for which the last vertex of `a` must be the first of `b`, A_{n+1} = B₁, B₋₁ = A_{n−1};
    "zero" also without second derivative at the seam, A_n midway between A_{n−1} and B₁. Vertices may be off by `tolerance`
    (default 10⁶ roundings of the size) and are then taken half way. bridge: where they are farther apart, segments between
    them, as smooth as the degree allows (C² if cubic): "shortest", or True, with no more vertices than there are; "fairest",
    with some that make the integral of the squared third derivative least, over a bridge as long as the gap takes at the
    speed of the ends, or of a `length` in parameters, which is needed where control points are traced. closed: the last is
    joined to the first as well, and the whole periodic; `join(a, closed=True)` closes one. The first keeps its knots; those
    that follow are shifted. edges: of surfaces, the sides that are joined, of each two; seams have all knots of both; where
    they run opposite ways the later one is turned, with a warning. Shapes that are no B-splines are converted within 1e-9 of
    their size. Differentiable in control points. Raises `InputError` with the distance where vertices are too far apart.
    Source: paper 003, (4) to (6), the second (6) with + for its misprinted −; other degrees and knots by blossoms.
    """
    if curvature not in CURVATURES:
        raise InputError(f"`curvature` must be one of {', '.join(CURVATURES)}, got {curvature!r}.")
    if bridge not in (True, False, *BRIDGES):
        raise InputError(f"`bridge` must be True, False, {' or '.join(map(repr, BRIDGES))}, got {bridge!r}.")
    if length is not None and not (length > 0 and bridge == "fairest"):
        raise InputError(f'`length` must be > 0 and is for `bridge="fairest"`, got {length} and {bridge!r}.')
    if not others and not closed:
        raise InputError("`join` needs two shapes or more, or `closed=True` to close one.")
    kind = {True: "shortest", False: None}.get(bridge, bridge)  # type: ignore[call-overload]
    how = _How(curvature, kind, length, tolerance)
    shapes, names = (a, *others), ("a", "b", *(f"shape {k + 1}" for k in range(2, len(others) + 1)))
    if any(isinstance(shape, AbstractSurface) for shape in shapes):
        return _join_surfaces(shapes, names, edges, closed, how)
    axes = [spline_axis(_spline(shape, name)) for shape, name in zip(shapes, names, strict=False)]
    axis = reduce(how.joined, axes)
    axis = how.closed(axis) if closed else axis
    return BSplineCurve(axis.net, axis.knots, axis.degree, axis.periodic)


@dataclass(frozen=True)
class _How:
    """How seams are made."""

    curvature: str
    bridge: str | None
    length: float | None
    tolerance: float | None

    def joined(self, a: SplineAxis, b: SplineAxis) -> SplineAxis:
        return joined(a, b, self.curvature, self.bridge, self.tolerance, self.length)

    def closed(self, axis: SplineAxis) -> SplineAxis:
        return closed_axis(axis, self.curvature, self.bridge, self.tolerance, self.length)


def _join_surfaces(
    shapes: tuple[Any, ...], names: tuple[str, ...], edges: tuple[str, str], closed: bool, how: _How
) -> BSplineSurface:
    for side in edges:
        if side not in SIDES:
            raise InputError(f"`edges` must be two sides among {', '.join(SIDES)}, got {side!r}.")
    ready = [_spline_surface(shape, name) for shape, name in zip(shapes, names, strict=False)]
    whole = _edge_at(ready[0], edges[0], last=True)
    for surface, name in zip(ready[1:], names[1:], strict=False):
        other = _edge_at(surface, edges[1], last=False)
        whole, other = _same_way(whole, other, f"{edges[1]} of `{name}` runs against {edges[0]} of what it is joined to")
        whole = with_axis(whole, how.joined(spline_axis(whole, "u"), spline_axis(other, "u")), "u")
    if closed:
        whole = with_axis(whole, how.closed(spline_axis(whole, "u")), "u")
    if edges[0][1] == "0":
        whole = reverse(whole, "u")
    return transpose(whole) if edges[0][0] == "v" else whole


def _same_way(whole: BSplineSurface, other: BSplineSurface, sentence: str) -> tuple[BSplineSurface, BSplineSurface]:
    """Both on common knots across, the second turned if it runs against the first."""
    if _runs_back(whole, other):
        warnings.warn(f"{sentence}: it is turned.", GeometryWarning, stacklevel=4)
        other = reverse(other, "v")
    along = same_knots([spline_axis(whole, "v"), spline_axis(other, "v")])
    one, two = (with_axis(shape, axis, "v") for shape, axis in zip((whole, other), along, strict=True))
    return one, two


def _edge_at(surface: BSplineSurface, side: str, last: bool) -> BSplineSurface:
    """The surface with a side at the last or the first u."""
    surface = transpose(surface) if side[0] == "v" else surface
    return reverse(surface, "u") if (side[1] == "1") != last else surface


def _runs_back(a: BSplineSurface, b: BSplineSurface) -> bool:
    """Whether the first u of `b` runs against the last one of `a`; no, where control points are traced."""
    if not is_concrete((a, b)):
        return False
    own, other = (points_on(shape, side, np.array([0.0, 1.0])) for shape, side in ((a, "u1"), (b, "u0")))
    return bool(np.sum((own - other[::-1]) ** 2) < np.sum((own - other) ** 2))


def _spline(curve: Any, name: str) -> BSplineCurve:
    spline = as_spline(curve) if isinstance(curve, AbstractCurve) else None
    if spline is None and isinstance(curve, AbstractCurve):
        spline = to_bspline(curve, _ACCURACY * _extent(curve(jnp.linspace(*curve.domain, 33)))).shape
    if spline is None or spline.periodic:
        what = "a periodic curve" if spline is not None else type(curve).__name__
        raise InputError(f"`{name}` must be a curve with two ends, got {what}.")
    return spline


def _spline_surface(surface: Any, name: str) -> BSplineSurface:
    if not isinstance(surface, AbstractSurface):
        raise InputError(f"`{name}` must be a surface as the others, got {type(surface).__name__}.")
    if isinstance(surface, BSplineSurface):
        return surface
    u, v = (jnp.linspace(*along, 9) for along in surface.domain)
    return to_bspline(surface, _ACCURACY * _extent(surface.grid(u, v))).shape


def _extent(points: Float[Array, "*n 3"]) -> float:
    return float(np.ptp(concrete(points).reshape(-1, 3), axis=0).max())


def _vertices(given: Any, name: str, axis: SplineAxis) -> Float[Array, "k 3"] | None:
    if given is None:
        return None
    points = as_float(given, axis.net.dtype)
    points = points[None] if points.ndim == 1 else points
    if points.ndim != 2 or points.shape[1:] != axis.net.shape[1:]:
        raise InputError(f"`{name}` must be pseudo-vertices (3,) or (k, 3), got shape {points.shape}.")
    return points
