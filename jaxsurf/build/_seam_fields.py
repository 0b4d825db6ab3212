"""Common normals along the seams of a network, fair and such that the planes of each patch fit at its corners."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._safe import divide, norm, unit
from ._alike import row_of
from ._edge_fields import SeamField, bernstein
from ._ribbons import CORNERS, SIDES, ribbons_of
from ._seam_polynomials import DEGREE, GAUSS, NODES, chebyshev, fairness_tables, gauss, tables
from ._seams import Seams
from ._tangent_surface import TangentSurface

_NEAR = 400.0  # weight of |D|², next to |D_uu|² + 2 |D_uv|² + |D_vv|², on patches of unit size


class SeamClass(NamedTuple):
    """Patches bent in one form: their class among the network's, rows in it, numbers; for each side its parts (p,).

    seams, turned: (patches, slots) over the parts of all sides; sides: the side of each slot; held: (patches, 4), whether
    sides are bent; shares: (patches, 4, most parts + 1) where the parts begin and end.
    """

    kind: int
    rows: np.ndarray
    members: tuple[int, ...]
    counts: tuple[int, ...]
    seams: np.ndarray
    turned: np.ndarray
    held: np.ndarray

    @property
    def sides(self) -> np.ndarray:
        return np.repeat(np.arange(4), self.counts)


class Read(NamedTuple):
    """Of the patches of a class: on both sides across each axis, at the Gauss and then at the Chebyshev shares, and on parts
    of sides, derivatives across and along and unit normals, (patches, shares, 2, 3); first and second ones at corners."""

    across: tuple[Array, Array]
    along: tuple[Array, Array]
    own: tuple[Array, Array]
    first: Float[Array, "p 2 2 2 3"]
    second: Float[Array, "p 2 2 2 2 3"]


class SeamFacts(NamedTuple):
    """What was found at nodes: angles between curves and the plane there, per end of a seam; what node equations lack."""

    off: Float[Array, "e"]
    lacks: Float[Array, "c"]


def seam_classes(seams: Seams, kinds: Any) -> list[SeamClass]:
    """The patches of each class of a network, by the numbers of parts on their sides."""
    found: dict[Any, list[tuple[int, int]]] = {}
    for number, kind in enumerate(kinds):
        for row, patch in enumerate(kind.members):
            counts = tuple(max(1, len(seams.pieces.get((patch, side), ()))) for side in SIDES)
            found.setdefault((number, counts), []).append((row, patch))
    classes = []
    for (number, counts), members in found.items():
        parts = [[seams.pieces.get((patch, side), (None,)) for side in SIDES] for _, patch in members]
        slots = [[piece for side in row for piece in side] for row in parts]
        classes.append(
            SeamClass(
                number,
                np.array([row for row, _ in members]),
                tuple(patch for _, patch in members),
                counts,
                np.array([[piece.seam if piece else 0 for piece in row] for row in slots]),
                np.array([[bool(piece and piece.turned) for piece in row] for row in slots]),
                np.array([[float(side[0] is not None) for side in row] for row in parts]),
            )
        )
    return classes


def bent_patches(seams: Seams, classes: list[SeamClass], sweeps: list[Any], parts: list[Any]) -> tuple[list[Any], SeamFacts]:
    """The patches of each class bent to common planes along all seams, stacked; inside traced code.

    sweeps: the network's patches, stacked by its classes. parts: for each class the shares where parts of sides begin and
    end, four arrays (patches, p + 1).
    """
    reads = [_read(row_of(sweeps[kind.kind], kind.rows), kind, at) for kind, at in zip(classes, parts, strict=True)]
    normals = _node_normals(seams, classes, reads)
    ends, b, tangent, off = _along(seams, classes, reads, normals)
    lengths = norm(tangent[:, [0, -1]])
    slopes = jnp.einsum("ek,nkx->nex", jnp.asarray(tables().slopes, ends.dtype), ends, precision="highest")
    turning = jnp.sum(slopes * b[:, [0, 2]], axis=-1)
    matrix, inverse, free = (jnp.asarray(x, ends.dtype) for x in seams.equations())
    wanted = _wanted(seams, classes, reads)
    x = divide(turning, lengths).reshape(-1)
    x = x - inverse @ (matrix @ x - wanted)
    lacks = matrix @ x - wanted
    start = jnp.concatenate([lengths * x.reshape(-1, 2) - turning, jnp.zeros_like(turning)], axis=1)
    base = jnp.einsum("dk,nkx->ndx", jnp.asarray(tables().through, ends.dtype), ends, precision="highest")
    bends = jnp.einsum("aqd,nqx->nadx", jnp.asarray(tables().bends, ends.dtype), b, precision="highest")
    count = len(seams.edges)
    to_slopes = (lengths.reshape(-1)[:, None] * free).reshape(count, 2, -1)
    into = jnp.zeros((count, 4, free.shape[1] + 2 * count), ends.dtype)
    into = into.at[:, :2, : free.shape[1]].set(to_slopes)
    own = free.shape[1] + np.arange(2 * count).reshape(count, 2)
    into = into.at[np.arange(count)[:, None], np.array([[2, 3]]), own].set(1)

    def better(chosen: Float[Array, "s 4"], _: None) -> tuple[Float[Array, "s 4"], None]:
        terms = [
            _fairness(kind, read, at, base, bends, chosen, (turning, lengths))
            for kind, read, at in zip(classes, reads, parts, strict=True)
        ]
        whole = jnp.zeros((4 * count, 4 * count), ends.dtype)
        pull = jnp.zeros(4 * count, ends.dtype)
        for kind, (square, linear) in zip(classes, terms, strict=True):
            at = (4 * kind.seams[:, :, None] + np.arange(4)).reshape(len(kind.members), -1)
            whole = whole.at[at[:, :, None], at[:, None, :]].add(square)
            pull = pull.at[at].add(linear)
        flat = into.reshape(4 * count, -1)
        square = flat.T @ whole @ flat
        floor = 1e-12 * jnp.trace(square) / square.shape[0]
        step = jnp.linalg.solve(square + floor * jnp.eye(square.shape[0], dtype=square.dtype), flat.T @ pull)
        return chosen - (flat @ step).reshape(count, 4), None

    chosen, _ = jax.lax.scan(better, start, None, length=2)
    vectors = base + jnp.einsum("na,nadx->ndx", chosen, bends, precision="highest")
    made = []
    for kind, read, at in zip(classes, reads, parts, strict=True):
        bend = lambda sweep, fields: TangentSurface(sweep, tuple(SeamField(*field) for field in fields), "gregory")
        own = row_of(sweeps[kind.kind], kind.rows)
        made.append(eqx.filter_vmap(bend)(own, _fields(kind, read, at, vectors, ends)))
    return made, SeamFacts(off, lacks)


def _read(sweeps: Any, kind: SeamClass, parts: Any) -> Read:
    """The sides of the patches of a class."""
    places = jnp.asarray(np.concatenate([gauss()[0], chebyshev()]), sweeps.dtype)

    def one(sweep: Any, at: Any) -> Read:
        ribbons = ribbons_of(sweep.prepared())
        found = []
        for axis in (0, 1):
            shares = [places]
            for side in (2 * axis, 2 * axis + 1):
                if kind.counts[side] > 1:
                    first, last = at[side][:-1, None], at[side][1:, None]
                    shares.append((first + (last - first) * places[GAUSS:]).reshape(-1))
            _, across, along = jax.vmap(lambda t, axis=axis: ribbons.sides(axis, t))(jnp.concatenate(shares))
            own = jnp.cross(across, along) if axis == 0 else jnp.cross(along, across)
            found.append((across, along, unit(own)))
        first, second = ribbons.corners(sweep.dtype)
        return _read_of(found, first, second)

    return eqx.filter_vmap(one)(sweeps, parts)


def _read_of(found: list[tuple[Array, Array, Array]], first: Array, second: Array) -> Read:
    (across, along, own), (across_v, along_v, own_v) = found
    return Read((across, across_v), (along, along_v), (own, own_v), first, second)


def _columns(kind: SeamClass, side: int, part: int) -> np.ndarray:
    """Where the Chebyshev places of a part of a side are among the shares read."""
    start = GAUSS
    if kind.counts[side] > 1:
        start += NODES * (1 + part + (kind.counts[side - 1] if side % 2 and kind.counts[side - 1] > 1 else 0))
    return start + np.arange(NODES)


def _by_patch(classes: list[SeamClass], of: Any) -> Array:
    """Values of all classes, ordered by patch."""
    order = np.argsort(np.concatenate([kind.members for kind in classes]))
    return jnp.concatenate(of)[order]


def _node_normals(seams: Seams, classes: list[SeamClass], reads: list[Read]) -> Float[Array, "n 3"]:
    """The mean unit normal of all corners at each node."""
    first = _by_patch(classes, [read.first for read in reads])
    own = unit(jnp.cross(first[..., 0, :], first[..., 1, :]))
    tip = unit(jnp.cross(first[:, 0, :, 1], first[:, 1, :, 1]))  # of sides that meet, the limit; j = 0 is not used
    area = norm(jnp.cross(first[..., 0, :], first[..., 1, :]), keepdims=True)
    flat = area <= 1e-9 * jnp.max(area, axis=(1, 2), keepdims=True)
    own = jnp.where(flat, tip[:, None], own)
    most = max(len(found) for found in seams.corners)
    index, counts = np.zeros((len(seams.corners), most, 3), int), np.zeros((len(seams.corners), most))
    for node, found in enumerate(seams.corners):
        for k, (patch, (i, j)) in enumerate(found):
            index[node, k], counts[node, k] = (patch, i, j), 1.0
    there = own[index[..., 0], index[..., 1], index[..., 2]]
    same = jnp.where(jnp.sum(there * there[:, :1], axis=-1) < 0, -1.0, 1.0).astype(there.dtype)
    return unit(jnp.sum((same * jnp.asarray(counts, there.dtype))[..., None] * there, axis=1))


def _along(seams: Seams, classes: list[SeamClass], reads: list[Read], normals: Array) -> tuple[Array, Array, Array, Array]:
    """Of every seam, in its direction: the normals R at the Chebyshev places, the nodes' own ones at both ends (s, k, 3);
    n × t there at the ends and amid (s, 3, 3); derivatives along (s, k, 3); sines of angles of curve and plane per end."""
    own, along = (_gathered(seams, classes, [getattr(read, name) for read in reads]) for name in ("own", "along"))
    one, other = own[:, 0], own[:, 1]
    same = jnp.where(jnp.sum(one * other, axis=-1, keepdims=True) < 0, -1.0, 1.0).astype(one.dtype)
    mean = unit(one + same * other)
    at_ends = normals[seams.nodes.reshape(-1, 2)]
    beside = one[:, [0, -1]] + 1e-3 * one[:, [1, -2]]
    at_ends = jnp.where(jnp.sum(at_ends * beside, axis=-1, keepdims=True) < 0, -at_ends, at_ends)
    mean = mean.at[:, [0, -1]].set(at_ends)
    tangent = along[:, 0]
    middle = (NODES - 1) // 2
    direction = unit(tangent)
    b = jnp.cross(mean[:, [0, middle, -1]], direction[:, [0, middle, -1]])
    off = jnp.abs(jnp.sum(at_ends * direction[:, [0, -1]], axis=-1)).reshape(-1)
    return mean, b, tangent, off


def _gathered(seams: Seams, classes: list[SeamClass], values: list[Any]) -> Float[Array, "s 2 k 3"]:
    """Values at the Chebyshev places of every seam as its first and its second patch have them, in its direction; those
    along have the sign of their own side. A seam of one patch has that one's twice."""
    table = jnp.concatenate([values[c][axis].reshape(-1, 3) for c in range(len(classes)) for axis in (0, 1)])
    index = np.full((len(seams.edges), 2, NODES), -1)
    start = 0
    for number, kind in enumerate(classes):
        for axis in (0, 1):
            _, count, *_ = values[number][axis].shape
            for row, patch in enumerate(kind.members):
                for side in (2 * axis, 2 * axis + 1):
                    for part, piece in enumerate(seams.pieces.get((patch, SIDES[side]), ())):
                        second = seams.edges[piece.seam].sides[0] != (patch, SIDES[side])
                        places = start + 2 * (row * count + _columns(kind, side, part)) + side % 2
                        index[piece.seam, int(second)] = places[::-1] if piece.turned else places
            start += 2 * count * len(kind.members)
    # a rim part of a side, and the far side of a seam that only one patch is bent along
    index[:, 0] = np.where(index[:, 0] < 0, index[:, 1], index[:, 0])
    index[:, 1] = np.where(index[:, 1] < 0, index[:, 0], index[:, 1])
    return table[index]


def _wanted(seams: Seams, classes: list[SeamClass], reads: list[Read]) -> Float[Array, "c"]:
    """The right sides of the node equations: cot θ (k_u − k_v) at corners, 0 where seams follow each other."""
    first = _by_patch(classes, [read.first for read in reads])
    second = _by_patch(classes, [read.second for read in reads])
    at = np.array([(joint.patch, *(joint.corner or (0, 0))) for joint in seams.joints], int).reshape(-1, 3)
    counted = jnp.asarray([float(joint.corner is not None) for joint in seams.joints], first.dtype)
    du, dv = (first[at[:, 0], at[:, 1], at[:, 2], k] for k in (0, 1))
    across = jnp.cross(du, dv)
    n = unit(across)
    bent = [
        divide(jnp.sum(second[at[:, 0], at[:, 1], at[:, 2], k, k] * n, axis=-1), jnp.sum(x * x, axis=-1))
        for k, x in enumerate((du, dv))
    ]
    return counted * divide(jnp.sum(du * dv, axis=-1), norm(across)) * (bent[0] - bent[1])


def _fairness(
    kind: SeamClass, read: Read, parts: Any, base: Array, bends: Array, chosen: Array, known: Any
) -> tuple[Array, Array]:
    """Square matrices and right sides, per patch, of ∬ |D_uu|² + 2 |D_uv|² + |D_vv|² + 400 |D|², D what H does to it, over
    the four numbers of each seam about it, at the present ones."""
    g, quadrature = (np.asarray(x) for x in gauss())
    sides = kind.sides
    turning, lengths = known
    slots = len(sides)
    bent, derive = (jnp.asarray(x, base.dtype) for x in fairness_tables())

    places = jnp.asarray(g, base.dtype)[None]
    of_side = jnp.asarray(sides == np.arange(4)[:, None], base.dtype)

    def pulled(m: Array, x: Array, t: Array) -> Array:
        m = unit(m - (m @ t) * t)
        return (x @ m) * m

    def side_terms(read: Read, at: Any, seams: Array, turned: Array) -> tuple[Array, Array]:
        """⟨X, M⟩ M at the Gauss places of the sides (4, g, 3), and its derivatives (4, g, 3, slots, 4)."""
        first, last = (jnp.concatenate([side[part] for side in at])[:, None] for part in (np.s_[:-1], np.s_[1:]))
        share = (places - first) / (last - first)
        share = jnp.where(turned[:, None], 1 - share, share)
        inside = (places > first) & (places <= last)
        weights = jnp.where(inside[..., None], bernstein(share, DEGREE), 0)
        vectors = base[seams] + jnp.einsum("pa,padx->pdx", chosen[seams], bends[seams], precision="highest")
        m = jnp.einsum("sp,pgd,pdx->sgx", of_side, weights, vectors, precision="highest")
        by = jnp.einsum("pgd,padx->pgax", weights, bends[seams], precision="highest")
        across, along = (
            jnp.concatenate([jnp.swapaxes(x[:GAUSS], 0, 1) for x in pair]) for pair in (read.across, read.along)
        )
        every = lambda f: jax.vmap(jax.vmap(f))(m, across, unit(along))
        turn = every(jax.jacfwd(pulled))
        return every(pulled), jnp.einsum("sp,sgyx,pgax->sgypa", of_side, turn, by, precision="highest")

    def one(read: Read, at: Any, seams: Array, turned: Array, held: Array) -> tuple[Array, Array]:
        value, by = side_terms(read, at, seams, turned)
        pulls = jnp.concatenate([value[..., None], by.reshape(4, GAUSS, 3, -1)], axis=-1) * held[:, None, None, None]
        corners = _corner_terms(kind, read, seams, turned, held, chosen, turning, lengths)
        weight = jnp.asarray(quadrature, base.dtype)
        size = jnp.mean(norm(read.first), axis=(0, 1))
        scale = divide(jnp.ones((), base.dtype), size[0] * size[1])
        square, linear = jnp.zeros((4 * slots, 4 * slots), base.dtype), jnp.zeros(4 * slots, base.dtype)
        for du, dv, factor in ((2, 0, 1.0), (1, 1, 2.0), (0, 2, 1.0), (0, 0, _NEAR)):
            moved = jnp.einsum("ia,bc,icxq->abxq", bent[du], derive[dv], pulls[:2], precision="highest")
            moved = moved + jnp.einsum("jb,ac,jcxq->abxq", bent[dv], derive[du], pulls[2:], precision="highest")
            moved = moved - jnp.einsum("ia,jb,ijxq->abxq", bent[du], bent[dv], corners, precision="highest")
            value, by = moved[..., 0], moved[..., 1:]
            square = square + factor * scale * jnp.einsum("a,b,abxp,abxq->pq", weight, weight, by, by, precision="highest")
            linear = linear + factor * scale * jnp.einsum("a,b,abxp,abx->p", weight, weight, by, value, precision="highest")
        return square, linear

    return jax.vmap(one)(read, parts, jnp.asarray(kind.seams), jnp.asarray(kind.turned), jnp.asarray(kind.held, base.dtype))


def _corner_terms(
    kind: SeamClass, read: Read, seams: Array, turned: Array, held: Array, chosen: Array, turning: Array, lengths: Array
) -> Array:
    """½ (ρ + ρ̃) n at the corners of a patch, and its derivatives by the numbers of the seams, (2, 2, 3, 1 + 4 slots)."""
    starts = np.cumsum((0, *kind.counts))
    slots = int(starts[-1])
    corners = np.array(CORNERS)
    # at a corner (i, j) the side u = i, whose end there is its j-th, and the side v = j
    about, last = corners + np.array([0, 2]), corners[:, ::-1]
    slot = np.where(last, starts[about + 1] - 1, starts[about])
    du, dv = jnp.moveaxis(read.first.reshape(4, 2, 3), 1, 0)
    across = jnp.cross(du, dv)
    n, area, inner = unit(across), norm(across), jnp.sum(du * dv, axis=-1)
    second = jnp.einsum("cabx,cx->cab", read.second.reshape(4, 2, 2, 3), n, precision="highest")
    # ⟨S_u, M_i'⟩ = −area x_i − ⟨S_u, S_v⟩ ⟨S_vv, n⟩ / |S_v|², and ⟨S_v, M_j'⟩ = area x_j − …
    bent = divide(second[:, 0, 0], jnp.sum(du * du, axis=-1)) + divide(second[:, 1, 1], jnp.sum(dv * dv, axis=-1))
    seam, end = seams[slot], jnp.where(turned[slot], 1 - last, last)
    share = divide(0.5 * area[:, None] * jnp.asarray([[-1.0, 1.0]], chosen.dtype), lengths[seam, end])
    mean = second[:, 0, 1] - 0.5 * inner * bent + jnp.sum(share * (chosen[seam, end] + turning[seam, end]), axis=1)
    rows = jnp.zeros((4, 1 + 4 * slots), chosen.dtype).at[:, 0].set(mean)
    rows = rows.at[np.arange(4)[:, None], 1 + 4 * slot + end].add(share)
    rows = rows * (held[corners[:, 0]] * held[2 + corners[:, 1]])[:, None]
    return (n[:, :, None] * rows[:, None, :]).reshape(2, 2, 3, -1)


def _fields(kind: SeamClass, read: Read, parts: Any, vectors: Array, mean: Array) -> tuple[Any, ...]:
    """What makes the fields of the four sides of each patch, on the side of its own normals."""
    starts = np.concatenate([[0], np.cumsum(kind.counts)])
    middle, found = (NODES - 1) // 2, []
    for side in range(4):
        axis, end = divmod(side, 2)
        pieces = []
        for part in range(kind.counts[side]):
            seam, turned = kind.seams[:, starts[side] + part], kind.turned[:, starts[side] + part]
            own = read.own[axis][:, _columns(kind, side, part)[middle], end]
            there = jnp.where(jnp.sum(mean[seam, middle] * own, axis=-1) < 0, -1.0, 1.0).astype(vectors.dtype)
            piece = there[:, None, None] * vectors[seam]
            pieces.append(jnp.where(turned[:, None, None], piece[:, ::-1], piece))
        held = jnp.asarray(kind.held[:, side], vectors.dtype)
        found.append((jnp.stack(pieces, axis=1), jnp.asarray(parts[side], vectors.dtype), held))
    return tuple(found)
