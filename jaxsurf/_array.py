"""Arrays at the public door, and maps over many points."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array

from ._errors import InputError
from ._prepared import prepare

Numbers = ArrayLike | Sequence[Any]
"""What a user may give for an array: a number, nested sequences, a numpy or a jax array."""

CHUNK = 30_000
"""Numbers computed together, 10^4 points: the temporaries of a bicubic patch then stay in the caches."""

Result = TypeVar("Result")


def as_float(values: Numbers, dtype: Any = None) -> Array:
    """Convert to a floating array; floats keep their type unless `dtype` is given, integers become the
    default float."""
    array = jnp.asarray(values)
    if jnp.issubdtype(array.dtype, jnp.complexfloating):
        raise InputError(f"Expected real numbers, got an array of {array.dtype}.")
    if dtype is None:
        dtype = array.dtype if jnp.issubdtype(array.dtype, jnp.floating) else jnp.zeros(0).dtype
    return array.astype(dtype)


def is_concrete(*trees: Any) -> bool:
    """Whether the values can be looked at: no leaf is traced."""
    return not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(trees))


def concrete(array: ArrayLike) -> np.ndarray:
    """The values as a numpy array; only for data that `is_concrete`."""
    return np.asarray(array)


def eps(dtype: Any) -> float:
    """Machine precision of a floating type."""
    return float(jnp.finfo(dtype).eps)


def take(rows: Array, index: Array) -> Array:
    """Row `index` of a table, for one index known to be inside it.

    Nothing is spent on negative or too large indices (a quarter of the time of a bicubic patch).
    """
    numbers = jax.lax.GatherDimensionNumbers(
        offset_dims=tuple(range(rows.ndim - 1)), collapsed_slice_dims=(0,), start_index_map=(0,)
    )
    mode = jax.lax.GatherScatterMode.PROMISE_IN_BOUNDS
    return jax.lax.gather(rows, jax.lax.expand_dims(index, (0,)), numbers, (1, *rows.shape[1:]), mode=mode)


@eqx.filter_jit
def map_points(function: Callable[..., Result], shape: Any, *parameters: Array, chunk: int | None = None) -> Result:
    """Apply `function(shape, *parameters)`, written for one point, to broadcast arrays of parameters.

    More than `chunk` points are worked on in chunks of at most that size, so that temporaries stay in the
    caches and reverse mode keeps one chunk of them at a time; by default as many points as make `CHUNK`
    numbers. Shapes inside `shape` are prepared first. Leaves of the result get the broadcast shape in front.
    """
    shape = prepare(shape)
    arrays = jnp.broadcast_arrays(*parameters)
    batch = arrays[0].shape
    flat = [array.reshape(-1) for array in arrays]
    count = flat[0].size
    one_point = lambda *p: function(shape, *p)
    one_chunk = jax.vmap(one_point)
    if chunk is None:
        chunk = _points_per_chunk(one_point, flat) if count > CHUNK // 100 else count
    chunks = -(-count // max(chunk, 1))
    if chunks <= 1:
        result = one_chunk(*flat)
    else:
        chunk = -(-count // chunks)
        padded = [jnp.pad(array, (0, chunks * chunk - count), mode="edge").reshape(chunks, chunk) for array in flat]
        body = jax.checkpoint(lambda p: one_chunk(*p))
        stacked = jax.lax.map(body, padded)
        result = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:count], stacked)
    return jax.tree.map(lambda leaf: leaf.reshape(*batch, *leaf.shape[1:]), result)


def _points_per_chunk(one_point: Callable[..., Any], parameters: list[Array]) -> int:
    """How many points make `CHUNK` numbers, at least three each; no fewer than 100."""
    result = jax.eval_shape(one_point, *(jax.ShapeDtypeStruct((), array.dtype) for array in parameters))
    numbers = sum(leaf.size for leaf in jax.tree.leaves(result))
    return max(100, CHUNK // max(3, numbers))


def float_type(tree: Any) -> Any:
    """The floating type of a pytree's arrays: that of its control data, and so of its results."""
    types = [leaf.dtype for leaf in jax.tree.leaves(tree) if eqx.is_inexact_array(leaf)]
    return jnp.result_type(*types) if types else jnp.zeros(0).dtype
