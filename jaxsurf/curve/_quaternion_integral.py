"""Quaternion integral curves: shaped by the directions of their tangents."""

import math
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float, Int

from .._arguments import as_number, as_vector
from .._array import Numbers, as_float, is_concrete, map_points, take
from .._registry import register
from .._safe import divide, norm, unit
from ..basis import BSplineBasis, check_knots, clamped_knots
from ..quaternion import angular_velocity, blended_direction, blended_on_spans
from ..quaternion._control import ROUGH, as_tolerance, check_directions, largest_angle, ready_angle
from ..quaternion._pieces import curve_layout, gauss_places, integral_matrix, powers_of_series
from ._abstract import AbstractCurve
from ._breaks import breaks, knot_breaks


@register
class QICurve(AbstractCurve):
    """C(u) = start + length / (b − a) ∫ₐᵘ q v₀ q⁻¹, a unit quaternion integral curve: its tangent is a spline of directions.

    q(u) = exp(ω_n B̃_n(u)) … exp(ω_1 B̃_1(u)) q_0 turns the fixed direction v₀ through the control tangents, ω_i from number
    i − 1 to number i. The speed is constant: a part has the length length (u − a) / (b − a). With clamped knots
    the curve begins along the first control tangent and ends along the last; of degree 1 it consists of circular arcs, in a
    plane of degree 2 of clothoids; it is C^degree.

    start: (3,); length: positive; tangents: (n, 3), control tangents of any length > 0, kept as unit vectors; degree ≥ 1;
    knots: (n + degree + 1,), by default clamped and even on [0, 1]. Points come from `pieces` polynomials for each span, as
    many as keep directions within `tolerance` (default 10⁻¹², 10⁻⁶ in single precision; positions, in units of the length,
    are closer) for neighbouring tangents up to `angle` radians apart (default: a little more than they are; 90° if they are
    traced); derivatives by u are those of the blended tangent itself. Raises `InputError` where shapes do not fit and, on
    concrete data, for a zero tangent and neighbours that are opposite. Source: Sakiyama, Miura, Kaneko (paper 004), (2)-(5).
    """

    start: Float[Array, "3"]
    length: Float[Array, ""]
    tangents: Float[Array, "n 3"]
    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)
    angle: float = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)

    def __init__(
        self,
        start: Numbers,
        length: Numbers,
        tangents: Numbers,
        degree: int = 3,
        knots: Numbers | None = None,
        *,
        tolerance: float | None = None,
        angle: float | None = None,
    ):
        self.start = as_vector(start, "start")
        dtype = self.start.dtype
        self.length = as_number(length, "length", dtype, positive=True)
        self.degree = int(degree)
        directions = as_float(tangents, dtype)
        check_directions(directions, "tangents", ("n", "3"))
        self.tangents = unit(directions)
        self.knots = as_float(clamped_knots(directions.shape[0], self.degree) if knots is None else knots, dtype)
        check_knots(self.knots, self.degree, directions.shape[0])
        self.angle = ready_angle(largest_angle(directions)) if angle is None else float(angle)
        self.tolerance = as_tolerance(tolerance, dtype)

    @classmethod
    def line(cls, start: Numbers, end: Numbers, count: int = 3, degree: int = 2) -> "QICurve":
        """The straight curve from `start` to `end`, (3,), with `count` control tangents: what a modeller begins with."""
        start = as_vector(start, "start")
        along = as_vector(end, "end", start.dtype) - start
        return cls(start, norm(along), jnp.broadcast_to(along, (count, 3)), degree)

    def replace(self, **changes: Any) -> "QICurve":
        """The curve with other control data, by their names in the constructor; checked, and made ready anew."""
        data = {**self._data(), **changes}
        if not is_concrete(data["tangents"]):
            data.setdefault("angle", self.angle)
        return QICurve(**data)

    def roughened(self) -> "QICurve":
        return self.replace(tolerance=max(ROUGH, self.tolerance))

    def renewed(self) -> "QICurve":
        if not is_concrete(self):
            return self
        return self.replace(angle=max(self.angle, ready_angle(largest_angle(self.tangents))))

    def _data(self) -> dict[str, Any]:
        names = ("start", "length", "tangents", "degree", "knots", "tolerance")
        return {name: getattr(self, name) for name in names}

    @property
    def basis(self) -> BSplineBasis:
        """The basis functions that blend the control tangents."""
        return BSplineBasis(self.knots, self.degree)

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.basis.domain

    @property
    def layout(self) -> tuple[int, int]:
        """How many polynomials stand for a span, and through how many nodes each goes."""
        return curve_layout(self.degree, self.angle, self.tolerance, self.tangents.shape[0] - self.degree)

    @property
    def speed(self) -> Float[Array, ""]:
        """|dC/du| = length / (b − a), the same everywhere."""
        first, last = self.domain
        return self.length / (last - first)

    def direction(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        """The unit tangent at one parameter, inside traced code."""
        return blended_direction(self.basis, self.tangents, u)

    def tangent(self, u: Numbers) -> Float[Array, "*batch 3"]:
        """Unit tangents at parameters of any shape, in closed form."""
        return map_points(_tangent_at, self, as_float(u, self.dtype))

    def curvature(self, u: Numbers) -> Float[Array, "*batch"]:
        """Curvature at parameters of any shape, in closed form: |W − ⟨W, T⟩T| / length, W the angular velocity."""
        return map_points(_curvature_at, self, as_float(u, self.dtype))

    def torsion(self, u: Numbers) -> Float[Array, "*batch"]:
        """Torsion at parameters of any shape, in closed form; where the curvature is 0, which has none, ⟨W, T⟩ / length."""
        return map_points(_torsion_at, self, as_float(u, self.dtype))

    def prepared(self) -> "PreparedQICurve":
        """The curve with the polynomials of its pieces."""
        knots, degree, count = self.knots, self.degree, self.tangents.shape[0]
        pieces, nodes = self.layout
        directions = blended_on_spans(self.basis, self.tangents, gauss_places(pieces, nodes))
        directions = directions.reshape(-1, nodes, 3)
        times = lambda matrix, values: jnp.einsum(
            "kq,pqx->pkx", jnp.asarray(matrix, self.dtype), values, precision="highest"
        )
        powers = times(powers_of_series(nodes + 1), times(integral_matrix(nodes), directions))
        halves = jnp.repeat(jnp.diff(knots[degree : count + 1]), pieces)[:, None] * (self.speed / (2 * pieces))
        powers = [halves * powers[:, k] for k in range(nodes + 1)]
        whole = sum(powers)  # at +1
        powers[0] = powers[0] + (self.start[None] + (jnp.cumsum(whole, axis=0) - whole))
        # the numbers of a piece side by side: they are fetched together
        return PreparedQICurve(self, jnp.stack(powers, axis=1).reshape(-1, 3))

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u)


class PreparedQICurve(AbstractCurve):
    """A `QICurve` with the coefficients of its points, by piece and power of the place in it."""

    curve: QICurve
    rows: Float[Array, "r 3"]

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.curve.domain

    def prepared(self) -> "PreparedQICurve":
        return self

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        return _position(self, u)

    def derivatives(self, u: Float[Array, ""], order: int) -> list[Float[Array, "3"]]:
        """The point and derivatives up to `order`, of the polynomial: cheap, and less exact with every order."""
        pieces, nodes = self.curve.layout
        piece, place, slope = place_in_piece(self.curve.basis, pieces, u)
        return horner(self.rows, piece * (nodes + 1), nodes + 1, place, slope, order)


@jax.custom_jvp
def _position(prepared: PreparedQICurve, u: Float[Array, ""]) -> Float[Array, "3"]:
    """The point, from the polynomial of the piece around `u`; the slope by `u` is the blended tangent itself."""
    return _by_polynomials(prepared, u)


@partial(_position.defjvp, symbolic_zeros=True)
def _(primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Array, Array]:
    prepared, u = primals
    by_data, by_u = tangents
    point = _by_polynomials(prepared, u)
    slope = jnp.zeros_like(point)
    if not isinstance(by_u, SymbolicZero):
        curve = prepared.curve
        slope = slope + by_u * curve.speed * curve.direction(u)
    if not all(isinstance(leaf, SymbolicZero) for leaf in jax.tree.leaves(by_data, is_leaf=_is_symbolic)):
        moving = jax.tree.map(_instantiate, by_data, is_leaf=_is_symbolic)
        slope = slope + jax.jvp(lambda data: _by_polynomials(data, u), (prepared,), (moving,))[1]
    return point, slope


def _tangent_at(prepared: PreparedQICurve, u: Float[Array, ""]) -> Float[Array, "3"]:
    return prepared.curve.direction(u)


def _curvature_at(prepared: PreparedQICurve, u: Float[Array, ""]) -> Float[Array, ""]:
    curve = prepared.curve
    direction, velocity, _ = angular_velocity(curve.basis, curve.tangents, u)
    return norm(jnp.cross(direction, velocity)) / curve.speed


def _torsion_at(prepared: PreparedQICurve, u: Float[Array, ""]) -> Float[Array, ""]:
    curve = prepared.curve
    direction, velocity, change = angular_velocity(curve.basis, curve.tangents, u)
    across = jnp.cross(direction, velocity)
    turning = divide(direction @ jnp.cross(velocity, change), across @ across)
    return (direction @ velocity + turning) / curve.speed


def _by_polynomials(prepared: PreparedQICurve, u: Float[Array, ""]) -> Float[Array, "3"]:
    return prepared.derivatives(u, 0)[0]


def place_in_piece(
    basis: BSplineBasis, pieces: int, u: Float[Array, ""]
) -> tuple[Int[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """Number of the piece around `u`, spans cut in equal ones; the place in it, from −1 to 1, and its slope by `u`."""
    if basis.size == basis.degree + 1:  # one span: nothing to look up
        first, (start, end) = jnp.zeros((), jnp.int32), basis.domain
    else:
        first = basis.span(u)
        start, end = take(basis.knots, first + basis.degree), take(basis.knots, first + basis.degree + 1)
    scale = pieces / (end - start)
    share = (u - start) * scale
    piece = jnp.clip(jax.lax.stop_gradient(share).astype(jnp.int32), 0, pieces - 1)
    return first * pieces + piece, 2 * (share - piece.astype(share.dtype)) - 1, 2 * scale


def horner(
    rows: Float[Array, "r w"],
    first: Int[Array, ""],
    count: int,
    place: Float[Array, ""],
    slope: Float[Array, ""],
    order: int = 0,
) -> list[Float[Array, "w"]]:
    """Σ_k place^k rows[first + k], k < count, and its derivatives up to `order`, times powers of `slope`."""
    if order == 0:
        return [_polynomial(count, rows, first, place)]
    block = _block(rows, first, count)
    return [math.factorial(k) * slope**k * part for k, part in enumerate(_expanded(block, place, order))]


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _polynomial(count: int, rows: Float[Array, "r w"], first: Int[Array, ""], place: Float[Array, ""]) -> Float[Array, "w"]:
    """Row by row, which compilers fuse; derivatives by the place share one fetch of all rows."""
    row = (lambda k: rows[k]) if rows.shape[0] == count else (lambda k: take(rows, first + k))
    total = row(count - 1)
    for power in range(count - 2, -1, -1):
        total = total * place + row(power)
    return total


@partial(_polynomial.defjvp, symbolic_zeros=True)
def _(count: int, primals: tuple[Array, ...], tangents: tuple[Any, ...]) -> tuple[Array, Array]:
    rows, first, place = primals
    by_rows, _, by_place = tangents
    if isinstance(by_place, SymbolicZero):
        value = _polynomial(count, rows, first, place)
        slope = jnp.zeros_like(value)
    else:
        value, slope = _expanded(_block(rows, first, count), place, 1)
        slope = by_place * slope
    if not isinstance(by_rows, SymbolicZero):
        # a single block: its transpose adds to all of its rows at once
        slope = slope + _powers(place, count) @ _block(by_rows, first, count)
    return value, slope


def _powers(x: Float[Array, ""], count: int) -> Float[Array, "n"]:
    powers = [jnp.ones_like(x)]
    for _ in range(count - 1):
        powers.append(powers[-1] * x)
    return jnp.stack(powers)


def _block(rows: Float[Array, "r w"], first: Int[Array, ""], count: int) -> Float[Array, "n w"]:
    return jax.lax.dynamic_slice(rows, (first, jnp.zeros_like(first)), (count, rows.shape[1]))


def _expanded(block: Float[Array, "n w"], place: Float[Array, ""], order: int) -> list[Float[Array, "w"]]:
    """Taylor coefficients at `place` of the polynomial with the rows of `block` for coefficients, by Horner's scheme."""
    found = [block[-1]] + [jnp.zeros_like(block[-1])] * order
    for row in range(block.shape[0] - 2, -1, -1):
        for k in range(order, 0, -1):
            found[k] = found[k] * place + found[k - 1]
        found[0] = found[0] * place + block[row]
    return found


def _is_symbolic(leaf: Any) -> bool:
    return isinstance(leaf, SymbolicZero)


def _instantiate(leaf: Any) -> Any:
    return jnp.zeros(leaf.shape, leaf.dtype) if _is_symbolic(leaf) else leaf


@breaks.register(QICurve)
def _(shape: QICurve) -> Any:
    return knot_breaks(shape.basis)


@breaks.register(PreparedQICurve)
def _(shape: PreparedQICurve) -> Any:
    return breaks(shape.curve)
