"""`sweep`: curves checked, paired, placed and made a surface."""

import math
import warnings
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_type, early
from .._array import concrete, eps, is_concrete
from .._errors import GeometryWarning, InputError
from .._safe import norm
from ..curve import AbstractCurve
from ..differential import ByArcLength
from ._blend import as_blend, smoothstep
from ._guides import Guides
from ._placing import chords_vanish, placed, size_of, without_points
from ._rotation import opposite_places, places_between
from ._rotations import as_rotation
from ._sweep import Sweep

_SCALES = {True: "uniform", False: "none", "chord": "chord"}
_JUMP = 1e-4  # radians by which a section may turn at a break of the guides
_WHIP = 0.1  # |f₀ + f|, about the angle in radians that lacks to a half turn, from which on a near miss is told


def sweep(
    characters: AbstractCurve | Sequence[AbstractCurve],
    guides: AbstractCurve | Sequence[AbstractCurve],
    *,
    rotation: Any = "guide",
    scale: bool | str = True,
    blend: Any = smoothstep,
    pairing: str = "parameter",
    move: bool = False,
    tolerance: float = 1e-6,
) -> Sweep:
    """Carry one or two characters along one or two guides: S(u, v), u along the characters, v along the guides.

    The first character belongs where the guides start, a second one where they end; S(u, first v) and S(u, last v) are they.
    With two guides S(first u, v) and S(last u, v) are the guides; with one the section keeps its place to it.

    rotation: how sections turn. "fixed"; "chord", with the chord between two guides; "guide", with the tangent of one guide,
    and with two guides as "chord+guide", with chord and tangents; "minimal", without twist; "frenet"; "up", level with z
    upright; or an object: `UpRotation(up)`, `RotationMinimising(…)`, `OrientationRotation(…)`, or a function of v that
    gives rotations. scale, with two guides: True, sections grow with the chord; "chord", along it only; False.
    A rotation or scale that leaves the second guide is refused. blend: φ between two characters. pairing of two guides:
    "parameter", or "arc length" for equal shares of their lengths. move: characters whose ends are not on the guides are
    moved there, turned and scaled with two guides; else they must meet within `tolerance` times the size.
    Raises `InputError` on curves that do not meet, and where the kind of rotation is not defined.
    Source: Jōnishi, Yajima (paper 000), sections 2 and 3.
    """
    characters, guides = _curves(characters, "characters"), _curves(guides, "guides")
    dtype = max((curve.dtype for curve in (*characters, *guides)), key=lambda d: jnp.finfo(d).bits)
    characters, guides = as_type(characters, dtype), as_type(guides, dtype)
    if pairing not in ("parameter", "arc length"):
        raise InputError(f'`pairing` must be "parameter" or "arc length", got {pairing!r}.')
    if pairing == "arc length" and len(guides) == 2:
        guides = tuple(ByArcLength(guide) for guide in guides)
    if not (isinstance(scale, bool) or scale == "chord"):
        raise InputError(f'`scale` must be True, False or "chord", got {scale!r}.')
    if len(guides) == 1 and scale == "chord":
        raise InputError('`scale="chord"` needs two guides, got one; give a second guide or leave `scale` out.')
    pair = Guides(guides)
    kind = as_rotation(rotation, len(guides))
    ends = ("first", "last")[: len(characters)]
    size, known = 1.0, is_concrete(characters, pair)
    if known:
        size = size_of((*characters, *guides))
        pair = Guides(guides, chords_vanish(pair, 1e-6 * size))
        characters = tuple(
            placed(c, pair, end, f"characters[{i}]", tolerance=tolerance, size=size, move=move)
            for i, (c, end) in enumerate(zip(characters, ends, strict=True))
        )
        characters, ends = without_points(characters, pair, ends, max(tolerance, 64 * eps(dtype)) * size)
    chosen = "none" if len(guides) == 1 else _SCALES[scale]
    surface = Sweep(characters, pair, kind.settled(pair), as_blend(blend, dtype), chosen, ends)
    if known and is_concrete(surface):
        _check_second_guide(surface, rotation, scale, max(tolerance, 64 * eps(dtype)) * size)
        _check_jumps(surface)
        _warn_of_near_misses(surface)
    return surface


def _curves(curves: Any, name: str) -> tuple[AbstractCurve, ...]:
    if not isinstance(curves, AbstractCurve | Sequence):
        raise InputError(f"`{name}` must be one or two curves, got {type(curves).__name__}.")
    found = (curves,) if isinstance(curves, AbstractCurve) else tuple(curves)
    if len(found) not in (1, 2):
        raise InputError(f"`{name}` must be one or two curves, got {len(found)}; `js.network` takes more.")
    for i, curve in enumerate(found):
        if not isinstance(curve, AbstractCurve):
            raise InputError(f"`{name}[{i}]` must be a curve, got {type(curve).__name__}.")
        size = eqx.filter_eval_shape(curve.point, jnp.zeros((), curve.dtype)).shape[0]
        if size != 3:
            raise InputError(f"`{name}[{i}]` must be a curve in space, got one in a parameter plane.")
    return found


@eqx.filter_jit
def _off_second_guide(surface: Sweep, v: Float[Array, "n"]) -> Float[Array, "n"]:
    prepared = surface.prepared()
    last = jnp.asarray(surface.domain[0][1], surface.dtype)
    gap = lambda t: norm(prepared.point(last, t) - prepared.guides.at(t).positions[1])
    return jax.vmap(gap)(v)


def _check_second_guide(surface: Sweep, rotation: Any, scale: Any, allowed: float) -> None:
    if len(surface.guides.curves) == 1:
        return
    places = places_between(surface.guides, 16)
    off = concrete(early(_off_second_guide, surface, jnp.asarray(places, surface.dtype)))
    if off.max() > allowed:
        v = places[np.argmax(off)]
        raise InputError(
            f"The sweep leaves `guides[1]` by {off.max():.3g} at v = {v:.4g} with rotation={rotation!r}, scale={scale!r}, "
            f'more than the {allowed:.3g} allowed: take "chord" or "chord+guide" with scale=True, or leave that guide out.'
        )


@eqx.filter_jit
def _rows(surface: Sweep, v: Float[Array, "n"]) -> Float[Array, "k n 3 3"]:
    prepared = surface.prepared()
    turn = lambda start, t: surface.rotation.matrix(prepared.table, start.known, prepared.guides.at(t))
    return jax.vmap(lambda start: jax.vmap(lambda t: turn(start, t))(v))(prepared.starts)


def _check_jumps(surface: Sweep) -> None:
    """Refuse guides with corners that a rotation follows: the surface would tear."""
    edges = concrete(surface.guides.breaks()).astype(np.float64)
    inner, gap = edges[1:-1], 1e-9 * (edges[-1] - edges[0])
    if not len(inner):
        return
    sides = np.stack([inner - gap, inner + gap], axis=1)
    for turns in early(_rows, surface, jnp.asarray(sides.ravel(), surface.dtype)):
        pairs = concrete(turns).astype(np.float64).reshape(-1, 2, 3, 3)
        cosine = (np.einsum("nij,nij->n", pairs[:, 0], pairs[:, 1]) - 1) / 2
        angle = np.arccos(np.clip(cosine, -1, 1))
        if angle.max() > max(_JUMP, 1e3 * eps(surface.dtype) ** 0.5):
            v = inner[np.argmax(angle)]
            raise InputError(
                f"The section would jump by {math.degrees(angle.max()):.3g}° at v = {v:.6g}, where a guide has a corner: "
                'split the guides there with `js.split`, or take rotation="fixed" or "chord".'
            )


def _warn_of_near_misses(surface: Sweep) -> None:
    """Where a smallest rotation passes by the opposite direction, sections are whipped round in a short stretch."""
    found = opposite_places(surface.rotation, surface.guides, surface.ends)
    if found is None:
        return
    v, missed = found
    if 1e-6 < missed < _WHIP:
        warnings.warn(
            f"The section is whipped round near v = {v:.4g}: the direction that it follows comes within "
            f'{math.degrees(missed):.2g}° of the opposite of that at its start; rotation="minimal" does not turn it so.',
            GeometryWarning,
            stacklevel=3,
        )
