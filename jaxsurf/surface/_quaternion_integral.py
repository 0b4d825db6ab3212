"""Quaternion integral surfaces: shaped by the directions of their u-lines, along an initial curve."""

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_vector
from .._array import Numbers, as_float, concrete, eps, is_concrete
from .._errors import InputError
from .._registry import register
from .._safe import norm, unit
from ..basis import BSplineBasis, check_knots, clamped_knots
from ..curve import QICurve, combine
from ..curve._quaternion_integral import horner, place_in_piece
from ..quaternion import blended_direction, blended_on_spans
from ..quaternion._control import ROUGH, angle_to_blend, as_tolerance, check_directions, largest_angle, ready_angle
from ..quaternion._pieces import (
    SURFACE_NODES as NODES,
    gauss_places,
    integral_matrix,
    pieces_per_span,
    powers_of_series,
    series_matrix,
)
from ._abstract import AbstractSurface
from ._breaks import breaks, knot_breaks

_PATHS = ("spine first", "u first")


@register
class QISurface(AbstractSurface):
    """S(u, v) = spine(v) + l(v) / (b − a) ∫ₐᵘ T(·, v), the unit quaternion integral surface.

    T(u, v): control tangents of row i are blended along v to t_i(v), as the tangent of a `QICurve` is, and those along u.
    spine: the initial curve u = a, with the domain of v; tangents: (n, m, 3), of any length > 0, kept as unit vectors;
    lengths: (m,), positive, control numbers of l(v), the length of the u-lines: |S_u| = l(v) / (b − a) everywhere. knots_u:
    (n + degree_u + 1,), knots_v: (m + degree_v + 1,), by default clamped and even on [0, 1].

    path: the tangent fields along u and along v do not fit together in general, so the way of integration belongs to the
    surface: "spine first", the paper's, along the initial curve and then along u; "u first" along u at the first v and then
    along v, with the initial curve's tangents for all u: the edge moved along the spine. `closure_gap` is their difference.

    tolerance and angles, those between neighbours along u and along v: as for `QICurve`. Raises `InputError` as that does,
    and where rows become opposite between control tangents. Source: Sakiyama, Miura, Kaneko (paper 004), (6)-(8).
    """

    spine: QICurve
    tangents: Float[Array, "n m 3"]
    lengths: Float[Array, "m"]
    knots_u: Float[Array, "k"]
    knots_v: Float[Array, "l"]
    degree_u: int = eqx.field(static=True)
    degree_v: int = eqx.field(static=True)
    path: str = eqx.field(static=True)
    angle_u: float = eqx.field(static=True)
    angle_v: float = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)

    def __init__(
        self,
        spine: QICurve,
        tangents: Numbers,
        lengths: Numbers,
        degree_u: int = 3,
        degree_v: int = 3,
        knots_u: Numbers | None = None,
        knots_v: Numbers | None = None,
        *,
        path: str = "spine first",
        tolerance: float | None = None,
        angles: tuple[float, float] | None = None,
    ):
        if not isinstance(spine, QICurve):
            raise InputError(f"`spine` must be a `QICurve`, the initial curve, got {type(spine).__name__}.")
        if path not in _PATHS:
            raise InputError(f"`path` must be {' or '.join(map(repr, _PATHS))}, got {path!r}.")
        dtype = spine.dtype
        self.spine, self.path = spine, path
        self.degree_u, self.degree_v = int(degree_u), int(degree_v)
        directions = as_float(tangents, dtype)
        check_directions(directions, "tangents", ("n", "m", "3"))
        n, m = directions.shape[:2]
        self.tangents = unit(directions)
        self.lengths = _positive(as_float(lengths, dtype), m)
        self.knots_u = as_float(clamped_knots(n, self.degree_u) if knots_u is None else knots_u, dtype)
        self.knots_v = as_float(clamped_knots(m, self.degree_v) if knots_v is None else knots_v, dtype)
        check_knots(self.knots_u, self.degree_u, n, name="knots_u")
        check_knots(self.knots_v, self.degree_v, m, name="knots_v")
        _check_domains(self.spine.domain, self.domain[1], eps(dtype))
        across = jnp.swapaxes(directions, 0, 1)
        check_directions(across, "tangents", ("m", "n", "3"))
        if angles is None:
            angles = (
                ready_angle(angle_to_blend(self.basis_v, across, "tangents")),
                ready_angle(largest_angle(across)),
            )
        self.angle_u, self.angle_v = map(float, angles)
        self.tolerance = as_tolerance(tolerance, dtype)

    @classmethod
    def plane(
        cls, corner: Numbers, side_u: Numbers, side_v: Numbers, shape: tuple[int, int] = (3, 3), degree: int = 2
    ) -> "QISurface":
        """The flat parallelogram with sides `side_u`, `side_v`, (3,), from `corner`, `shape` control tangents and as many
        of the initial curve: what a modeller begins with."""
        corner = as_vector(corner, "corner")
        along_u, along_v = (as_vector(side, name, corner.dtype) for side, name in ((side_u, "side_u"), (side_v, "side_v")))
        spine = QICurve.line(corner, corner + along_v, shape[1], degree)
        tangents = jnp.broadcast_to(along_u, (*shape, 3))
        return cls(spine, tangents, jnp.full(shape[1], norm(along_u)), degree, degree)

    def replace(self, **changes: Any) -> "QISurface":
        """The surface with other control data, by their names in the constructor; checked, and made ready anew."""
        data = {**self._data(), **changes}
        if not is_concrete(data["tangents"]):
            data.setdefault("angles", (self.angle_u, self.angle_v))
        return QISurface(**data)

    def roughened(self) -> "QISurface":
        return self.replace(spine=self.spine.roughened(), tolerance=max(ROUGH, self.tolerance))

    def renewed(self) -> "QISurface":
        if not is_concrete(self):
            return self
        needed = self.replace(spine=self.spine.renewed())
        angles = max(self.angle_u, needed.angle_u), max(self.angle_v, needed.angle_v)
        return needed.replace(angles=angles)

    def _data(self) -> dict[str, Any]:
        names = ("spine", "tangents", "lengths", "degree_u", "degree_v", "knots_u", "knots_v", "path", "tolerance")
        return {name: getattr(self, name) for name in names}

    @property
    def basis_u(self) -> BSplineBasis:
        """The basis functions that blend tangents along u."""
        return BSplineBasis(self.knots_u, self.degree_u)

    @property
    def basis_v(self) -> BSplineBasis:
        """The basis functions that blend tangents, and the lengths, along v."""
        return BSplineBasis(self.knots_v, self.degree_v)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.basis_u.domain, self.basis_v.domain

    @property
    def pieces_u(self) -> int:
        """How many polynomials stand for a span along u."""
        return pieces_per_span(self.degree_u, self.angle_u, self.tolerance, NODES)

    @property
    def pieces_v(self) -> int:
        """How many polynomials stand for a span along v."""
        # half way between directions a and b that are θ apart |a + b| = 2 cos(θ/2): there a change of either turns the most
        steeper = 1 / max(math.cos(self.angle_u / 2), 0.1)
        # and they are no entire functions of v: the bound was missed by a factor of 500
        return pieces_per_span(self.degree_v, self.angle_v * steeper, 1e-3 * self.tolerance, NODES)

    def length(self, v: Float[Array, ""]) -> Float[Array, ""]:
        """The length l(v) of the u-line at one parameter, inside traced code."""
        return combine(self.basis_v, self.lengths[:, None], v)[0]

    def direction(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        """The unit tangent T(u, v) of the u-line at one pair of parameters, inside traced code."""
        return blended_direction(self.basis_u, blended_direction(self.basis_v, jnp.swapaxes(self.tangents, 0, 1), v), u)

    def u_line(self, v: Float[Array, ""]) -> QICurve:
        """The curve u ↦ S(u, v) of "spine first", inside traced code."""
        rows = blended_direction(self.basis_v, jnp.swapaxes(self.tangents, 0, 1), v)
        return self._line(self.spine.point(v), self.length(v), rows)

    def prepared(self) -> Any:
        """The surface with the polynomials of its pieces."""
        if self.path == "u first":
            first = self.domain[1][0]
            rows = blended_direction(self.basis_v, jnp.swapaxes(self.tangents, 0, 1), first)
            edge = self._line(jnp.zeros(3, self.dtype), self.length(first), rows)
            return TranslatedSpine(self, self.spine.prepared(), edge.prepared())
        return PreparedQISurface(self, self.spine.prepared(), self._integral_rows())

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)

    def _line(self, start: Float[Array, "3"], length: Float[Array, ""], rows: Float[Array, "n 3"]) -> QICurve:
        """A curve along u, ready for the same angles as the surface."""
        return QICurve(start, length, rows, self.degree_u, self.knots_u, angle=self.angle_u, tolerance=self.tolerance)

    def _integral_rows(self) -> Float[Array, "r w"]:
        """Coefficients of ∫ T / (b − a): a row for each pair of pieces and power of u, in it by power of v."""
        (a, b), _ = self.domain
        directions = self._directions_at_nodes()
        times = lambda which, matrix, values: jnp.einsum(which, jnp.asarray(matrix, self.dtype), values, precision="highest")
        series = times("aq,uqvwx->uavwx", integral_matrix(NODES), times("bw,uqvwx->uqvbx", series_matrix(NODES), directions))
        powers = times("bw,uavwx->uavbx", powers_of_series(NODES), series)
        powers = times("aq,uqvbx->uvabx", powers_of_series(NODES + 1), powers)
        spans = jnp.diff(self.knots_u[self.degree_u : self.tangents.shape[0] + 1])
        halves = jnp.repeat(spans, self.pieces_u) / (2 * self.pieces_u * (b - a))
        powers = powers * halves.reshape(-1, 1, 1, 1, 1)
        whole = jnp.sum(powers, axis=2)  # at the end of each piece
        powers = powers.at[:, :, 0].add(jnp.cumsum(whole, axis=0) - whole)
        return powers.reshape(-1, NODES * 3)

    def _directions_at_nodes(self) -> Float[Array, "u q v w 3"]:
        """T at all pairs of nodes: piece and node along u, piece and node along v."""
        across = blended_on_spans(self.basis_v, jnp.swapaxes(self.tangents, 0, 1), gauss_places(self.pieces_v, NODES))
        rows = jnp.swapaxes(across.reshape(-1, *across.shape[2:]), 0, 1)
        directions = blended_on_spans(self.basis_u, rows, gauss_places(self.pieces_u, NODES))
        return directions.reshape(-1, NODES, rows.shape[1] // NODES, NODES, 3)


class PreparedQISurface(AbstractSurface):
    """A `QISurface` with the rows of `_integral_rows`."""

    surface: QISurface
    spine: Any
    rows: Float[Array, "r w"]

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.surface.domain

    def prepared(self) -> "PreparedQISurface":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.spine.point(v) + self.surface.length(v) * self._integrals(u, v, 0)[0, 0]

    def derivatives(self, u: Float[Array, ""], v: Float[Array, ""], order: int) -> dict[tuple[int, int], Float[Array, "3"]]:
        """The point and all derivatives (i, j), i + j ≤ `order`, of the polynomials."""
        integrals, spine = self._integrals(u, v, order), self.spine.derivatives(v, order)
        lengths = _derivatives(self.surface.length, v, order)
        found = {}
        for i, j in integrals:
            product = sum(math.comb(j, b) * lengths[b] * integrals[i, j - b] for b in range(j + 1))
            found[i, j] = product if i else spine[j] + product
        return found

    def _integrals(self, u: Float[Array, ""], v: Float[Array, ""], order: int) -> dict[tuple[int, int], Float[Array, "3"]]:
        """∫ T / (b − a) and its derivatives."""
        surface = self.surface
        piece_u, place_u, slope_u = place_in_piece(surface.basis_u, surface.pieces_u, u)
        piece_v, place_v, slope_v = place_in_piece(surface.basis_v, surface.pieces_v, v)
        first = (piece_u * self._pieces_along_v() + piece_v) * (NODES + 1)
        none = jnp.zeros((), jnp.int32)
        along_u = horner(self.rows, first, NODES + 1, place_u, slope_u, order)
        along_v = [horner(a.reshape(NODES, 3), none, NODES, place_v, slope_v, order - i) for i, a in enumerate(along_u)]
        return {(i, j): along_v[i][j] for i in range(order + 1) for j in range(order + 1 - i)}

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        surface = self.surface
        piece_u, place_u, _ = jax.vmap(lambda t: place_in_piece(surface.basis_u, surface.pieces_u, t))(u)
        piece_v, place_v, _ = jax.vmap(lambda t: place_in_piece(surface.basis_v, surface.pieces_v, t))(v)
        powers = self.rows.reshape(-1, self._pieces_along_v(), NODES + 1, NODES, 3)[:, piece_v]
        columns = powers[:, :, :, -1]  # (pieces along u, k, power of u, 3)
        for power in range(NODES - 2, -1, -1):
            columns = columns * place_v[None, :, None, None] + powers[:, :, :, power]
        columns = jnp.moveaxis(columns, 2, 0)
        total = columns[-1][piece_u]
        for power in range(NODES - 1, -1, -1):
            total = total * place_u[:, None, None] + columns[power][piece_u]
        length = jax.vmap(surface.length)(v)
        return jax.vmap(self.spine.point)(v)[None] + length[None, :, None] * total

    def _pieces_along_v(self) -> int:
        surface = self.surface
        return (surface.tangents.shape[1] - surface.degree_v) * surface.pieces_v


class TranslatedSpine(AbstractSurface):
    """A `QISurface` of the path "u first", with its two curves prepared."""

    surface: QISurface
    spine: Any
    edge: Any

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.surface.domain

    def prepared(self) -> "TranslatedSpine":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.spine.point(v) + self.edge.point(u)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return jax.vmap(self.spine.point)(v)[None] + jax.vmap(self.edge.point)(u)[:, None]


def _derivatives(f: Callable[[Array], Array], t: Float[Array, ""], order: int) -> list[Float[Array, ""]]:
    """f and its derivatives up to `order`."""
    slope = lambda x: jax.jvp(f, (x,), (jnp.ones_like(x),))[1]
    return [f(t), *(_derivatives(slope, t, order - 1) if order else [])]


@breaks.register(QISurface)
def _(shape: QISurface) -> tuple[Any, Any]:
    spine, own = breaks(shape.spine), knot_breaks(shape.basis_v)
    if is_concrete(spine, own):
        return knot_breaks(shape.basis_u), np.unique(np.concatenate([concrete(own), concrete(spine)]))
    return knot_breaks(shape.basis_u), jnp.sort(jnp.concatenate([jnp.asarray(own), jnp.asarray(spine)]))


@breaks.register(PreparedQISurface)
@breaks.register(TranslatedSpine)
def _(shape: Any) -> tuple[Any, Any]:
    return breaks(shape.surface)


def _positive(lengths: Array, count: int) -> Array:
    if lengths.shape != (count,):
        raise InputError(f"`lengths` must have shape ({count},), one for each column of `tangents`, got {lengths.shape}.")
    if is_concrete(lengths):
        values = concrete(lengths)
        bad = ~(np.isfinite(values) & (values > 0))
        if np.any(bad):
            i = int(np.argmax(bad))
            raise InputError(f"`lengths` must be finite and positive, but lengths[{i}] is {values[i]:g}.")
    return lengths


def _check_domains(spine: tuple[Any, Any], own: tuple[Any, Any], unit_roundoff: float) -> None:
    if not is_concrete(spine, own):
        return
    (a, b), (c, d) = (tuple(float(end) for end in pair) for pair in (spine, own))
    if max(abs(a - c), abs(b - d)) > 8 * unit_roundoff * max(abs(c), abs(d)):
        raise InputError(
            f"`spine` must have the domain of v, [{c:g}, {d:g}], got [{a:g}, {b:g}]; give it or `knots_v` other knots."
        )
