"""Arrays at the public door, and maps over many points."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from jax.typing import ArrayLike

from ._errors import InputError

Numbers = ArrayLike | Sequence[Any]
"""What a user may give for an array: a number, nested sequences, a numpy or a jax array."""

CHUNK = 10_000
"""Points evaluated together: the temporaries of a bicubic patch then stay in the caches (measured: 10^4 is best)."""

Result = TypeVar("Result")


def as_float(values: Numbers, dtype: Any = None) -> Array:
    """Convert to a floating array; floats keep their type unless `dtype` is given, integers become the default float."""
    array = jnp.asarray(values)
    if jnp.issubdtype(array.dtype, jnp.complexfloating):
        raise InputError(f"Expected real numbers, got an array of {array.dtype}.")
    if dtype is None:
        dtype = array.dtype if jnp.issubdtype(array.dtype, jnp.floating) else jnp.zeros(0).dtype
    return array.astype(dtype)


def is_concrete(*trees: Any) -> bool:
    """Whether the values can be looked at: no leaf is traced."""
    return not any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(trees))


def concrete(array: ArrayLike) -> np.ndarray:
    """The values as a numpy array; only for data that `is_concrete`."""
    return np.asarray(array)


def eps(dtype: Any) -> float:
    """Machine precision of a floating type."""
    return float(jnp.finfo(dtype).eps)


@eqx.filter_jit
def map_points(function: Callable[..., Result], shape: Any, *parameters: Array, chunk: int = CHUNK) -> Result:
    """Apply `function(shape, *parameters)`, written for one point, to broadcast arrays of parameters.

    More than `chunk` points are worked on in chunks of that size, the last one padded, so that temporaries stay in
    the caches and reverse mode keeps one chunk of them at a time. Leaves of the result get the broadcast shape in front.
    """
    arrays = jnp.broadcast_arrays(*parameters)
    batch = arrays[0].shape
    flat = [array.reshape(-1) for array in arrays]
    count = flat[0].size
    one_chunk = jax.vmap(lambda *p: function(shape, *p))
    if count <= chunk:
        result = one_chunk(*flat)
    else:
        chunks = -(-count // chunk)
        padded = [
            jnp.pad(array, (0, chunks * chunk - count), mode="edge").reshape(chunks, chunk) for array in flat
        ]
        body = jax.checkpoint(lambda p: one_chunk(*p))
        stacked = jax.lax.map(body, padded)
        result = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:count], stacked)
    return jax.tree.map(lambda leaf: leaf.reshape(*batch, *leaf.shape[1:]), result)


def float_type(tree: Any) -> Any:
    """The floating type of a pytree's arrays: that of its control data, and so of its results."""
    types = [leaf.dtype for leaf in jax.tree.leaves(tree) if eqx.is_inexact_array(leaf)]
    return jnp.result_type(*types) if types else jnp.zeros(0).dtype
