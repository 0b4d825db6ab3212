"""Common normals along the seams of a network, fair and such that the planes of each patch fit at its corners."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._safe import divide, norm, unit
from ._alike import row_of
from ._curved_surface import CurvedSurface
from ._edge_fields import SeamField
from ._node_forms import node_forms
from ._seam_fairness import fairness
from ._seam_polynomials import NODES, tables
from ._seam_reads import Read, SeamClass, by_patch, columns, corners_at_nodes, gathered, read_sides
from ._seams import Seams
from ._tangent_surface import TangentSurface


class SeamFacts(NamedTuple):
    """What was found at nodes: sines of the angles between curves and the plane there, for both directions of its corners;
    what the equations x_i + x_j = c of corners lack, times the length of an edge; of order 2 how far normal curvatures are
    off those of the node's form, see `NodeForms`."""

    off: Float[Array, "n c 2"]
    lacks: Float[Array, "c"]
    bends: Float[Array, "n c 2"]


def bent_patches(
    seams: Seams, classes: list[SeamClass], sweeps: list[Any], parts: list[Any], order: int
) -> tuple[list[Any], SeamFacts]:
    """The patches of each class bent to common planes along all seams, and of order 2 to common curvatures across them,
    stacked; inside traced code.

    sweeps: the network's patches, stacked by its classes. parts: for each class the shares where parts of sides begin and
    end, four arrays (patches, p + 1).
    """
    reads = [
        read_sides(row_of(sweeps[kind.kind], kind.rows), kind, at, order) for kind, at in zip(classes, parts, strict=True)
    ]
    normals = _node_normals(seams, classes, reads)
    ends, b, tangent = _along(seams, classes, reads, normals)
    lengths = norm(tangent[:, [0, -1]])
    slopes = jnp.einsum("ek,nkx->nex", jnp.asarray(tables().slopes, ends.dtype), ends, precision="highest")
    turning = jnp.sum(slopes * b[:, [0, 2]], axis=-1)
    matrix, inverse, free = (jnp.asarray(x, ends.dtype) for x in seams.equations())
    wanted = _wanted(seams, classes, reads)
    x = divide(turning, lengths).reshape(-1)
    if order == 2:  # forms at nodes say what normals do there
        bends, x, odd = _bends(seams, classes, reads, (normals, ends, b, tangent))
        free = free[:, :0]
    else:
        bends, x, odd = None, x - inverse @ (matrix @ x - wanted), jnp.zeros((0, 0, 2), ends.dtype)
    sizes = jnp.mean(lengths, axis=1)[np.array([joint.ends[0] // 2 for joint in seams.joints], int)]
    lacks = sizes * (matrix @ x - wanted)
    start = jnp.concatenate([lengths * x.reshape(-1, 2) - turning, jnp.zeros_like(turning)], axis=1)
    base = jnp.einsum("dk,nkx->ndx", jnp.asarray(tables().through, ends.dtype), ends, precision="highest")
    turns = jnp.einsum("aqd,nqx->nadx", jnp.asarray(tables().bends, ends.dtype), b, precision="highest")
    count = len(seams.edges)
    to_slopes = (lengths.reshape(-1)[:, None] * free).reshape(count, 2, -1)
    into = jnp.zeros((count, 4, free.shape[1] + 2 * count), ends.dtype)
    into = into.at[:, :2, : free.shape[1]].set(to_slopes)
    own = free.shape[1] + np.arange(2 * count).reshape(count, 2)
    into = into.at[np.arange(count)[:, None], np.array([[2, 3]]), own].set(1)

    def better(chosen: Float[Array, "s 4"], _: None) -> tuple[Float[Array, "s 4"], None]:
        terms = [
            fairness(kind, read, at, base, turns, chosen, (turning, lengths))
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
    vectors = base + jnp.einsum("na,nadx->ndx", chosen, turns, precision="highest")
    made: list[Any] = []
    surface = CurvedSurface if order == 2 else TangentSurface
    for kind, read, at in zip(classes, reads, parts, strict=True):
        bend = lambda sweep, fields: surface(sweep, tuple(SeamField(*field) for field in fields), "gregory")
        own = row_of(sweeps[kind.kind], kind.rows)
        made.append(eqx.filter_vmap(bend)(own, _fields(kind, read, at, vectors, bends, ends)))
    return made, SeamFacts(_off_planes(seams, classes, reads, normals), lacks, odd)


def _node_normals(seams: Seams, classes: list[SeamClass], reads: list[Read]) -> Float[Array, "n 3"]:
    """The mean unit normal of all corners at each node."""
    first = by_patch(classes, [read.first for read in reads])
    own = unit(jnp.cross(first[..., 0, :], first[..., 1, :]))
    tip = unit(jnp.cross(first[:, 0, :, 1], first[:, 1, :, 1]))  # of sides that meet, the limit; j = 0 is not used
    area = norm(jnp.cross(first[..., 0, :], first[..., 1, :]), keepdims=True)
    flat = area <= 1e-9 * jnp.max(area, axis=(1, 2), keepdims=True)
    own = jnp.where(flat, tip[:, None], own)
    index, counts = corners_at_nodes(seams)
    there = own[index[..., 0], index[..., 1], index[..., 2]]
    same = jnp.where(jnp.sum(there * there[:, :1], axis=-1) < 0, -1.0, 1.0).astype(there.dtype)
    return unit(jnp.sum((same * jnp.asarray(counts[..., 0] >= 0, there.dtype))[..., None] * there, axis=1))


def _bends(
    seams: Seams, classes: list[SeamClass], reads: list[Read], known: tuple[Array, Array, Array, Array]
) -> tuple[Float[Array, "s d"], Float[Array, "e"], Float[Array, "n c 2"]]:
    """Of every seam the curvature across, near the mean of its patches' and that of the form at nodes, as Bernstein
    coefficients; ⟨M', b⟩ / |T| at its ends; how far curvatures at nodes are off."""
    normals, mean, b, tangent = known
    index, counts = corners_at_nodes(seams)
    first, second = (by_patch(classes, [getattr(read, name) for read in reads]) for name in ("first", "second"))
    at = (index[..., 0], index[..., 1], index[..., 2])
    forms = node_forms(normals, first[at], second[at], counts)
    own, bend = (gathered(seams, classes, [getattr(read, name) for read in reads]) for name in ("own", "bend"))
    signs = jnp.where(jnp.sum(own * mean[:, None], axis=-1) < 0, -1.0, 1.0).astype(own.dtype)
    values = jnp.mean(signs * bend[..., 0], axis=1)
    ends, nodes = np.array([0, -1]), seams.nodes.reshape(-1, 2)
    beside = unit(b[:, ends])
    values = values.at[:, ends].set(forms.of(nodes, mean[:, ends], beside, beside))
    turning = -forms.of(nodes, mean[:, ends], unit(tangent[:, ends]), beside)
    through = jnp.asarray(tables().through, own.dtype)
    return jnp.einsum("dk,nk->nd", through, values, precision="highest"), turning.reshape(-1), forms.off


def _along(seams: Seams, classes: list[SeamClass], reads: list[Read], normals: Array) -> tuple[Array, Array, Array]:
    """Of every seam, in its direction: the normals R at the Chebyshev places, the nodes' own ones at both ends (s, k, 3);
    n × t there at the ends and amid (s, 3, 3); derivatives along (s, k, 3)."""
    own, along = (gathered(seams, classes, [getattr(read, name) for read in reads]) for name in ("own", "along"))
    one, other = own[:, 0], own[:, 1]
    same = jnp.where(jnp.sum(one * other, axis=-1, keepdims=True) < 0, -1.0, 1.0).astype(one.dtype)
    mean = unit(one + same * other)
    at_ends = normals[seams.nodes.reshape(-1, 2)]
    beside = one[:, [0, -1]] + 1e-3 * one[:, [1, -2]]
    at_ends = jnp.where(jnp.sum(at_ends * beside, axis=-1, keepdims=True) < 0, -at_ends, at_ends)
    mean = mean.at[:, [0, -1]].set(at_ends)
    tangent = along[:, 0]
    middle = (NODES - 1) // 2
    b = jnp.cross(mean[:, [0, middle, -1]], unit(tangent[:, [0, middle, -1]]))
    return mean, b, tangent


def _off_planes(
    seams: Seams, classes: list[SeamClass], reads: list[Read], normals: Float[Array, "n 3"]
) -> Float[Array, "n c 2"]:
    """Sines of the angles between curves and the planes of nodes; 0 along free sides, which may move, and at tips."""
    index, counts = corners_at_nodes(seams)
    first = by_patch(classes, [read.first for read in reads])[index[..., 0], index[..., 1], index[..., 2]]
    lengths = norm(first)
    counted = (counts > 0) & (lengths > 1e-9 * jnp.max(lengths, axis=(1, 2), keepdims=True))
    return jnp.where(counted, jnp.abs(jnp.sum(unit(first) * normals[:, None, None], axis=-1)), 0)


def _wanted(seams: Seams, classes: list[SeamClass], reads: list[Read]) -> Float[Array, "c"]:
    """The right sides of the node equations: cot θ (k_u − k_v) at corners, 0 where seams follow each other."""
    first = by_patch(classes, [read.first for read in reads])
    second = by_patch(classes, [read.second for read in reads])
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


def _fields(kind: SeamClass, read: Read, parts: Any, vectors: Array, bends: Array | None, mean: Array) -> tuple[Any, ...]:
    """What makes the fields of the four sides of each patch, on the side of its own normals."""
    starts = np.concatenate([[0], np.cumsum(kind.counts)])
    middle, found = (NODES - 1) // 2, []
    whole = vectors if bends is None else jnp.concatenate([vectors, bends[..., None]], axis=-1)
    for side in range(4):
        axis, end = divmod(side, 2)
        pieces = []
        for part in range(kind.counts[side]):
            seam, turned = kind.seams[:, starts[side] + part], kind.turned[:, starts[side] + part]
            own = read.own[axis][:, columns(kind, side, part)[middle], end]
            there = jnp.where(jnp.sum(mean[seam, middle] * own, axis=-1) < 0, -1.0, 1.0).astype(vectors.dtype)
            piece = there[:, None, None] * whole[seam]
            pieces.append(jnp.where(turned[:, None, None], piece[:, ::-1], piece))
        held, made = jnp.asarray(kind.held[:, side], vectors.dtype), jnp.stack(pieces, axis=1)
        shares = jnp.asarray(parts[side], vectors.dtype)
        found.append((made[..., :3], shares, held, *(() if bends is None else (made[..., 3],))))
    return tuple(found)
