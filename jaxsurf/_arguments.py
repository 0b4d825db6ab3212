"""What constructors do with their arguments: vectors, numbers, trees of one floating type, known values."""

from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ._array import Numbers, as_float, concrete, is_concrete
from ._errors import InputError

Tree = TypeVar("Tree")
Result = TypeVar("Result")


def as_vector(values: Numbers, name: str, dtype: Any = None, *, sizes: tuple[int, ...] = (3,)) -> Array:
    """Convert to one vector; refuse other shapes and, on concrete data, numbers that are not finite."""
    vector = as_float(values, dtype)
    if vector.ndim != 1 or vector.shape[0] not in sizes:
        wanted = " or ".join(f"({size},)" for size in sizes)
        raise InputError(f"`{name}` must have shape {wanted}, got {vector.shape}.")
    _check_finite(vector, name)
    return vector


def as_direction(values: Numbers, name: str, dtype: Any = None) -> Array:
    """Convert to a vector of any length that gives a direction; concrete zero vectors are refused."""
    vector = as_vector(values, name, dtype)
    if is_concrete(vector) and not np.sum(concrete(vector) ** 2) > 0:
        raise InputError(f"`{name}` must be a direction, got the zero vector {concrete(vector).tolist()}.")
    return vector


def as_number(value: Numbers, name: str, dtype: Any = None, *, positive: bool = False) -> Array:
    """Convert to one number; on concrete data it must be finite and, where asked, positive."""
    number = as_float(value, dtype)
    if number.shape != ():
        raise InputError(f"`{name}` must be one number, got shape {number.shape}.")
    _check_finite(number, name)
    if positive and is_concrete(number) and not concrete(number) > 0:
        raise InputError(f"`{name}` must be positive, got {float(number):g}.")
    return number


def as_type(tree: Tree, dtype: Any) -> Tree:
    """The same pytree with all its floating arrays of one type."""
    return jax.tree.map(lambda leaf: leaf.astype(dtype) if eqx.is_inexact_array(leaf) else leaf, tree)


def early(function: Callable[..., Result], *known: Any) -> Result:
    """`function(*known)`, computed at once if all of it is concrete, so that it stays so inside `jit`."""
    if not is_concrete(known) or is_concrete(jnp.zeros(())):  # the latter: nothing is being traced
        return function(*known)
    with jax.ensure_compile_time_eval():
        return function(*known)


def _check_finite(array: Array, name: str) -> None:
    if is_concrete(array) and not np.all(np.isfinite(concrete(array))):
        raise InputError(f"`{name}` must be finite, got {concrete(array).tolist()}.")
