"""Creases repaired: both parts bent to one field of planes along each crease, and converted so that they keep it."""

import warnings
from itertools import pairwise
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, eps, is_concrete
from .._errors import GeometryWarning, InputError
from .._registry import register
from ..convert import Conversion, to_bspline
from ..convert._adaptive import amid, interpolation, sites
from ..curve import BSplineCurve
from ..differential import normal, partials
from ..surface import AbstractSurface, BSplineSurface
from ..surface._breaks import breaks
from ._creases import split_at_creases
from ._edge_fields import AbstractEdgeField
from ._network import Network
from ._ribbons import SIDES
from ._tangent_surface import TangentSurface

_PARTS = 32  # steps in each span along a crease, as many as creases are looked for at
_FOLD = 150.0  # degrees between normals beyond which their mean is no plane that both parts could touch
_ALONG = 2e-7  # radians by which a converted part may leave its planes: half of them and less is left for 1e-6 over a seam
_ROUNDS = 5
_BLOCK = 256  # places on a side differentiated together, so that a part is compiled once


def smooth_creases(
    surface: AbstractSurface | Network, angle: float = 1e-3, *, direction: str = "v"
) -> tuple[AbstractSurface, ...]:
    """The parts of a surface between its creases, bent so that they are tangent to each other along every one of them.

    The surface is split where its normal jumps by more than `angle`, radians, across rows v = constant (`direction` "u":
    u = constant); there both parts are bent by operator H to one field of planes, normal to the mean of both unit normals
    as a quintic spline. They meet with equal tangent planes to rounding, and the creases themselves stay as curves. H acts
    across the creases alone and fades towards the other end of each part. So the rims that a crease runs into stay where
    they are if both parts have one tangent plane there, as on two guides, C¹ and met; where a rim has a kink itself, as on
    the free end of a sweep along one guide, it is rounded with the rest. Curvature still jumps, and the tangent planes along
    the rims turn a little.

    Each part has its own part of the domain; a surface without creases comes back alone, as it is. Of a network: the parts
    of all its patches, each repaired by itself. `js.to_bspline` converts a part so that it keeps its planes within 2e-7 rad.
    Needs known data; the planes are then data of the parts, which are differentiable. Raises `InputError` for creases of
    more than 150°, where the surface folds back. Source: Jōnishi, Yajima (paper 000), sections 3 to 5, figures 5, 6 and 11.
    """
    if isinstance(surface, Network):
        return tuple(part for patch in surface.patches for part in smooth_creases(patch, angle, direction=direction))
    parts = split_at_creases(surface, angle, direction=direction)
    if len(parts) == 1:
        return parts
    axis = "uv".index(direction)
    fields = [_common_field(before, after, axis) for before, after in pairwise(parts)]
    fields = [fields[0].released(), *fields, fields[-1].released()]
    free = (None, None)
    return tuple(
        TangentSurface(part, (*ends, *free) if axis == 0 else (*free, *ends), "hermite")
        for part, ends in zip(parts, pairwise(fields), strict=True)
    )


@register
class CreaseField(AbstractEdgeField):
    """Normals along a crease, a curve over its share 0 to 1; held: 1, or 0 on the other ends of the first and last part.

    So all parts have one structure, and what is done with them compiles once.
    """

    curve: BSplineCurve
    held: Float[Array, ""]

    @property
    def weight(self) -> Float[Array, ""]:
        return self.held

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        return self.curve.point(share)

    def released(self) -> "CreaseField":
        """The same normals on a side that is left as it is."""
        return CreaseField(self.curve, jnp.zeros_like(self.held))


def _common_field(before: AbstractSurface, after: AbstractSurface, axis: int) -> CreaseField:
    """The mean of the unit normals of both parts along their crease; exactly theirs at ends where they agree."""
    edges = concrete(breaks(before)[1 - axis])
    share = np.linspace(0, 1, _PARTS + 1)
    places = np.append(np.concatenate([(1 - share[:-1]) * a + share[:-1] * b for a, b in pairwise(edges)]), edges[-1])
    at = [_on_side(part, axis, end, places) for part, end in ((before, 1), (after, 0))]
    own = [np.asarray(normal(part, *where), np.float64) for part, where in zip((before, after), at, strict=True)]
    turns = np.degrees(_angles(*own))
    if turns.max() > _FOLD:
        worst = int(np.argmax(turns))
        raise InputError(
            f"`surface` folds back by {turns[worst]:.0f}° at {'uv'[axis]} = {float(before.domain[axis][1]):.6g}, "
            f"{'vu'[axis]} = {places[worst]:.6g}, and creases of more than {_FOLD:.0f}° have no plane that both sides could "
            'touch; sweep it with `rotation="chord"`, "minimal" or "fixed", or take the parts of `js.split_at_creases`.'
        )
    mean = own[0] + own[1]
    mean = mean / np.sqrt(np.sum(mean**2, axis=-1, keepdims=True))
    shares = (places - places[0]) / (places[-1] - places[0])
    return CreaseField(_through(mean, shares, before.dtype, ring=_is_ring(before, at[0], own)), jnp.ones((), before.dtype))


def _through(normals: Float[np.ndarray, "n 3"], shares: Float[np.ndarray, "n"], dtype: Any, *, ring: bool) -> BSplineCurve:
    """The quintic through normals; exact at both ends, or periodic."""
    from scipy.interpolate import make_interp_spline  # half a second, only when it is needed

    ends = normals[[0, 0]] if ring else normals[[0, -1]]
    normals = np.concatenate([ends[:1], normals[1:-1], ends[1:]])
    spline = make_interp_spline(shares, normals, 5, bc_type="periodic" if ring else None)
    control = spline.c if ring else np.concatenate([ends[:1], spline.c[1:-1], ends[1:]])
    return BSplineCurve(jnp.asarray(control, dtype), jnp.asarray(spline.t, dtype), 5)


def _on_side(
    surface: AbstractSurface, axis: int, end: int, places: Float[np.ndarray, "n"]
) -> tuple[Float[Array, "n"], Float[Array, "n"]]:
    """Parameters (u, v) of places along a side."""
    along = jnp.asarray(places, surface.dtype)
    there = jnp.full_like(along, surface.domain[axis][end])
    return (there, along) if axis == 0 else (along, there)


def _is_ring(part: AbstractSurface, at: tuple[Array, Array], own: list[Float[np.ndarray, "n 3"]]) -> bool:
    """Whether a crease closes smoothly, so that the planes must do so too."""
    close = 1e3 * eps(part.dtype)
    if not all(float(_angles(normals[-1], normals[0])) <= close for normals in own):
        return False
    points = concrete(part(*(x[np.array([0, len(x) // 2, -1])] for x in at)))
    gap, across = (np.sqrt(np.sum((points[k] - points[0]) ** 2)) for k in (-1, 1))
    return bool(gap <= close * across)


@to_bspline.register(TangentSurface)
def _(shape: TangentSurface, tol: float, *, degree: int = 3) -> Conversion:
    """Converted as any surface; bent by H across one direction, it also keeps its tangent planes on these sides.

    A spline within a tolerance has slopes that are off by its power degree / (degree + 1): 3e-5 rad for 1e-6. So the row of
    control points next to a bent side is set to the shape's own slopes there, whose interpolation is one order better,
    and the tolerance falls until the normals along the side are right.
    """
    convert = to_bspline.dispatch(AbstractSurface)
    bent = [side for side, field in enumerate(shape.fields) if field is not None and not _is_released(field)]
    if shape.operator != "hermite" or len({side // 2 for side in bent}) != 1:
        return convert(shape, tol, degree=degree)
    allowed = max(_ALONG, 1e3 * eps(shape.dtype))
    aim, best, nearest = tol / 2, None, np.inf
    for _ in range(_ROUNDS):
        try:
            found = convert(shape, aim, degree=degree)
        except InputError:
            break
        spline, moved = found.shape, 0.0
        for side in bent:
            spline, step = _with_own_slopes(shape, spline, *divmod(side, 2))
            moved = max(moved, step)
        off = max(_angle_along(shape, spline, *divmod(side, 2)) for side in bent)
        error = float(found.max_error) + moved
        if error <= tol and off < nearest:
            best, nearest = Conversion(spline, jnp.asarray(error, shape.dtype)), off
            if off <= allowed:
                return best
        aim *= float(np.clip(0.6 * allowed / off, 1e-3, 0.5))
    if best is None:
        return convert(shape, tol, degree=degree)
    warnings.warn(
        f"A B-spline keeps the planes along {', '.join(SIDES[side] for side in bent)} within {nearest:.2g} rad only, "
        f"and {allowed:.2g} were wanted; take a higher `degree`.",
        GeometryWarning,
        stacklevel=3,
    )
    return best


def _angles(a: Float[np.ndarray, "*n 3"], b: Float[np.ndarray, "*n 3"]) -> Any:
    """Angles between vectors of any length > 0, radians, (*n,)."""
    return np.arctan2(np.sqrt(np.sum(np.cross(a, b) ** 2, axis=-1)), np.sum(a * b, axis=-1))


def _is_released(field: AbstractEdgeField) -> bool:
    return field.weight is not None and is_concrete(field.weight) and not concrete(field.weight).any()


def _with_own_slopes(shape: AbstractSurface, spline: BSplineSurface, axis: int, end: int) -> tuple[BSplineSurface, float]:
    """A spline with the derivative across a side that the shape has at the sites along it, and how far its points moved."""
    side = _Side(spline, axis, end)
    places = sites(side.along, side.degrees[1])
    across = _derivatives(shape, axis, end, places)[axis]
    row = side.rows[0] + side.reach * interpolation(side.along, side.degrees[1], across)
    moved = float(np.sqrt(np.sum((row - side.rows[1]) ** 2, axis=-1)).max())
    index = (side.second,) if axis == 0 else (slice(None), side.second)
    net = spline.control_points.at[index].set(jnp.asarray(row, spline.dtype))
    return eqx.tree_at(lambda s: s.control_points, spline, net), moved


def _angle_along(shape: AbstractSurface, spline: BSplineSurface, axis: int, end: int) -> float:
    """The largest angle between the tangent planes of a shape and its spline along a side, at four places in each span."""
    from scipy.interpolate import BSpline

    side = _Side(spline, axis, end)
    knots = np.unique(side.along)
    places = np.concatenate([knots, amid(knots, 4)])
    along = BSpline(side.along, side.rows[0], side.degrees[1]).derivative()(places)
    across = BSpline(side.along, (side.rows[1] - side.rows[0]) / side.reach, side.degrees[1])(places)
    theirs = np.cross(across, along) if axis == 0 else np.cross(along, across)
    return float(_angles(np.cross(*_derivatives(shape, axis, end, places)), theirs).max())


class _Side:
    """A clamped spline at a side: control points along it and those next to it, knots along, degrees (across, along).

    reach: the derivative across is the difference of both rows by it. second: index across of the latter.
    """

    def __init__(self, spline: BSplineSurface, axis: int, end: int):
        net = np.moveaxis(np.asarray(spline.control_points, np.float64), axis, 0)
        knots = [np.asarray(x, np.float64) for x in (spline.knots_u, spline.knots_v)]
        degrees = (spline.degree_u, spline.degree_v)
        self.degrees, self.along = degrees[:: 1 - 2 * axis], knots[1 - axis]
        inner = np.unique(knots[axis])
        first, self.second = (0, 1) if end == 0 else (-1, -2)
        self.rows = net[first], net[self.second]
        self.reach = (inner[self.second] - inner[first]) / degrees[axis]


def _derivatives(
    shape: AbstractSurface, axis: int, end: int, places: Float[np.ndarray, "n"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """S_u and S_v of a shape on a side, in double precision, block by block."""
    found = []
    with jax.ensure_compile_time_eval():
        for start in range(0, len(places), _BLOCK):
            block = places[start : start + _BLOCK]
            filled = np.append(block, np.full(_BLOCK - len(block), block[-1]))
            there = partials(shape, *_on_side(shape, axis, end, filled))
            found.append([np.asarray(x, np.float64)[: len(block)] for x in (there.u, there.v)])
    first, second = zip(*found, strict=True)
    return np.concatenate(first), np.concatenate(second)
