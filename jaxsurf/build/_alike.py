"""Shapes that differ in the values of their arrays alone are evaluated in one pass, which compiles once."""

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from .._prepared import prepare


def kinds_of(shapes: Sequence[Any], flags: Sequence[Any] | None = None) -> list[list[int]]:
    """The numbers of the shapes of each kind: one structure, one set of shapes of arrays, one static rest, one flag."""
    kinds: list[Any] = []
    members: list[list[int]] = []
    for number, (shape, flag) in enumerate(zip(shapes, flags or [None] * len(shapes), strict=True)):
        arrays, rest = eqx.partition(shape, eqx.is_array)
        sizes = tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(arrays))
        static = tuple(leaf if isinstance(leaf, Hashable) else id(leaf) for leaf in jax.tree.leaves(rest))
        kind = (jax.tree.structure(arrays), sizes, jax.tree.structure(rest), static, flag)
        if kind not in kinds:
            kinds.append(kind)
            members.append([])
        members[kinds.index(kind)].append(number)
    return members


def stack(shapes: Sequence[Any]) -> Any:
    """Shapes of one kind as one, their arrays stacked in front."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves) if eqx.is_array(leaves[0]) else leaves[0], *shapes)


def prepared_alike(shapes: Sequence[Any]) -> tuple[tuple[Any, ...], Any]:
    """Shapes prepared, and all of them stacked if they are several of one kind, else None."""
    if len(shapes) == 1 or len(kinds_of(shapes)) > 1:
        return tuple(prepare(shape) for shape in shapes), None
    together = eqx.filter_vmap(prepare)(stack(shapes))
    return tuple(row_of(together, k) for k in range(len(shapes))), together


def row_of(together: Any, row: Any) -> Any:
    """One of stacked shapes."""
    return jax.tree.map(lambda leaf: leaf[row] if eqx.is_array(leaf) else leaf, together)


def each(shapes: Sequence[Any], evaluate: Callable[[Any], Any]) -> list[Any]:
    """`evaluate` of every shape; those of one kind share one pass."""
    found: list[Any] = [None] * len(shapes)
    for members in kinds_of(shapes):
        if len(members) == 1 or not jax.tree.leaves(eqx.filter(shapes[members[0]], eqx.is_array)):
            for k in members:
                found[k] = evaluate(shapes[k])
            continue
        values = eqx.filter_vmap(evaluate)(stack([shapes[k] for k in members]))
        for row, k in enumerate(members):
            found[k] = row_of(values, row)
    return found
