"""What a smooth network does to its patches, as data and as a table."""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._array import concrete, is_concrete
from .._errors import InputError
from ._network import Network, bent_network, patches_of_stacks
from ._ribbons import SIDES
from ._seams import Seams, seams_of
from ._tangency_facts import curved_outcome, line_facts, outcome


class PatchReport(NamedTuple):
    """A patch of a smooth network: sides along inner edges; largest angles to the common planes there before and after,
    radians; differences to the common curvatures, 0 of order 1; largest displacement, also relative to the patch's size;
    on which share of its lines operator F would have been fit: where that is below 1, H was the only choice."""

    patch: int
    sides: tuple[str, ...]
    before: float
    after: float
    bend_before: float
    bend_after: float
    moved: float
    relative: float
    scaling_fit: float


class UnsolvedNode(NamedTuple):
    """A node where the vertex enclosure condition fails: which corners, and by how much their equations are missed. Patches
    are smooth there all the same, by Gregory's form, whose mixed derivative at the corner depends on the direction."""

    corners: tuple[tuple[int, tuple[int, int]], ...]
    lack: float


class NetworkReport(NamedTuple):
    """What `Network.smooth` did; prints as a table."""

    order: int
    patches: tuple[PatchReport, ...]
    unsolved: tuple[UnsolvedNode, ...]

    def __str__(self) -> str:
        lines = [f"smooth of order {self.order}: {len(self.patches)} patches"]
        lines.append("patch  sides        angle before  after     moved     of its size  F fit")
        for p in self.patches:
            lines.append(
                f"{p.patch:<6} {' '.join(p.sides):<12} {p.before:<13.2e} {p.after:<9.1e} {p.moved:<9.2e} "
                f"{f'{100 * p.relative:.2g} %':<12} {100 * p.scaling_fit:.0f} %"
            )
        if self.order == 2:
            bends = max(p.bend_before for p in self.patches), max(p.bend_after for p in self.patches)
            lines.append(f"curvatures off by {bends[0]:.2e} at most before, {bends[1]:.1e} after")
        for node in self.unsolved:
            places = ", ".join(f"patch {patch} (u{i}, v{j})" for patch, (i, j) in node.corners)
            lines.append(f"no common twists at {places}: off by {node.lack:.2g}, Gregory's form there")
        return "\n".join(lines)


def network_report(network: Network, tolerance: float) -> NetworkReport:
    """The report of a smooth network; tolerance: by how much equations of nodes, in radians, may be missed."""
    if not network.order:
        raise InputError("`surface` must be a smooth network, got one as it was made; give `network.smooth()`.")
    if not is_concrete(network):
        raise InputError("`surface` of a report must be known, got one inside `jit` or `grad`; call it outside.")
    seams = seams_of(network.topology)
    stacks, facts = bent_network(network)
    reports = _patch_reports(network, seams, patches_of_stacks(network), stacks)
    return NetworkReport(network.order, reports, _unsolved_nodes(seams, concrete(facts.lacks), tolerance))


def _patch_reports(
    network: Network, seams: Seams, members: list[tuple[int, ...]], stacks: list[Any]
) -> tuple[PatchReport, ...]:
    """The patches in order; stacks: as they are bent."""
    found = {}
    for patches, (angles, bends, rest) in zip(members, _facts(stacks, network.order), strict=True):
        angles, bends = ({side: concrete(x) for side, x in table.items()} for table in (angles, bends))
        for row, (patch, numbers) in enumerate(zip(patches, concrete(rest).tolist(), strict=True)):
            sides = tuple(side for side in SIDES if (patch, side) in seams.pieces)
            most = lambda table, k, row=row, sides=sides: max((float(table[s][row, k]) for s in sides), default=0.0)
            before, after, bend_before, bend_after = (most(table, k) for table in (angles, bends) for k in (0, 1))
            moved, size, fit = numbers
            found[patch] = PatchReport(
                patch, sides, before, after, bend_before, bend_after, moved, moved / size if size else 0.0, fit
            )
    return tuple(found[patch] for patch in sorted(found))


@eqx.filter_jit
def _facts(stacks: list[Any], order: int) -> list[Any]:
    """Of the patches of each stack: by side the angles and the curvatures off, before and after, (p, 2); displacement, size
    and the share of lines fit for F, (p, 3)."""

    def one(bent: Any) -> Any:
        u, v = (jnp.linspace(a, b, 5, dtype=bent.dtype) for a, b in bent.domain)
        points = bent.surface.prepared().grid_points(u, v).reshape(-1, 3)
        size = jnp.max(jnp.max(points, axis=0) - jnp.min(points, axis=0))
        fit = jnp.mean(jnp.stack([jnp.mean(line.behave.astype(bent.dtype)) for line in line_facts(bent).values()]))
        pairs = lambda was, now: {side: jnp.stack([jnp.max(was[side]), jnp.max(now[side])]) for side in was}
        if order == 2:
            done = curved_outcome(bent)
            bends = pairs(done.bend_before, done.bend_after)
        else:
            done = outcome(bent)
            bends = {side: jnp.zeros(2, bent.dtype) for side in done.before}
        return pairs(done.before, done.after), bends, jnp.stack([done.moved, size, fit])

    return [eqx.filter_vmap(one)(stack) for stack in stacks]


def _unsolved_nodes(seams: Seams, lacks: Float[np.ndarray, "c"], allowed: float) -> tuple[UnsolvedNode, ...]:
    """Nodes with equations that are missed by more than is allowed."""
    worst: dict[int, float] = {}
    for joint, lack in zip(seams.joints, np.abs(lacks), strict=True):
        node = int(seams.nodes[joint.ends[0]])
        worst[node] = max(worst.get(node, 0.0), float(lack))
    return tuple(UnsolvedNode(seams.corners[node], lack) for node, lack in sorted(worst.items()) if lack > allowed)
