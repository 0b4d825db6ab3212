"""One second fundamental form at each node of a network: what patches with common curvatures along all seams share there."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._safe import divide, norm, unit

_SINGULAR = 1e-2  # of singular values, relative: directions of forms that curves leave open


class NodeForms(NamedTuple):
    """Normals at nodes, two orthonormal directions beside them, forms in these, and by how much curves have other normal
    curvatures than their node's form, times their speed: (n, c, 2) for the directions of its corners."""

    normals: Float[Array, "n 3"]
    axes: Float[Array, "n 2 3"]
    forms: Float[Array, "n 2 2"]
    off: Float[Array, "n c 2"]

    def of(self, node: np.ndarray, normal: Array, one: Array, other: Array) -> Array:
        """II(one, other) at nodes, by normals that are theirs or the opposite ones."""
        a, b = (jnp.sum(self.axes[node] * x[..., None, :], axis=-1) for x in (one, other))
        value = jnp.sum(a[..., :, None] * self.forms[node] * b[..., None, :], axis=(-2, -1))
        return jnp.sum(normal * self.normals[node], axis=-1) * value


def node_forms(
    normals: Float[Array, "n 3"],
    first: Float[Array, "n c 2 3"],
    second: Float[Array, "n c 2 2 3"],
    counted: Int[np.ndarray, "n c 2"],
) -> NodeForms:
    """Forms with the normal curvatures of all curves at each node, as well as there are such, and in what these leave open
    those of the mean of the patches' own.

    first, second: derivatives of the corners at each node by both parameters. counted: 1 where these are along curves, 0
    along free sides, −1 for no corner at all.
    """
    dtype = normals.dtype
    lengths = norm(first)
    there = (lengths > 1e-9 * jnp.max(lengths, axis=(1, 2), keepdims=True)) & (counted >= 0)
    live = there.astype(dtype)
    start = jnp.where(live[:, 0, :1] > 0, first[:, 0, 0], first[:, 0, 1])
    one = unit(start - jnp.sum(start * normals, axis=-1, keepdims=True) * normals)
    axes = jnp.stack([one, jnp.cross(normals, one)], axis=1)
    at = jnp.einsum("ncdx,nax->ncda", first, axes, precision="highest")
    bent = jnp.einsum("ncdex,nx->ncde", second, normals, precision="highest")
    own, known = _own_forms(at, bent, live[..., 0] * live[..., 1] * lengths[..., 0] * lengths[..., 1])
    mean = divide(jnp.sum(own * known[..., None], axis=1), jnp.maximum(jnp.sum(known, axis=1), 1)[:, None])
    x, y = jnp.moveaxis(divide(at, lengths[..., None]), -1, 0)
    held = live * jnp.asarray(counted > 0, dtype)
    rows = held[..., None] * jnp.stack([x * x, 2 * x * y, y * y], axis=-1)
    bends = held * divide(jnp.stack([bent[..., 0, 0], bent[..., 1, 1]], axis=-1), lengths * lengths)
    rows, bends = rows.reshape(len(rows), -1, 3), bends.reshape(len(rows), -1)
    lack = bends - jnp.einsum("nrk,nk->nr", rows, mean, precision="highest")
    found = mean + jnp.einsum("nkr,nr->nk", jnp.linalg.pinv(rows, rtol=_SINGULAR), lack, precision="highest")
    off = bends - jnp.einsum("nrk,nk->nr", rows, found, precision="highest")
    return NodeForms(normals, axes, found[:, np.array([[0, 1], [1, 2]])], off.reshape(lengths.shape) * lengths)


def _own_forms(at: Array, bent: Array, sizes: Array) -> tuple[Float[Array, "n c 3"], Float[Array, "n c"]]:
    """The corners' own forms, by D II Dᵀ = L, and which of them have one; sizes: products of lengths, 0 of what does not
    count."""
    (a, b), (c, d) = jnp.moveaxis(at[..., 0, :], -1, 0), jnp.moveaxis(at[..., 1, :], -1, 0)
    area = a * d - b * c
    known = (jnp.abs(area) > 1e-6 * sizes).astype(at.dtype)
    area = jnp.where(known > 0, area, 1)
    inverse = jnp.stack([jnp.stack([d, -b], -1), jnp.stack([-c, a], -1)], -2) / area[..., None, None]
    form = jnp.einsum("ncad,ncde,ncbe->ncab", inverse, bent, inverse, precision="highest")
    form = jnp.stack([form[..., 0, 0], 0.5 * (form[..., 0, 1] + form[..., 1, 0]), form[..., 1, 1]], axis=-1)
    return jnp.where(known[..., None] > 0, form, 0), known
