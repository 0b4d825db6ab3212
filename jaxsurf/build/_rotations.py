"""The table of rotation kinds by name."""

from typing import Any

from .._errors import InputError
from ._rotation import (
    AbstractRotation,
    ChordGuideRotation,
    ChordRotation,
    Fixed,
    FrenetRotation,
    GivenRotation,
    GuideRotation,
    UpRotation,
)
from ._rotation_minimising import RotationMinimising

ONE_GUIDE = {
    "fixed": Fixed,
    "guide": GuideRotation,
    "minimal": RotationMinimising,
    "frenet": FrenetRotation,
    "up": UpRotation,
}
TWO_GUIDES = {**ONE_GUIDE, "guide": ChordGuideRotation, "chord": ChordRotation, "chord+guide": ChordGuideRotation}
NAMES = ("fixed", "chord", "guide", "chord+guide", "minimal", "frenet", "up")


def as_rotation(rotation: Any, guides: int) -> AbstractRotation:
    """The kind for a name, an object or a function of v, for one or two guides."""
    if isinstance(rotation, AbstractRotation):
        if guides == 1 and isinstance(rotation, ChordRotation | ChordGuideRotation):
            raise InputError(f"`rotation` {type(rotation).__name__} needs two guides, got one; give a second guide.")
        return rotation
    if isinstance(rotation, str):
        if rotation not in NAMES:
            raise InputError(f"`rotation` must be one of {', '.join(map(repr, NAMES))} or an object, got {rotation!r}.")
        if guides == 1 and rotation not in ONE_GUIDE:
            raise InputError(f'`rotation` {rotation!r} needs two guides, got one; take "guide", or give a second guide.')
        return (ONE_GUIDE if guides == 1 else TWO_GUIDES)[rotation]()
    if callable(rotation):
        return GivenRotation(rotation)
    raise InputError(f"`rotation` must be a name, an object or a function of v, got {type(rotation).__name__}.")
