"""Cells of a network of known curves: walks from node to node, on numpy."""

from collections.abc import Iterator
from typing import Any, NamedTuple, NoReturn

import numpy as np
from jaxtyping import Float

from .._errors import InputError
from ._network_crossings import FREE, Crossing, Samples, distances

Run = tuple[int, int, int]
"""A curve (guides count first, then characters), and the positions on it of the first and the last end of a part: position k
is the k-th node of the curve, −1 its start, one beyond the last node its end; on a closed curve positions go on round it."""


class Slot(NamedTuple):
    """A node on a curve: its number, and where its parameter comes from.

    source: 2x + 0 or 1 for the guide or the character of crossing x; with X crossings and M curves 2X + curve for the
    curve's start and 2X + M + curve for its end.
    """

    node: int
    source: int


class Cell(NamedTuple):
    """Guides and characters about a cell. tip: the two guides meet at their last ends."""

    guides: tuple[Run, ...]
    characters: tuple[Run, ...]
    tip: bool = False


class Half(NamedTuple):
    """A curve leaving a node: its number, the node's position on it, and +1 or −1."""

    curve: int
    position: int
    way: int


class _Stop(NamedTuple):
    """Where a walk ended: "corner" with the curve to turn into, "tip" where curves of one kind meet, or "end"."""

    kind: str
    position: int
    node: int | None = None
    turn: Half | None = None
    side: Any = None


class Web:
    """Known curves with their nodes."""

    def __init__(
        self, samples: Samples, guides: int, closed: list[bool], slots: list[list[Slot]], places: list[list[float]]
    ):
        self.samples, self.guides, self.closed, self.slots, self.places = samples, guides, closed, slots, places
        self.at: dict[int, list[tuple[int, int]]] = {}
        for curve, row in enumerate(slots):
            for position, slot in enumerate(row):
                self.at.setdefault(slot.node, []).append((curve, position))
        self.tail = 0.0

    def is_guide(self, curve: int) -> bool:
        return curve < self.guides

    def place(self, curve: int, position: int) -> float:
        """The parameter of a position, going on beyond the end of a closed curve."""
        first, last = self.samples.parameters[curve, [0, -1]]
        count = len(self.slots[curve])
        if self.closed[curve]:
            turns, k = divmod(position, count)
            return self.places[curve][k] + turns * (last - first)
        return first if position < 0 else last if position >= count else self.places[curve][position]

    def point(self, curve: int, t: Any) -> np.ndarray:
        """Points between the samples, by straight lines."""
        parameters, points = self.samples.parameters[curve], self.samples.points[curve]
        if self.closed[curve]:
            t = parameters[0] + np.mod(np.asarray(t) - parameters[0], parameters[-1] - parameters[0])
        return np.stack([np.interp(t, parameters, points[:, k]) for k in range(3)], axis=-1)

    def path(self, curve: int, a: int, b: int, count: int = 25) -> Float[np.ndarray, "n 3"]:
        """Points from one position to another."""
        return self.point(curve, np.linspace(self.place(curve, a), self.place(curve, b), count))

    def next(self, curve: int, position: int, way: int) -> int | None:
        """The next position, or None at the end of the curve; tails that are too short are no way."""
        count = len(self.slots[curve])
        if self.closed[curve] or 0 <= position + way < count:
            return position + way
        if position < 0 or position >= count:
            return None
        path = self.path(curve, position, position + way)
        long = np.linalg.norm(np.diff(path, axis=0), axis=1).sum() > self.tail
        return position + way if long else None

    def node(self, curve: int, position: int) -> int | None:
        """The node at a position, or None at a free end."""
        count = len(self.slots[curve])
        if self.closed[curve]:
            return self.slots[curve][position % count].node
        return self.slots[curve][position].node if 0 <= position < count else None

    def halves(self, node: int) -> Iterator[Half]:
        """All that leaves a node."""
        for curve, position in self.at[node]:
            for way in (1, -1):
                if self.next(curve, position, way) is not None:
                    yield Half(curve, position, way)

    def direction(self, half: Half, share: float = 0.2) -> Float[np.ndarray, "3"]:
        """The unit secant of a curve where it leaves a node; where curves touch, tangents would not do."""
        after = self.next(*half)
        assert after is not None
        a, b = self.place(half.curve, half.position), self.place(half.curve, after)
        start, there = self.point(half.curve, np.array([a, a + share * (b - a)]))
        return _unit(there - start)


def walk(web: Web, half: Half, side: Float[np.ndarray, "3"]) -> _Stop:
    """Along a curve, to the first curve of the other kind that leaves it on the given side."""
    curve, position, way = half
    while True:
        after = web.next(curve, position, way)
        if after is None or (after != position and abs(after - half.position) > len(web.slots[curve]) + 1):
            node = web.node(curve, position)
            meets = node is not None and any(web.is_guide(c) == web.is_guide(curve) and c != curve for c, _ in web.at[node])
            return _Stop("tip" if meets and position != half.position else "end", position, node)
        path = web.path(curve, position, after)
        side, tangent = _transported(side, path)
        position = after
        node = web.node(curve, position)
        if node is None:
            return _Stop("end", position)
        best: tuple[float, Half] | None = None
        for turn in web.halves(node):
            along = web.direction(turn)
            across = along - (along @ tangent) * tangent
            if turn.curve != curve and across @ side > 1e-3 * np.linalg.norm(side):
                angle = float(np.arccos(np.clip(-along @ tangent, -1, 1)))
                if best is None or angle < best[0]:
                    best = angle, turn
        if best is not None:
            turn = best[1]
            if web.is_guide(turn.curve) == web.is_guide(curve):
                return _Stop("tip", position, node)
            return _Stop("corner", position, node, turn, -tangent)


def cells(web: Web, allowed: float, names: list[str], *, open_cells: bool) -> list[Cell]:
    """All cells, each once, in order of their guides and characters. Raises `InputError` on a cell that is not bounded."""
    found: dict[Any, Cell] = {}
    for node in web.at:
        halves = list(web.halves(node))
        directions = {half: web.direction(half) for half in halves}
        for guide in (h for h in halves if web.is_guide(h.curve)):
            for character in (h for h in halves if not web.is_guide(h.curve)):
                others = [d for h, d in directions.items() if h not in (guide, character)]
                if _is_between(directions[guide], directions[character], others):
                    continue
                cell = _cell(web, guide, character, directions, allowed, names)
                known = frozenset((c, k) for run in (*cell.guides, *cell.characters) for c, k in elements(web, run))
                closed = len(cell.guides) == len(cell.characters) == 2 or cell.tip
                if closed or open_cells:
                    found.setdefault(known, cell)
    order = lambda c: (c.guides[0][0], min(c.guides[0][1:]), c.characters[0][0], min(c.characters[0][1:]))
    return sorted(found.values(), key=order)


def elements(web: Any, run: Run) -> list[tuple[int, int]]:
    """The parts between neighbouring positions that make a run, in its order: (curve, lower position)."""
    curve, a, b = run
    count = len(web.slots[curve])
    steps = range(a, b) if a < b else range(a - 1, b - 1, -1)
    return [(curve, k % count if web.closed[curve] else k) for k in steps]


def _cell(
    web: Web, guide: Half, character: Half, directions: dict[Half, np.ndarray], allowed: float, names: list[str]
) -> Cell:
    """The cell in the corner between a guide and a character that leave a node."""
    along_guide = walk(web, guide, directions[character])
    along_character = walk(web, character, directions[guide])
    g = (guide.curve, guide.position, along_guide.position)
    c = (character.curve, character.position, along_character.position)
    # from both far corners on, towards the corner opposite
    by_guide, by_character = _onwards(web, along_guide), _onwards(web, along_character)
    if by_guide is None and by_character is None:
        return Cell((g,), (c,))
    if by_guide is not None and by_character is not None:
        (c2, one), (g2, other) = by_guide, by_character
        meet = one.kind == other.kind == "corner" and one.node == other.node
        if meet and one.turn is not None and other.turn is not None and (one.turn.curve, other.turn.curve) == (g2[0], c2[0]):
            return _quad(web, g, g2, c, c2)
        _refuse(web, g2[0], c2[0], (guide, character), allowed, names)
    ahead, mine = (by_guide, along_character) if by_guide is not None else (by_character, along_guide)
    assert ahead is not None
    run, stop = ahead
    if mine.kind == "tip" and stop.kind == "tip" and mine.node == stop.node:
        # the two curves that meet are the guides, whichever kind they are
        return Cell((c, run), (g,), True) if by_guide is not None else Cell((g, run), (c,), True)
    if stop.turn is not None:
        this = character.curve if by_guide is not None else guide.curve
        _refuse(web, this, stop.turn.curve, (guide, character), allowed, names)
    if by_guide is not None:
        return Cell((g,), (c, run))
    return Cell((g,) if elements(web, g) == elements(web, run) else (g, run), (c,))


def _onwards(web: Web, stop: _Stop) -> tuple[Run, _Stop] | None:
    """From a corner on: the run to the next stop."""
    if stop.turn is None:
        return None
    after = walk(web, stop.turn, stop.side)
    return (stop.turn.curve, stop.turn.position, after.position), after


def _quad(web: Web, g: Run, g2: Run, c: Run, c2: Run) -> Cell:
    """A cell between two guides and two characters; each pair in the order of its numbers."""
    same = lambda a, b: elements(web, a) == elements(web, b)
    if same(g, g2):
        return Cell((g,), (c, c2))
    if c[1] > c[2]:  # along the curves' own ways, as far as can be
        g, g2, c, c2 = g2, g, _back(c), _back(c2)
    if g[1] > g[2]:
        g, g2, c, c2 = _back(g), _back(g2), c2, c
    return Cell((g, g2), (c, c2))


def _back(run: Run) -> Run:
    return run[0], run[2], run[1]


def _refuse(web: Web, one: int, other: int, corner: tuple[Half, Half], allowed: float, names: list[str]) -> NoReturn:
    """Tell why a cell has no fourth corner."""
    guide, character = (one, other) if web.is_guide(one) else (other, one)
    here = f"the cell where {names[corner[0].curve]} leaves {names[corner[1].curve]}"
    if web.is_guide(guide) != web.is_guide(character):
        apart = distances(web.samples.points[guide], web.samples.points[character]).min()
        if apart > allowed:
            raise InputError(
                f"{names[guide]} and {names[character]} should cross to close {here}, but are {apart:.3g} apart, more "
                f"than the {allowed:.3g} (`tolerance` × size) allowed: make them meet, cut off what sticks into the cell, "
                "or give a larger `tolerance`."
            )
    raise InputError(
        f"{here[0].upper()}{here[1:]} is not bounded by one or two guides and one or two characters, beyond "
        f"{names[guide]} and {names[character]}: add the curve that divides it, or cut off what sticks into it."
    )


def _transported(side: Float[np.ndarray, "3"], path: Float[np.ndarray, "n 3"]) -> tuple[np.ndarray, np.ndarray]:
    """A vector carried along a path with the smallest rotations between its chords, and the last chord's direction."""
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    tangents = steps[lengths > 1e-12 * lengths.max()]
    tangents = tangents / np.linalg.norm(tangents, axis=1)[:, None]
    side = side - (side @ tangents[0]) * tangents[0]
    for a, b in zip(tangents[:-1], tangents[1:], strict=True):
        if a @ b > -0.99:
            side = side - (side @ b) / (1 + a @ b) * (a + b)
    return side, tangents[-1]


def _is_between(one: np.ndarray, other: np.ndarray, directions: list[np.ndarray]) -> bool:
    """Whether a direction lies inside the corner of two others."""
    basis = np.stack([one, other], axis=1)
    for direction in directions:
        shares = np.linalg.lstsq(basis, direction, rcond=1e-6)[0]
        if shares.min() > 0.05 and np.linalg.norm(basis @ shares - direction) < 0.7:
            return True
    return False


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 0 else vector


def merged_nodes(
    crossings: list[Crossing], samples: Samples, guides: int, closed: list[bool], allowed: float
) -> tuple[list[list[Slot]], list[list[float]]]:
    """Nodes on each curve in order, and their parameters: crossings, and ends of one kind that meet; near ones are one."""
    count, curves = len(crossings), len(samples.points)
    nodes: list[np.ndarray] = []
    rows: list[dict[int, tuple[float, int]]] = [{} for _ in range(curves)]

    def number(point: np.ndarray) -> int:
        for k, known in enumerate(nodes):
            if np.linalg.norm(known - point) <= 2 * allowed:
                return k
        nodes.append(point)
        return len(nodes) - 1

    for x, crossing in enumerate(crossings):
        node = number(crossing.point)
        for side, curve in enumerate((crossing.guide, crossing.character)):
            if node not in rows[curve] or crossing.held[side] != FREE:
                rows[curve][node] = crossing.at[side], 2 * x + side
    for kind in (range(guides), range(guides, curves)):
        ends = [(c, e) for c in kind if not closed[c] for e in (0, 1)]
        points = {(c, e): samples.points[c, -e] for c, e in ends}
        for i, one in enumerate(ends):
            for other in ends[i + 1 :]:
                if one[0] == other[0] or np.linalg.norm(points[one] - points[other]) > allowed:
                    continue
                node = number(points[one])
                for curve, end in (one, other):
                    place = float(samples.parameters[curve, -end])
                    rows[curve][node] = place, 2 * count + end * curves + curve
    slots, places = [], []
    for row in rows:
        ordered = sorted((place, node, source) for node, (place, source) in row.items())
        slots.append([Slot(node, source) for _, node, source in ordered])
        places.append([place for place, _, _ in ordered])
    return slots, places
