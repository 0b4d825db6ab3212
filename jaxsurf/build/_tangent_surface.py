"""Surfaces bent so that they touch given planes along their sides, and keep their boundary curves."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._prepared import prepare
from .._registry import register
from .._safe import divide, norm, unit
from ..surface import AbstractSurface
from ..surface._breaks import breaks
from ._alike import each
from ._edge_fields import AbstractEdgeField
from ._guides import shares_of, value_and_slope
from ._ribbons import CORNERS, AbstractRibbons, hermite_weight, ribbons_of

OPERATORS = ("scaling", "hermite", "gregory", "blend")


class Corner(eqx.Module):
    """Where two sides with fields meet: first and second derivatives, M_i and M_j, and their derivatives along the sides."""

    first: Float[Array, "2 3"]
    second: Float[Array, "2 2 3"]
    normals: Float[Array, "2 3"]
    changes: Float[Array, "2 3"]

    @property
    def rho(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """ρ = ⟨S_uv, n⟩ + ⟨S_u, M_i'⟩ and ρ̃ = ⟨S_uv, n⟩ + ⟨S_v, M_j'⟩; they are equal where (5.7) to (5.10) hold."""
        twist = self.second[0, 1] @ self.normals[0]
        return twist + self.first[0] @ self.changes[0], twist + self.first[1] @ self.changes[1]


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

    def affine(self) -> tuple[Array, Array, Array, Array, Array]:
        """β (), g (3,), e (3,), c (3,) and P (2, 3) of x ↦ β x − e⟨g, x⟩ + c − Σ w_i(place) P_i, the same map."""
        (mu, nu), share = self.mu, self.share
        one, other = 1 + mu * (self.own @ self.e), 1 + nu * (self.first @ self.e)
        stretch, g = share * one * other + (1 - share), share * (mu * self.own + nu * one * self.first)
        constant = share * self.end - (share * one * other) * self.end + self.e * (g @ self.end)
        return stretch, g, self.e, constant, (1 - share) * self.pulls


class AbstractBentSurface(AbstractSurface):
    """A surface bent along the sides that have fields: u = first, u = last, v = first, v = last, or None."""

    surface: AbstractSurface
    fields: tuple[AbstractEdgeField | None, ...]
    operator: str = eqx.field(static=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.surface.domain

    def bent(self, axis: int) -> bool:
        """Whether a side across an axis has a field."""
        return any(field is not None for field in self.fields[2 * axis : 2 * axis + 2])

    def normals(self, axis: int, share: Float[Array, ""], along: Float[Array, "2 3"]) -> dict[int, Float[Array, "3"]]:
        """The unit normals given on sides across an axis, by end; their planes hold the derivatives along the sides."""
        given = {end: field for end, field in enumerate(self.fields[2 * axis : 2 * axis + 2]) if field is not None}
        if not given:
            return {}
        values = jnp.stack(each(list(given.values()), lambda field: field.normal(share)))
        return dict(zip(given, jax.vmap(upright)(values, along[np.array(list(given))]), strict=True))

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().point(u, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return self.prepared().grid_points(u, v)


@register
class TangentSurface(AbstractBentSurface):
    """A surface with its boundary curves, bent so that it is tangent to planes along some of its sides.

    Made by `js.tangent_to`. fields: normals along the sides u = first, u = last, v = first, v = last, or None. operator:
    "scaling" (F), "hermite" (H), "gregory" (H without corner conditions) or "blend" (F where its rows behave, H elsewhere).
    Source: Jōnishi, Yajima (paper 000), sections 4 and 5; H adds multiples of the normals by cubic Hermite weights.
    """

    def prepared(self) -> Any:
        whole = TangentSurface(self.surface.prepared(), prepare(self.fields), self.operator)
        ribbons = ribbons_of(whole.surface)
        if self.operator in ("hermite", "gregory"):
            return HermiteSurface(whole, ribbons, whole._twists(ribbons))
        return ScaledSurface(whole, ribbons, whole._edge_maps(ribbons))

    def corners(self, ribbons: AbstractRibbons) -> dict[tuple[int, int], Corner]:
        """The corners between sides with fields, inside traced code."""
        pairs = [(i, j) for i, j in CORNERS if self.fields[i] is not None and self.fields[2 + j] is not None]
        if not pairs:
            return {}
        first, second = (x.reshape(4, *x.shape[2:]) for x in ribbons.corners(self.dtype))
        ends = jnp.arange(2, dtype=self.dtype)
        known = {}
        given = {side: field for side, field in enumerate(self.fields) if field is not None}
        both = lambda field: jax.vmap(lambda t: value_and_slope(field.normal, t))(ends)
        values = jax.tree.map(lambda *x: jnp.stack(x), *each(list(given.values()), both))
        at = np.array([[CORNERS.index((k, end) if k < 2 else (end, k - 2)) for end in (0, 1)] for k in given])
        along = np.array([[1 if k < 2 else 0] * 2 for k in given])
        turn = lambda m, x: jax.jvp(upright, (m[0], x[0]), (m[1], x[1]))
        turned = jax.vmap(jax.vmap(turn))(values, (first[at, along], second[at, along, along]))
        for row, side in enumerate(given):
            known[side] = tuple(x[row] for x in turned)
        found = {}
        for i, j in pairs:
            at = CORNERS.index((i, j))
            (n, by_v), (other, by_u) = [tuple(x[end] for x in known[side]) for side, end in ((i, j), (2 + j, i))]
            sign = jnp.where(jax.lax.stop_gradient(n @ other) < 0, -1.0, 1.0)
            found[i, j] = Corner(first[at], second[at], jnp.stack([n, sign * other]), jnp.stack([by_v, sign * by_u]))
        return found

    def _twists(self, ribbons: AbstractRibbons) -> Float[Array, "2 2 2 3"]:
        """ρ n and ρ̃ n at every corner, 0 where no two fields meet."""
        found = self.corners(ribbons)
        none = jnp.zeros((2, 3), self.dtype)
        of = lambda at: jnp.stack(found[at].rho)[:, None] * found[at].normals[:1] if at in found else none
        twists = {(i, j): weighted(of((i, j)), self.fields[i], self.fields[2 + j]) for i, j in CORNERS}
        return jnp.stack([twists[at] for at in CORNERS]).reshape(2, 2, 2, 3)

    def _edge_maps(self, ribbons: AbstractRibbons) -> Any:
        """Of the maps along u at both ends of v: the maps, and their changes by v; None where only one direction is bent."""
        if not (self.bent(0) and self.bent(1)):
            return None
        ends = jnp.arange(2, dtype=self.dtype)
        return jax.vmap(lambda end: value_and_slope(lambda t: self.line(ribbons, 0, t).map(self.operator), end))(ends)

    def line(self, ribbons: AbstractRibbons, axis: int, share: Float[Array, ""], maps: Any = None) -> "Line":
        """What F and H need of the line across axis 0 at a share of v, or across axis 1 at a share of u.

        maps: those that have bent the surface before, at both ends, and their changes across.
        """
        points, across, along = ribbons.sides(axis, share)
        if maps is not None:
            move = lambda m, x: jax.jvp(lambda ready, y: ready(y, share), (m[0], x[0]), (m[1], x[1]))[1]
            across = jax.vmap(move)(maps, (points, across))
        own = unit(jnp.cross(across, along) if axis == 0 else jnp.cross(along, across))
        given = self.normals(axis, share, along)
        weights = [None if field is None else field.weight for field in self.fields[2 * axis : 2 * axis + 2]]
        there = [alike(given[k], own[k]) if k in given else own[k] for k in (0, 1)]
        there = [n if w is None else w * n + (1 - w) * own[k] for k, (n, w) in enumerate(zip(there, weights, strict=True))]
        normals = jnp.stack(there)
        return Line(points, across, own, normals, unit(points[1] - points[0]), (0 in given, 1 in given))


class Line(eqx.Module):
    """A line across a surface: ends, derivatives across there, unit normals of the surface and those that are to be there,
    the unit direction of its chord, and at which ends a normal is given."""

    points: Float[Array, "2 3"]
    across: Float[Array, "2 3"]
    own: Float[Array, "2 3"]
    normals: Float[Array, "2 3"]
    e: Float[Array, "3"]
    given: tuple[bool, bool] = eqx.field(static=True)

    @property
    def pulls(self) -> Float[Array, "2 3"]:
        """⟨S', M⟩ M at either end, 0 where no normal is given."""
        pull = lambda k: (self.across[k] @ self.normals[k]) * self.normals[k] * float(self.given[k])
        return jnp.stack([pull(0), pull(1)])

    @property
    def below(self) -> Float[Array, "2"]:
        """The denominators of μ₁ and μ₂, the left sides of (4.14)."""
        # ⟨X × e, N × M⟩ = ⟨X, N⟩⟨e, M⟩ − ⟨X, M⟩⟨e, N⟩
        pair = [jnp.stack([self.own[1], self.normals[0]]), self.normals]
        (x_n, x_m), (e_n, e_m) = ([jnp.sum(x * y, axis=-1) for y in pair] for x in (self.across, self.e[None]))
        return x_n * e_m - x_m * e_n

    def scaling(self) -> LineMap:
        """Operator F."""
        pulled = jnp.sum(self.across * self.normals, axis=1) * jnp.asarray(self.given, self.e.dtype)
        mu = divide(pulled, self.below)
        return LineMap(self.points[1], self.e, self.own[1], self.normals[0], mu, self.pulls, jnp.ones((), mu.dtype))

    def map(self, operator: str) -> LineMap:
        """Operator "scaling" (F), or its "blend" with H."""
        found = self.scaling()
        return found if operator == "scaling" else eqx.tree_at(lambda m: m.share, found, self.share_of_scaling(found))

    def like_this(self, x: float) -> Float[Array, "3"]:
        """The point at x of the cubic with the line's ends and end slopes."""
        rise = x * x * (3 - 2 * x)
        bent = hermite_weight(0, x) * self.across[0] + hermite_weight(1, x) * self.across[1]
        return (1 - rise) * self.points[0] + rise * self.points[1] + bent

    def share_of_scaling(self, scaling: LineMap) -> Float[Array, ""]:
        """1 where F behaves, 0 near rows where its denominator vanishes: both keep the planes, and so does any mixture.

        1/γ = (4/27) |denominator| / max |[N; X_h]| over the cubic X_h like the line; the share is smoothstep(6 (1/γ − 1/3)).
        """
        total = jnp.ones((), self.e.dtype)
        rows = [self.like_this(x) - self.points[1] for x in (0.2, 0.4, 0.6, 0.8)]
        for given, below, normal in zip(self.given, self.below, (scaling.own, scaling.first), strict=True):
            if given:
                largest = jnp.max(jnp.stack([norm(_bracket(normal, x, self.e)) for x in rows]))
                x = jnp.clip(6 * (4 / 27 * divide(jnp.abs(below), largest) - 1 / 3), 0, 1)
                total = total * x * x * (3 - 2 * x)
        return total


class HermiteSurface(AbstractSurface):
    """A `TangentSurface` by operator H: S less multiples of the given normals near each side."""

    whole: TangentSurface
    ribbons: AbstractRibbons
    twists: Float[Array, "2 2 2 3"]

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.whole.domain

    def prepared(self) -> "HermiteSurface":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        s, t = shares_of(u, v, self.domain)
        total = self.whole.surface.point(u, v)
        for axis, (along, across) in enumerate(((t, s), (s, t))):
            for end, pull in self._pulls(axis, along).items():
                total = total - hermite_weight(end, across) * pull
        weights = _weights(s)[:, None] * _weights(t)[None, :]
        for share, twists in zip(self._gregory(s, t), (0, 1), strict=True):
            total = total + share * jnp.sum(weights[..., None] * self.twists[:, :, twists], axis=(0, 1))
        return total

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        s, t = shares_of(u, v, self.domain)
        total = self.whole.surface.grid_points(u, v)
        by = (
            [hermite_weight(end, s)[:, None, None] for end in (0, 1)],
            [hermite_weight(end, t)[None, :, None] for end in (0, 1)],
        )
        for end, pull in jax.vmap(lambda y: self._pulls(0, y))(t).items():
            total = total - by[0][end] * pull[None]
        for end, pull in jax.vmap(lambda x: self._pulls(1, x))(s).items():
            total = total - by[1][end] * pull[:, None]
        shares = self._gregory(s[:, None], t[None, :])
        for which, share in enumerate(shares[: 1 if self.whole.operator == "hermite" else 2]):
            bent = jnp.einsum("abx,kb->akx", self.twists[:, :, which], jax.vmap(_weights)(t), precision="highest")
            bent = sum(by[0][end] * bent[end][None] for end in (0, 1))
            total = total + (bent if share.ndim == 0 else share[..., None] * bent)
        return total

    def _pulls(self, axis: int, share: Float[Array, ""]) -> dict[int, Float[Array, "3"]]:
        """⟨S_x, M⟩ M on the sides across an axis that have fields."""
        if not self.whole.bent(axis):
            return {}
        _, across, along = self.ribbons.sides(axis, share)
        normals = self.whole.normals(axis, share, along)
        pull = lambda end, normal: weighted((across[end] @ normal) * normal, self.whole.fields[2 * axis + end])
        return {end: pull(end, normal) for end, normal in normals.items()}

    def _gregory(self, s: Any, t: Any) -> tuple[Any, Any]:
        """How much ρ and ρ̃ count: ρ alone, or b : a where a = s(1 − s), b = t(1 − t), half each at corners."""
        if self.whole.operator == "hermite":
            return jnp.ones((), self.dtype), jnp.zeros((), self.dtype)
        a, b = s * (1 - s), t * (1 - t)
        corner = a + b == 0
        share = jnp.where(corner, 0.5, b / jnp.where(corner, 1, a + b))
        return 1 - share, share


class ScaledSurface(AbstractSurface):
    """A `TangentSurface` by operator F, or its blend with H: lines along u are mapped, and then those along v."""

    whole: TangentSurface
    ribbons: AbstractRibbons
    edge_maps: Any

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return self.whole.domain

    def prepared(self) -> "ScaledSurface":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        s, t = shares_of(u, v, self.domain)
        along, across = self._map(0, t), self._map(1, s)
        x = self.whole.surface.point(u, v)
        if along is not None:
            x = along(x, s)
        return x if across is None else across(x, t)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        s, t = shares_of(u, v, self.domain)
        rows, columns = jax.vmap(lambda y: self._map(0, y))(t), jax.vmap(lambda x: self._map(1, x))(s)
        total = self.whole.surface.grid_points(u, v)
        for maps, places, at in ((rows, s[:, None, None], np.s_[None, :]), (columns, t[None, :, None], np.s_[:, None])):
            if maps is not None:
                stretch, g, e, constant, pulls = _held(jax.vmap(LineMap.affine)(maps))
                along = sum(g[..., j : j + 1][at] * total[..., j : j + 1] for j in range(3))
                total = stretch[..., None][at] * total - e[at] * along + constant[at]
                if self.whole.operator != "scaling":
                    total = total - sum(hermite_weight(end, places) * pulls[:, end][at] for end in (0, 1))
        return total

    def line(self, axis: int, share: Float[Array, ""]) -> Line:
        """The line along u at a share of v, or that along v at a share of u on the surface that the first maps have made."""
        return self.whole.line(self.ribbons, axis, share, self.edge_maps if axis == 1 else None)

    def _map(self, axis: int, share: Float[Array, ""]) -> LineMap | None:
        """The map of a line, None where neither end has a field."""
        if not self.whole.bent(axis):
            return None
        return self.line(axis, share).map(self.whole.operator)


def _held(rows: Any) -> Any:
    """Arrays by lines as they are, by way of a product with 1: compilers keep products, and work sums out at every point."""
    leaves, structure = jax.tree.flatten(rows)
    flat = [leaf.reshape(len(leaf), -1) for leaf in leaves]
    ends = np.cumsum([leaf.shape[1] for leaf in flat])
    table = jnp.concatenate(flat, axis=1)
    table = jnp.matmul(table, jnp.eye(table.shape[1], dtype=table.dtype), precision="highest")
    parts = jnp.split(table, ends[:-1], axis=1)
    return jax.tree.unflatten(structure, [part.reshape(leaf.shape) for part, leaf in zip(parts, leaves, strict=True)])


def weighted(x: Any, *fields: AbstractEdgeField | None) -> Any:
    """x times the weights of fields."""
    for field in fields:
        x = x if field is None or field.weight is None else field.weight * x
    return x


def _bracket(m: Float[Array, "3"], x: Float[Array, "3"], e: Float[Array, "3"]) -> Float[Array, "3"]:
    """[M; X] = M × (X × e) = X⟨M, e⟩ − e⟨M, X⟩."""
    return x * (m @ e) - e * (m @ x)


def alike(normal: Float[Array, "3"], other: Float[Array, "3"]) -> Float[Array, "3"]:
    """The normal, or its negative, that points to the side of another one."""
    return jnp.where(jax.lax.stop_gradient(normal @ other) < 0, -normal, normal)


def upright(normal: Float[Array, "3"], along: Float[Array, "3"]) -> Float[Array, "3"]:
    """The unit normal of the nearest plane that holds a direction."""
    along = unit(along)
    return unit(normal - (normal @ along) * along)


def _weights(x: Float[Array, ""]) -> Float[Array, "2"]:
    return jnp.stack([hermite_weight(end, x) for end in (0, 1)])


@breaks.register(AbstractBentSurface)
def _(shape: AbstractBentSurface) -> tuple[Any, Any]:
    return breaks(shape.surface)


@breaks.register(HermiteSurface)
@breaks.register(ScaledSurface)
def _(shape: Any) -> tuple[Any, Any]:
    return breaks(shape.whole)
