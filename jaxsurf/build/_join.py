"""Splines extended and joined by pseudo-vertices, without a change of what is joined."""

import warnings
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import as_float, concrete, eps, is_concrete
from .._errors import GeometryWarning, InputError
from ..curve import AbstractCurve, BSplineCurve
from ..edit import _knots, reverse, transpose
from ..edit._blossom import derivative_row
from ..edit._spline_axis import SplineAxis, concrete_knots, spline_axis, with_axis
from ..surface import AbstractSurface, BSplineSurface
from ._edge_fields import points_on
from ._ribbons import SIDES
from ._same_knots import as_spline, product, same_knots

CURVATURES = ("match", "zero", "tangent")


def extend(curve: Any, start: Any = None, end: Any = None) -> BSplineCurve:
    """A B-spline curve with pseudo-vertices: each adds a segment at its end, and the given segments stay.

    start, end: pseudo-vertices (3,) or (k, 3), in the order of the curve's control points. If neither is given both ends get
    one, such that the second derivative vanishes there: natural ends. Knots go on in the spacing of the end segment; clamped
    ends are first written on such knots, which changes control points, not points. Source: paper 003, section 2.
    """
    spline = _spline(curve, "curve")
    axis = spline_axis(spline)
    both = start is None and end is None
    axis = _extended(axis, _vertices(end, "end", axis), both)
    turned = _turned(axis)
    first = _vertices(start, "start", axis)
    axis = _turned(_extended(turned, None if first is None else first[::-1], both))
    return with_axis(spline, axis)


def join(
    a: Any,
    b: Any,
    *,
    curvature: str = "match",
    edges: tuple[str, str] = ("u1", "u0"),
    bridge: bool = False,
    tolerance: float | None = None,
) -> Any:
    """One B-spline curve or surface of two: `a`, a part between, and `b`; both are kept.

    curvature: "tangent" makes the whole C¹: one pseudo-vertex each, A_{n+1} = B₁ + 2B₀ − 2A_n and B₋₁ = A_{n−1} + 2A_n − 2B₀
    if cubic and uniform; "match" C², for which the last vertex of `a` must be the first of `b`, A_{n+1} = B₁, B₋₁ = A_{n−1};
    "zero" also without second derivative at the seam, A_n midway between A_{n−1} and B₁. Vertices may be off by `tolerance`
    (default 10⁶ roundings of the size) and are then taken half way. bridge: where they are farther apart, segments between
    them, as smooth as the degree allows (C² if cubic). `a` keeps its knots; those of `b` are shifted to follow.
    edges: of surfaces, the sides that are joined; the seam has all knots of both; where they run opposite ways `b` is
    turned, with a warning. Differentiable in the control points. Raises `InputError` with the distance where vertices are
    too far apart. Source: paper 003, (4) to (6); other degrees and knots by blossoms.
    """
    if curvature not in CURVATURES:
        raise InputError(f"`curvature` must be one of {', '.join(CURVATURES)}, got {curvature!r}.")
    if isinstance(a, AbstractSurface) or isinstance(b, AbstractSurface):
        return _join_surfaces(a, b, curvature, edges, bridge, tolerance)
    one, other = _spline(a, "a"), _spline(b, "b")
    axis = _joined(spline_axis(one), spline_axis(other), curvature, bridge, tolerance)
    return BSplineCurve(axis.net, axis.knots, axis.degree)


def _join_surfaces(
    a: Any, b: Any, curvature: str, edges: tuple[str, str], bridge: bool, tolerance: float | None
) -> BSplineSurface:
    for name, shape, side in (("a", a, edges[0]), ("b", b, edges[1])):
        if not isinstance(shape, BSplineSurface):
            raise InputError(
                f"`{name}` must be a B-spline surface as the other, got {type(shape).__name__}; see js.to_bspline."
            )
        if side not in SIDES:
            raise InputError(f"`edges` must be two sides among {', '.join(SIDES)}, got {side!r}.")
    one, other = _edge_at(a, edges[0], last=True), _edge_at(b, edges[1], last=False)
    if is_concrete((one, other)) and _runs_back(one, other):
        warnings.warn(f"{edges[1]} of `b` runs against {edges[0]} of `a`: `b` is turned.", GeometryWarning, stacklevel=3)
        other = reverse(other, "v")
    along = same_knots([spline_axis(one, "v"), spline_axis(other, "v")])
    one, other = (with_axis(shape, axis, "v") for shape, axis in zip((one, other), along, strict=True))
    axis = _joined(spline_axis(one, "u"), spline_axis(other, "u"), curvature, bridge, tolerance)
    whole = with_axis(one, axis, "u")
    whole = reverse(whole, "u") if edges[0][1] == "0" else whole
    return transpose(whole) if edges[0][0] == "v" else whole


def _edge_at(surface: BSplineSurface, side: str, last: bool) -> BSplineSurface:
    """The surface with a side at the last or the first u."""
    surface = transpose(surface) if side[0] == "v" else surface
    return reverse(surface, "u") if (side[1] == "1") != last else surface


def _runs_back(a: BSplineSurface, b: BSplineSurface) -> bool:
    """Whether the first u of `b` runs against the last one of `a`."""
    own, other = (points_on(shape, side, np.array([0.0, 1.0])) for shape, side in ((a, "u1"), (b, "u0")))
    return bool(np.sum((own - other[::-1]) ** 2) < np.sum((own - other) ** 2))


def _spline(curve: Any, name: str) -> BSplineCurve:
    spline = as_spline(curve) if isinstance(curve, AbstractCurve) else None
    if spline is None or spline.periodic:
        what = "a periodic curve" if spline is not None else type(curve).__name__
        raise InputError(f"`{name}` must be a B-spline curve with two ends, got {what}; js.to_bspline converts curves.")
    return spline


def _vertices(given: Any, name: str, axis: SplineAxis) -> Float[Array, "k 3"] | None:
    if given is None:
        return None
    points = as_float(given, axis.net.dtype)
    points = points[None] if points.ndim == 1 else points
    if points.ndim != 2 or points.shape[1:] != axis.net.shape[1:]:
        raise InputError(f"`{name}` must be pseudo-vertices (3,) or (k, 3), got shape {points.shape}.")
    return points


def _turned(axis: SplineAxis) -> SplineAxis:
    return SplineAxis(axis.net[::-1], early(lambda knots: -knots[::-1], axis.knots), axis.degree)


def _extended(axis: SplineAxis, points: Float[Array, "k *rest"] | None, natural: bool) -> SplineAxis:
    """With further vertices at the end, or one without second derivative there."""
    if points is None and not natural:
        return axis
    known, count = _known(axis), 1 if points is None else len(points)
    body, step = known[: len(known) - axis.degree], _last_step(known, axis.degree)
    outer = known[len(known) - axis.degree :]
    if not np.all(np.diff(np.append(body[-1], outer)) > 1e-9 * step):
        outer = body[-1] + step * np.arange(1, axis.degree + 1)
    whole = np.concatenate([body, outer, outer[-1] + step * np.arange(1, count + 1)])
    net = _on(axis, known, np.concatenate([body, outer]))
    if points is None:
        row = derivative_row(whole, axis.degree, whole[-axis.degree - 1], min(2, axis.degree))
        if axis.degree == 1:  # straight on
            row = np.concatenate([np.zeros(len(net) - 2), [1.0, -2.0, 1.0]])
        points = -product(jnp.asarray(row[None, :-1] / row[-1], net.dtype), net)
    return SplineAxis(jnp.concatenate([net, points]), _as_knots(whole, axis), axis.degree)


def _joined(a: SplineAxis, b: SplineAxis, curvature: str, bridge: bool, tolerance: float | None) -> SplineAxis:
    degree = max(a.degree, b.degree, 3)
    a, b = (_knots.raised(axis, degree, "join") for axis in (a, b))
    known_a, known_b = _known(a), _known(b)
    allowed = 1e6 * eps(a.net.dtype) * _size(a.net, b.net) if tolerance is None else tolerance
    steps = _last_step(known_a, degree), _last_step(-known_b[::-1], degree)
    if bridge:
        return _bridged(a, b, known_a, known_b, steps, curvature)
    order = 1 if curvature == "tangent" else 2
    made, gap, bend = _merged(a, b, known_a, known_b, steps, degree - order, curvature)
    _refuse_gap(gap, allowed, curvature, "the last vertex of `a` to be the first of `b`")
    _refuse_gap(bend, allowed, curvature, "that vertex to be midway between its neighbours")
    return made


def _merged(
    a: SplineAxis,
    b: SplineAxis,
    known_a: np.ndarray,
    known_b: np.ndarray,
    steps: tuple[float, float],
    times: int,
    curvature: str,
) -> tuple[SplineAxis, Any, Any]:
    """One segment more each up to a seam of so many knots; distances of what should be one vertex, and off the midpoint."""
    degree = a.degree
    seam = known_a[-degree - 1] + steps[0]
    whole, net_a, net_b = _laid(a, b, known_a, known_b, np.full(times, seam), steps[1])
    shared = degree - times - 1
    middle = 0.5 * (net_a[len(net_a) - shared :] + net_b[:shared])
    made = jnp.concatenate([net_a[: len(net_a) - shared], middle, net_b[shared:]])
    bend = None
    if curvature == "zero":
        row = derivative_row(whole, degree, seam, 2) * 0.5 * steps[0] * steps[1]
        bend = product(jnp.asarray(row[None], made.dtype), made)
    return SplineAxis(made, _as_knots(whole, a), degree), net_a[len(net_a) - shared :] - net_b[:shared], bend


def _bridged(
    a: SplineAxis, b: SplineAxis, known_a: np.ndarray, known_b: np.ndarray, steps: tuple[float, float], curvature: str
) -> SplineAxis:
    """Segments between, C^(degree − 1) throughout; without second derivative amid, by one vertex more."""
    degree = a.degree
    more = 1 if curvature == "zero" else 0
    between = known_a[-degree - 1] + np.cumsum(np.linspace(*steps, degree + more))[:-1]
    whole, net_a, net_b = _laid(a, b, known_a, known_b, between, steps[1])
    parts = [net_a, net_b]
    if more:
        row = derivative_row(whole, degree, between[len(between) // 2], 2)
        at = len(net_a)
        known = product(jnp.asarray(row[None, :at], a.net.dtype), net_a) + product(
            jnp.asarray(row[None, at + 1 :], a.net.dtype), net_b
        )
        parts.insert(1, -known / row[at])
    return SplineAxis(jnp.concatenate(parts), _as_knots(whole, a), degree)


def _laid(
    a: SplineAxis, b: SplineAxis, known_a: np.ndarray, known_b: np.ndarray, between: np.ndarray, last: float
) -> tuple[np.ndarray, Array, Array]:
    """The knots of `a`, those between, and those of `b` shifted to begin `last` after these; both nets on them."""
    degree = a.degree
    body = known_a[: len(known_a) - degree]
    start = (between[-1] if len(between) else body[-1]) + last
    shift = start - known_b[degree]
    whole = np.concatenate([body, between, known_b[degree:] + shift])
    net_a = _on(a, known_a, whole[: len(known_a)])
    lead = whole[len(body) + len(between) - degree : len(body) + len(between)] - shift
    return whole, net_a, _on(b, known_b, np.concatenate([lead, known_b[degree:]]))


def _on(axis: SplineAxis, known: np.ndarray, knots: np.ndarray) -> Array:
    """The net on knots that differ outside the domain alone; vertices whose knots stay are kept bit for bit."""
    near = 1e-12 * (known[-1] - known[0])
    windows = lambda x: np.lib.stride_tricks.sliding_window_view(x[1:-1], axis.degree)
    same = np.all(np.abs(windows(known) - windows(knots)) <= near, axis=1)
    if np.all(same):
        return axis.net
    changed = _knots.on_knots(axis, _as_knots(knots, axis)).net
    return jnp.where(jnp.asarray(same).reshape(-1, *[1] * (axis.net.ndim - 1)), axis.net, changed)


def _known(axis: SplineAxis) -> np.ndarray:
    return concrete_knots(axis, "join").astype(np.float64)


def _as_knots(values: np.ndarray, axis: SplineAxis) -> Array:
    return early(lambda: jnp.asarray(values, axis.knots.dtype))


def _last_step(knots: np.ndarray, degree: int) -> float:
    """The length of the last span of the domain."""
    end = knots[len(knots) - degree - 1]
    return float(end - knots[knots < end].max())


def _size(*nets: Array) -> float:
    """The largest extent of control points; 1 for traced ones."""
    if not is_concrete(nets):
        return 1.0
    points = np.concatenate([concrete(net).reshape(-1, net.shape[-1]) for net in nets])
    return float(np.ptp(points, axis=0).max())


def _refuse_gap(gap: Any, allowed: float, curvature: str, wanted: str) -> None:
    if gap is None or not is_concrete(gap) or not gap.size:
        return
    distance = float(np.sqrt(np.sum(concrete(gap) ** 2, axis=-1)).max())
    if distance > allowed:
        raise InputError(
            f'`curvature="{curvature}"` needs {wanted}, within {allowed:.2g}, but they are {distance:.6g} apart; take '
            '`bridge=True` for more segments between, "tangent", or a larger `tolerance`.'
        )
