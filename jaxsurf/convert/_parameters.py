"""Parameters for points that a spline is to pass through."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._safe import divide, norm, safe_sqrt

_LENGTHS = {
    "chord": lambda chords: chords,
    "centripetal": safe_sqrt,
    "uniform": jnp.ones_like,
}


def spaced_parameters(
    points: Float[Array, "n *rows d"], parameters: str | Numbers, closed: bool, name: str = "parameters"
) -> Float[Array, "k"]:
    """Ascending parameters of points along the first axis; closed, one more for the return to the first.

    A named spacing runs from 0 to 1: steps in proportion to the chords, to their square roots (centripetal)
    or all equal; of several rows, the mean of those that have a length. Source: The NURBS Book, (9.4)-(9.6),
    A9.3.
    """
    count = points.shape[0] + closed
    if not isinstance(parameters, str):
        given = as_float(parameters, points.dtype)
        if given.shape != (count,):
            also = ", the last for the return to the first point" if closed else ""
            raise InputError(f"`{name}` must have shape ({count},){also}, got {given.shape}.")
        _check_ascending(given, name)
        return given
    if parameters not in _LENGTHS:
        known = ", ".join(f'"{key}"' for key in _LENGTHS)
        raise InputError(f"`{name}` must be one of {known} or an array, got {parameters!r}.")
    rows = points.reshape(points.shape[0], -1, points.shape[-1])
    if closed:
        rows = jnp.concatenate([rows, rows[:1]])
    steps = _LENGTHS[parameters](norm(rows[1:] - rows[:-1]))
    # a row shrunk to a point has no shares
    shares = jnp.sum(divide(steps, jnp.sum(steps, axis=0, keepdims=True)), axis=1)
    mean = divide(shares, jnp.sum(shares))
    _check_apart(mean, closed)
    ends = (jnp.zeros(1, mean.dtype), jnp.ones(1, mean.dtype))
    return jnp.concatenate([ends[0], jnp.cumsum(mean)[:-1], ends[1]])


def _check_ascending(parameters: Float[Array, "n"], name: str) -> None:
    if not is_concrete(parameters):
        return
    falls = np.flatnonzero(~(np.diff(concrete(parameters)) > 0))
    if falls.size:
        i = int(falls[0])
        a, b = concrete(parameters)[i : i + 2]
        raise InputError(f"`{name}` must ascend, but number {i + 1} ({b:g}) is not above number {i} ({a:g}).")


def _check_apart(steps: Any, closed: bool) -> None:
    """Refuse neighbours that coincide: two sites at one parameter."""
    if not is_concrete(steps):
        return
    equal = np.flatnonzero(~(concrete(steps) > 0))
    if equal.size:
        i = int(equal[0])
        after = 0 if closed and i == len(steps) - 1 else i + 1
        raise InputError(
            f"`points` {i} and {after} coincide; remove one of them, or give `parameters` that tell them apart."
        )
