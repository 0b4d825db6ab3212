"""A fit as data: which numbers are free, which points are to be met."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import _safe
from .._array import map_points
from .._errors import InputError
from ..curve import NURBSCurve
from ..query import held_parameters, value_and_tangents
from ..surface import NURBSSurface
from ._losses import LOSSES, Loss
from ._shard import total

Free = tuple[bool | str, ...]
"""For each leaf of a shape: whether it is free, and "log" where its logarithm is, which keeps it positive."""


class Problem(eqx.Module):
    """Fit the free leaves of `shape` to `points`.

    The unknowns θ are the free leaves, flattened in order, of rational weights the logarithms; `shape` holds their start and
    all that is fixed. The objective is ½ Σ w s² ρ(d²/s²) / (size² Σ w) plus half the penalties, d the distance to the foot
    point, and so without unit.
    weights: (N,) ≥ 0; scale: s of the loss; bending and fairness: weights of the two penalties; sliding: see
    `linearise`; rest: the θ at which nothing is bent, 0 for a flat sheet; penalty: the bending matrix of the control
    points, which are the first leaf, or `None`; fixed: functions of the shape that are to vanish; held: whether points
    belong to known parameters, so that feet stay where they are; turns: steps at most by which feet follow the shape; mesh:
    of the devices over which the points lie spread, `None` for one.
    """

    shape: Any
    points: Float[Array, "N d"]
    weights: Float[Array, "N"]
    size: Float[Array, ""]
    scale: Float[Array, ""]
    bending: Float[Array, ""]
    fairness: Float[Array, ""]
    sliding: Float[Array, ""]
    rest: Float[Array, "P"]
    penalty: Float[Array, "q q"] | None
    fixed: tuple[Callable[[Any], Any], ...]
    free: Free = eqx.field(static=True)
    loss: str = eqx.field(static=True)
    fair: bool = eqx.field(static=True)
    held: bool = eqx.field(static=True, default=False)
    turns: int = eqx.field(static=True, default=60)
    mesh: Any = eqx.field(static=True, default=None)

    def unknowns(self, shape: Any = None) -> Float[Array, "P"]:
        """θ of `shape`, by default of the start."""
        return unknowns_of(self.shape if shape is None else shape, self.free)

    def member(self, theta: Float[Array, "P"]) -> Any:
        """The shape with unknowns θ."""
        return moved(self.shape, theta, self.free)

    def violation(self, theta: Float[Array, "P"]) -> Float[Array, "k"]:
        """How far the shape is from what is fixed, 0 where that is kept; lengths are measured by the size."""
        shape = self.member(theta)
        return jnp.concatenate([jnp.ravel(rows(shape)) for rows in self.fixed])

    def unit(self) -> Float[Array, ""]:
        """size² Σ w, over all devices: what makes the objective free of units."""
        return self.size**2 * total(jnp.sum(self.weights), self.mesh)

    def point_weights(self, distance: Float[Array, "N"]) -> Float[Array, "N"]:
        """Weights of the points in the normal equations, times `unit`."""
        loss: Loss = LOSSES[self.loss]
        return self.weights * loss.weight((distance / self.scale) ** 2)

    def loss_of(self, square: Float[Array, "N"]) -> Float[Array, ""]:
        """The data term of the objective by the squared distances, times `unit`."""
        loss: Loss = LOSSES[self.loss]
        return 0.5 * jnp.sum(self.weights * self.scale**2 * loss.value(square / self.scale**2))


def moved(shape: Any, theta: Float[Array, "P"], free: Free) -> Any:
    """The shape with its free leaves filled from θ."""
    leaves, structure = jax.tree.flatten(shape)
    filled, at = [], 0
    for leaf, moves in zip(leaves, free, strict=True):
        if moves:
            value = theta[at : at + leaf.size].reshape(leaf.shape)
            leaf, at = jnp.exp(value) if moves == "log" else value, at + leaf.size
        filled.append(leaf)
    return jax.tree.unflatten(structure, filled)


def unknowns_of(shape: Any, free: Free) -> Float[Array, "P"]:
    """The free leaves of a shape, flattened in order."""
    leaves = zip(jax.tree.leaves(shape), free, strict=True)
    return jnp.concatenate([(jnp.log(leaf) if moves == "log" else leaf).reshape(-1) for leaf, moves in leaves if moves])


def free_leaves(shape: Any, where: Callable[[Any], Any] | None) -> Free:
    """Which leaves of a shape may move: all arrays but knots, or those that `where` picks from the shape. Rational weights
    stay positive.

    Raises `InputError` if nothing is free.
    """
    if where is None:
        paths = jax.tree_util.tree_flatten_with_path(shape)[0]
        free = tuple(
            eqx.is_inexact_array(leaf) and not any("knots" in jax.tree_util.keystr((key,)) for key in path)
            for path, leaf in paths
        )
    else:
        none = jax.tree.map(lambda _: False, shape)
        chosen = eqx.tree_at(lambda s: jax.tree.leaves(where(s)), none, replace_fn=lambda _: True)
        free = tuple(jax.tree.leaves(chosen))
    if not any(free):
        raise InputError("`free` leaves nothing to fit: it must pick at least one array of the shape.")
    return tuple("log" if moves and weights else moves for moves, weights in zip(free, _weights(shape), strict=True))


def _weights(shape: Any) -> list[bool]:
    """Which leaves are the weights of rational shapes."""
    rational = lambda node: isinstance(node, NURBSCurve | NURBSSurface)
    none = lambda node: jax.tree.map(lambda _: False, node)
    mark = lambda node: eqx.tree_at(lambda n: n.weights, none(node), True) if rational(node) else False
    return jax.tree.leaves(jax.tree.map(mark, shape, is_leaf=rational))


class Linearised(eqx.Module):
    """Distances at fixed feet: offset S − p, and the matrix R whose RᵀR weighs the directions in which S may move."""

    offset: Float[Array, "... d"]
    root: Float[Array, "... d d"]


def linearise(
    shape: Any, parameters: Float[Array, "N k"], points: Float[Array, "N d"], sliding: Float[Array, ""]
) -> Linearised:
    """At each foot R = I − (1 − √sliding) QQᵀ, Q spanning the tangents along which the foot is free to slide.

    With sliding = 0 that is the projector onto the normal of a surface; on a border the direction out of it is added, at a
    corner, or at the end of a curve, it is the identity. By the envelope theorem the derivative of ½ d² by θ is
    offset · ∂S/∂θ, and RᵀR the Gauss-Newton metric, in which a little `sliding` keeps the net from gliding along the sheet.
    """
    k, d = parameters.shape[1], points.shape[1]

    def one(shape: Any, *row: Array) -> Linearised:
        t, p = jnp.stack(row[:k]), jnp.stack(row[k:])
        point, tangents = value_and_tangents(shape, t)
        held = held_parameters(shape, t, (point - p) @ tangents)
        moving = jnp.where(held[None, :], 0, tangents)
        normal = across(moving)
        along = jnp.eye(d, dtype=p.dtype) - normal
        return Linearised(point - p, normal + jnp.sqrt(sliding) * along)

    return map_points(one, shape, *parameters.T, *points.T)


def across(tangents: Float[Array, "d k"]) -> Float[Array, "d d"]:
    """The projector onto what is orthogonal to the columns; columns of zeros do not count."""
    normal = jnp.eye(tangents.shape[0], dtype=tangents.dtype)
    for i in range(tangents.shape[1]):
        q = _safe.unit(normal @ tangents[:, i])
        normal = normal - q[:, None] * q[None, :]
    return normal
