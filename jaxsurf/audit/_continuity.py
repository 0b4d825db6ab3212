"""How closely two surfaces meet along the edge that they share."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._array import concrete, is_concrete
from .._errors import InputError
from .._safe import norm
from ..surface import AbstractSurface, TrimmedSurface
from ._feet import Start, differentiable_feet, rim_feet
from ._gaps import Gaps, gaps, gaps_at_feet
from ._matching import Match, feet_on, match, nearest_distance
from ._sides import AbstractPath, Rim, named_rims, rim_points, sampled

GAP, ANGLE, CURVATURE = 1e-6, 1e-3, 1e-2
"""Up to what an edge counts as G0 (in lengths of the edge), G1 (radians) and G2 (relative) unless other limits are given."""

_TOLERANCE = 1e-2  # of the size: how far apart edges may be and still be taken for one


_SAMPLES = 513  # of a traced side


class Continuity(eqx.Module):
    """Gaps between two surfaces at n samples along their shared edge.

    g0: distance from the sample on the side of `a` to its foot on the side of `b`. g1: angle between the tangent plane of
    `a`, going on over the edge, and that of `b`, in radians from 0 (smooth) to π (folded back); it does not depend on which
    way the normals point. g2: difference of the normal curvatures in the direction across the edge, 1 / length;
    g2_relative: the same by the larger of both, or by 1 / length of the edge where that is larger. parameters_a,
    parameters_b: (n, 2); points_a, points_b: (n, 3); curvature_a, curvature_b: (n,), across the edge, with respect to one
    normal. length: of the edge. reversed: whether the parameters along the sides run in opposite directions.
    """

    side_a: str = eqx.field(static=True)
    side_b: str = eqx.field(static=True)
    parameters_a: Float[Array, "n 2"]
    parameters_b: Float[Array, "n 2"]
    points_a: Float[Array, "n 3"]
    points_b: Float[Array, "n 3"]
    g0: Float[Array, "n"]
    g1: Float[Array, "n"]
    g2: Float[Array, "n"]
    g2_relative: Float[Array, "n"]
    curvature_a: Float[Array, "n"]
    curvature_b: Float[Array, "n"]
    length: Float[Array, ""]
    reversed: Bool[Array, ""]

    @property
    def max_g0(self) -> Float[Array, ""]:
        """The largest distance."""
        return jnp.max(self.g0)

    @property
    def max_g1(self) -> Float[Array, ""]:
        """The largest angle, in radians."""
        return jnp.max(self.g1)

    @property
    def max_g2(self) -> Float[Array, ""]:
        """The largest difference of curvature, 1 / length."""
        return jnp.max(self.g2)

    @property
    def max_g2_relative(self) -> Float[Array, ""]:
        """The largest relative difference of curvature."""
        return jnp.max(self.g2_relative)

    @property
    def folded(self) -> Bool[Array, "n"]:
        """Where the sheets fold back upon each other: g1 is beyond three quarters of π."""
        return self.g1 > 0.75 * jnp.pi

    def order(self, *, gap: float | None = None, angle: float = ANGLE, curvature: float = CURVATURE) -> int:
        """The order of continuity that holds everywhere: 2, 1, 0, or -1 where not even the points meet.

        gap: limit of g0, default 1e-6 of the edge's length; angle: of g1, in radians; curvature: of g2_relative.
        """
        limits = (GAP * float(self.length) if gap is None else gap, angle, curvature)
        held = [float(x) <= limit for x, limit in zip((self.max_g0, self.max_g1, self.max_g2_relative), limits, strict=True)]
        return (held + [False]).index(False) - 1

    def __str__(self) -> str:
        way = ", reversed" if bool(self.reversed) else ""
        degrees = float(jnp.rad2deg(self.max_g1))
        fold = ", folded back" if bool(jnp.any(self.folded)) else ""
        return (
            f"{self.side_a} of a on {self.side_b} of b{way}, length {float(self.length):.6g}, {len(self.g0)} samples\n"
            f"G0 {float(self.max_g0):.3e}\n"
            f"G1 {float(self.max_g1):.3e} rad ({degrees:.3e}°){fold}\n"
            f"G2 {float(self.max_g2):.3e} per length ({float(self.max_g2_relative):.3e} relative)"
        )


def continuity(
    a: Any,
    b: Any,
    side_a: str | None = None,
    side_b: str | None = None,
    *,
    count: int = 65,
    tolerance: float | None = None,
    part: tuple[Any, Any] | None = None,
) -> Continuity:
    """Gaps of position, tangent plane and curvature along the edge that two surfaces share.

    Sides are "u0", "u1", "v0" and "v1", of trimmed surfaces also pieces of loops such as "loop 0 edge 2". Sides not given
    are the two that lie closest together, of equals the longest. They may run in opposite directions and share a part only;
    `count` samples are spread over it evenly in the parameter of `a`, each measured at its exact foot on the side of `b`.
    Samples where a surface has no tangent plane (a pole) are left out. `tolerance`: how far apart the sides may be, default
    1e-2 of the size of both. `part`: from where to where on side_a, in shares of it, if that is known. Where tangent planes
    agree along the edge, equal curvatures across it make all curvatures equal. Source: Pegna, Wolter, Geometrical criteria
    to guarantee curvature continuity of blend surfaces, J. Mech. Des. 114, 1992.

    Differentiable in both surfaces: name both sides; then all samples are kept, over `part` or the whole side.
    Raises `InputError` for unknown sides, sides shrunk to a point, and surfaces that share no edge within the tolerance.
    """
    _check(a, "a")
    _check(b, "b")
    if count < 2:
        raise InputError(f"`count` must be at least 2, got {count}.")
    if tolerance is not None and not tolerance > 0:
        raise InputError(f"`tolerance` must be a length above 0, got {tolerance:g}.")
    if part is not None and is_concrete(part) and not all(0 <= float(share) <= 1 for share in part):
        raise InputError(f"`part` must be two shares of `side_a` between 0 and 1, got {tuple(float(x) for x in part)}.")
    paths_a, paths_b = named_rims(a, side_a, "side_a"), named_rims(b, side_b, "side_b")
    same = a is b
    a, b = untrimmed(a), untrimmed(b)
    if not is_concrete(a, b, part):
        if len(paths_a) > 1 or len(paths_b) > 1:
            raise InputError("Under `jit` and `grad` the shared sides cannot be searched: give `side_a` and `side_b`.")
        return _traced(a, b, next(iter(paths_a.items())), next(iter(paths_b.items())), count, part)
    rims_a, rims_b = sampled(a, paths_a), sampled(b, paths_b)
    for surface, side, known in (("a", side_a, rims_a), ("b", side_b, rims_b)):
        if not any(rim.length > 0 for rim in known):
            what = f"Side {side}" if side else "Every side"
            raise InputError(f"{what} of `{surface}` is a single point; give a side that has a length.")
    corners = np.concatenate([rim.points for rim in (*rims_a, *rims_b)])
    reach = _TOLERANCE * float(np.linalg.norm(np.ptp(corners, axis=0))) if tolerance is None else float(tolerance)
    pairs = [(p, q) for p in rims_a for q in rims_b if p.length > 0 < q.length and not (same and p.name == q.name)]
    found = [(p, q, held) for p, q in pairs if (held := match(p, q, reach)) is not None]
    if not found:
        raise InputError(_nothing_shared(*min(((nearest_distance(*pair), *pair) for pair in pairs), key=_first), reach))
    least = min(held.apart + held.slack for _, _, held in found)
    near = [edge for edge in found if edge[2].apart - edge[2].slack <= least]
    measured = [measure(a, b, *edge, count, part) for edge in near]
    apart = [float(one.max_g0) for one in measured]
    if min(apart) > reach:
        raise InputError(
            _nothing_shared(*min(((d, p, q) for d, (p, q, _) in zip(apart, near, strict=True)), key=_first), reach)
        )
    # of edges that are equally near the longest
    best = min(apart) + 1e-9 * max(rim.length for rim in (*rims_a, *rims_b))
    return max((one for d, one in zip(apart, measured, strict=True) if d <= best), key=lambda one: float(one.length))


def _first(row: tuple[float, Rim, Rim]) -> float:
    return row[0]


def _check(surface: Any, argument: str) -> None:
    if not isinstance(surface, AbstractSurface):
        raise InputError(f"`{argument}` must be a surface, got a {type(surface).__name__}.")


def untrimmed(surface: AbstractSurface) -> AbstractSurface:
    """The surface that carries a face."""
    return surface.surface if isinstance(surface, TrimmedSurface) else surface


def _nothing_shared(apart: float, p: Rim, q: Rim, reach: float) -> str:
    return (
        f"`a` and `b` share no edge within `tolerance` = {reach:.3g}: the sides nearest to each other, {p.name} of `a` and "
        f"{q.name} of `b`, are {apart:.3g} apart; move the surfaces together, give other sides or a larger `tolerance`."
    )


def measure(
    a: AbstractSurface, b: AbstractSurface, first: Rim, second: Rim, held: Match, count: int, part: Any = None
) -> Continuity:
    """The gaps along a matched part of two rims of concrete surfaces."""
    dtype = a.dtype
    start, end = _exact_ends(a, first, second, held) if part is None else (float(x) for x in part)
    shares = np.linspace(start, end, count)
    shares = jnp.asarray(np.where(shares > 1, shares - 1, shares), dtype)
    begin = feet_on(second, first.at(concrete(shares).astype(float))).place / (len(second.points) - 1)
    found = gaps_at_feet(a, first.path, shares, b, second.path, _start(begin, second, b.dtype))
    keep = concrete(found.regular)
    if not keep.any():
        raise InputError(
            f"Along {first.name} of `a` and {second.name} of `b` the surfaces have no tangent plane; give other sides."
        )
    kept = jax.tree.map(lambda leaf: leaf[keep], found)
    return _result(first.name, second.name, kept, found)


def _start(begin: np.ndarray, rim: Rim, dtype: Any) -> Start:
    """Begin at feet on the polygon of a rim's samples."""
    width = np.full_like(begin, 2 / (len(rim.points) - 1))
    return Start(jnp.asarray(begin, dtype), jnp.asarray(width, dtype), jnp.full(begin.shape, rim.closed))


def _exact_ends(a: AbstractSurface, first: Rim, second: Rim, held: Match) -> tuple[float, float]:
    """The ends of the shared part at exact feet of the second rim's ends."""
    ends = [held.start, held.end]
    inner = [k for k, number in enumerate((held.lowest, held.highest)) if number >= 0 and ends[k] not in (0.0, 1.0)]
    if inner:
        given = second.points[[(held.lowest, held.highest)[k] for k in inner]]
        begin = np.array([ends[k] for k in inner])
        # two rows always: compiled once
        rows = np.resize(np.arange(len(inner)), 2)
        found = rim_feet(a, first.path, jnp.asarray(given[rows], a.dtype), _start(begin[rows], first, a.dtype))
        for k, place in zip(inner, concrete(found).astype(float)[: len(inner)], strict=True):
            ends[k] = place + round(ends[k] - place)
    return ends[0], ends[1]


def _traced(
    a: AbstractSurface,
    b: AbstractSurface,
    first: tuple[str, AbstractPath],
    second: tuple[str, AbstractPath],
    count: int,
    part: Any,
) -> Continuity:
    start, end = (jnp.asarray(x, a.dtype) for x in ((0.0, 1.0) if part is None else part))
    shares = start + (end - start) * jnp.linspace(0, 1, count, dtype=a.dtype)
    points = rim_points(a, first[1], shares).astype(b.dtype)
    samples = jnp.linspace(0, 1, _SAMPLES, dtype=b.dtype)
    known = rim_points(b, second[1], samples)
    nearest = jax.vmap(lambda p: jnp.argmin(jnp.sum((known - p[None]) ** 2, axis=1)))(points)
    begin = samples[nearest]
    start_b = Start(begin, jnp.full_like(begin, 2 / (_SAMPLES - 1)), jnp.zeros(begin.shape, bool))
    places = differentiable_feet(b, second[1], points, rim_feet(b, second[1], points, start_b))
    found = gaps(a, first[1], shares, b, second[1], places)
    return _result(first[0], second[0], found, found)


def _result(side_a: str, side_b: str, kept: Gaps, all_of_them: Gaps) -> Continuity:
    length = _length(all_of_them.points_a, all_of_them.tangents)
    difference = jnp.abs(kept.curvature_a - kept.curvature_b)
    most = jnp.maximum(jnp.abs(kept.curvature_a), jnp.abs(kept.curvature_b))
    return Continuity(
        side_a,
        side_b,
        kept.parameters_a,
        kept.parameters_b,
        kept.points_a,
        kept.points_b,
        kept.g0,
        kept.g1,
        difference,
        difference / jnp.maximum(most, 1 / length),
        kept.curvature_a,
        kept.curvature_b,
        length,
        2 * jnp.sum(kept.reversed, dtype=jnp.int32) > kept.reversed.shape[0],
    )


def _length(points: Float[Array, "n 3"], tangents: Float[Array, "n 3"]) -> Float[Array, ""]:
    """Length through points, from chords c and turns θ of the tangents: c (1 + θ² / 24), good to θ⁴."""
    turn = jnp.sum(jnp.diff(tangents, axis=0) ** 2, axis=1)
    return jnp.sum(norm(jnp.diff(points, axis=0)) * (1 + turn / 24))
