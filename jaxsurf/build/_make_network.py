"""`network`: curves checked, their crossings found, and cells made patches."""

import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_type, early
from .._array import concrete, eps, is_concrete
from .._errors import InputError
from .._safe import norm
from ..curve import AbstractCurve
from ._blend import as_blend, smoothstep
from ._network import Network, stacked_patches
from ._network_cells import Cell, Run, Web, cells, merged_nodes
from ._network_corners import Corners, corners
from ._network_crossings import Crossing, Samples, distances, find_crossings, sample
from ._network_topology import NetworkTopology, form, plain, with_one_side_up
from ._rotation import AbstractRotation, ChordGuideRotation, ChordRotation, Fixed, GivenRotation
from ._rotations import ONE_GUIDE, as_rotation

_SCALES = {True: "uniform", False: "none", "chord": "chord"}
_TAIL = 1e-3  # parts of curves beyond the last crossing that are shorter than this share of the size bound no patch
_MOST = 16  # crossings of one guide and one character


def network(
    guides: Any,
    characters: Any,
    *,
    tolerance: float = 1e-6,
    rotation: Any = "guide",
    scale: bool | str = True,
    blend: Any = smoothstep,
    open_cells: bool = True,
) -> Network:
    """Split guides and characters that cross, any number in any order and direction, into sweeps that share their edges.

    guides, characters: curves in space, one or a sequence of them.

    A cell between two guides and two characters is a full sweep. Where edges are missing, at the rim, there are sweeps of
    one character along two guides, of two along one, of one along one; open_cells=False leaves these out. Guides, or
    characters, whose ends meet make triangles. Curves may end on others, or be closed. Parts beyond the last crossing
    shorter than 0.001 of the size bound nothing.

    Curves cross where they come within `tolerance` times the size of each other; guides are then kept, and characters moved
    onto them, with their tangents and curvatures at the crossings kept. See `Network.gaps`.
    rotation, scale, blend: as for `js.sweep`, for all patches; of the kinds that need two guides "chord" stands for "fixed"
    and "chord+guide" for "guide" on patches with one.
    Decides on known values: make it outside of `jit` and `grad`, and derive by the network's own guides and characters.
    Raises `InputError` on curves that do not cross, on cells that are not bounded, and where the rotation is not defined.
    Source: Jōnishi, Yajima (paper 000), section 2, figures 1 and 2.
    """
    kinds = (_curves(guides, "guides"), _curves(characters, "characters"))
    curves, count = (*kinds[0], *kinds[1]), len(kinds[0])
    if not is_concrete(curves):
        raise InputError(
            "`network` decides on known values which curves cross: make it outside of `jit` and `grad`, and derive by the "
            "`guides` and `characters` of the network."
        )
    names = [f"`{kind}[{k}]`" for kind, of in zip(("guides", "characters"), kinds, strict=True) for k in range(len(of))]
    dtype = max((curve.dtype for curve in curves), key=lambda d: jnp.finfo(d).bits)
    curves = as_type(curves, dtype)
    if not (isinstance(tolerance, int | float) and 0 < tolerance < 0.1):
        raise InputError(f"`tolerance` must be a number between 0 and 0.1, a share of the size, got {tolerance!r}.")
    if not (isinstance(scale, bool) or scale == "chord"):
        raise InputError(f'`scale` must be True, False or "chord", got {scale!r}.')
    rotations = _rotations(rotation)
    samples = sample(curves)
    size = float(np.linalg.norm(np.ptp(samples.points.reshape(-1, 3), axis=0)))
    allowed = max(tolerance, 64 * eps(dtype)) * size
    lengths = np.linalg.norm(np.ptp(samples.points, axis=1), axis=1)
    if lengths.min() <= allowed:
        raise InputError(
            f"{names[int(lengths.argmin())]} is a point; leave it out: guides that meet need no character there."
        )
    bends = [corners(curve) for curve in curves]
    closed = [bool(np.linalg.norm(points[-1] - points[0]) <= allowed) for points in samples.points]
    crossings = find_crossings(curves, samples, count, closed, bends, allowed, size)
    _check_crossings(crossings, samples, count, names, allowed)
    slots, places = merged_nodes(crossings, samples, count, closed, allowed)
    web = Web(samples, count, closed, slots, places)
    web.tail = max(allowed, _TAIL * size)
    found = cells(web, allowed, names, open_cells=open_cells)
    if not found:
        raise InputError(
            "The curves bound no cell with two guides and two characters; add curves, or leave `open_cells` on."
        )
    topology = with_one_side_up(
        NetworkTopology(
            count,
            tuple((c.guide, c.character) for c in crossings),
            tuple(c.held for c in crossings),
            tuple(closed),
            tuple(tuple((slot.node, slot.source) for slot in row) for row in slots),
            plain([_in_range(cell, web) for cell in found]),
        )
    )
    if not isinstance(rotations[1], Fixed | ChordRotation | GivenRotation):
        _check_corners(topology, web, bends, names)
    at = early(jnp.asarray, np.array([c.at for c in crossings]), dtype)
    made = Network(curves[:count], curves[count:], at, topology, rotations, as_blend(blend, dtype), _SCALES[scale])
    if isinstance(rotations[1], ChordGuideRotation):
        _check_chords(topology, web, names)
    if not (isinstance(rotations[1], ChordRotation | ChordGuideRotation) and scale):
        _check_patches(made, names, rotation, scale, allowed)  # the others meet all curves
    return made


def _curves(curves: Any, name: str) -> tuple[AbstractCurve, ...]:
    if not isinstance(curves, AbstractCurve | Sequence) or isinstance(curves, str):
        raise InputError(f"`{name}` must be curves, got {type(curves).__name__}.")
    found = (curves,) if isinstance(curves, AbstractCurve) else tuple(curves)
    if not found:
        raise InputError(f"`{name}` must hold at least one curve, got none.")
    for i, curve in enumerate(found):
        if not isinstance(curve, AbstractCurve):
            raise InputError(f"`{name}[{i}]` must be a curve, got {type(curve).__name__}.")
        if eqx.filter_eval_shape(curve.point, jnp.zeros((), curve.dtype)).shape[0] != 3:
            raise InputError(f"`{name}[{i}]` must be a curve in space, got one in a parameter plane.")
    return found


def _rotations(rotation: Any) -> tuple[AbstractRotation, AbstractRotation]:
    """The kinds for patches with one guide and with two."""
    two = as_rotation(rotation, 2)
    if not isinstance(rotation, str) or rotation in ONE_GUIDE:
        return as_rotation(rotation, 1), two
    return as_rotation("fixed" if rotation == "chord" else "guide", 1), two


def _check_crossings(crossings: list[Crossing], samples: Samples, guides: int, names: list[str], allowed: float) -> None:
    """Every curve must cross one of the other kind, and none runs along another one."""
    pairs = [(c.guide, c.character) for c in crossings]
    for curve, name in enumerate(names):
        if any(curve in pair for pair in pairs):
            continue
        others = range(guides, len(names)) if curve < guides else range(guides)
        apart = [distances(samples.points[curve], samples.points[other]).min() for other in others]
        nearest = int(np.argmin(apart))
        raise InputError(
            f"{name} crosses no {'character' if curve < guides else 'guide'}: the nearest is {names[others[nearest]]}, "
            f"{apart[nearest]:.3g} away, more than the {allowed:.3g} (`tolerance` × size) allowed; make them meet, give a "
            "larger `tolerance`, or leave it out."
        )
    for pair in set(pairs):
        if pairs.count(pair) > _MOST:
            raise InputError(f"{names[pair[0]]} and {names[pair[1]]} run along each other; leave one of them out.")


def _in_range(cell: Cell, web: Web) -> Cell:
    """Runs on closed curves with their lower position on the first round."""

    def moved(run: Run) -> Run:
        curve, a, b = run
        if not web.closed[curve]:
            return run
        count = len(web.slots[curve])
        turns = min(a, b) // count * count
        return curve, a - turns, b - turns

    return Cell(tuple(map(moved, cell.guides)), tuple(map(moved, cell.characters)), cell.tip)


def _check_corners(topology: NetworkTopology, web: Web, bends: list[Corners], names: list[str]) -> None:
    """Refuse guides with corners inside a patch, where a rotation that follows the tangent would tear the surface."""
    for guides, *_ in topology.cells:
        for curve, a, b in guides:
            low, high = sorted((web.place(curve, a), web.place(curve, b)))
            first, last = web.samples.parameters[curve, [0, -1]]
            room = 1e-9 * (last - first)
            places, angles = bends[curve].parameters, bends[curve].angles
            if web.closed[curve]:
                seam = [first] if bends[curve].seam else []
                places = np.concatenate([places, seam])
                angles = np.concatenate([angles, np.full(len(seam), np.nan)])
                places, angles = np.concatenate([places, places + (last - first)]), np.concatenate([angles, angles])
            inside = (places > low + room) & (places < high - room)
            if inside.any():
                k = int(np.argmax(inside))
                degrees = math.degrees(angles[k])
                by = f" of {degrees:.3g}°" if np.isfinite(degrees) else ""
                raise InputError(
                    f"{names[curve]} has a corner{by} at {places[k]:.6g}, inside a patch, where the section would jump: "
                    'let a curve cross it there, split it with `js.split`, or take rotation="fixed" or "chord".'
                )


def _check_chords(topology: NetworkTopology, web: Web, names: list[str]) -> None:
    """Refuse guides that run along their chord, where the frame of chord and tangents is not defined."""
    for guides, _, tip, _ in topology.cells:
        if len(guides) < 2:
            continue
        one, other = (web.path(*run, count=33) for run in guides)
        along, chord = np.gradient(one, axis=0) + np.gradient(other, axis=0), other - one
        lengths = np.linalg.norm(along, axis=1) * np.linalg.norm(chord, axis=1)
        across = np.linalg.norm(np.cross(along, chord), axis=1)
        bad = across[: -1 if tip else None] <= 1e-6 * lengths[: -1 if tip else None]
        if bad.any():
            raise InputError(
                f"{names[guides[0][0]]} and {names[guides[1][0]]} run along the chord between them, where a rotation that "
                'follows their tangents is not defined; take rotation="chord".'
            )


@eqx.filter_jit
def _off(network: Network) -> list[Float[Array, "p"]]:
    """For each patch how far its sides are from its curves."""
    shares = jnp.linspace(0, 1, 9, dtype=network.dtype)

    def of_patch(patch: Any) -> Float[Array, ""]:
        ready = patch.prepared()
        grid = ready.grid_points(shares, shares)
        rows = (*ready.characters.ready, *ready.guides.curves)
        curves = jnp.stack([jax.vmap(curve.point)(shares) for curve in rows])
        sides = [grid[:, 0], grid[:, -1]][: len(ready.characters.ready)]
        sides += [grid[0], grid[-1]] if len(ready.guides.curves) == 2 else [curves[-1]]
        return jnp.max(norm(jnp.stack(sides) - curves))

    return [eqx.filter_vmap(of_patch)(together) for together in stacked_patches(network)]


def _check_patches(made: Network, names: list[str], rotation: Any, scale: Any, allowed: float) -> None:
    found = early(_off, made)
    numbers = [patch for kind in made.classes() for patch in kind.members]
    off = np.concatenate([concrete(part) for part in found])[np.argsort(numbers)]
    worst = np.nan_to_num(off, nan=np.inf)
    if worst.max() <= allowed:
        return
    patch = int(worst.argmax())
    cell = made.topology.cells[patch]
    where = " and ".join(names[curve] for curve, *_ in (*cell[0], *cell[1]))
    if np.isfinite(worst[patch]):
        raise InputError(
            f"The patch between {where} leaves its curves by {worst[patch]:.3g} with rotation={rotation!r}, "
            f'scale={scale!r}, more than the {allowed:.3g} allowed: take rotation "guide" or "chord" with scale=True.'
        )
    raise InputError(
        f"The patch between {where} ({form(cell)}) is not defined with rotation={rotation!r}: a guide runs along the "
        'chord or stands still; take another rotation, such as "chord" or "fixed".'
    )
