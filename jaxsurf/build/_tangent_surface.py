"""Surfaces bent so that they touch given planes along their sides, and keep their boundary curves."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._registry import register
from .._safe import divide, norm, unit
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._edge_fields import AbstractEdgeField, unit_normal
from ._guides import carried, value_and_slope
from ._square import Square, hermite_weight

OPERATORS = ("scaling", "hermite", "gregory", "blend")


class Corner(eqx.Module):
    """ρ n and ρ̃ n of operator H, and the unit normal n, at a corner where two sides with fields meet."""

    by_u: Float[Array, "3"]
    by_v: Float[Array, "3"]


class LineMap(eqx.Module):
    """What operators F and H do to the points of one line across, an affine map of them.

    end: its last point P₂; e: unit direction of its chord; own: the normal N₂ that counts at the end for the first step;
    first: M₁; mu: both factors; pulls: what H takes away at either end, ⟨S', M⟩M; share: of F, the rest is H.
    """

    end: Float[Array, "3"]
    e: Float[Array, "3"]
    own: Float[Array, "3"]
    first: Float[Array, "3"]
    mu: Float[Array, "2"]
    pulls: Float[Array, "2 3"]
    share: Float[Array, ""]

    def __call__(self, x: Float[Array, "3"], place: Float[Array, ""]) -> Float[Array, "3"]:
        """The mapped point of a point x at a share `place` of the line."""
        rest = x - self.end
        rest = rest + self.mu[0] * _bracket(self.own, rest, self.e)
        rest = rest + self.mu[1] * _bracket(self.first, rest, self.e)
        scaled = self.end + rest
        bent = x - sum(hermite_weight(i, place) * self.pulls[i] for i in (0, 1))
        return self.share * scaled + (1 - self.share) * bent


@register
class TangentSurface(AbstractSurface):
    """A surface with its boundary curves, bent so that it is tangent to planes along some of its sides.

    Made by `js.tangent_to`. fields: normals along the sides u = first, u = last, v = first, v = last, or None. operator:
    "scaling" (F), "hermite" (H), "gregory" (H without corner conditions) or "blend" (F where its rows behave, H elsewhere).
    Source: Jōnishi, Yajima (paper 000), sections 4 and 5; H adds multiples of the normals by cubic Hermite weights.
    """

    surface: AbstractSurface
    fields: tuple[AbstractEdgeField | None, ...]
    operator: str = eqx.field(static=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.surface.domain

    def prepared(self) -> Any:
        ready = self.surface.prepared()
        if self.operator in ("hermite", "gregory"):
            corners = tuple(tuple(self._corner(ready, i, j) for j in (0, 1)) for i in (0, 1))
            return HermiteSurface(self, ready, corners)
        return ScaledSurface(self, ready, self._edge_maps(ready))

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)

    def normal(self, side: int, share: Float[Array, ""]) -> Float[Array, "3"]:
        """The unit normal given on a side, of "u0" "u1" "v0" "v1", inside traced code."""
        field = self.fields[side]
        assert field is not None
        return unit_normal(field, share)

    def _corner(self, ready: Any, i: int, j: int) -> Corner | None:
        if self.fields[i] is None or self.fields[2 + j] is None:
            return None
        first, second, mixed = Square(ready).corner(i, j, self.dtype)
        s, t = (jnp.asarray(float(k), self.dtype) for k in (i, j))
        n, by_v = value_and_slope(lambda y: self.normal(i, y), t)
        by_u = value_and_slope(lambda x: _alike(self.normal(2 + j, x), n), s)[1]
        twist = mixed @ n
        return Corner((twist + first @ by_v) * n, (twist + second @ by_u) * n)

    def _edge_maps(self, ready: Any) -> Any:
        """Of the maps along u at both ends of v: the maps, and their changes by v; None where only one direction is bent."""
        if not (any(f is not None for f in self.fields[:2]) and any(f is not None for f in self.fields[2:])):
            return None
        square = Square(ready)
        ends = (jnp.zeros((), self.dtype), jnp.ones((), self.dtype))
        return tuple(value_and_slope(lambda t: self.line_map(square, 0, t), end) for end in ends)

    def line_map(self, square: Square, axis: int, share: Float[Array, ""], edges: Any = None) -> LineMap:
        """The map of the line across axis 0 at a share of v, or across axis 1 at a share of u.

        edges: what is known of the two ends instead of the square's own: (point, along, across) each.
        """
        ends = edges or [square.on_side(axis, end, share) for end in (0, 1)]
        points, along, across = (jnp.stack(x) for x in zip(*ends, strict=True))
        e = unit(points[1] - points[0])
        crossed = jax.vmap(jnp.cross)(across, along) if axis == 0 else jax.vmap(jnp.cross)(along, across)
        own = unit(crossed)
        given = [self.fields[2 * axis + end] is not None for end in (0, 1)]
        normals = [_alike(self.normal(2 * axis + k, share), own[k]) if given[k] else own[k] for k in (0, 1)]
        pulls = [(across[k] @ normals[k]) * normals[k] if given[k] else jnp.zeros(3, self.dtype) for k in (0, 1)]
        below = [
            jnp.cross(across[0], e) @ jnp.cross(own[1], normals[0]),
            jnp.cross(across[1], e) @ jnp.cross(normals[0], normals[1]),
        ]
        mu = jnp.stack([divide(across[k] @ normals[k], below[k]) if given[k] else jnp.zeros((), self.dtype) for k in (0, 1)])
        one = LineMap(points[1], e, own[1], normals[0], mu, jnp.stack(pulls), jnp.ones((), self.dtype))
        if self.operator == "scaling":
            return one
        return eqx.tree_at(lambda m: m.share, one, _share_of_scaling(one, points, across, jnp.stack(below), given))


class HermiteSurface(AbstractSurface):
    """A `TangentSurface` by operator H: S less multiples of the given normals near each side."""

    whole: TangentSurface
    surface: Any
    corners: tuple[tuple[Corner | None, ...], ...]

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.whole.domain

    def prepared(self) -> "HermiteSurface":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        s, t = self._shares(u, v)
        total = self.surface.point(u, v)
        for axis, (along, across) in enumerate(((t, s), (s, t))):
            for end, pull in self._pulls(axis, along):
                total = total - hermite_weight(end, across) * pull
        return total + self._corner_part(s, t)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        s, t = self._shares(u, v)
        total = self.surface.grid_points(u, v)
        for end, pull in jax.vmap(lambda y: dict(self._pulls(0, y)))(t).items():
            total = total - hermite_weight(end, s)[:, None, None] * pull[None]
        for end, pull in jax.vmap(lambda x: dict(self._pulls(1, x)))(s).items():
            total = total - hermite_weight(end, t)[None, :, None] * pull[:, None]
        return total + jax.vmap(lambda x: jax.vmap(lambda y: self._corner_part(x, y))(t))(s)

    def _shares(self, u: Any, v: Any) -> tuple[Any, Any]:
        along_u, along_v = self.domain
        return carried(u, along_u, (0.0, 1.0)), carried(v, along_v, (0.0, 1.0))

    def _pulls(self, axis: int, share: Float[Array, ""]) -> list[tuple[int, Float[Array, "3"]]]:
        """⟨S_x, M⟩ M on the sides across an axis that have fields."""
        found = []
        for end in (0, 1):
            if self.whole.fields[2 * axis + end] is not None:
                normal = self.whole.normal(2 * axis + end, share)
                across = Square(self.surface).on_side(axis, end, share)[2]
                found.append((end, (across @ normal) * normal))
        return found

    def _corner_part(self, s: Float[Array, ""], t: Float[Array, ""]) -> Float[Array, "3"]:
        total = jnp.zeros(3, self.dtype)
        share = _gregory_share(s, t) if self.whole.operator == "gregory" else None
        for i, row in enumerate(self.corners):
            for j, corner in enumerate(row):
                if corner is not None:
                    twist = corner.by_u if share is None else share * corner.by_v + (1 - share) * corner.by_u
                    total = total + hermite_weight(i, s) * hermite_weight(j, t) * twist
        return total


class ScaledSurface(AbstractSurface):
    """A `TangentSurface` by operator F, or its blend with H: lines along u are mapped, and then those along v."""

    whole: TangentSurface
    surface: Any
    edge_maps: Any

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.whole.domain

    def prepared(self) -> "ScaledSurface":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        along_u, along_v = self.domain
        s, t = carried(u, along_u, (0.0, 1.0)), carried(v, along_v, (0.0, 1.0))
        along, across = self._maps(s, t)
        x = self.surface.point(u, v)
        if along is not None:
            x = along(x, s)
        return x if across is None else across(x, t)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        along_u, along_v = self.domain
        s, t = carried(u, along_u, (0.0, 1.0)), carried(v, along_v, (0.0, 1.0))
        rows = jax.vmap(lambda y: self._maps(s[0], y)[0])(t)
        columns = jax.vmap(lambda x: self._maps(x, t[0])[1])(s)
        total = self.surface.grid_points(u, v)
        if rows is not None:
            total = jax.vmap(lambda line, x: jax.vmap(lambda m, p: m(p, x))(rows, line))(total, s)
        if columns is not None:
            total = jax.vmap(lambda m, line: jax.vmap(m)(line, t))(columns, total)
        return total

    def _maps(self, s: Float[Array, ""], t: Float[Array, ""]) -> tuple[LineMap | None, LineMap | None]:
        """The maps of the line along u at t, and of the line along v at s on the surface that the first ones have made."""
        whole, square = self.whole, Square(self.surface)
        by_u, by_v = (any(f is not None for f in fields) for fields in (whole.fields[:2], whole.fields[2:]))
        rows = whole.line_map(square, 0, t) if by_u else None
        if not by_v:
            return rows, None
        edges = None
        if self.edge_maps is not None:
            edges = []
            for end in (0, 1):
                point, along, across = square.on_side(1, end, s)
                ready, change = self.edge_maps[end]
                moved = jax.jvp(lambda m, x: m(x, s), (ready, point), (change, across))[1]
                edges.append((point, along, moved))
        return rows, whole.line_map(square, 1, s, edges)


def _bracket(m: Float[Array, "3"], x: Float[Array, "3"], e: Float[Array, "3"]) -> Float[Array, "3"]:
    """[M; X] = M × (X × e) = X⟨M, e⟩ − e⟨M, X⟩."""
    return x * (m @ e) - e * (m @ x)


def _alike(normal: Float[Array, "3"], other: Float[Array, "3"]) -> Float[Array, "3"]:
    """The normal, or its negative, that points to the side of another one."""
    return jnp.where(jax.lax.stop_gradient(normal @ other) < 0, -normal, normal)


def _gregory_share(s: Float[Array, ""], t: Float[Array, ""]) -> Float[Array, ""]:
    """b / (a + b), a = s(1 − s), b = t(1 − t): 0 on the sides t = 0, 1, and 1 on s = 0, 1; ½ at corners."""
    a, b = s * (1 - s), t * (1 - t)
    corner = a + b == 0
    return jnp.where(corner, 0.5, b / jnp.where(corner, 1, a + b))


def hermite_line(points: Float[Array, "2 3"], across: Float[Array, "2 3"], x: Any) -> Float[Array, "3"]:
    """The cubic with these ends and end slopes."""
    rise = x * x * (3 - 2 * x)
    return (1 - rise) * points[0] + rise * points[1] + hermite_weight(0, x) * across[0] + hermite_weight(1, x) * across[1]


def _share_of_scaling(
    line: LineMap, points: Float[Array, "2 3"], across: Float[Array, "2 3"], below: Float[Array, "2"], given: list[bool]
) -> Float[Array, ""]:
    """1 where F behaves, 0 near rows where its denominator vanishes: both keep the planes, and so does any mixture.

    1/γ = (4/27) |denominator| / max |[N; X_h]| over the row's cubic X_h; the share is smoothstep(6 (1/γ − 1/3)).
    """
    total = jnp.ones((), below.dtype)
    rows = [hermite_line(points, across, x) - line.end for x in (0.2, 0.4, 0.6, 0.8)]
    for k, normal in enumerate((line.own, line.first)):
        if given[k]:
            largest = jnp.max(jnp.stack([norm(_bracket(normal, x, line.e)) for x in rows]))
            steady = 4 / 27 * divide(jnp.abs(below[k]), largest)
            x = jnp.clip(6 * (steady - 1 / 3), 0, 1)
            total = total * x * x * (3 - 2 * x)
    return total


@breaks.register(TangentSurface)
def _(shape: TangentSurface) -> tuple[Any, Any]:
    return breaks(shape.surface)


@breaks.register(HermiteSurface)
@breaks.register(ScaledSurface)
def _(shape: Any) -> tuple[Any, Any]:
    return breaks(shape.whole)
