"""What is measured on the sides, lines and corners of a surface before it is bent to given planes, and after."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._prepared import prepare
from .._safe import angle, divide, norm, unit
from ..differential._partials import Partials2, second_partials_at
from ..surface import AbstractSurface
from ._curved_surface import CurvedSurface
from ._edge_fields import curvature_across
from ._guides import carried, value_and_slope
from ._ribbons import SIDES, hermite_weight, ribbons_of
from ._tangent_surface import AbstractBentSurface, Corner, Line, ScaledSurface, TangentSurface, alike, upright

SAMPLES = 33
_INSIDE = (0.2, 0.4, 0.6, 0.8)
SINGULAR = 1e-6
"""Left sides of (4.14), for unit vectors, below which F is not defined."""

_WILD = 2.5  # how far F may move a line, next to H


class SideFacts(NamedTuple):
    """Of one side at even shares: its points, derivatives along and across, the surface's normal, the given one."""

    point: Float[Array, "n 3"]
    along: Float[Array, "n 3"]
    across: Float[Array, "n 3"]
    own: Float[Array, "n 3"]
    given: Float[Array, "n 3"]


class LineFacts(NamedTuple):
    """Of the lines across one axis: ⟨e, N⟩ of (4.13) and the left sides of (4.14) for unit vectors, at ends with a normal;
    sines of the angles to the given planes there; k₁ and k₂; how far F and H move the cubic like the line at most; k' at
    both ends."""

    chord_slope: Float[Array, "n 2"]
    below: Float[Array, "n 2"]
    pulled: Float[Array, "n 2"]
    k: Float[Array, "n 2"]
    by_scaling: Float[Array, "n"]
    by_hermite: Float[Array, "n"]
    slopes_of_k: Float[Array, "2 2"]

    @property
    def behave(self) -> Bool[Array, "n"]:
        """Whether F is defined on a line, moves it not much further than H does and turns nothing round."""
        few = 1e-9 * jnp.max(self.by_hermite) + 1e-13
        near = (self.by_scaling <= _WILD * self.by_hermite + few) & (jnp.min(self.k, axis=1) > 0)
        return near & ~jnp.any(self.singular, axis=1)

    @property
    def singular(self) -> Bool[Array, "n 2"]:
        """Where (4.14) fails and the plane is not the surface's own."""
        return (jnp.abs(self.below) < SINGULAR) & (self.pulled > 1e-9)


def shares(dtype: Any) -> Float[Array, "n"]:
    """Where sides are sampled."""
    return jnp.linspace(0, 1, SAMPLES, dtype=dtype)


@eqx.filter_jit
def side_facts(shape: TangentSurface) -> tuple[dict[str, SideFacts], dict[tuple[int, int], Corner]]:
    """All sides with fields, and the corners between them."""
    ribbons = ribbons_of(shape.surface.prepared())
    at = shares(shape.dtype)
    sides = {}
    for axis in (0, 1):
        points, across_all, along_all = jax.vmap(lambda t, axis=axis: ribbons.sides(axis, t))(at)
        for end in (0, 1):
            field = shape.fields[2 * axis + end]
            if field is not None:
                across, along = across_all[:, end], along_all[:, end]
                own = unit(jnp.cross(across, along) if axis == 0 else jnp.cross(along, across))
                given = unit(jax.vmap(prepare(field).normal)(at))
                sides[SIDES[2 * axis + end]] = SideFacts(points[:, end], along, across, own, given)
    return sides, shape.corners(ribbons)


@eqx.filter_jit
def line_facts(shape: AbstractBentSurface) -> dict[int, LineFacts]:
    """Of the lines across both axes that have fields; those across the second one on what F has made of the first."""
    ready: ScaledSurface = TangentSurface(shape.surface, shape.fields, "scaling").prepared()
    at = shares(shape.dtype)
    found = {}
    for axis in (0, 1):
        if any(field is not None for field in shape.fields[2 * axis : 2 * axis + 2]):
            read = lambda t, axis=axis: _of_line(ready.line(axis, t))
            values = jax.vmap(read)(at)
            slope = lambda t, read=read: value_and_slope(lambda x: read(x)["k"], t)[1]
            found[axis] = LineFacts(**values, slopes_of_k=jax.vmap(slope)(at[np.array([0, -1])]))
    return found


def _of_line(line: Line) -> dict[str, Array]:
    scaling = line.scaling()
    counted = jnp.stack([scaling.own, scaling.first])
    lengths = jnp.maximum(norm(line.across), jnp.finfo(line.e.dtype).tiny)
    below = line.below / lengths
    pulled = norm(line.pulls) / lengths
    factors = 1 + scaling.mu * (counted @ line.e)
    moved = []
    for place in _INSIDE:
        x, share = line.like_this(place), jnp.asarray(place, line.e.dtype)
        bent = eqx.tree_at(lambda m: m.share, scaling, jnp.zeros((), line.e.dtype))
        moved.append((norm(scaling(x, share) - x), norm(bent(x, share) - x)))
    most = [jnp.max(jnp.stack(sizes)) for sizes in zip(*moved, strict=True)]
    names = ("chord_slope", "below", "pulled", "k", "by_scaling", "by_hermite")
    return dict(zip(names, (counted @ line.e, below, pulled, factors, *most), strict=True))


class Outcome(NamedTuple):
    """Angles between the surface and the given planes along the sides, before and after; the largest displacement."""

    before: dict[str, Float[Array, "n"]]
    after: dict[str, Float[Array, "n"]]
    moved: Float[Array, ""]


@eqx.filter_jit
def outcome(shape: TangentSurface) -> Outcome:
    """Of the surface as it is bent."""
    bent = shape.prepared()
    base, before = bent.whole.surface, bent.ribbons
    after = ribbons_of(bent)
    at = shares(shape.dtype)

    def angles(axis: int, share: Float[Array, ""]) -> dict[str, tuple[Array, Array]]:
        was, now = before.sides(axis, share), after.sides(axis, share)
        normals = bent.whole.normals(axis, share, was[2])
        off = lambda x, end, normal: plane_angle(x[1][end], x[2][end], normal)
        both = lambda end, normal: (off(was, end, normal), off(now, end, normal))
        return {SIDES[2 * axis + end]: both(end, normal) for end, normal in normals.items()}

    both = {name: pair for axis in (0, 1) for name, pair in jax.vmap(lambda t, a=axis: angles(a, t))(at).items()}
    return Outcome({k: x[0] for k, x in both.items()}, {k: x[1] for k, x in both.items()}, _moved(bent, base))


class CurvedOutcome(NamedTuple):
    """Along the sides: angles to the given planes before and after, the given curvatures across, how far those of the
    surface are off before and after; the largest displacement."""

    before: dict[str, Float[Array, "n"]]
    after: dict[str, Float[Array, "n"]]
    wanted: dict[str, Float[Array, "n"]]
    bend_before: dict[str, Float[Array, "n"]]
    bend_after: dict[str, Float[Array, "n"]]
    moved: Float[Array, ""]


@eqx.filter_jit
def curved_outcome(shape: CurvedSurface) -> CurvedOutcome:
    """Of the surface as it is bent, by its second derivatives along the sides, not at corners: there those of Gregory's form
    depend on the direction."""
    bent, at = shape.prepared(), 0.01 + 0.98 * shares(shape.dtype)
    found: dict[str, Any] = {}
    for side, field in enumerate(bent.fields):
        if field is None:
            continue
        axis, end = divmod(side, 2)
        along = carried(at, (0.0, 1.0), shape.domain[1 - axis])
        across = jnp.full_like(at, shape.domain[axis][end])
        u, v = (across, along) if axis == 0 else (along, across)
        was, now = (jax.vmap(lambda s, t, x=x: second_partials_at(x, s, t))(u, v) for x in (bent.surface, bent))
        tangent = now.v if axis == 0 else now.u
        normal = jax.vmap(upright)(jax.vmap(field.normal)(at), tangent)
        wanted = jax.vmap(field.curvature)(at)
        off = [jax.vmap(plane_angle)(p.u, p.v, normal) for p in (was, now)]
        bends = [jnp.abs(_curvature_across(p, axis, normal) - wanted) for p in (was, now)]
        found[SIDES[side]] = (*off, wanted, *bends)
    before, after, wanted, bend_before, bend_after = ({name: row[k] for name, row in found.items()} for k in range(5))
    return CurvedOutcome(before, after, wanted, bend_before, bend_after, _moved(bent, bent.surface))


def _curvature_across(p: Partials2, axis: int, normal: Float[Array, "n 3"]) -> Float[Array, "n"]:
    """The normal curvature in the direction across a side, by normals on the side of the given ones."""
    own = jax.vmap(alike)(unit(jnp.cross(p.u, p.v)), normal)
    along, across, twice_along, twice_across = (p.v, p.u, p.vv, p.uu) if axis == 0 else (p.u, p.v, p.uu, p.vv)
    return jax.vmap(curvature_across)(own, along, across, twice_along, p.uv, twice_across)


def _moved(one: AbstractSurface, other: AbstractSurface) -> Float[Array, ""]:
    """The largest distance of two surfaces over one domain on a grid of equal parameters."""
    at = shares(one.dtype)[::2]
    u, v = (carried(at, (0.0, 1.0), ends) for ends in one.domain)
    return jnp.max(norm(one.grid_points(u, v) - other.grid_points(u, v)))


@eqx.filter_jit
def curved_ends(shape: CurvedSurface) -> tuple[Float[Array, "2 2 4"], Float[Array, "3 2 4"]]:
    """Lengths of the rows of the first step across both axes at the ends of the sides: what boundary curves cannot follow;
    and those of the second step across v at the ends, with derivatives: what "hermite" leaves to sides of u."""
    bent = shape.prepared()
    ends = jnp.arange(2, dtype=shape.dtype)
    first = jnp.stack([jax.vmap(lambda t, a=axis: norm(bent.step(a, t, None)))(ends) for axis in (0, 1)])
    if bent.tables[0] is None:
        return first, jnp.zeros((3, 2, 4), shape.dtype)
    return first, norm(bent.at_corners(1, bent.tables[0]))


def plane_angle(one: Float[Array, "3"], other: Float[Array, "3"], normal: Float[Array, "3"]) -> Float[Array, ""]:
    """The angle in [0, π/2] between the plane of two derivatives and that of a normal; 0 where the former is none."""
    own = jnp.cross(one, other)
    least = 1e4 * jnp.finfo(own.dtype).eps * (one @ one + other @ other)
    return jnp.where(norm(own) <= least, 0, angle(own, alike(normal, own)))


def predicted(shape: TangentSurface, sides: dict[str, SideFacts], corners: dict[tuple[int, int], Corner]) -> Any:
    """Angles that operator H leaves where corners are not compatible: on sides of u its derivative across is that of the
    surface less ⟨S_u, M⟩ M and Σ_j w_j(v) σ_ij n_ij; sides of v are met."""
    at = shares(shape.dtype)
    found = {}
    for name, facts in sides.items():
        side = SIDES.index(name)
        left = facts.across - jnp.sum(facts.across * facts.given, axis=1, keepdims=True) * facts.given
        for (i, j), corner in corners.items():
            if i == side:
                rho, other = corner.rho
                left = left - (hermite_weight(j, at) * (other - rho))[:, None] * corner.normals[0][None]
        tangent = unit(facts.along)
        left = left - jnp.sum(left * tangent, axis=1, keepdims=True) * tangent
        out = jnp.sum(left * facts.given, axis=1)
        found[name] = jnp.arctan(divide(jnp.abs(out), norm(left - out[:, None] * facts.given)))
    return found


def is_a_point(facts: SideFacts, surface: AbstractSurface) -> Any:
    """Whether a side is a single point."""
    return jnp.max(norm(facts.along)) <= 1e-9 * jnp.max(norm(facts.across))
