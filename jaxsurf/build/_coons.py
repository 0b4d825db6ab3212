"""Coons patches: a surface between four boundary curves."""

import itertools
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import eps, is_concrete
from .._errors import InputError
from .._registry import register
from ..convert import Conversion, to_bspline
from ..curve import AbstractCurve
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._blend import AbstractBlend, as_blend, linear
from ._boolean_sum import BlendedPair, BooleanSum, measured, meetings, spline_of_sum
from ._family import Family, check_curve, of_one_type
from ._placing import ends_of, size_of

CORNERS = {("u0", 0): ("v0", 0), ("u0", 1): ("v1", 0), ("u1", 0): ("v0", 1), ("u1", 1): ("v1", 1)}
"""Which end of a curve of u meets which end of a curve of v: 0 the first, 1 the last."""


@register
class Coons(AbstractSurface):
    """S(u, v) = (1 − φ(s)) u0(v) + φ(s) u1(v) + (1 − ψ(t)) v0(u) + ψ(t) v1(u) − the same of the corners.

    u0, u1: the sides u = first, last, curves of v; v0, v1: the sides v = first, last, curves of u. u runs over the domain of
    v0, v over that of u0, those of the opposite ones follow evenly; s and t are u and v from 0 to 1. blend_u, blend_v: φ, ψ.
    Made by `js.coons`, which checks that corners meet; where they do not quite, all sides are off by half the gap at most.
    Source: Farin, Curves and Surfaces for CAGD, §22.2.
    """

    u0: AbstractCurve
    u1: AbstractCurve
    v0: AbstractCurve
    v1: AbstractCurve
    blend_u: AbstractBlend
    blend_v: AbstractBlend

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.v0.domain, self.u0.domain

    def prepared(self) -> BooleanSum:
        """The patch with its corners computed."""
        return boolean_sum((self.u0, self.u1, self.v0, self.v1), self.blend_u, self.blend_v, self.domain, self.dtype)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)


def coons(u0: Any, u1: Any, v0: Any, v1: Any, *, blend: Any = linear, tolerance: float = 1e-6) -> Coons:
    """The Coons patch between four boundary curves, exactly met.

    u0, u1: the sides u = first and u = last, curves of v; v0, v1: the sides v = first and v = last, curves of u. blend: φ on
    [0, 1], such as `js.linear` or `js.smoothstep`, or a pair of them for u and v; with `js.smoothstep` derivatives across a
    side are those of the curves that end on it, blended. B-spline sides and such a blend convert to one B-spline exactly.
    Raises `InputError` where corners are further apart than `tolerance` times the size. Source: Coons, 1967; Farin, §22.2.
    """
    sides = {"u0": u0, "u1": u1, "v0": v0, "v1": v1}
    for name, curve in sides.items():
        check_curve(curve, name)
    sides = of_one_type(sides)
    blend_u, blend_v = blends(blend, sides["u0"].dtype)
    patch = Coons(sides["u0"], sides["u1"], sides["v0"], sides["v1"], blend_u, blend_v)
    check_corners(sides, tolerance)
    return patch


def blends(blend: Any, dtype: Any) -> tuple[AbstractBlend, AbstractBlend]:
    """One blend for both directions, or a pair (u, v)."""
    pair = blend if isinstance(blend, tuple | list) else (blend, blend)
    if len(pair) != 2:
        raise InputError(f"`blend` must be one function or a pair for u and v, got {len(pair)}.")
    in_u, in_v = (as_blend(each, dtype) for each in pair)
    return in_u, in_v


def boolean_sum(
    sides: tuple[Any, Any, Any, Any],
    blend_u: AbstractBlend,
    blend_v: AbstractBlend,
    domain: tuple[tuple[Any, Any], tuple[Any, Any]],
    dtype: Any,
) -> BooleanSum:
    """Sides u0, u1, v0, v1 as a sum of two ruled surfaces less the one through the corners."""
    in_u, in_v = domain
    along_v, along_u = Family(sides[:2], in_v).prepared(), Family(sides[2:], in_u).prepared()
    ends = [jnp.stack([jnp.asarray(end, dtype) for end in pair]) for pair in domain]
    corners, _ = meetings(along_u, along_v, *ends)
    return BooleanSum(along_u, along_v, BlendedPair(blend_u, in_u), BlendedPair(blend_v, in_v), corners, domain)


def check_corners(sides: dict[str, AbstractCurve], tolerance: float) -> None:
    """Refuse known curves that do not meet, with what mends it."""
    if not is_concrete(sides):
        return
    size = size_of(tuple(sides.values()))
    allowed = max(tolerance, 64 * eps(sides["u0"].dtype)) * size
    ends = {name: ends_of(curve) for name, curve in sides.items()}
    gaps = _gaps(ends, ())
    index = int(np.argmax(gaps))
    if gaps[index] <= allowed:
        return
    (mine, end), (other, start) = list(CORNERS.items())[index]
    words = ("first", "last")
    at = f"u = {words[mine == 'u1']}, v = {words[other == 'v1']}"
    raise InputError(
        f"At the corner {at} `{mine}` and `{other}` are {gaps[index]:.3g} apart (the {words[end]} point of `{mine}`, the "
        f"{words[start]} of `{other}`), more than the {allowed:.3g} allowed (`tolerance` × size): {_advice(ends, allowed)}."
    )


def _gaps(ends: dict[str, tuple[np.ndarray, np.ndarray]], turned: tuple[str, ...]) -> np.ndarray:
    """The distances at the four corners, with some curves turned round."""
    at = lambda name, end: ends[name][1 - end if name in turned else end]
    return np.array([np.linalg.norm(at(*mine) - at(*other)) for mine, other in CORNERS.items()])


def _advice(ends: dict[str, tuple[np.ndarray, np.ndarray]], allowed: float) -> str:
    for count in (1, 2):  # exchanged sides are the two others reversed
        for turned in itertools.combinations(ends, count):
            if _gaps(ends, turned).max() <= allowed:
                return "reverse " + " and ".join(f"`{name}`" for name in turned) + " with `js.reverse`"
    return "move the ends together"


@breaks.register(Coons)
def _(shape: Coons) -> tuple[Any, Any]:
    in_u, in_v = shape.domain
    return Family((shape.v0, shape.v1), in_u).breaks(), Family((shape.u0, shape.u1), in_v).breaks()


@to_bspline.register(Coons)
def _(shape: Coons, tol: float, *, degree: int = 3) -> Conversion:
    return exact_sum(shape, tol, degree)


def exact_sum(shape: Any, tol: float, degree: int) -> Conversion:
    """A surface that prepares to a sum of splines as one B-spline; any other by the rule for all surfaces."""
    spline = spline_of_sum(shape.prepared()) if is_concrete(shape) and tol > 0 else None
    error = None if spline is None else measured(shape, spline)
    if spline is None or error is None or not float(error) <= tol:
        return to_bspline.dispatch(AbstractSurface)(shape, tol, degree=degree)
    return Conversion(spline, error)
