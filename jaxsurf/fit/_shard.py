"""Rows spread over the devices of a mesh: each device works on its own rows, and only sums travel."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array

from .._errors import InputError

AXIS = "points"


def point_mesh(devices: Any = None) -> Mesh:
    """A mesh of one axis, over all devices of all processes unless some are given."""
    return Mesh(np.asarray(jax.devices() if devices is None else devices).reshape(-1), (AXIS,))


def mesh_of(rows: Any) -> Mesh | None:
    """The mesh over which the rows of an array lie spread, or `None`.

    Raises `InputError` if that mesh has more than one axis.
    """
    if not isinstance(rows, jax.Array) or isinstance(rows, Tracer):
        return None
    sharding = rows.sharding
    if not isinstance(sharding, NamedSharding) or sharding.is_fully_replicated:
        return None
    if len(sharding.mesh.axis_names) != 1 or sharding.spec[0] is None or any(sharding.spec[1:]):
        raise InputError(
            f"An array of points must be spread over a mesh of one axis, along its rows, got {sharding.spec} on a mesh of "
            f"{len(sharding.mesh.axis_names)}; use `shard_points`."
        )
    assert isinstance(sharding.mesh, Mesh)
    return sharding.mesh


def spread(rows: Any, mesh: Mesh) -> Array:
    """This process's rows, as many in each process and a multiple of its devices, as part of one array over the mesh."""
    return jax.make_array_from_process_local_data(by_rows(mesh), np.asarray(rows))


def by_rows(mesh: Mesh) -> NamedSharding:
    """Rows apart, columns together."""
    return NamedSharding(mesh, PartitionSpec(mesh.axis_names[0]))


def on_mesh(tree: Any, mesh: Mesh | None) -> Any:
    """The tree with a copy of every array on every device, but for arrays that lie on the mesh already."""
    if mesh is None:
        return tree
    everywhere = NamedSharding(mesh, PartitionSpec())

    def place(leaf: Any) -> Any:
        if not eqx.is_array_like(leaf) or isinstance(leaf, int | float | bool):
            return leaf
        if isinstance(leaf, jax.Array) and isinstance(leaf.sharding, NamedSharding) and leaf.sharding.mesh == mesh:
            return leaf
        host = np.asarray(leaf)
        return jax.make_array_from_callback(host.shape, everywhere, lambda index: host[index])

    return jax.tree.map(place, tree)


def at_home(tree: Any, mesh: Mesh | None) -> Any:
    """The tree with plain arrays of this process in place of those that lie on every device."""
    if mesh is None:
        return tree
    return jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)) if isinstance(leaf, jax.Array) else leaf, tree)


def over_shards(mesh: Mesh | None, function: Callable[..., Any], whole: Any, *rows: Array) -> Any:
    """`function(whole, *rows)`, which gives rows again, for the rows of each device by itself."""
    return function(whole, *rows) if mesh is None else _compiled(mesh, function, whole, *rows)


def in_shards(mesh: Mesh, function: Callable[..., Any], whole: Any, rows: Any, results: Any) -> Any:
    """`function(whole, rows)` for the rows of each device; `results`: a tree of booleans, which results are rows.

    The others must be equal on all devices, as sums of `total` are. For use inside traced code.
    """
    apart, together = PartitionSpec(mesh.axis_names[0]), PartitionSpec()
    arrays, fixed = eqx.partition(whole, eqx.is_array)
    return jax.shard_map(
        lambda arrays, rows: function(eqx.combine(arrays, fixed), rows),
        mesh=mesh,
        in_specs=(together, apart),
        out_specs=jax.tree.map(lambda is_rows: apart if is_rows else together, results),
        check_vma=False,
    )(arrays, rows)


def total(values: Any, mesh: Mesh | None) -> Any:
    """The sum over the devices of a tree of what each has; inside of `in_shards`."""
    return values if mesh is None else jax.lax.psum(values, mesh.axis_names[0])


@eqx.filter_jit
def _compiled(mesh: Mesh, function: Callable[..., Any], whole: Any, *rows: Array) -> Any:
    return in_shards(mesh, lambda whole, rows: function(whole, *rows), whole, rows, True)
