"""Fields of normals turned as little as possible, so that the planes of all sides fit together at corners."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, is_concrete, map_points
from .._errors import InputError
from .._prepared import prepare
from .._registry import register
from .._safe import angle, arctan2, unit
from ..surface import AbstractSurface
from ._edge_fields import AbstractEdgeField, given_fields
from ._guides import carried, value_and_slope
from ._ribbons import SIDES, AbstractRibbon, hermite_weight, ribbon_of, ribbons_of
from ._tangency_facts import shares
from ._tangent_surface import TangentSurface, alike, upright

# ∫ of products of the cubic Hermite functions on [0, 1]: slopes by slopes, and slopes by values
_MASS = np.array([[1 / 105, -1 / 140], [-1 / 140, 1 / 105]])
_COUPLING = np.array([[11 / 210, 13 / 420], [-13 / 420, -11 / 210]])


@register
class MendedField(AbstractEdgeField):
    """Normals along a side of a surface, turned about the side's tangent by a cubic angle; a function of the parameter.

    Made by `js.make_compatible`. values, slopes: (2,), the angle at both ends of the side and its derivatives by the share.
    """

    surface: AbstractSurface
    field: AbstractEdgeField
    values: Float[Array, "2"]
    slopes: Float[Array, "2"]
    side: str = eqx.field(static=True)

    @property
    def domain(self) -> tuple[Any, Any]:
        """First and last parameter along the side."""
        return self.surface.domain[1 if self.side[0] == "u" else 0]

    def __call__(self, t: Numbers) -> Float[Array, "*batch 3"]:
        """Unit normals at parameters along the side."""
        return map_points(_normal, self, carried(as_float(t, self.surface.dtype), self.domain, (0.0, 1.0)))

    def prepared(self) -> "PreparedMendedField":
        ribbon = ribbon_of(self.surface.prepared(), *divmod(SIDES.index(self.side), 2))
        return PreparedMendedField(ribbon, self.field.prepared(), self.values, self.slopes)

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        return self.prepared().normal(share)


class PreparedMendedField(AbstractEdgeField):
    """A `MendedField` by the ribbon of its side."""

    ribbon: AbstractRibbon
    field: AbstractEdgeField
    values: Float[Array, "2"]
    slopes: Float[Array, "2"]

    def normal(self, share: Float[Array, ""]) -> Float[Array, "3"]:
        along = value_and_slope(lambda t: self.ribbon.at(t)[0], share)[1]
        normal = upright(self.field.normal(share), along)
        rise = share * share * (3 - 2 * share)
        turn = (1 - rise) * self.values[0] + rise * self.values[1]
        turn = turn + hermite_weight(0, share) * self.slopes[0] + hermite_weight(1, share) * self.slopes[1]
        return jnp.cos(turn) * normal + jnp.sin(turn) * jnp.cross(unit(along), normal)


def _normal(field: AbstractEdgeField, share: Float[Array, ""]) -> Float[Array, "3"]:
    return field.normal(share)


class MendedFields(dict[str, MendedField]):
    """Fields of normals by side, for `js.tangent_to(surface, **fields)`.

    moved: by how much each was turned at most, radians.
    """

    moved: dict[str, Any]

    def __init__(self, fields: dict[str, MendedField], moved: dict[str, Any]):
        super().__init__(fields)
        self.moved = moved


def make_compatible(
    surface: AbstractSurface, *, u0: Any = None, u1: Any = None, v0: Any = None, v1: Any = None
) -> MendedFields:
    """Turn fields of normals as little as possible, so that `js.tangent_to` can meet the planes of all sides at once.

    u0, u1, v0, v1: as for `js.tangent_to`. Each normal is laid across its side, (4.3), and turned about the side's tangent
    by a cubic angle a(t): at the ends to the surface's own normal there, (4.4) and (5.4), with slopes such that (5.7) to
    (5.10) hold at every corner of two given sides and Σ ∫ a² is least. Returns the fields by side, functions of the
    parameter; `.moved` has by how much each was turned at most, radians. Raises `InputError` for what gives no normals.
    Source: Jōnishi, Yajima (paper 000), section 5.
    """
    given = {"u0": u0, "u1": u1, "v0": v0, "v1": v1}
    fields = given_fields(surface, given)
    values, slopes, moved = _mended(surface, fields)
    if is_concrete(moved) and not np.all(np.isfinite(moved)):
        side = SIDES[int(np.argmin(np.isfinite(moved)))]
        raise InputError(
            f"`{side}` must give finite normals of length > 0 all along the side, across its curve; it does not."
        )
    kept = {k: field for k, field in enumerate(fields) if field is not None}
    made = {SIDES[k]: MendedField(surface, field, values[k], slopes[k], SIDES[k]) for k, field in kept.items()}
    return MendedFields(made, {SIDES[k]: float(moved[k]) if is_concrete(moved) else moved[k] for k in kept})


@eqx.filter_jit
def _mended(
    surface: AbstractSurface, fields: tuple[AbstractEdgeField | None, ...]
) -> tuple[Float[Array, "4 2"], Float[Array, "4 2"], Float[Array, "4"]]:
    """The angles at the ends of the sides, their slopes, and the largest angle to the given normals."""
    ready = surface.prepared()
    dtype = surface.dtype
    ends = jnp.arange(2, dtype=dtype)
    ribbons = ribbons_of(ready)
    first, _ = ribbons.corners(dtype)
    own = unit(jnp.cross(first[..., 0, :], first[..., 1, :]))
    values = jnp.zeros((4, 2), dtype)
    for side, field in enumerate(fields):
        if field is None:
            continue
        axis, end = divmod(side, 2)
        along, wanted = (first[end, :, 1], own[end]) if axis == 0 else (first[:, end, 0], own[:, end])
        normals = jax.vmap(upright)(jax.vmap(field.prepared().normal)(ends), along)
        wanted = jax.vmap(alike)(wanted, normals)
        beside = jnp.cross(unit(along), normals)
        values = values.at[side].set(arctan2(jnp.sum(wanted * beside, axis=1), jnp.sum(wanted * normals, axis=1)))
    turned = lambda slopes: tuple(
        None if field is None else MendedField(surface, field, values[side], slopes[side], SIDES[side])
        for side, field in enumerate(fields)
    )
    corners = TangentSurface(ready, prepare(turned(jnp.zeros((4, 2), dtype))), "gregory").corners(ribbons)
    inverse = jnp.asarray(np.kron(np.eye(4), np.linalg.inv(_MASS)), dtype)
    slopes = -inverse @ (jnp.asarray(np.kron(np.eye(4), _COUPLING), dtype) @ values.reshape(-1))
    rows, lacks = [jnp.zeros((0, 8), dtype)], [jnp.zeros(0, dtype)]
    for (i, j), corner in corners.items():
        rho, other = corner.rho
        beside = lambda k, corner=corner: jnp.cross(unit(corner.first[1 - k]), corner.normals[k])
        row = jnp.zeros(8, dtype).at[2 * (2 + j) + i].set(corner.first[1] @ beside(1))
        rows.append(row.at[2 * i + j].set(-corner.first[0] @ beside(0))[None])
        lacks.append((other - rho)[None])
    conditions = jnp.concatenate(rows)
    lack = jnp.concatenate(lacks) + conditions @ slopes
    spread = inverse @ conditions.T
    # a corner that is a point has no condition: its row is zero
    square = conditions @ spread
    empty = jnp.diag(square) == 0
    slopes = slopes - spread @ jnp.linalg.solve(square + jnp.diag(empty.astype(dtype)), jnp.where(empty, 0, lack))
    slopes = slopes.reshape(4, 2)
    return values, slopes, _turned(fields, turned(slopes), dtype)


def _turned(given: Any, mended: Any, dtype: Any) -> Float[Array, "4"]:
    """The largest angles between given and mended normals."""
    at, moved = shares(dtype), jnp.zeros(4, dtype)
    for side, (one, other) in enumerate(zip(given, mended, strict=True)):
        if one is not None:
            was, now = (jax.vmap(field.prepared().normal)(at) for field in (one, other))
            moved = moved.at[side].set(jnp.max(angle(jax.vmap(alike)(was, now), now)))
    return moved
