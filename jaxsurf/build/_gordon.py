"""Gordon surfaces: through a full network of curves."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import Numbers, as_float, concrete, eps, is_concrete
from .._errors import InputError
from .._registry import register
from .._safe import norm
from ..basis import BSplineBasis
from ..convert import Conversion, to_bspline
from ..curve import AbstractCurve
from ..curve._breaks import knot_breaks
from ..edit import split
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._boolean_sum import BooleanSum, meetings
from ._cardinal import cardinal_knots, cardinals
from ._coons import exact_sum
from ._crossings import common_shares, crossings
from ._family import Family, given_curves, of_one_type
from ._guides import join_breaks
from ._placing import size_of

_MOST = 3  # the degree of the cardinal functions, lower for few curves


@register
class Gordon(AbstractSurface):
    """S = Σ_j L_j(v) u_curves[j](u) + Σ_i M_i(u) v_curves[i](v) − Σ_ij M_i(u) L_j(v) P_ij: all curves of a network are met.

    u_curves: m curves of u, at v = v_parameters (m,); v_curves: n curves of v, at u = u_parameters (n,); the first and the
    last of the parameters are the domain. Curves share the domain of the first of their family, evenly. L and M: cardinal
    functions of cubic spline interpolation, of lower degree for 2 or 3 curves. P_ij: the points amid two curves where they
    should cross; each is met to about half the largest `gap`. Made by `js.gordon`, which checks that.
    Source: Gordon, Spline-blended surface interpolation through curve networks, 1969; The NURBS Book, §10.5.
    """

    u_curves: tuple[AbstractCurve, ...]
    v_curves: tuple[AbstractCurve, ...]
    u_parameters: Float[Array, "n"]
    v_parameters: Float[Array, "m"]

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        u, v = self.u_parameters, self.v_parameters
        return early(lambda u, v: ((u[0], u[-1]), (v[0], v[-1])), u, v)

    @property
    def gap(self) -> Float[Array, ""]:
        """The largest distance between two curves where they should cross."""
        return jnp.max(self.gaps)

    @property
    def gaps(self) -> Float[Array, "n m"]:
        """The distance between v_curves[i] and u_curves[j] where they should cross."""
        return _distances(self)

    def prepared(self) -> BooleanSum:
        """The surface with its curves prepared, and its crossings and cardinal functions computed."""
        along_u, along_v = (family.prepared() for family in self._families())
        points, _ = meetings(along_u, along_v, self.u_parameters, self.v_parameters)
        across_u, across_v = (cardinals(places, _degree(places)) for places in (self.u_parameters, self.v_parameters))
        return BooleanSum(along_u, along_v, across_u, across_v, points, self.domain)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)

    def _families(self) -> tuple[Family, Family]:
        return Family(self.u_curves, self.u_curves[0].domain), Family(self.v_curves, self.v_curves[0].domain)


def gordon(
    u_curves: Any,
    v_curves: Any,
    u_parameters: Numbers | None = None,
    v_parameters: Numbers | None = None,
    *,
    tolerance: float = 1e-6,
) -> Gordon:
    """The Gordon surface through a full network: every one of 2 or more curves of u meets every one of 2 or more of v.

    u_parameters: (n,), ascending, the u of each of `v_curves`, in the domain of u_curves[0]; v_parameters: (m,), the v of
    each of `u_curves`, in that of v_curves[0]; the other curves follow evenly. The surface ends with the outer curves. Where
    none are given, crossings are found where curves are nearest, and each curve is cut and stretched evenly from its first
    crossing to its last; this asks for crossings at equal shares of the way along all curves of a family, within 1e-6 (or
    `tolerance`, if that is more), and cannot be done under tracing.
    Curves may miss each other by `tolerance` times the size; see `.gap` of the result. Raises `InputError` with the pair and
    the distance, or with the pair and both shares. Source: Gordon, 1969; The NURBS Book, §10.5.
    """
    along_u, along_v = of_one_type((given_curves(u_curves, "u_curves", 2), given_curves(v_curves, "v_curves", 2)))
    if (u_parameters is None) != (v_parameters is None):
        raise InputError("Give both `u_parameters` and `v_parameters`, or none of them: then crossings are looked for.")
    size = size_of((*along_u, *along_v)) if is_concrete(along_u, along_v) else 1.0
    allowed = max(tolerance, 64 * eps(along_u[0].dtype))
    if u_parameters is None or v_parameters is None:
        surface = _found(along_u, along_v, allowed, size)
    else:
        surface = _given(along_u, along_v, u_parameters, v_parameters)
    if is_concrete(surface):
        _check_gaps(concrete(early(_distances, surface)), allowed * size)
    return surface


def _given(u_curves: Any, v_curves: Any, u_parameters: Numbers, v_parameters: Numbers) -> Gordon:
    dtype = u_curves[0].dtype
    places = []
    for name, values, family, others in (
        ("u_parameters", u_parameters, u_curves, v_curves),
        ("v_parameters", v_parameters, v_curves, u_curves),
    ):
        given = early(lambda values=values: as_float(values, dtype)) if is_concrete(values) else as_float(values, dtype)
        other = "v_curves" if name == "u_parameters" else "u_curves"
        if given.shape != (len(others),):
            raise InputError(f"`{name}` must have shape ({len(others)},), one for each of `{other}`, got {given.shape}.")
        if is_concrete(given) and not np.all(np.diff(concrete(given)) > 0):
            raise InputError(f"`{name}` must ascend, got {concrete(given).tolist()}.")
        if is_concrete(given, family[0].domain):
            (a, b), inside = (float(end) for end in family[0].domain), concrete(given)
            if inside[0] < a - 1e-9 * (b - a) or inside[-1] > b + 1e-9 * (b - a):
                raise InputError(
                    f"`{name}` must lie in the domain [{a:g}, {b:g}] of the first curve, got {inside.tolist()}."
                )
        places.append(given)
    return Gordon(u_curves, v_curves, *places)


def _found(u_curves: Any, v_curves: Any, allowed: float, size: float) -> Gordon:
    """The network with crossings looked for."""
    if not is_concrete(u_curves, v_curves):
        raise InputError(
            "Crossings cannot be looked for on traced curves: call `js.gordon` outside of the transformation first, and "
            "give `u_parameters` and `v_parameters` of its result."
        )
    found = crossings(u_curves, v_curves)
    _check_gaps(found.gap, allowed * size)
    near, dtype = max(1e-6, allowed), u_curves[0].dtype
    families, places = [], []
    for curves, shares, names in (
        (u_curves, found.u, ("u_curves", "v_curves")),
        (v_curves, found.v.T, ("v_curves", "u_curves")),
    ):
        shares = np.where(shares < near, 0, np.where(shares > 1 - near, 1, shares))
        even = common_shares(shares, names, near)
        cut = [_cut(curve, column[[0, -1]]) for curve, column in zip(curves, shares.T, strict=True)]
        a, b = (float(end) for end in cut[0].domain)
        places.append(early(lambda a=a, b=b, even=even: jnp.asarray((1 - even) * a + even * b, dtype)))
        families.append(tuple(cut))
    return Gordon(*families, *places)


def _cut(curve: Any, ends: Float[np.ndarray, "2"]) -> Any:
    """The part of a known curve between two shares of its domain; as it is if these are its ends."""
    a, b = (float(end) for end in curve.domain)
    for share, part in zip(ends, (1, 0), strict=True):
        if 0 < share < 1:
            curve = split(curve, (1 - share) * a + share * b)[part]
    return curve


def _check_gaps(gaps: Float[np.ndarray, "n m"], allowed: float) -> None:
    i, j = np.unravel_index(np.argmax(gaps), gaps.shape)
    if not gaps[i, j] <= allowed:
        raise InputError(
            f"`u_curves[{j}]` and `v_curves[{i}]` are {gaps[i, j]:.3g} apart where they should cross; at most {allowed:.3g} "
            "(`tolerance` × size) is allowed: make them meet, or give a larger `tolerance`."
        )


@eqx.filter_jit
def _distances(surface: Gordon) -> Float[Array, "n m"]:
    along_u, along_v = (family.prepared() for family in surface._families())
    _, off = meetings(along_u, along_v, surface.u_parameters, surface.v_parameters)
    return norm(off)


@breaks.register(Gordon)
def _(shape: Gordon) -> tuple[Any, Any]:
    pairs = zip(shape._families(), (shape.u_parameters, shape.v_parameters), strict=True)
    along_u, along_v = (_within(join_breaks(family.breaks(), _knots(places)), places) for family, places in pairs)
    return along_u, along_v


def _knots(places: Float[Array, "k"]) -> Any:
    degree = _degree(places)
    return knot_breaks(BSplineBasis(early(cardinal_knots, places, degree, False), degree))


def _degree(places: Float[Array, "k"]) -> int:
    return min(_MOST, places.shape[0] - 1)


def _within(found: Any, places: Float[Array, "k"]) -> Any:
    """Breaks inside the domain: curves may run on beyond it."""
    if not is_concrete(found, places):
        return jnp.sort(jnp.clip(jnp.asarray(found), places[0], places[-1]))
    a, b = concrete(places)[[0, -1]]
    inner = found[(found > a) & (found < b)]
    return np.concatenate([[a], inner, [b]]).astype(places.dtype)


@to_bspline.register(Gordon)
def _(shape: Gordon, tol: float, *, degree: int = 3) -> Conversion:
    return exact_sum(shape, tol, degree)
