"""Lofts: surfaces through sections."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._array import Numbers, is_concrete
from .._errors import InputError
from .._registry import register
from ..convert import Conversion, to_bspline
from ..convert._parameters import spaced_parameters
from ..curve import AbstractCurve
from ..surface import AbstractSurface, BSplineSurface
from ..surface._breaks import breaks
from ._boolean_sum import measured
from ._cardinal import Cardinals, cardinal_knots, cardinals
from ._family import Family, given_curves, of_one_type
from ._guides import carried
from ._same_knots import as_axes, product, same_knots
from ._sections import aligned

_ROWS = 17  # places along the sections of whose chords the mean is taken


@register
class Loft(AbstractSurface):
    """S(u, v) = Σ_k L_k(v) curves[k](u), L_k the cardinal functions of spline interpolation: S(u, v_k) = curves[k](u).

    u runs over the domain of curves[0], those of the others follow evenly. parameters: (k,), the v_k, ascending; closed,
    (k + 1,), the last for the return to curves[0]. Made by `js.loft`. Source: The NURBS Book, §10.3.
    """

    curves: tuple[AbstractCurve, ...]
    parameters: Float[Array, "k"]
    degree: int = eqx.field(static=True)
    closed: bool = eqx.field(static=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.curves[0].domain, (self.parameters[0], self.parameters[-1])

    def prepared(self) -> "PreparedLoft":
        """The loft with its sections prepared and its cardinal functions computed."""
        family = Family(self.curves, self.curves[0].domain).prepared()
        return PreparedLoft(family, cardinals(self.parameters, self.degree, self.closed), self.domain)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)


class PreparedLoft(AbstractSurface):
    """A `Loft` with its sections prepared and its cardinal functions computed."""

    sections: Family
    weights: Cardinals
    bounds: tuple[tuple[Any, Any], tuple[Any, Any]]

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.bounds

    def prepared(self) -> "PreparedLoft":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return product(self.weights(v), self.sections.points(u))

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        rows, weights = self.sections.rows(u), jax.vmap(self.weights)(v)
        return jnp.einsum("bk,akd->abd", weights, rows, precision="highest")


def loft(
    curves: Any,
    parameters: str | Numbers | None = None,
    degree: int = 3,
    closed: bool = False,
    *,
    align: bool = True,
) -> Any:
    """The surface through sections: S(u, v_k) = curves[k](u), for 2 or more curves of any kinds, knots and degrees.

    parameters: the v_k, (k,), ascending; or a spacing "chord" (default: mean over the sections' chords), "centripetal",
    "uniform" on [0, 1]. closed: the loft returns to curves[0] and is periodic, C^(degree−1); then 3 or more sections, k + 1
    numbers and an odd degree. degree: in v, lowered to k − 1 for fewer sections. u runs over the domain of curves[0].
    align: sections that run against the one before are turned round (open ones by their ends, closed ones by their areas);
    False only warns. Closed sections that start elsewhere on their way round are warned of. B-splines on known knots (lines
    too) give one `BSplineSurface` on their common knots, all else a `Loft`: the same surface.
    Raises `InputError` for too few or equal sections and parameters that do not fit. Source: The NURBS Book, §10.3.
    """
    sections = of_one_type(given_curves(curves, "curves", 3 if closed else 2))
    if int(degree) != degree or degree < 1 or (closed and degree % 2 == 0):
        kind = "an odd whole number ≥ 1 for a closed loft" if closed else "a whole number ≥ 1"
        raise InputError(f"`degree` must be {kind}, got {degree!r}.")
    if is_concrete(sections):
        sections = aligned(sections, turn=align, closed=closed)
    degree = int(degree) if closed else min(int(degree), len(sections) - 1)
    family = Family(sections, sections[0].domain)
    places = _parameters(family, "chord" if parameters is None else parameters, closed)
    return _splines(sections, places, degree, closed) or Loft(sections, places, degree, closed)


def _parameters(family: Family, parameters: str | Numbers, closed: bool) -> Float[Array, "k"]:
    dtype = family.curves[0].dtype
    points = jnp.zeros((len(family.curves), 1, 3), dtype)
    if isinstance(parameters, str):
        points = _rows(family)
    return spaced_parameters(points, parameters, closed)


@eqx.filter_jit
def _rows(family: Family) -> Float[Array, "k n 3"]:
    """Places on all sections."""
    dtype = family.curves[0].dtype
    share = jnp.linspace(0, 1, _ROWS, dtype=dtype)
    unit = (jnp.zeros((), dtype), jnp.ones((), dtype))
    return jnp.swapaxes(family.prepared().rows(carried(share, unit, family.domain)), 0, 1)


def _splines(sections: tuple[Any, ...], places: Float[Array, "k"], degree: int, closed: bool) -> BSplineSurface | None:
    """The loft of splines as one spline: their control points on common knots, interpolated."""
    axes = as_axes(sections)
    if axes is None:
        return None
    axes = same_knots(axes)
    first, across = axes[0], cardinals(places, degree, closed)
    net = product(across.matrix, jnp.stack([axis.net for axis in axes]))
    net, knots = jnp.swapaxes(net, 0, 1), across.knots
    return BSplineSurface(net, first.knots, knots, first.degree, degree, first.periodic, closed)


@breaks.register(Loft)
def _(shape: Loft) -> tuple[Any, Any]:
    return Family(shape.curves, shape.domain[0]).breaks(), _knots(shape).breaks()


def _knots(shape: Loft) -> Cardinals:
    """The cardinal functions as far as their knots go."""
    count = shape.parameters.shape[0] - shape.closed
    knots = cardinal_knots(shape.parameters, shape.degree, shape.closed)
    return Cardinals(jnp.zeros((count, count), shape.dtype), knots, shape.degree, shape.closed)


@to_bspline.register(Loft)
def _(shape: Loft, tol: float, *, degree: int = 3) -> Conversion:
    """Exact for splines."""
    if is_concrete(shape) and (spline := _splines(shape.curves, shape.parameters, shape.degree, shape.closed)) is not None:
        return Conversion(spline, measured(shape, spline))
    return to_bspline.dispatch(AbstractSurface)(shape, tol, degree=degree)
