"""Surfaces bent so that they touch given planes along their sides and have given curvatures across them."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._prepared import prepare
from .._registry import register
from .._safe import divide, norm, unit
from ._guides import shares_of, value_and_slope, with_two_slopes
from ._ribbons import AbstractRibbons, ribbons_of
from ._tangent_surface import AbstractBentSurface, weighted

OPERATORS = ("hermite", "gregory")


@register
class CurvedSurface(AbstractBentSurface):
    """A surface bent so that along some sides it is tangent to planes and has given normal curvatures across, G2.

    Made by `js.tangent_to` with `order=2`. fields: normals with curvatures along the sides u = first, u = last, v = first,
    v = last, or None. operator: "hermite" (lines along u, then those along v) or "gregory" (both orders, each where it is
    exact, so that no condition at corners is needed; where they fail, second derivatives at a corner depend on the
    direction). Quintic weights with one slope or one second derivative of 1 carry the normal parts of S_u and S_uu; S_u and
    S_uu go to the plane and to the normal curvature of the target.
    """

    def prepared(self) -> "PreparedCurvedSurface":
        ready = self.surface.prepared()
        bare = PreparedCurvedSurface(ready, prepare(self.fields), self.operator, ribbons_of(ready), (None, None))
        tables = tuple(bare.at_corners(axis, None) if bare.bent(axis) and bare.bent(1 - axis) else None for axis in (0, 1))
        return PreparedCurvedSurface(ready, bare.fields, self.operator, bare.ribbons, tables)


class PreparedCurvedSurface(AbstractBentSurface):
    """A `CurvedSurface` by the ribbons of its sides.

    tables: for each axis the rows of its first step at both ends of the sides, with two derivatives, (orders, ends, 4, 3).
    """

    ribbons: AbstractRibbons
    tables: tuple[Float[Array, "3 2 4 3"] | None, ...]

    def prepared(self) -> "PreparedCurvedSurface":
        return self

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        s, t = shares_of(u, v, self.domain)
        total = self.surface.point(u, v)
        for axis, (along, across) in enumerate(((t, s), (s, t))):
            for counted, rows in zip(self._counted(axis, s, t), self.rows(axis, along), strict=True):
                total = total - counted * jnp.sum(weights(across)[:, None] * rows, axis=0)
        return total

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        s, t = shares_of(u, v, self.domain)
        total = self.surface.grid_points(u, v)
        for axis, (along, across) in enumerate(((t, s), (s, t))):
            all_rows = jax.vmap(lambda x, axis=axis: self.rows(axis, x))(along)
            by = jax.vmap(weights)(across)
            for counted, rows in zip(self._counted(axis, s[:, None], t[None, :]), all_rows, strict=True):
                bent = jnp.einsum("aw,bwx->abx" if axis == 0 else "aw,bwx->bax", by, rows, precision="highest")
                total = total - jnp.broadcast_to(counted, total.shape[:2])[..., None] * bent
        return total

    def at_corners(self, axis: int, table: Float[Array, "3 2 4 3"] | None) -> Float[Array, "3 2 4 3"]:
        """The rows of a step across an axis at both ends of its sides, and two derivatives by the share."""
        ends = jnp.arange(2, dtype=self.dtype)
        return jnp.stack(jax.vmap(lambda end: with_two_slopes(lambda x: self.step(axis, x, table), end))(ends))

    def rows(self, axis: int, share: Float[Array, ""]) -> list[Float[Array, "4 3"]]:
        """Those of the steps across an axis that count: on the surface as it is, and after the other axis's step."""
        other = self.tables[1 - axis]
        if not self.bent(axis):
            return []
        if other is None:
            return [self.step(axis, share, None)]
        if self.operator == "hermite":
            return [self.step(axis, share, other if axis else None)]
        both = jax.vmap(lambda table: self.step(axis, share, table))(jnp.stack([jnp.zeros_like(other), other]))
        return [both[0], both[1]]

    def step(self, axis: int, share: Float[Array, ""], table: Float[Array, "3 2 4 3"] | None) -> Float[Array, "4 3"]:
        """What is taken away across an axis, as multiples of `weights`, from the surface less what `table` says."""
        planes = lambda t: self._planes(axis, t, table)
        normals, turning, (along, across, second) = jax.jvp(planes, (share,), (jnp.ones_like(share),), has_aux=True)
        speed = norm(along)
        t = unit(along)
        b = jnp.cross(normals, t)
        dot = lambda x, y: jnp.sum(x * y, axis=-1)
        x_t, x_b = dot(across, t), dot(across, b)
        kept = self.fields[2 * axis : 2 * axis + 2]
        curvatures = jnp.stack([jnp.zeros((), self.dtype) if f is None else f.curvature(share) for f in kept])
        wanted = x_b * x_b * curvatures - divide(x_t * x_t * dot(turning, t) + 2 * x_t * x_b * dot(turning, b), speed)
        held = jnp.stack([weighted(jnp.ones((), self.dtype), field) for field in kept])
        found = jnp.concatenate([held * dot(across, normals), held * (dot(second, normals) - wanted)])
        return found[:, None] * jnp.concatenate([normals, normals])

    def _planes(self, axis: int, share: Float[Array, ""], table: Any) -> tuple[Array, tuple[Array, Array, Array]]:
        """Unit normals at both sides across an axis, 0 where none are given; derivatives along, across and twice so."""
        _, across, along = self.ribbons.sides(axis, share)
        second = self.ribbons.bends(axis, share)
        if table is not None:
            by, slopes = value_and_slope(weights, share)
            taken = lambda weight, rows: jnp.sum(weight[None, :, None] * rows, axis=1)
            along = along - taken(slopes, table[0])
            across, second = across - taken(by, table[1]), second - taken(by, table[2])
        given = self.normals(axis, share, along)
        normals = jnp.stack([given[end] if end in given else jnp.zeros(3, self.dtype) for end in (0, 1)])
        return normals, (along, across, second)

    def _counted(self, axis: int, s: Any, t: Any) -> list[Any]:
        """How much each of `rows` counts."""
        if not self.bent(axis):
            return []
        if self.tables[1 - axis] is None or self.operator == "hermite":
            return [jnp.ones((), self.dtype)]
        a, b = s * (1 - s), t * (1 - t)
        # of the step across u after that across v; half at corners
        last = jnp.where(a + b == 0, 0.5, divide(b * b, a * a + b * b))
        return [1 - last, last] if axis == 0 else [last, 1 - last]


def weights(t: Float[Array, ""]) -> Float[Array, "4"]:
    """Quintics with derivative 1 at 0 and at 1, and with second derivative 1 there; all else at both ends is 0."""
    r = 1 - t
    return jnp.stack([t * r**3 * (1 + 3 * t), -r * t**3 * (1 + 3 * r), 0.5 * t * t * r**3, 0.5 * t**3 * r * r])
