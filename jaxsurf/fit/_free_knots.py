"""B-splines whose inner knots may move: ratios of knot spacings in place of the knots, so that these stay in order."""

from functools import singledispatch
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._errors import InputError
from .._registry import register
from ..convert import Conversion, to_bspline
from ..curve import AbstractCurve, BSplineCurve
from ..query._samples import sample_parameters
from ..surface import AbstractSurface, BSplineSurface, breaks

_LEAST = 0.02  # least spacing of two knots, of the mean one: below, the equations of a fit lose their meaning


@register
class SpacedKnots(eqx.Module):
    """Clamped knots by the logarithms of their spacings over the first one.

    ratios: (s − 1,) for s spans, free; end_knots: (2,); multiplicities: of the inner knots. Source: Jupp, Approximation to
    data by splines with free knots, SIAM J. Numer. Anal. 15, 1978.
    """

    ratios: Float[Array, "r"]
    end_knots: Float[Array, "2"]
    degree: int = eqx.field(static=True)
    multiplicities: tuple[int, ...] = eqx.field(static=True)

    @classmethod
    def of(cls, knots: Float[Array, "k"], degree: int, name: str) -> "SpacedKnots":
        """Those of a knot vector."""
        if not is_concrete(knots):
            raise InputError(f"`{name}` must be known, not traced: how often its knots repeat decides the shape.")
        values, times = np.unique(concrete(knots), return_counts=True)
        if times[0] != degree + 1 or times[-1] != degree + 1:
            raise InputError(f"`{name}` must repeat its ends {degree + 1} times, got {times[0]} and {times[-1]}; clamp it.")
        shares = np.diff(values) / (values[-1] - values[0])
        free = (shares - _LEAST / len(shares)) / (1 - _LEAST)
        if free.min() <= 0:
            at = int(free.argmin())
            raise InputError(
                f"`{name}` must leave {_LEAST:.0%} of the mean spacing between two knots to move them, but has "
                f"{values[at]:.6g} and {values[at + 1]:.6g}; take one of them out, or repeat it."
            )
        ratios = np.log(free[1:] / free[0])
        return cls(jnp.asarray(ratios), jnp.asarray(values[[0, -1]]), degree, tuple(int(n) for n in times[1:-1]))

    def knots(self) -> Float[Array, "k"]:
        """The knot vector."""
        free = jax.nn.softmax(jnp.append(jnp.zeros_like(self.end_knots[:1]), self.ratios))
        shares = (1 - _LEAST) * free + _LEAST / free.size
        first, last = self.end_knots
        inner = first + (last - first) * jnp.cumsum(shares)[:-1]
        inner = inner[np.repeat(np.arange(len(self.multiplicities)), self.multiplicities)]
        ends = jnp.ones(self.degree + 1, inner.dtype)
        return jnp.concatenate([first * ends, inner, last * ends])


@register
class FreeKnotCurve(AbstractCurve):
    """A clamped B-spline curve with knots that a fit may move; made by `free_knots`, and `spline()` is the curve."""

    control_points: Float[Array, "n d"]
    along: SpacedKnots

    def spline(self) -> BSplineCurve:
        """The curve on its present knots."""
        return BSplineCurve(self.control_points, self.along.knots(), self.along.degree)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.along.end_knots[0], self.along.end_knots[1]

    def prepared(self) -> BSplineCurve:
        return self.spline()

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return self.spline().point(u)


@register
class FreeKnotSurface(AbstractSurface):
    """A clamped B-spline surface with knots that a fit may move; made by `free_knots`, and `spline()` is the surface."""

    control_points: Float[Array, "n m 3"]
    along_u: SpacedKnots
    along_v: SpacedKnots

    def spline(self) -> BSplineSurface:
        """The surface on its present knots."""
        u, v = self.along_u, self.along_v
        return BSplineSurface(self.control_points, u.knots(), v.knots(), u.degree, v.degree)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        (a, b), (c, d) = self.along_u.end_knots, self.along_v.end_knots
        return (a, b), (c, d)

    def prepared(self) -> BSplineSurface:
        return self.spline()

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.spline().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.spline().grid_points(u, v)


@singledispatch
def free_knots(shape: Any) -> Any:
    """The same B-spline with knots that `js.fit` may move too: `js.fit(js.free_knots(net), points).shape.spline()`.

    Inner knots move between their neighbours, no nearer than a fiftieth of the mean spacing, and keep their multiplicities;
    ends stay. All points of a span must be seen by the cloud: no bending holds what they leave open. Knots have many local
    minima: start from knots that are about where the shape changes.
    Raises `InputError` for periodic shapes, ends that are not clamped, knots nearer than that, or none inside.
    """
    raise InputError(f"`free_knots` expects a `BSplineCurve` or a `BSplineSurface`, got {type(shape).__name__}.")


@free_knots.register
def _(shape: BSplineCurve) -> FreeKnotCurve:
    if shape.periodic:
        raise InputError("`free_knots` expects a clamped curve, got a periodic one.")
    found = FreeKnotCurve(shape.control_points, SpacedKnots.of(shape.knots, shape.degree, "knots"))
    _check_inner(found.along)
    return found


@free_knots.register
def _(shape: BSplineSurface) -> FreeKnotSurface:
    if shape.periodic_u or shape.periodic_v:
        raise InputError("`free_knots` expects a clamped surface, got a periodic one.")
    along_u, along_v = (
        SpacedKnots.of(shape.knots_u, shape.degree_u, "knots_u"),
        SpacedKnots.of(shape.knots_v, shape.degree_v, "knots_v"),
    )
    _check_inner(along_u, along_v)
    return FreeKnotSurface(shape.control_points, along_u, along_v)


def _check_inner(*ways: SpacedKnots) -> None:
    if not any(way.ratios.size for way in ways):
        raise InputError("`free_knots` needs at least one inner knot, got none; insert some.")


@breaks.register(FreeKnotCurve)
@breaks.register(FreeKnotSurface)
def _(shape: FreeKnotCurve | FreeKnotSurface) -> Any:
    return breaks(shape.spline())


@sample_parameters.register(FreeKnotCurve)
@sample_parameters.register(FreeKnotSurface)
def _(shape: FreeKnotCurve | FreeKnotSurface) -> tuple[Any, ...]:
    return sample_parameters(shape.spline())


@to_bspline.register(FreeKnotCurve)
@to_bspline.register(FreeKnotSurface)
def _(shape: FreeKnotCurve | FreeKnotSurface, tol: float, *, degree: int = 3) -> Conversion:
    return to_bspline(shape.spline(), tol, degree=degree)
