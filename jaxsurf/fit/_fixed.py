"""What a fit keeps: functions of the shape whose values are to vanish, and do at the end to rounding."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import _safe
from .._array import Numbers, as_float, concrete
from .._errors import InputError
from ..audit._sides import SIDES
from ..basis import BSplineBasis
from ..curve import AbstractCurve, BSplineCurve, NURBSCurve
from ..query import value_and_tangents
from ..surface import BSplineSurface, NURBSSurface

_SAMPLES = 24  # places on an edge that has no knots


class AbstractCondition(eqx.Module):
    """Rows, without unit, that vanish where a shape keeps the condition."""

    @abstractmethod
    def __call__(self, shape: Any) -> Float[Array, "..."]:
        """The rows."""

    def bound(self, shape: Any) -> "AbstractCondition":
        """The condition with what it takes from the shape that a fit starts from."""
        return self

    def complaint(self, start: Any, shape: Any) -> str | None:
        """What is wrong with a shape that keeps the condition, if anything is."""
        del start, shape
        return None


def _length(shape: Any) -> Float[Array, ""]:
    """What lengths are measured by."""
    (_, places) = _net(shape)
    return jax.lax.stop_gradient(jnp.max(jnp.max(places, axis=0) - jnp.min(places, axis=0)))


def _net(shape: Any) -> tuple[Float[Array, "n k"], Float[Array, "n d"]]:
    """Parameters, as many as determine a spline, and the places there."""
    if isinstance(shape, AbstractCurve):
        t = _resolving(shape, 0)
        return t[:, None], shape(t)
    u, v = _resolving(shape, 0), _resolving(shape, 1)
    pairs = jnp.stack(jnp.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
    return pairs, shape.grid_points(u, v).reshape(-1, 3)


def _resolving(shape: Any, axis: int) -> Float[Array, "n"]:
    """Parameters along an axis that determine a spline: knot averages; evenly spaced ones of other shapes."""
    if isinstance(shape, BSplineCurve | NURBSCurve):
        return _greville(shape.basis)
    if isinstance(shape, BSplineSurface | NURBSSurface):
        return _greville((shape.basis_u, shape.basis_v)[axis])
    a, b = shape.domain if isinstance(shape, AbstractCurve) else shape.domain[axis]
    a, b = jnp.asarray(a, shape.dtype), jnp.asarray(b, shape.dtype)
    return a + (b - a) * jnp.linspace(0, 1, _SAMPLES, dtype=shape.dtype)


def _greville(basis: BSplineBasis) -> Float[Array, "n"]:
    knots, p = basis.unrolled_knots, basis.degree
    means = jnp.mean(jnp.stack([knots[i : i + basis.size] for i in range(1, p + 1)]), axis=0)
    return jax.lax.stop_gradient(basis.wrapped(means) if basis.periodic else jnp.clip(means, *basis.domain))


def _on_side(surface: Any, side: str) -> Float[Array, "n 2"]:
    """Parameters along a side."""
    if isinstance(surface, AbstractCurve):
        raise InputError(f"`fixed` names the side {side!r}, but the shape is a curve; hold its ends by `FixedPoint`.")
    axis = "uv".index(side[0])
    running = _resolving(surface, 1 - axis)
    end = jnp.broadcast_to(jnp.asarray(surface.domain[axis][int(side[1])], surface.dtype), running.shape)
    return jnp.stack([end, running] if axis == 0 else [running, end], axis=-1)


def _places(surface: Any, side: str) -> Float[Array, "n 3"]:
    return jax.vmap(lambda t: surface.point(t[0], t[1]))(_on_side(surface, side))


def _checked(side: str) -> str:
    if side not in SIDES:
        raise InputError(f"`side` must be one of {', '.join(map(repr, SIDES))}, got {side!r}.")
    return side


class Rows(eqx.Module):
    """What a side had at its places."""

    points: Float[Array, "n d"]


class FixedPoint(AbstractCondition):
    """The place at given parameters is `point`, by default where it is in the shape that the fit starts from.

    parameters: u of a curve, (u, v) of a surface; point: (3,).
    """

    parameters: Float[Array, "k"]
    point: Float[Array, "d"] | None = None

    def __init__(self, parameters: Numbers, point: Numbers | None = None):
        self.parameters = jnp.atleast_1d(as_float(parameters))
        self.point = None if point is None else as_float(point)

    def bound(self, shape: Any) -> "FixedPoint":
        wanted = 1 if isinstance(shape, AbstractCurve) else 2
        if self.parameters.shape != (wanted,):
            raise InputError(f"`FixedPoint` needs {wanted} parameters on this shape, got shape {self.parameters.shape}.")
        return self if self.point is not None else FixedPoint(self.parameters, shape.point(*self.parameters))

    def __call__(self, shape: Any) -> Float[Array, "d"]:
        assert self.point is not None
        return (shape.point(*self.parameters.astype(shape.dtype)) - self.point) / _length(shape)


class FixedEdge(AbstractCondition):
    """A side of a surface is `curve`, by default what it is in the shape that the fit starts from.

    side: "u0" "u1" "v0" "v1"; curve: any curve, its domain onto the side's. It is met at as many places as determine a
    spline: everywhere, if the side can have its form.
    """

    curve: Any
    side: str = eqx.field(static=True)

    def __init__(self, side: str, curve: AbstractCurve | Rows | None = None):
        self.side, self.curve = _checked(side), curve

    def bound(self, shape: Any) -> "FixedEdge":
        return self if self.curve is not None else FixedEdge(self.side, Rows(_places(shape, self.side)))

    def __call__(self, shape: Any) -> Float[Array, "n 3"]:
        rows = _on_side(shape, self.side)
        return (_places(shape, self.side) - self._wanted(shape, rows)) / _length(shape)

    def _wanted(self, shape: Any, rows: Float[Array, "n 2"]) -> Float[Array, "n 3"]:
        if isinstance(self.curve, Rows):
            return self.curve.points
        axis = 1 - "uv".index(self.side[0])
        (a, b), (c, d) = shape.domain[axis], self.curve.domain
        return self.curve(c + (d - c) * (rows[:, axis] - a) / (b - a))


class TangentPlane(AbstractCondition):
    """Along a side a surface is tangent to the planes with the given normals.

    side: "u0" "u1" "v0" "v1"; normal: (3,), or a function of the side's parameter, by default those of the shape that the
    fit starts from. The surface is tangent everywhere along the side if the normal is the same there and the surface a
    polynomial spline; else at as many places as determine the side, for `js.tangent_to` to finish.
    """

    normal: Any
    side: str = eqx.field(static=True)

    def __init__(self, side: str, normal: Numbers | Rows | Callable[[Any], Any] | None = None):
        self.side = _checked(side)
        if normal is None or callable(normal) or isinstance(normal, Rows):
            self.normal = normal
        else:
            self.normal = as_float(normal)

    def bound(self, shape: Any) -> "TangentPlane":
        return self if self.normal is not None else TangentPlane(self.side, Rows(self._normals(shape)))

    def _normals(self, shape: Any) -> Float[Array, "n 3"]:
        tangents = jax.vmap(lambda t: value_and_tangents(shape, t)[1])(_on_side(shape, self.side))
        return _safe.unit(jnp.cross(tangents[:, :, 0], tangents[:, :, 1]))

    def complaint(self, start: Any, shape: Any) -> str | None:
        facing = jnp.sum(self._normals(start) * self._normals(shape), axis=1)
        if np.all(concrete(facing) >= 0):
            return None
        return (
            f"The surface keeps its tangent planes along {self.side!r}, but has folded over there to come nearer to points "
            "that lie otherwise: give more `bending`, or planes that suit the points."
        )

    def __call__(self, shape: Any) -> Float[Array, "2 n"]:
        rows = _on_side(shape, self.side)
        tangents = jax.vmap(lambda t: value_and_tangents(shape, t)[1])(rows)
        if isinstance(self.normal, Rows):
            normals = self.normal.points
        elif callable(self.normal):
            normals = jax.vmap(self.normal)(rows[:, 1 - "uv".index(self.side[0])])
        else:
            normals = jnp.broadcast_to(self.normal, tangents.shape[:2])
        (a, b), (c, d) = shape.domain
        scale = jnp.stack([jnp.asarray(b - a, shape.dtype), jnp.asarray(d - c, shape.dtype)]) / _length(shape)
        return jnp.einsum("nxk,nx->kn", tangents, _safe.unit(normals)) * scale[:, None]


class Symmetry(AbstractCondition):
    """Reflection in a plane maps the shape onto itself, with one parameter running backwards.

    point, normal: (3,) of the plane; along: the parameter, "u" or "v". Knots and weights must be symmetric.
    """

    point: Float[Array, "3"]
    normal: Float[Array, "3"]
    along: str = eqx.field(static=True)

    def __init__(self, point: Numbers, normal: Numbers, along: str = "u"):
        if along not in ("u", "v"):
            raise InputError(f"`along` must be 'u' or 'v', got {along!r}.")
        self.point, self.normal, self.along = as_float(point), as_float(normal), along

    def __call__(self, shape: Any) -> Float[Array, "n 3"]:
        if isinstance(shape, BSplineSurface | NURBSSurface | BSplineCurve | NURBSCurve):
            axis = 1 if self.along == "v" else 0
            net = jnp.moveaxis(shape.control_points, axis, 0)
            half = -(-net.shape[0] // 2)
            here, there = net[:half].reshape(-1, 3), net[::-1][:half].reshape(-1, 3)
        else:
            rows, here = _net(shape)
            axis = 0 if self.along == "u" else 1
            a, b = shape.domain if isinstance(shape, AbstractCurve) else shape.domain[axis]
            there = jax.vmap(lambda t: shape.point(*t))(rows.at[:, axis].set(a + b - rows[:, axis]))
        normal = _safe.unit(self.normal)
        reflected = there - 2 * ((there - self.point[None]) @ normal)[:, None] * normal[None]
        return (here - reflected) / _length(shape)


class PlanarEdge(AbstractCondition):
    """A side of a surface lies in a plane: any, or that through `point` with `normal`, (3,) each."""

    point: Float[Array, "3"] | None
    normal: Float[Array, "3"] | None
    side: str = eqx.field(static=True)

    def __init__(self, side: str, point: Numbers | None = None, normal: Numbers | None = None):
        if (point is None) != (normal is None):
            raise InputError("`point` and `normal` of a `PlanarEdge` must be given both, or none of them.")
        self.side = _checked(side)
        self.point, self.normal = (None if x is None else as_float(x) for x in (point, normal))

    def __call__(self, shape: Any) -> Float[Array, "n"]:
        places = _places(shape, self.side)
        if self.point is not None and self.normal is not None:
            return (places - self.point[None]) @ _safe.unit(self.normal) / _length(shape)
        return _off_best(places, 2) / _length(shape)


class StraightEdge(AbstractCondition):
    """A side of a surface lies on a straight line: any."""

    side: str = eqx.field(static=True, converter=_checked)

    def __call__(self, shape: Any) -> Float[Array, "n"]:
        return _off_best(_places(shape, self.side), 1) / _length(shape)


def _off_best(places: Float[Array, "n 3"], dimension: int) -> Float[Array, "m"]:
    """How far places are from their line or plane of least squares, with derivatives that let it turn."""
    frozen = jax.lax.stop_gradient(places)
    centre = jnp.mean(frozen, axis=0)
    axes = jnp.linalg.eigh((frozen - centre[None]).T @ (frozen - centre[None]))[1][:, ::-1]
    inside, off = (frozen - centre[None]) @ axes[:, :dimension], (places - centre[None]) @ axes[:, dimension:]
    # what a shift or a turn of the line or plane would do is taken out
    turns = jnp.linalg.qr(jnp.concatenate([jnp.ones_like(inside[:, :1]), inside], axis=1))[0]
    return (off - turns @ (turns.T @ off)).reshape(-1)


def bound_to(shape: Any, fixed: tuple[Callable[[Any], Any], ...]) -> tuple[Callable[[Any], Any], ...]:
    """All conditions, with what they take from the start."""
    return tuple(one.bound(shape) if isinstance(one, AbstractCondition) else jax.tree_util.Partial(one) for one in fixed)
