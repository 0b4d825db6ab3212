"""How the patches of a network hang together: sides, edges and nodes. Static: numbers only."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import equinox as eqx

from .._registry import register
from ._network_cells import Cell, Run, elements

SIDES = ("u0", "u1", "v0", "v1")
_LOOP = {"v0": 1, "u1": 1, "v1": -1, "u0": -1}  # the way round a patch, along (+1) or against the sides' own parameters


class SharedEdge(NamedTuple):
    """A part of a curve that bounds two sides, or one: (patch, side), and its positions, in the order of the first side."""

    sides: tuple[tuple[int, str], ...]
    reversed: bool
    positions: tuple[tuple[int, int], ...]


@register
class NetworkTopology(eqx.Module):
    """What does not change with the control data of a network's curves.

    guides: how many of the curves are guides; crossings: numbers of guide and character; held: what holds both parameters;
    closed: for each curve; slots: for each curve its nodes in order, (node, source of the parameter); cells: for each patch
    (guides, characters, tip, mirrored), guides and characters as runs (curve, position, position). Of a mirrored patch with
    one guide the guide is at the last u. See `Run` and `Slot`.
    """

    guides: int = eqx.field(static=True)
    crossings: tuple[tuple[int, int], ...] = eqx.field(static=True)
    held: tuple[tuple[int, int], ...] = eqx.field(static=True)
    closed: tuple[bool, ...] = eqx.field(static=True)
    slots: tuple[tuple[tuple[int, int], ...], ...] = eqx.field(static=True)
    cells: tuple[Any, ...] = eqx.field(static=True)

    @property
    def nodes(self) -> int:
        """How many nodes there are."""
        return 1 + max(node for row in self.slots for node, _ in row)

    def node(self, curve: int, position: int) -> int | None:
        """The node at a position, None at a free end."""
        row = self.slots[curve]
        if self.closed[curve]:
            return row[position % len(row)][0]
        return row[position][0] if 0 <= position < len(row) else None

    def sides(self, patch: int) -> dict[str, Run | None]:
        """The run on each side of a patch, in the direction of the side's parameter; None on a free side; a tip has none."""
        guides, characters, tip, mirrored = self.cells[patch]
        found: dict[str, Run | None] = dict.fromkeys(SIDES)
        if len(guides) == 2:
            found["u0"], found["u1"] = guides
        else:
            found["u1" if mirrored else "u0"] = guides[0]
            curve, a, b = characters[0]
            if self.closed[curve] and self.node(curve, a) == self.node(curve, b):
                found["u0"] = found["u1"] = guides[0]
        found["v0"] = characters[0]
        if len(characters) == 2:
            found["v1"] = characters[1]
        if tip:
            del found["v1"]
        return found

    def edges(self) -> list[SharedEdge]:
        """All edges: the longest runs with the same patches on both sides, and on the rim with one."""
        touching: dict[tuple[int, int], list[tuple[int, str, int]]] = {}
        free = []
        for patch in range(len(self.cells)):
            for side, run in self.sides(patch).items():
                if run is None:
                    free.append(SharedEdge(((patch, side),), False, ()))
                    continue
                for k, element in enumerate(elements(self, run)):
                    touching.setdefault(element, []).append((patch, side, k))
        found: dict[Any, list[tuple[int, ...]]] = {}
        for touched in touching.values():
            sides = tuple((patch, side) for patch, side, _ in touched)
            found.setdefault(sides, []).append(tuple(k for *_, k in touched))
        edges = []
        for sides, places in found.items():
            for run in _runs(sorted(places)):
                edges.append(self._edge(sides, run))
        return sorted(edges + free, key=lambda edge: edge.sides)

    def _edge(self, sides: tuple[tuple[int, str], ...], places: list[tuple[int, ...]]) -> SharedEdge:
        ways, positions = [], []
        for k, (patch, side) in enumerate(sides):
            run = self.sides(patch)[side]
            assert run is not None
            _, a, b = run
            way = 1 if b > a else -1
            low, high = min(p[k] for p in places), max(p[k] for p in places) + 1
            ways.append(way)
            positions.append((a + way * low, a + way * high) if way == ways[0] else (a + way * high, a + way * low))
        return SharedEdge(sides, len(set(ways)) == 2, tuple(positions))


def _runs(places: list[tuple[int, ...]]) -> Iterator[list[tuple[int, ...]]]:
    """Cut where neighbours along the first side are no neighbours along the others."""
    run: list[tuple[int, ...]] = []
    for place in places:
        if run and any(abs(a - b) != 1 for a, b in zip(place, run[-1], strict=True)):
            yield run
            run = []
        run.append(place)
    if run:
        yield run


def with_one_side_up(topology: NetworkTopology) -> NetworkTopology:
    """Patches mirrored in u so that neighbours have their normals on one side, as far as the whole is orientable."""
    flips: dict[int, bool] = {}
    beside: dict[int, list[tuple[int, bool]]] = {}
    for edge in topology.edges():
        if len(edge.sides) == 2:
            (one, side), (other, opposite) = edge.sides
            same_way = _LOOP[side] * _LOOP[opposite] * (-1 if edge.reversed else 1) > 0
            beside.setdefault(one, []).append((other, same_way))
            beside.setdefault(other, []).append((one, same_way))
    for start in range(len(topology.cells)):
        waiting = [start] if start not in flips else []
        flips.setdefault(start, False)
        while waiting:
            patch = waiting.pop(0)
            for other, same_way in beside.get(patch, ()):
                if other not in flips:
                    flips[other] = flips[patch] != same_way
                    waiting.append(other)
    cells = [_mirrored(cell) if flips[k] else cell for k, cell in enumerate(topology.cells)]
    return dataclasses.replace(topology, cells=tuple(cells))


def _mirrored(cell: Any) -> Any:
    guides, characters, tip, mirrored = cell
    return guides[::-1], tuple((curve, b, a) for curve, a, b in characters), tip, not mirrored


def plain(cells: Sequence[Cell]) -> tuple[Any, ...]:
    """Cells as plain tuples, not mirrored."""
    return tuple((tuple(cell.guides), tuple(cell.characters), bool(cell.tip), False) for cell in cells)


def form(cell: Any) -> str:
    """Which of the four basic forms a patch has (paper 000, fig. 2)."""
    count = lambda n, what: f"{n} {what}" + ("s" if n > 1 else "")
    return f"{count(len(cell[0]), 'guide')} + {count(len(cell[1]), 'character')}"
