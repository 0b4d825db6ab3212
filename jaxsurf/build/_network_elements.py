"""Edges, nodes and crossings of a network, as its users see them."""

from typing import Any, NamedTuple

from jaxtyping import Array, Float

from ._network_topology import NetworkTopology


class InnerEdge(NamedTuple):
    """An edge that two patches share: (patch, side) of both, side "u0", "u1", "v0" or "v1".

    reversed: whether the sides' parameters run in opposite directions. first_part, second_part: from where to where on each
    side it runs, in the first side's direction: (0, 1) and, reversed, (1, 0), but where a curve ends amid a longer side.
    """

    first: tuple[int, str]
    second: tuple[int, str]
    reversed: bool
    first_part: tuple[float, float]
    second_part: tuple[float, float]


class OuterEdge(NamedTuple):
    """An edge of one patch alone: patch, side, which part of it, and whether a curve was given there."""

    patch: int
    side: str
    part: tuple[float, float]
    given: bool


class NetworkNode(NamedTuple):
    """Where curves meet. valence: parts of curves that leave it and bound patches; inner: patches all round.

    corners: (patch, (i, j)), corner u = i, v = j; sides: (patch, side) of patches for which it lies amid a side.
    """

    point: Float[Array, "3"]
    valence: int
    inner: bool
    corners: tuple[tuple[int, tuple[int, int]], ...]
    sides: tuple[tuple[int, str], ...]


class Gap(NamedTuple):
    """A crossing: numbers of the guide and of the character, their parameters, and how far apart they are there."""

    guide: int
    character: int
    parameters: tuple[float, float]
    distance: float


def nodes_of(topology: NetworkTopology, points: Float[Array, "n 3"]) -> tuple[NetworkNode, ...]:
    """The nodes that bound patches, with what lies about them."""
    corners: list[dict[Any, None]] = [{} for _ in range(topology.nodes)]
    amid: list[dict[Any, None]] = [{} for _ in range(topology.nodes)]
    for patch in range(len(topology.cells)):
        for side, run in topology.sides(patch).items():
            if run is None:
                continue
            curve, a, b = run
            way = 1 if b > a else -1
            for position in range(a, b + way, way):
                node = topology.node(curve, position)
                if node is None:
                    continue
                if position not in (a, b):
                    amid[node][patch, side] = None
                    continue
                end, fixed = int(position == b), int(side[1])
                corners[node][patch, (fixed, end) if side[0] == "u" else (end, fixed)] = None
    touching = [0] * topology.nodes
    rim = [False] * topology.nodes
    for edge in topology.edges():
        if not edge.positions:
            continue
        patch, side = edge.sides[0]
        run = topology.sides(patch)[side]
        assert run is not None
        (a, b), curve = edge.positions[0], run[0]
        for position in range(min(a, b), max(a, b) + 1):
            node = topology.node(curve, position)
            if node is not None:
                touching[node] += 1 if position in (a, b) else 2
                rim[node] |= len(edge.sides) == 1
    used = [k for k in range(topology.nodes) if corners[k] or amid[k]]
    return tuple(NetworkNode(points[k], touching[k], not rim[k], tuple(corners[k]), tuple(amid[k])) for k in used)
