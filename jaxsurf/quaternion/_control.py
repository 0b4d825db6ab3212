"""Control directions at the door: unit, and no two neighbours opposite."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import early
from .._array import concrete, is_concrete
from .._errors import InputError
from ..basis import BSplineBasis
from ._directions import blended_on_spans

_TRACED_ANGLE = math.pi / 2  # what evaluation is made ready for where the angles are not known
_LEAST_ANGLE = math.pi / 6
_MARGIN = 1.15  # on the angles at hand, so that an optimiser may bend on
_LOOKS = 8
_OPPOSITE = 1e-6  # radians from opposite: the turn has no axis to 1e-10


def angle_to_blend(basis: BSplineBasis, directions: Float[Array, "m n 3"], name: str) -> float | None:
    """The largest angle between neighbours along the second axis when they are blended along the first; None if traced.

    Refuses blends that become opposite, though the control directions are not. Looked at in 8 places of every span.
    """
    if not is_concrete(basis, directions):
        return None
    blended = concrete(early(_blend, basis, directions)).astype(np.float64)
    angles = neighbour_angles(np.moveaxis(blended, 1, 0))
    if np.any(angles > math.pi - _OPPOSITE):
        i, place = _first(angles > math.pi - _OPPOSITE)
        t = float(concrete(basis.knots)[basis.degree + place // _LOOKS])
        raise InputError(
            f"`{name}` become opposite between rows {i} and {i + 1}, near v = {t:g}, when they are blended; turn them less."
        )
    return float(angles.max(initial=0.0))


@eqx.filter_jit
def _blend(basis: BSplineBasis, directions: Float[Array, "m n 3"]) -> Float[Array, "p n 3"]:
    places = (2 * np.arange(_LOOKS) + 1) / _LOOKS - 1
    return blended_on_spans(basis, directions, places).reshape(-1, *directions.shape[1:])


def neighbour_angles(directions: Float[np.ndarray, "n ... 3"]) -> Float[np.ndarray, "m ..."]:
    """Angles between neighbours along the first axis."""
    a, b = directions[:-1], directions[1:]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def largest_angle(directions: Float[Array, "n *rest 3"]) -> float | None:
    """The largest angle between neighbours along the first axis; None if traced."""
    if not is_concrete(directions):
        return None
    return float(neighbour_angles(concrete(directions).astype(np.float64)).max(initial=0.0))


def ready_angle(angle: float | None) -> float:
    """The angle between neighbours that evaluation is made ready for, given the largest there is, or None if it is traced.

    A little more than that, and in few steps: an optimiser may bend on, and shapes of one family share compiled programs.
    """
    wanted = _TRACED_ANGLE if angle is None else max(_LEAST_ANGLE, _MARGIN * angle)
    return math.radians(min(180, 10 * math.ceil(math.degrees(wanted) / 10 - 1e-9)))


ROUGH = 1e-3
"""How far directions may be off where places are asked for to a thousandth."""


def as_tolerance(tolerance: float | None, dtype: Any) -> float:
    """How far directions may be off, by default 10⁻¹², 10⁻⁶ in single precision."""
    if tolerance is None:
        return 1e-12 if jnp.finfo(dtype).bits > 32 else 1e-6
    if not tolerance > 0:
        raise InputError(f"`tolerance` must be a number > 0, got {tolerance}.")
    return float(tolerance)


def check_directions(directions: Any, name: str, shape: tuple[str, ...]) -> None:
    """Refuse control directions of the wrong shape and, on concrete data, not finite, zero or opposite neighbours along the
    first axis; shape: what is wanted, as in ("n", "3")."""
    if directions.ndim != len(shape) or directions.shape[-1] != 3:
        raise InputError(f"`{name}` must have shape ({', '.join(shape)}), got {directions.shape}.")
    if not is_concrete(directions):
        return
    values = concrete(directions).astype(np.float64)
    sizes = np.linalg.norm(values, axis=-1)
    bad = ~np.isfinite(sizes) | (sizes == 0)
    if np.any(bad):
        place = _first(bad)
        raise InputError(f"`{name}` must be finite and not zero, but {name}{list(place)} is {values[place].tolist()}.")
    refuse_opposite(neighbour_angles(values), name)


def refuse_opposite(angles: Float[np.ndarray, "m ..."], name: str) -> None:
    """Refuse neighbours along the first axis that point opposite ways: no smallest turn leads from one to the other."""
    opposite = angles > math.pi - _OPPOSITE
    if np.any(opposite):
        place = _first(opposite)
        after = (place[0] + 1, *place[1:])
        raise InputError(
            f"`{name}` must not have opposite neighbours, but {name}{list(place)} and {name}{list(after)} are "
            f"{math.degrees(angles[place]):.6f}° apart; put a direction between them, or turn one a little."
        )


def _first(where: np.ndarray) -> tuple[int, ...]:
    return tuple(int(i) for i in np.argwhere(where)[0])
