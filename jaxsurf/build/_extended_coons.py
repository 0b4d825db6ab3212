"""Extended Coons patches: sides may be points, or left out."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._arguments import as_type, as_vector, early
from .._errors import InputError
from .._registry import register
from ..convert import Conversion, to_bspline
from ..curve import AbstractCurve, Line
from ..edit import transform
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._blend import AbstractBlend, smoothstep
from ._boolean_sum import BooleanSum
from ._coons import Coons, blends, boolean_sum, check_corners, exact_sum
from ._family import Family, check_curve, of_one_type

_OPPOSITE = {"u0": "u1", "u1": "u0", "v0": "v1", "v1": "v0"}


@register
class ExtendedCoons(AbstractSurface):
    """A Coons patch (see `Coons`) of which sides may be points (3,), or None and then follow from the others.

    Made by `js.extended_coons`. Only what was given is control data: sides left out move with the others.
    """

    u0: Any
    u1: Any
    v0: Any
    v1: Any
    blend_u: AbstractBlend
    blend_v: AbstractBlend

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return _domain(self.v0, self.v1), _domain(self.u0, self.u1)

    def completed(self) -> Coons:
        """The patch with a curve on every side."""
        sides = completed({name: getattr(self, name) for name in _OPPOSITE})
        return Coons(sides["u0"], sides["u1"], sides["v0"], sides["v1"], self.blend_u, self.blend_v)

    def prepared(self) -> BooleanSum:
        """The patch with its sides and corners computed."""
        whole = self.completed()
        sides = (whole.u0, whole.u1, whole.v0, whole.v1)
        return boolean_sum(sides, self.blend_u, self.blend_v, self.domain, self.dtype)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)


def extended_coons(
    u0: Any = None, u1: Any = None, v0: Any = None, v1: Any = None, *, blend: Any = smoothstep, tolerance: float = 1e-6
) -> ExtendedCoons:
    """A Coons patch on the sides that there are: four, three, or two of them; for comparison with `js.sweep`.

    u0, u1: the sides u = first and u = last, curves of v; v0, v1: the sides v = first and v = last, curves of u. A side is a
    curve, a point (3,) to which the patch shrinks (triangles), or None. One left out between two others is the straight line
    between their ends; two neighbours left out are the given ones moved in parallel, which gives the translation surface
    (Coons' sweep). At least two sides must be curves. u runs over the domain of v0, of v1 where v0 is no curve, or [0, 1].
    blend: φ on [0, 1], or a pair for u and v. Values and gradients are finite at degenerate sides; there the normal is not
    defined. Raises `InputError` where corners are further apart than `tolerance` times the size.
    Source: Jōnishi, Yajima (paper 000), section 6 and its reference 4; Coons, 1967.
    """
    given = {"u0": u0, "u1": u1, "v0": v0, "v1": v1}
    curves = [side for side in given.values() if isinstance(side, AbstractCurve)]
    if len(curves) < 2:
        raise InputError(f"At least two of `u0`, `u1`, `v0`, `v1` must be curves, got {len(curves)}; give further sides.")
    dtype = of_one_type(curves)[0].dtype
    sides = {name: _side(side, name, dtype) for name, side in given.items()}
    blend_u, blend_v = blends(blend, dtype)
    patch = ExtendedCoons(sides["u0"], sides["u1"], sides["v0"], sides["v1"], blend_u, blend_v)
    check_corners(early(eqx.filter_jit(completed), sides), tolerance)
    return patch


def completed(sides: dict[str, Any]) -> dict[str, AbstractCurve]:
    """All four sides as curves."""
    out: dict[str, Any] = {name: Line(side, side) if eqx.is_array(side) else side for name, side in sides.items()}
    missing = [name for name, side in sides.items() if side is None]
    ends = {name: _ends(side) for name, side in out.items() if side is not None}
    neighbours = len(missing) == 2 and missing[0][0] != missing[1][0]
    for name in missing:
        across = "v" if name[0] == "u" else "u"
        if neighbours:
            opposite, (way,) = _OPPOSITE[name], (ends[side] for side in ends if side[0] == across)
            step = way[1] - way[0]
            out[name] = transform(out[opposite], jnp.eye(3, dtype=step.dtype), step if name[1] == "1" else -step)
        else:
            end = int(name[1])
            out[name] = Line(ends[across + "0"][end], ends[across + "1"][end])
    return out


def _ends(curve: AbstractCurve) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    first, last = (curve.point(jnp.asarray(end, curve.dtype)) for end in curve.domain)
    return first, last


def _domain(side: Any, opposite: Any) -> tuple[Any, Any]:
    return next((each.domain for each in (side, opposite) if isinstance(each, AbstractCurve)), (0.0, 1.0))


def _side(side: Any, name: str, dtype: Any) -> Any:
    if side is None:
        return None
    if isinstance(side, AbstractCurve):
        check_curve(side, name)
        return as_type(side, dtype)
    try:
        return as_vector(side, name, dtype)
    except (TypeError, ValueError) as error:
        raise InputError(f"`{name}` must be a curve, a point (3,) or None, got {side!r:.60}.") from error


@breaks.register(ExtendedCoons)
def _(shape: ExtendedCoons) -> tuple[Any, Any]:
    whole, (in_u, in_v) = shape.completed(), shape.domain
    return Family((whole.v0, whole.v1), in_u).breaks(), Family((whole.u0, whole.u1), in_v).breaks()


@to_bspline.register(ExtendedCoons)
def _(shape: ExtendedCoons, tol: float, *, degree: int = 3) -> Conversion:
    return exact_sum(shape, tol, degree)
