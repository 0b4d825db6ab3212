"""Progress of long work: the library reports, the caller shows."""

from collections.abc import Callable
from typing import Any, NamedTuple


class Event(NamedTuple):
    """One step of long work.

    phase: what is being done, in words; step: steps done in this phase; steps: how many there will be at most, or
    `None`; rms: the present root mean square deviation, or `None`; snapshot: what a fit needs to go on from here, or
    `None`.
    """

    phase: str
    step: int = 0
    steps: int | None = None
    rms: float | None = None
    snapshot: Any = None


Progress = Callable[[Event], object]
"""Called with an `Event`. A true return value asks the work to stop; the best result so far is then returned."""


def silent(event: Event) -> bool:
    """The default: show nothing, never stop."""
    return False
