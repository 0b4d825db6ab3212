"""What is read on the sides of the patches of a network, and how it is ordered by seams and by nodes."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._safe import unit
from ._edge_fields import curvature_across
from ._guides import with_two_slopes
from ._ribbons import SIDES, AbstractRibbons, ribbons_of
from ._seam_polynomials import GAUSS, NODES, chebyshev, gauss
from ._seams import Seams


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
    of sides, derivatives across and along and unit normals, (patches, shares, 2, 3); first and second ones at corners; for
    order 2 normal curvatures across, (patches, shares, 2, 1)."""

    across: tuple[Array, Array]
    along: tuple[Array, Array]
    own: tuple[Array, Array]
    first: Float[Array, "p 2 2 2 3"]
    second: Float[Array, "p 2 2 2 2 3"]
    bend: tuple[Array, Array] | None


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


def read_sides(sweeps: Any, kind: SeamClass, parts: Any, order: int) -> Read:
    """The sides of the patches of a class."""
    places = jnp.asarray(np.concatenate([gauss()[0], chebyshev()]), sweeps.dtype)

    def one(sweep: Any, at: Any) -> Read:
        ribbons = ribbons_of(sweep.prepared())
        found, bend = [], []
        for axis in (0, 1):
            shares = [places]
            for side in (2 * axis, 2 * axis + 1):
                if kind.counts[side] > 1:
                    first, last = at[side][:-1, None], at[side][1:, None]
                    shares.append((first + (last - first) * places[None, GAUSS:]).reshape(-1))
            at_shares = jnp.concatenate(shares)
            _, across, along = jax.vmap(lambda t, axis=axis: ribbons.sides(axis, t))(at_shares)
            own = unit(jnp.cross(across, along) if axis == 0 else jnp.cross(along, across))
            found.append((across, along, own))
            if order == 2:
                bend.append(jax.vmap(lambda t, n, axis=axis: _bend_across(ribbons, axis, t, n))(at_shares, own))
        first, second = ribbons.corners(sweep.dtype)
        (across, along, own), (across_v, along_v, own_v) = found
        bends = (bend[0], bend[1]) if bend else None
        return Read((across, across_v), (along, along_v), (own, own_v), first, second, bends)

    return eqx.filter_vmap(one)(sweeps, parts)


def _bend_across(
    ribbons: AbstractRibbons, axis: int, share: Float[Array, ""], normals: Float[Array, "2 3"]
) -> Float[Array, "2 1"]:
    """Normal curvatures across both sides."""
    (_, across), (along, mixed), (twice, _) = with_two_slopes(lambda t: ribbons.at(axis, t), share)
    found = jax.vmap(curvature_across)(normals, along, across, twice, mixed, ribbons.bends(axis, share))
    return found[:, None]


def columns(kind: SeamClass, side: int, part: int) -> np.ndarray:
    """Where the Chebyshev places of a part of a side are among the shares read."""
    start = GAUSS
    if kind.counts[side] > 1:
        start += NODES * (1 + part + (kind.counts[side - 1] if side % 2 and kind.counts[side - 1] > 1 else 0))
    return start + np.arange(NODES)


def by_patch(classes: list[SeamClass], of: Any) -> Array:
    """Values of all classes, ordered by patch."""
    order = np.argsort(np.concatenate([kind.members for kind in classes]))
    return jnp.concatenate(of)[order]


def gathered(seams: Seams, classes: list[SeamClass], values: list[Any]) -> Float[Array, "s 2 k w"]:
    """Values at the Chebyshev places of every seam as its first and its second patch have them, in its direction; those
    along have the sign of their own side. A seam of one patch has that one's twice."""
    width = values[0][0].shape[-1]
    table = jnp.concatenate([values[c][axis].reshape(-1, width) for c in range(len(classes)) for axis in (0, 1)])
    index = np.full((len(seams.edges), 2, NODES), -1)
    start = 0
    for number, kind in enumerate(classes):
        for axis in (0, 1):
            _, count, *_ = values[number][axis].shape
            for row, patch in enumerate(kind.members):
                for side in (2 * axis, 2 * axis + 1):
                    for part, piece in enumerate(seams.pieces.get((patch, SIDES[side]), ())):
                        second = seams.edges[piece.seam].sides[0] != (patch, SIDES[side])
                        places = start + 2 * (row * count + columns(kind, side, part)) + side % 2
                        index[piece.seam, int(second)] = places[::-1] if piece.turned else places
            start += 2 * count * len(kind.members)
    # a rim part of a side, and the far side of a seam that only one patch is bent along
    index[:, 0] = np.where(index[:, 0] < 0, index[:, 1], index[:, 0])
    index[:, 1] = np.where(index[:, 1] < 0, index[:, 0], index[:, 1])
    return table[index]


def corners_at_nodes(seams: Seams) -> tuple[np.ndarray, np.ndarray]:
    """Patch, i and j of the corners at each node, (nodes, most, 3), and for both directions 1 along curves, 0 along free
    sides, −1 for no corner, (nodes, most, 2)."""
    most = max(len(found) for found in seams.corners)
    index, counts = np.zeros((len(seams.corners), most, 3), int), np.full((len(seams.corners), most, 2), -1)
    for node, found in enumerate(seams.corners):
        for k, (patch, (i, j)) in enumerate(found):
            index[node, k] = patch, i, j
            counts[node, k] = [(patch, side) not in seams.free for side in (f"v{j}", f"u{i}")]
    return index, counts
