"""How fields of normals along the edges of a network hang together at its nodes. Static: numbers only."""

import math
from collections.abc import Hashable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .._errors import InputError
from ._network_topology import NetworkTopology, SharedEdge


class Piece(NamedTuple):
    """A part of a side, in its direction: its seam, whether that runs the other way, positions on the side's run."""

    seam: int
    turned: bool
    positions: tuple[int, int]


class Joint(NamedTuple):
    """Two ends of seams, numbers 2 seam + end, that are bound at a node: at a corner of a patch that is bent along both, or,
    corner None, because they follow each other on one side."""

    ends: tuple[int, int]
    patch: int
    corner: tuple[int, int] | None


class Seams(NamedTuple):
    """Edges with fields of normals.

    edges: the edges; pieces: for each (patch, side) that is bent, its parts in order; nodes: for each end of a seam its
    node; corners: for each node the corners (patch, (i, j)) that have its plane; joints: conditions at nodes; free: sides
    without a curve.
    """

    edges: tuple[SharedEdge, ...]
    pieces: dict[tuple[int, str], tuple[Piece, ...]]
    nodes: np.ndarray
    corners: tuple[tuple[tuple[int, tuple[int, int]], ...], ...]
    joints: tuple[Joint, ...]
    free: frozenset[tuple[int, str]]

    def equations(self) -> tuple[Float[np.ndarray, "c e"], Float[np.ndarray, "e c"], Float[np.ndarray, "e z"]]:
        """A of A x = c for one number x per end of a seam, its pseudo-inverse, and what leaves A x as it is; by nodes."""
        count = 2 * len(self.edges)
        matrix = np.zeros((len(self.joints), count))
        for row, joint in enumerate(self.joints):
            for end, sign in zip(joint.ends, (1.0, 1.0 if joint.corner else -1.0), strict=True):
                matrix[row, end] += sign
        inverse, free = np.zeros((count, len(self.joints))), []
        for node in range(len(self.corners)):
            ends = np.flatnonzero(self.nodes == node)
            rows = np.flatnonzero(np.isin([joint.ends[0] for joint in self.joints], ends)) if self.joints else ends[:0]
            own = matrix[np.ix_(rows, ends)]
            inverse[np.ix_(ends, rows)] = np.linalg.pinv(own)
            _, sizes, across = np.linalg.svd(np.concatenate([own, np.zeros((1, len(ends)))]), full_matrices=True)
            for vector in across[int(np.sum(sizes > 1e-9)) :]:
                free.append(np.zeros(count))
                free[-1][ends] = vector
        return matrix, inverse, np.stack(free, axis=1) if free else np.zeros((count, 0))


def seams_of(topology: NetworkTopology) -> Seams:
    """The seams of a network: all edges of sides that a neighbour shares, at least in part."""
    edges = [edge for edge in topology.edges() if edge.positions]
    touched = {side for edge in edges if len(edge.sides) == 2 for side in edge.sides}
    edges = [edge for edge in edges if touched & set(edge.sides)]
    pieces: dict[tuple[int, str], list[Piece]] = {}
    for number, edge in enumerate(edges):
        for k, (side, positions) in enumerate(zip(edge.sides, edge.positions, strict=True)):
            if side in touched:
                turned = k == 1 and edge.reversed
                first, last = positions
                pieces.setdefault(side, []).append(Piece(number, turned, (last, first) if turned else (first, last)))
    for (patch, side), parts in pieces.items():
        run = topology.sides(patch)[side]
        assert run is not None
        way = 1 if run[2] > run[1] else -1
        parts.sort(key=lambda piece, way=way: way * piece.positions[0])
    numbers: dict[Hashable, int] = {}
    nodes = np.zeros(2 * len(edges), int)
    for number, edge in enumerate(edges):
        patch, side = edge.sides[0]
        run = topology.sides(patch)[side]
        assert run is not None
        for end in (0, 1):
            key = _node(topology, run[0], edge.positions[0][end])
            nodes[2 * number + end] = numbers.setdefault(key, len(numbers))
    sides = {side: tuple(parts) for side, parts in pieces.items()}
    free = frozenset(edge.sides[0] for edge in topology.edges() if not edge.positions)
    return Seams(tuple(edges), sides, nodes, _corners(topology, numbers), _joints(sides), free)


def refuse_bent_nodes(topology: NetworkTopology, off: Float[np.ndarray, "n c 2"], allowed: float) -> None:
    """Refuse nodes whose curves have no common tangent plane; off: sines of the angles to it."""
    if not off.size or not off.max() > allowed:
        return
    name, place, sine = _worst(topology, off)
    raise InputError(
        f"A smooth network needs a plane at each node that holds the tangents of all curves there; at {place} {name} is off "
        f"it by {math.degrees(math.asin(min(1, sine))):.3g}°; turn its tangent, or leave the network as it is."
    )


def _worst(topology: NetworkTopology, values: Float[np.ndarray, "n c 2"]) -> tuple[str, str, float]:
    """The curve with the largest value at corners of nodes, the corner, and the value."""
    node, corner, direction = np.unravel_index(np.abs(values).argmax(), values.shape)
    patch, (i, j) = seams_of(topology).corners[node][corner]
    name = _name(topology, patch, (f"v{j}", f"u{i}")[direction])
    return name, f"corner (u{i}, v{j}) of patch {patch}", float(abs(values[node, corner, direction]))


def refuse_odd_bends(topology: NetworkTopology, bends: Float[np.ndarray, "n c 2"], allowed: float) -> None:
    """Refuse nodes whose curves have normal curvatures that no one surface has; bends: by how much, times their speeds."""
    if not bends.size or not np.abs(bends).max() > allowed:
        return
    name, place, off = _worst(topology, bends)
    raise InputError(
        "A smooth network of `order=2` needs curves whose normal curvatures at a node are those of one surface; at "
        f"{place} they are not: {name} is off the nearest such by {off:.3g} / its length; let no more than three directions "
        "meet there, change the curves, or take `order=1`."
    )


def refuse_parts(topology: NetworkTopology) -> None:
    """Refuse sides of several seams, which have no second derivatives where these follow each other."""
    for (patch, side), pieces in seams_of(topology).pieces.items():
        if len(pieces) > 1:
            raise InputError(
                f"A smooth network of `order=2` needs curves that end at the corners of patches, but one ends amid side "
                f"{side} of patch {patch}, on {_name(topology, patch, side)}; let that curve go on, or take `order=1`."
            )


def _name(topology: NetworkTopology, patch: int, side: str) -> str:
    """The curve along a side, as an argument of `js.network`."""
    run = topology.sides(patch)[side]
    assert run is not None
    curve, count = run[0], topology.guides
    return f"`guides[{curve}]`" if curve < count else f"`characters[{curve - count}]`"


def _node(topology: NetworkTopology, curve: int, position: int) -> Hashable:
    """The node at a position of a curve; a free end is one of its own."""
    found = topology.node(curve, position)
    return found if found is not None else (curve, position)


def _corners(topology: NetworkTopology, numbers: dict[Hashable, int]) -> tuple[tuple[tuple[int, tuple[int, int]], ...], ...]:
    """The corners at each node: those between two curves, or, at free ends, all."""
    full: list[list[tuple[int, tuple[int, int]]]] = [[] for _ in numbers]
    others: list[list[tuple[int, tuple[int, int]]]] = [[] for _ in numbers]
    for patch in range(len(topology.cells)):
        runs = topology.sides(patch)
        for i in (0, 1):
            for j in (0, 1):
                met = [(runs.get(side), end) for side, end in ((f"u{i}", j), (f"v{j}", i))]
                keys = [_node(topology, run[0], run[1 + end]) for run, end in met if run is not None]
                for key in dict.fromkeys(keys):
                    if key in numbers:
                        both = len(keys) == 2 or (f"v{j}" not in runs and len(keys) == 1)  # a tip has the plane of its sides
                        (full if both else others)[numbers[key]].append((patch, (i, j)))
    return tuple(tuple(a or b) for a, b in zip(full, others, strict=True))


def _joints(pieces: dict[tuple[int, str], tuple[Piece, ...]]) -> tuple[Joint, ...]:
    def end_of(side: tuple[int, str], last: int) -> int:
        piece = pieces[side][-1 if last else 0]
        return 2 * piece.seam + (1 - last if piece.turned else last)

    found = []
    for patch, side in pieces:
        parts = pieces[patch, side]
        for before, after in zip(parts[:-1], parts[1:], strict=True):
            ends = (2 * before.seam + (0 if before.turned else 1), 2 * after.seam + (1 if after.turned else 0))
            found.append(Joint(ends, patch, None))
        if side[0] != "u":
            continue
        for j in (0, 1):
            if (patch, f"v{j}") in pieces:
                i = int(side[1])
                found.append(Joint((end_of((patch, side), j), end_of((patch, f"v{j}"), i)), patch, (i, j)))
    return tuple(found)
