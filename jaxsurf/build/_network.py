"""A network of guides and characters as patches that share their edges."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import Numbers, as_float, concrete, eps, float_type, is_concrete
from .._errors import InputError
from .._registry import register
from .._safe import norm
from ..curve import AbstractCurve
from ..surface import AbstractSurface
from ._blend import AbstractBlend
from ._guides import Guides
from ._network_crossings import FIRST, THERE, follow_crossings
from ._network_curves import NetworkEdge, Stacks, stacked, structures, wrapped
from ._network_elements import Gap, InnerEdge, NetworkNode, OuterEdge, nodes_of
from ._network_topology import SIDES, NetworkTopology, form
from ._rotation import AbstractRotation
from ._seam_fields import SeamFacts, bent_patches
from ._seam_reads import SeamClass, seam_classes
from ._seams import Seams, refuse_bent_nodes, refuse_odd_bends, refuse_parts, seams_of
from ._sweep import Sweep

_PLANE = 1e-6  # radians between curves and the plane of their node


class PatchClass(NamedTuple):
    """Patches of one structure: their numbers, and rows and ends of their curves, (curves, patches) and (…, 2)."""

    members: tuple[int, ...]
    guides: int
    tip: bool
    groups: tuple[int, ...]
    closed: tuple[bool, ...]
    curves: np.ndarray
    rows: np.ndarray
    ends: np.ndarray


class _Nodes(NamedTuple):
    """Parameters of the nodes on each curve, with the ends of the curve behind them, and the offsets there."""

    places: Float[Array, "c n"]
    ends: Float[Array, "c n2 2"]
    offsets: Float[Array, "c n 3"]
    points: Float[Array, "nodes 3"]


@register
class Network(eqx.Module):
    """Guides and characters that cross, and the patches between them; made by `js.network`.

    A pure function of `guides` and `characters`: change these with `equinox.tree_at` or derive by them; the crossings follow
    (Newton, implicit derivatives), which curves cross and bound which patch stays. Each patch runs over [0, 1] × [0, 1].
    Guides are kept; where a character passes a guide at a distance it is moved onto it, see `NetworkEdge`.
    """

    guides: tuple[AbstractCurve, ...]
    characters: tuple[AbstractCurve, ...]
    parameters: Float[Array, "crossings 2"]
    topology: NetworkTopology
    rotations: tuple[AbstractRotation, AbstractRotation]
    blend: AbstractBlend
    scale: str = eqx.field(static=True)
    order: int = eqx.field(static=True, default=0)

    @property
    def dtype(self) -> Any:
        """The floating type of the curves."""
        return float_type((self.guides, self.characters))

    @property
    def patches(self) -> tuple[AbstractSurface, ...]:
        """The patches on [0, 1] × [0, 1], each a `Sweep`, or one bent to the common planes; computed anew at each call."""
        found: list[Any] = [None] * len(self.topology.cells)
        for members, together in zip(patches_of_stacks(self), stacked_patches(self), strict=True):
            if is_concrete(together):
                together = jax.tree.map(lambda leaf: concrete(leaf) if eqx.is_array(leaf) else leaf, together)
            for row, patch in enumerate(members):
                pick = lambda leaf, row=row: jnp.asarray(leaf[row]) if eqx.is_array(leaf) else leaf
                found[patch] = jax.tree.map(pick, together)
        return tuple(found)

    def classes(self) -> "list[PatchClass]":
        """Patches sorted by form and by structures of curves: each class is compiled once."""
        return _classes(self)

    @property
    def forms(self) -> tuple[str, ...]:
        """The basic form of each patch, such as "2 guides + 1 character"."""
        return tuple(form(cell) for cell in self.topology.cells)

    def grid(self, u: Numbers, v: Numbers) -> Float[Array, "patches m k 3"]:
        """Points of all patches at u (m,), v (k,) in [0, 1]; patches of one form and structure are compiled once."""
        u, v = as_float(u, self.dtype), as_float(v, self.dtype)
        if u.ndim != 1 or v.ndim != 1:
            raise InputError(f"`u` and `v` of a grid must be one-dimensional, got shapes {u.shape} and {v.shape}.")
        return _grid(self, u, v)

    def smooth(self, order: int = 1) -> "Network":
        """The network with patches that have common tangent planes along all inner edges, G1 by construction, or with
        `order=2` common curvatures too, G2.

        Curves stay; where a part of the rim is no curve of the network it may move. Each inner edge carries one field of
        normals that both its patches take: a polynomial near the mean of their normals, whose slopes at nodes fit the
        curvatures of the curves, and whose free numbers let the patches move and bend least. Patches are bent by operator H
        in Gregory's form, which needs no condition at corners; where the conditions hold it is H. A pure function of
        `guides` and `characters` as before. Raises `InputError` where no plane holds the tangents of inner edges at a node.

        Of order 2, all patches at a node have one second fundamental form there, with the normal curvatures of its curves:
        `InputError` where there is none, as may be where more than three directions meet, and where an inner edge is but a
        part of a side.
        Source: Jōnishi, Yajima (paper 000), sections 4 and 5; Peters, the vertex enclosure condition, for nodes.
        """
        if order not in (1, 2):
            raise InputError(f"`order` must be 1 for common tangent planes or 2 for common curvatures too, got {order!r}.")
        if order == 2:
            refuse_parts(self.topology)
        smoothed = dataclasses.replace(self, order=order)
        if is_concrete(smoothed):
            facts, allowed = early(bent_network, smoothed)[1], max(_PLANE, 1e3 * eps(self.dtype))
            refuse_bent_nodes(self.topology, concrete(facts.off).astype(np.float64), allowed)
            refuse_odd_bends(self.topology, concrete(facts.bends).astype(np.float64), allowed)
        return smoothed

    def inner_edges(self) -> tuple[InnerEdge, ...]:
        """Edges that two patches share."""
        edges = [edge for edge in self.topology.edges() if len(edge.sides) == 2]
        parts = _parts(self, [(s, p) for e in edges for s, p in zip(e.sides, e.positions, strict=True)])
        pairs = zip(parts[::2], parts[1::2], strict=True)
        return tuple(InnerEdge(e.sides[0], e.sides[1], e.reversed, *p) for e, p in zip(edges, pairs, strict=True))

    def outer_edges(self) -> tuple[OuterEdge, ...]:
        """Edges of one patch alone: the rim, and free sides along which no curve was given."""
        edges = [edge for edge in self.topology.edges() if len(edge.sides) == 1]
        given = [edge for edge in edges if edge.positions]
        parts = iter(_parts(self, [(edge.sides[0], edge.positions[0]) for edge in given]))
        return tuple(
            OuterEdge(*edge.sides[0], next(parts) if edge.positions else (0.0, 1.0), bool(edge.positions)) for edge in edges
        )

    @property
    def nodes(self) -> tuple[NetworkNode, ...]:
        """The nodes, with what lies about them."""
        return nodes_of(self.topology, _nodes_of(self).points)

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """All crossings with the distances between their curves."""
        places, apart = _gaps(self)
        if is_concrete(places, apart):
            places, apart = concrete(places).tolist(), concrete(apart).tolist()
        pairs = self.topology.crossings
        return tuple(
            Gap(i, j - self.topology.guides, tuple(at), d) for (i, j), at, d in zip(pairs, places, apart, strict=True)
        )

    @property
    def largest_gap(self) -> Any:
        """The largest distance between curves that cross."""
        return max(gap.distance for gap in self.gaps)


def _curves(network: Network) -> tuple[AbstractCurve, ...]:
    return (*network.guides, *network.characters)


def _classes(network: Network) -> list[PatchClass]:
    """Patches sorted by form and structures of curves."""
    topology = network.topology
    group_of, row_of = structures(_curves(network), topology.closed)
    found: dict[Any, list[int]] = {}
    for patch, (guides, characters, tip, _) in enumerate(topology.cells):
        runs = (*guides, *characters)
        found.setdefault((len(guides), tip, tuple(group_of[c] for c, _, _ in runs)), []).append(patch)
    width = _width(topology)
    classes = []
    for (guides, tip, groups), members in found.items():
        runs = np.array([[*topology.cells[patch][0], *topology.cells[patch][1]] for patch in members]).swapaxes(0, 1)
        curves = runs[..., 0]
        closed = tuple(topology.closed[row[0]] for row in curves)
        ends = np.array([[[_slot(topology, c, k, width) for k in (a, b)] for c, a, b in row] for row in runs.tolist()])
        classes.append(PatchClass(tuple(members), guides, tip, groups, closed, curves, np.array(row_of)[curves], ends))
    return classes


def _width(topology: NetworkTopology) -> int:
    """How many positions the tables have; one more than nodes, and of closed curves twice round."""
    return max(len(row) * (2 if loop else 1) for row, loop in zip(topology.slots, topology.closed, strict=True)) + 1


def _slot(topology: NetworkTopology, curve: int, position: int, width: int) -> int:
    """Where a position's parameter is in the table of ends."""
    if topology.closed[curve]:
        return position
    return width if position < 0 else width + 1 if position >= len(topology.slots[curve]) else position


def _located(network: Network, stacks: Stacks) -> _Nodes:
    """The nodes on all curves, inside traced code."""
    topology = network.topology
    held = np.array(topology.held, np.int32)
    crossings = follow_crossings(stacks, topology.crossings, topology.closed, held, network.parameters)
    dtype, count = network.dtype, len(topology.closed)
    domains = jnp.stack([jnp.stack([jnp.asarray(end, dtype) for end in curve.domain]) for curve in _curves(network)])
    known = jnp.concatenate([crossings.reshape(-1), domains[:, 0], domains[:, 1]])
    width = _width(topology)
    source, turns, steps = (np.zeros((count, width), int) for _ in range(3))
    node = np.zeros((count, width), int)
    nudged = np.zeros((count, width), bool)
    for c, row in enumerate(topology.slots):
        for k in range(width):
            last = 2 * len(row) if topology.closed[c] else len(row) - 1
            turns[c, k], inside = divmod(min(k, last), len(row))
            steps[c, k] = max(0, k - last)
            node[c, k], source[c, k] = row[inside]
            nudged[c, k] = source[c, k] < 2 * len(held) and held.reshape(-1)[source[c, k]] in (FIRST, THERE)
    period = (domains[:, 1] - domains[:, 0])[:, None]
    places = known[source] + jnp.asarray(turns + steps, dtype) * period
    points = jnp.zeros((count, width, 3), dtype)
    for number, group in enumerate(stacks.groups):
        members, loop = np.array(group.members), topology.closed[group.members[0]]
        at = jax.vmap(lambda row, t, n=number, l=loop: _at(stacks.curve(n, row), t, l))
        points = points.at[members].set(at(jnp.arange(len(members)), known[source[members]]))
    chosen = np.zeros((topology.nodes, 2), int)
    for c in range(count - 1, -1, -1):  # the first curve last: guides keep their place
        for k in range(len(topology.slots[c])):
            chosen[node[c, k]] = c, k
    at_nodes = points[chosen[:, 0], chosen[:, 1]]
    return _Nodes(places, _ends(places, domains, nudged), at_nodes[node] - points, at_nodes)


def _at(curve: Any, t: Float[Array, "n"], closed: bool) -> Float[Array, "n 3"]:
    return jax.vmap(lambda x: curve.point(wrapped(curve, x, closed)))(t)


def _ends(places: Float[Array, "c n"], domains: Float[Array, "c 2"], nudged: np.ndarray) -> Float[Array, "c n2 2"]:
    """Parameters of the ends of runs, as the lower and as the upper end: below a corner by a few roundings, so that the
    tangent at the end is that of the run."""
    table = jnp.concatenate([places, domains], axis=1)
    roundings = (
        4 * jnp.finfo(places.dtype).eps * jnp.maximum(jnp.max(jnp.abs(domains), axis=1), domains[:, 1] - domains[:, 0])
    )
    less = jnp.where(np.pad(nudged, ((0, 0), (0, 2))), roundings[:, None], 0)
    return jnp.stack([table, table - less], axis=-1)


def _patch(network: Network, kind: PatchClass, stacks: Stacks, nodes: _Nodes, member: Any) -> Sweep:
    """One patch of a class; its number there may be traced."""
    edges = []
    for k, (group, loop) in enumerate(zip(kind.groups, kind.closed, strict=True)):
        curve = jnp.asarray(kind.curves)[k, member]
        ends = jnp.asarray(kind.ends)[k, member]
        both = nodes.ends[curve][ends]
        ascends = both[0, 0] < both[1, 0]
        places = jnp.where(ascends, jnp.stack([both[0, 0], both[1, 1]]), jnp.stack([both[0, 1], both[1, 0]]))
        whole = stacks.curve(group, jnp.asarray(kind.rows)[k, member])
        edges.append(NetworkEdge(whole, nodes.places[curve], nodes.offsets[curve], places, loop))
    guides, characters = tuple(edges[: kind.guides]), tuple(edges[kind.guides :])
    rotation = network.rotations[kind.guides - 1]
    scale = network.scale if kind.guides == 2 else "none"
    return Sweep(characters, Guides(guides, kind.tip), rotation, network.blend, scale, ("first", "last")[: len(characters)])


def stacked_patches(network: Network) -> list[Any]:
    """The patches of each structure, with all their arrays stacked."""
    if network.order:
        return bent_network(network)[0]
    return _stacked_patches(network, _nodes_of(network))


def patches_of_stacks(network: Network) -> list[tuple[int, ...]]:
    """The numbers of the patches of each structure."""
    kinds = _classes(network)
    return [kind.members for kind in (seam_classes(seams_of(network.topology), kinds) if network.order else kinds)]


def _grid(network: Network, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "p m k 3"]:
    if not network.order:
        return _grid_of_patches(network, _nodes_of(network), u, v)
    order = np.argsort(np.concatenate(patches_of_stacks(network)))
    return _grid_of_stacks(stacked_patches(network), u, v)[order]


def bent_network(network: Network) -> tuple[list[Any], SeamFacts]:
    nodes = _nodes_of(network)
    return _bent_patches(network, nodes, _stacked_patches(network, nodes))


# compiled apart from what evaluates patches, once for all of it
@eqx.filter_jit
def _nodes_of(network: Network) -> _Nodes:
    return _located(network, stacked(_curves(network), network.topology.closed))


@eqx.filter_jit
def _stacked_patches(network: Network, nodes: _Nodes) -> list[Any]:
    stacks = stacked(_curves(network), network.topology.closed, ready=False)
    made = []
    for kind in _classes(network):
        make = lambda member, kind=kind: _patch(network, kind, stacks, nodes, member)
        made.append(eqx.filter_vmap(make)(jnp.arange(len(kind.members))))
    return made


@eqx.filter_jit
def _grid_of_patches(network: Network, nodes: _Nodes, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "p m k 3"]:
    stacks = stacked(_curves(network), network.topology.closed)
    classes, parts = _classes(network), []
    for kind in classes:
        points = lambda member, kind=kind: _patch(network, kind, stacks, nodes, member).prepared().grid_points(u, v)
        parts.append(jax.vmap(points)(jnp.arange(len(kind.members))))
    order = np.argsort(np.concatenate([kind.members for kind in classes]))
    return jnp.concatenate(parts)[order]


@eqx.filter_jit
def _grid_of_stacks(stacks: list[Any], u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "p m k 3"]:
    points = eqx.filter_vmap(lambda patch: patch.prepared().grid_points(u, v))
    return jnp.concatenate([points(stack) for stack in stacks])


@eqx.filter_jit
def _bent_patches(network: Network, nodes: _Nodes, sweeps: list[Any]) -> tuple[list[Any], SeamFacts]:
    seams = seams_of(network.topology)
    classes = seam_classes(seams, _classes(network))
    return bent_patches(seams, classes, sweeps, _seam_parts(network, nodes, seams, classes), network.order)


def _seam_parts(network: Network, nodes: _Nodes, seams: Seams, classes: list[SeamClass]) -> list[Any]:
    """For each class, and each side, the shares where its parts begin and end, (patches, p + 1)."""
    made, whole = [], np.array([0.0, 1.0])
    for kind in classes:
        sides = []
        for side in SIDES:
            rows = []
            for patch in kind.members:
                pieces = seams.pieces.get((patch, side), ())
                if len(pieces) < 2:
                    rows.append(jnp.asarray(whole, network.dtype))
                    continue
                found = _parts(network, [((patch, side), piece.positions) for piece in pieces], nodes.ends[..., 0])
                inside = [jnp.asarray(last, network.dtype) for _, last in found[:-1]]
                rows.append(jnp.stack([jnp.zeros((), network.dtype), *inside, jnp.ones((), network.dtype)]))
            sides.append(jnp.stack(rows))
        made.append(tuple(sides))
    return made


@eqx.filter_jit
def _gaps(network: Network) -> tuple[Float[Array, "x 2"], Float[Array, "x"]]:
    topology = network.topology
    stacks = stacked(_curves(network), topology.closed)
    held = np.array(topology.held, np.int32)
    places = follow_crossings(stacks, topology.crossings, topology.closed, held, network.parameters)
    table = np.array(topology.crossings)
    ends = jnp.zeros((len(table), 2, 3), network.dtype)
    for side in (0, 1):
        for number, group in enumerate(stacks.groups):
            chosen = np.flatnonzero(np.isin(table[:, side], group.members))
            if len(chosen):
                rows = np.array([stacks.row_of[c] for c in table[chosen, side]])
                loop = topology.closed[group.members[0]]
                one = jax.vmap(lambda row, t, n=number, l=loop: _at(stacks.curve(n, row), t[None], l)[0])
                ends = ends.at[chosen, side].set(one(jnp.asarray(rows), places[chosen, side]))
    return places, norm(ends[:, 0] - ends[:, 1])


def _parts(
    network: Network, wanted: list[tuple[tuple[int, str], tuple[int, int]]], table: Any = None
) -> list[tuple[Any, Any]]:
    """Parts of sides, given by positions on their runs, as shares; table: the ends of runs, if they are at hand."""
    topology = network.topology
    parts, width = [], _width(topology)
    for (patch, side), (a, b) in wanted:
        run = topology.sides(patch)[side]
        assert run is not None
        curve, first, last = run
        if {a, b} == {first, last}:
            parts.append((0.0, 1.0) if a == first else (1.0, 0.0))
            continue
        if table is None:
            table = _nodes_of(network).ends[..., 0]
            table = concrete(table) if is_concrete(table) else table
        t = [table[curve, _slot(topology, curve, k, width)] for k in (first, last, a, b)]
        shares = [(x - t[0]) / (t[1] - t[0]) for x in t[2:]]
        parts.append(tuple(float(s) if isinstance(s, np.floating) else s for s in shares))
    return parts
