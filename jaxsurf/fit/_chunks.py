"""Many points by chunks of equal size, so that what is computed for each of them finds room."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

CHUNK = 100_000  # points worked on at once

Carry = TypeVar("Carry")


def over_chunks(work: Callable[[Carry, Any, Bool[Array, "n"]], tuple[Carry, Array]], carry: Carry, rows: Any) -> Any:
    """`work(carry, rows, new)` for chunks of the rows of a tree, one after the other: the last carry, and the rows of the
    array that each chunk gives. The last chunk overlaps the one before it: `new` marks the rows not seen before."""
    count = jax.tree.leaves(rows)[0].shape[0]
    size = min(CHUNK, count)
    offsets = jnp.arange(size, dtype=jnp.int32)

    def one(state: tuple[Carry, Array], first: Array) -> tuple[tuple[Carry, Array], None]:
        carry, found = state
        start = jnp.minimum(first, count - size)
        chunk = jax.tree.map(lambda x: jax.lax.dynamic_slice_in_dim(x, start, size), rows)
        carry, part = work(carry, chunk, start + offsets >= first)
        return (carry, jax.lax.dynamic_update_slice_in_dim(found, part, start, axis=0)), None

    if size == count:
        return work(carry, rows, jnp.ones(count, bool))
    whole = jax.tree.map(lambda x: x[:size], rows)
    part = jax.eval_shape(lambda rows: work(carry, rows, jnp.ones(size, bool))[1], whole)
    found = jnp.zeros((count, *part.shape[1:]), part.dtype)
    return jax.lax.scan(one, (carry, found), jnp.arange(0, count, size, dtype=jnp.int32))[0]
