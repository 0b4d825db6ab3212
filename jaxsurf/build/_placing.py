"""Characters put where the guides start or end."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, eps
from .._errors import InputError
from .._safe import norm
from ..curve import AbstractCurve
from ..edit import transform
from ..quaternion import minimal_rotation, to_matrix
from ._guides import Guides
from ._rotation import sampled


def placed(
    character: AbstractCurve, guides: Guides, end: str, name: str, *, tolerance: float, size: float, move: bool
) -> AbstractCurve:
    """A known character with its ends on the guides: as it is if it is there, or moved if that is wanted.

    With one guide a character may stand anywhere; moved, it starts on it. Raises `InputError` with the distance.
    """
    targets, (first, last) = ends_of_guides(guides, end), ends_of(character)
    if len(targets) == 1:
        return transform(character, np.eye(3), targets[0] - first) if move else character
    off = [float(np.linalg.norm(a - b)) for a, b in zip((first, last), targets, strict=True)]
    allowed = max(tolerance, 64 * eps(character.dtype)) * size
    if max(off) <= allowed:
        return character
    if move:
        return _carried(character, (first, last), targets, name)
    index = int(np.argmax(off))
    turned = max(np.linalg.norm(last - targets[0]), np.linalg.norm(first - targets[1])) <= allowed
    advice = "turn it round with `js.reverse`" if turned else "move it there, or pass `move=True`"
    where = "start" if end == "first" else "end"
    raise InputError(
        f"`{name}` {('starts', 'ends')[index]} {off[index]:.3g} from where `guides[{index}]` {where}s; at most "
        f"{allowed:.3g} (`tolerance` × size) is allowed: {advice}."
    )


def _carried(
    character: AbstractCurve, ends: tuple[np.ndarray, np.ndarray], targets: list[np.ndarray], name: str
) -> AbstractCurve:
    """Moved, turned as little as can be, and scaled, so that its ends are on two points."""
    chord, wanted = ends[1] - ends[0], targets[1] - targets[0]
    if np.linalg.norm(chord) <= 64 * eps(character.dtype) * np.ptp(places_on(character), axis=0).max():
        raise InputError(f"`{name}` starts where it ends, so it cannot be moved onto two guides; give an open curve.")
    turn = concrete(early(lambda a, b: to_matrix(minimal_rotation(a, b)), jnp.asarray(chord), jnp.asarray(wanted)))
    matrix = np.linalg.norm(wanted) / np.linalg.norm(chord) * turn
    return transform(character, matrix, targets[0] - matrix @ ends[0])


def without_points(
    characters: tuple[AbstractCurve, ...], guides: Guides, ends: tuple[str, ...], allowed: float
) -> tuple[tuple[AbstractCurve, ...], tuple[str, ...]]:
    """Characters without those that are a point where two guides meet: the other one shrinks to it by itself."""
    if len(guides.curves) == 1:
        return characters, ends
    kept = []
    for i, (character, end) in enumerate(zip(characters, ends, strict=True)):
        first, last = ends_of_guides(guides, end)
        if np.linalg.norm(last - first) > allowed:
            kept.append((character, end))
            continue
        if np.ptp(places_on(character), axis=0).max() > allowed:
            raise InputError(
                f"`characters[{i}]` must be a point where the guides meet, {first.tolist()}; leave it out, or move the "
                "guides apart."
            )
    if not kept:
        raise InputError("The guides meet where the character is, so it cannot grow from there; reverse the guides.")
    characters, ends = zip(*kept, strict=True)
    return characters, ends


def chords_vanish(guides: Guides, allowed: float) -> bool:
    """Whether two known guides meet, or nearly so, at one of many places."""
    if len(guides.curves) == 1:
        return False
    return bool(sampled(guides, lambda here: norm(here.chord))[1].min() <= allowed)


def ends_of(curve: AbstractCurve) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """First and last point of a known curve."""
    places = places_on(curve)
    return places[0], places[-1]


def ends_of_guides(guides: Guides, end: str) -> list[Float[np.ndarray, "3"]]:
    """The points of known guides at one end of their domain."""
    return [ends_of(curve)[0 if end == "first" else 1] for curve in guides.curves]


def places_on(curve: AbstractCurve, count: int = 17) -> Float[np.ndarray, "n 3"]:
    """Points at even parameters of a known curve, its ends included."""
    return concrete(early(_places_on, curve, count))


@eqx.filter_jit
def _places_on(curve: AbstractCurve, count: int) -> Float[Array, "n 3"]:
    a, b = (jnp.asarray(end, curve.dtype) for end in curve.domain)
    share = jnp.linspace(0, 1, count, dtype=curve.dtype)
    return jax.vmap(curve.prepared().point)((1 - share) * a + share * b)


def size_of(curves: tuple[AbstractCurve, ...]) -> float:
    """The diagonal of the box about known curves."""
    return float(np.linalg.norm(np.ptp(np.concatenate([places_on(curve) for curve in curves]), axis=0)))
