"""Other parameters for the same shape: reversed, transposed, split, on another domain."""

import functools
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import as_float, concrete, is_concrete
from .._errors import InputError
from ..curve import AbstractCurve, BSplineCurve, CompositeCurve, NURBSCurve
from ..curve._reversed import reversed_spline
from ..surface import AbstractSurface, BSplineSurface, NURBSSurface, TrimmedSurface
from ._knots import halves
from ._reparametrised import ReparametrisedCurve, ReparametrisedSurface, affine, as_pair
from ._spline_axis import SplineAxis, check_direction, directions, spline_axis, with_axis
from ._transform import transform, with_pieces


def reverse(shape: Any, direction: str | None = None) -> Any:
    """The same shape run backwards over the same domain; for surfaces `direction` is "u" or "v".

    The point at u goes to a + b - u. Reversing one direction of a surface reverses the side of the normal.
    Splines stay splines, composite curves composite; any other shape is wrapped.
    """
    check_direction(shape, direction, "reverse")
    return _reverse(shape, direction)


def split(shape: Any, at: Any, direction: str | None = None) -> tuple[Any, Any]:
    """The two parts of a shape before and after the parameter `at`, each with its own part of the domain.

    For surfaces `direction`, "u" or "v", says which parameter `at` is. Splines are split exactly by knot
    insertion; periodic ones are opened at their seam as well. With traced knots or a traced `at` the number
    of control points is not known: then, and for other shapes, the parts are wrappers that restrict the
    shape.
    Raises `InputError` if `at` is not inside the domain (on concrete data).
    """
    check_direction(shape, direction, "split")
    ends = shape.domain if direction is None else shape.domain["uv".index(direction)]
    if is_concrete(at, ends):
        first, last = (float(end) for end in ends)
        if not first < float(at) < last:
            raise InputError(f"`at` must lie inside the domain ({first:g}, {last:g}), got {float(at):g}.")
    return _split(shape, early(as_float, at, shape.dtype), direction)


def reparametrise(shape: Any, domain: Any) -> Any:
    """The same shape on another domain: (a, b) for a curve, ((a, b), (c, d)) for a surface.

    The change of parameters is affine. Splines keep their control points and get new knots; composite curves
    change piece by piece, any other shape is wrapped. Raises `InputError` if the new domain does not ascend
    (on concrete data).
    """
    along = directions(shape)
    check_direction(shape, along[0], "reparametrise")
    count = len(along)
    if _nested_shape(domain) != ((2,) if count == 1 else (2, 2)):
        wanted = "(a, b)" if count == 1 else "((a, b), (c, d))"
        raise InputError(f"`domain` must be {wanted}, got {domain}.")
    pairs = [domain] if count == 1 else domain
    intervals = [as_pair(pair, "domain", shape.dtype) for pair in pairs]
    for interval in intervals:
        if is_concrete(interval) and not concrete(interval)[0] < concrete(interval)[1]:
            raise InputError(f"`domain` must ascend, got {concrete(interval).tolist()}.")
    return _reparametrise(shape, intervals)


@functools.singledispatch
def transpose(surface: Any) -> Any:
    """The same surface with u and v exchanged; the side of the normal is reversed."""
    raise TypeError(f"transpose is not defined for {type(surface).__name__}.")


@transpose.register(AbstractSurface)
def _(surface: AbstractSurface) -> AbstractSurface:
    u, v = _intervals(surface)
    return ReparametrisedSurface(surface, v, u, v, u, transposed=True)


@transpose.register(ReparametrisedSurface)
def _(surface: ReparametrisedSurface) -> ReparametrisedSurface:
    return ReparametrisedSurface(
        surface.surface,
        surface.ends_v,
        surface.ends_u,
        surface.interval_v,
        surface.interval_u,
        transposed=not surface.transposed,
    )


@transpose.register(BSplineSurface)
def _(surface: BSplineSurface) -> BSplineSurface:
    net = jnp.swapaxes(surface.control_points, 0, 1)
    u, v = spline_axis(surface, "u"), spline_axis(surface, "v")
    return BSplineSurface(net, v.knots, u.knots, v.degree, u.degree, v.periodic, u.periodic)


@transpose.register(NURBSSurface)
def _(surface: NURBSSurface) -> NURBSSurface:
    net = jnp.swapaxes(surface.control_points, 0, 1)
    u, v = spline_axis(surface, "u"), spline_axis(surface, "v")
    return NURBSSurface(net, surface.weights.T, v.knots, u.knots, v.degree, u.degree)


@transpose.register(TrimmedSurface)
def _(surface: TrimmedSurface) -> TrimmedSurface:
    exchange = jnp.eye(2, dtype=surface.dtype)[::-1]
    return _retrimmed(surface, transpose(surface.surface), exchange, jnp.zeros(2, surface.dtype))


@functools.singledispatch
def _reverse(shape: Any, direction: str | None) -> Any:
    raise TypeError(f"reverse is not defined for {type(shape).__name__}.")


@_reverse.register(AbstractCurve)
def _(shape: AbstractCurve, direction: None) -> ReparametrisedCurve:
    (interval,) = _intervals(shape)
    return _wrapped_curve(shape, interval[::-1], interval)


@_reverse.register(AbstractSurface)
def _(shape: AbstractSurface, direction: str) -> ReparametrisedSurface:
    u, v = _intervals(shape)
    ends = (u[::-1], v) if direction == "u" else (u, v[::-1])
    return _wrapped_surface(shape, ends, (u, v))


@_reverse.register(BSplineCurve)
@_reverse.register(NURBSCurve)
@_reverse.register(BSplineSurface)
@_reverse.register(NURBSSurface)
def _(shape: Any, direction: str | None) -> Any:
    axis = spline_axis(shape, direction)
    net, knots = reversed_spline(axis.net, axis.knots, axis.degree, axis.periodic)
    return with_axis(shape, SplineAxis(net, knots, axis.degree, axis.periodic), direction)


@_reverse.register(CompositeCurve)
def _(shape: CompositeCurve, direction: None) -> CompositeCurve:
    breaks = shape.breaks[0] + shape.breaks[-1] - shape.breaks[::-1]
    pieces = (reverse(piece) for piece in reversed(shape.pieces))
    return with_pieces(shape, _on_breaks(pieces, breaks))


@_reverse.register(TrimmedSurface)
def _(shape: TrimmedSurface, direction: str) -> TrimmedSurface:
    k = "uv".index(direction)
    interval = _intervals(shape)[k]
    signs = jnp.ones(2, shape.dtype).at[k].set(-1)
    offset = jnp.zeros(2, shape.dtype).at[k].set(interval[0] + interval[1])
    return _retrimmed(shape, reverse(shape.surface, direction), jnp.diag(signs), offset)


@functools.singledispatch
def _split(shape: Any, at: Float[Array, ""], direction: str | None) -> tuple[Any, Any]:
    raise TypeError(f"split is not defined for {type(shape).__name__}.")


@_split.register(AbstractCurve)
def _split_curve(shape: AbstractCurve, at: Float[Array, ""], direction: None) -> tuple[Any, Any]:
    (interval,) = _intervals(shape)
    before, after = jnp.stack([interval[0], at]), jnp.stack([at, interval[1]])
    return _wrapped_curve(shape, before, before), _wrapped_curve(shape, after, after)


@_split.register(AbstractSurface)
def _split_surface(shape: AbstractSurface, at: Float[Array, ""], direction: str) -> tuple[Any, Any]:
    u, v = _intervals(shape)
    cut = u if direction == "u" else v
    parts = jnp.stack([cut[0], at]), jnp.stack([at, cut[1]])
    pairs = [(part, v) if direction == "u" else (u, part) for part in parts]
    before, after = (_wrapped_surface(shape, pair, pair) for pair in pairs)
    return before, after


@_split.register(BSplineCurve)
@_split.register(NURBSCurve)
@_split.register(BSplineSurface)
@_split.register(NURBSSurface)
def _(shape: Any, at: Float[Array, ""], direction: str | None) -> tuple[Any, Any]:
    axis = spline_axis(shape, direction)
    if not is_concrete(axis.knots, at):
        wrap = _split_curve if direction is None else _split_surface
        return wrap(shape, at, direction)
    before, after = halves(axis, concrete(at), "split")
    return with_axis(shape, before, direction), with_axis(shape, after, direction)


@_split.register(CompositeCurve)
def _(shape: CompositeCurve, at: Float[Array, ""], direction: None) -> tuple[Any, Any]:
    if not is_concrete(shape.breaks, at):
        return _split_curve(shape, at, direction)
    breaks = concrete(shape.breaks)
    whole = _on_breaks(shape.pieces, shape.breaks)  # each piece on its own part of the domain
    k = int(np.searchsorted(breaks, concrete(at), side="right")) - 1
    if breaks[k] == concrete(at):
        return with_pieces(shape, whole[:k]), with_pieces(shape, whole[k:])
    before, after = split(whole[k], at)
    return with_pieces(shape, (*whole[:k], before)), with_pieces(shape, (after, *whole[k + 1 :]))


@_split.register(TrimmedSurface)
def _(shape: TrimmedSurface, at: Float[Array, ""], direction: str) -> tuple[Any, Any]:
    raise InputError("`split` does not cut trimming loops: split `shape.surface`, or cut the trimmed one with `js.cut`.")


@functools.singledispatch
def _reparametrise(shape: Any, intervals: list[Array]) -> Any:
    raise TypeError(f"reparametrise is not defined for {type(shape).__name__}.")


@_reparametrise.register(AbstractCurve)
def _(shape: AbstractCurve, intervals: list[Array]) -> ReparametrisedCurve:
    return _wrapped_curve(shape, *_intervals(shape), *intervals)


@_reparametrise.register(AbstractSurface)
def _(shape: AbstractSurface, intervals: list[Array]) -> ReparametrisedSurface:
    return _wrapped_surface(shape, tuple(_intervals(shape)), tuple(intervals))


@_reparametrise.register(BSplineCurve)
@_reparametrise.register(NURBSCurve)
@_reparametrise.register(BSplineSurface)
@_reparametrise.register(NURBSSurface)
def _(shape: Any, intervals: list[Array]) -> Any:
    for direction, interval in zip(directions(shape), intervals, strict=True):
        axis = spline_axis(shape, direction)
        knots = affine(axis.knots, jnp.stack(axis.ends), interval)
        name = "knots" if direction is None else f"knots_{direction}"
        shape = eqx.tree_at(lambda s, name=name: getattr(s, name), shape, knots)
    return shape


@_reparametrise.register(CompositeCurve)
def _(shape: CompositeCurve, intervals: list[Array]) -> CompositeCurve:
    breaks = affine(shape.breaks, jnp.stack(shape.domain), intervals[0])
    return with_pieces(shape, _on_breaks(shape.pieces, breaks))


@_reparametrise.register(TrimmedSurface)
def _(shape: TrimmedSurface, intervals: list[Array]) -> TrimmedSurface:
    old = jnp.stack(_intervals(shape))
    new = jnp.stack(intervals)
    ratio = (new[:, 1] - new[:, 0]) / (old[:, 1] - old[:, 0])
    offset = new[:, 0] - ratio * old[:, 0]
    return _retrimmed(shape, _reparametrise(shape.surface, intervals), jnp.diag(ratio), offset)


def _nested_shape(values: Any) -> tuple[int, ...] | None:
    """The shape of nested pairs, of which the numbers may be traced; None if they are ragged."""
    if not isinstance(values, tuple | list):
        return np.shape(values)
    shapes = {_nested_shape(value) for value in values}
    inner = shapes.pop() if len(shapes) == 1 else None
    return None if inner is None else (len(values), *inner)


def _intervals(shape: Any) -> list[Float[Array, "2"]]:
    """The domain as one array for each direction."""
    pairs = shape.domain if isinstance(shape, AbstractSurface) else (shape.domain,)
    return [as_pair(pair, "domain", shape.dtype) for pair in pairs]


def _on_breaks(pieces: Any, breaks: Float[Array, "n"]) -> tuple[AbstractCurve, ...]:
    return tuple(_reparametrise(piece, [breaks[i : i + 2]]) for i, piece in enumerate(pieces))


def _wrapped_curve(curve: AbstractCurve, ends: Array, interval: Array) -> ReparametrisedCurve:
    """A wrapper that never holds another one."""
    if isinstance(curve, ReparametrisedCurve):
        curve, ends = curve.curve, affine(ends, curve.interval, curve.ends)
    return ReparametrisedCurve(curve, ends, interval)


def _wrapped_surface(
    surface: AbstractSurface, ends: tuple[Array, ...], intervals: tuple[Array, ...]
) -> ReparametrisedSurface:
    transposed = False
    if isinstance(surface, ReparametrisedSurface):
        inner, transposed = surface, surface.transposed
        ends = (
            affine(ends[0], inner.interval_u, inner.ends_u),
            affine(ends[1], inner.interval_v, inner.ends_v),
        )
        surface = inner.surface
    return ReparametrisedSurface(surface, *ends, *intervals, transposed=transposed)


def _retrimmed(shape: TrimmedSurface, surface: Any, matrix: Array, offset: Array) -> TrimmedSurface:
    """The surface on other parameters, with the loops mapped to them."""
    return TrimmedSurface(surface, [transform(loop, matrix, offset) for loop in shape.loops])
