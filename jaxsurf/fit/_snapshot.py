"""Where a solver stands."""

from typing import NamedTuple

import numpy as np


class Snapshot(NamedTuple):
    """A solver at an accepted θ, complete but for the feet, which are found again.

    theta: (P,); step_size: of the trust region, with which it goes on; measured: that with which θ was measured; steps: so
    many were done; done: whether it had met its tolerance; round, scale: the number of the robust round, and the loss's
    scale in it.
    """

    theta: np.ndarray
    step_size: float
    measured: float
    steps: int
    done: bool = False
    round: int = 0
    scale: float = 1.0
