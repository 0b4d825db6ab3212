"""Many clouds fitted at once, in one compiled call."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from ..curve import AbstractCurve
from ..query import nearest_samples
from ..surface import AbstractSurface
from ._fit import Fit, fit

_TOGETHER = 16_384  # points of scans that are worked on side by side


def fit_many(
    shape: AbstractCurve | AbstractSurface,
    clouds: Numbers | Sequence[Numbers],
    *,
    weights: Numbers | Sequence[Numbers] | None = None,
    stacked: bool = False,
    **options: Any,
) -> Fit:
    """Fit one shape to each of many clouds; the compiled call serves again for as many clouds of as many points.

    shape: the start of all fits, or with `stacked=True` a shape of which every array has one more axis in front, a start for
    each cloud (as `eqx.filter_vmap` makes). clouds: (K, N, 3), or a sequence of K arrays (N_i, 3) of different size, which are
    padded to the longest with points of weight 0. weights: (K, N), or a sequence alike. options: as in `fit`, the same for
    all: loss, trimmed, fairness, bending, free, fixed, sliding, release, rtol, max_steps.

    Returns a `Fit` with an axis K in front of every array; distances of padding are 0. `jax.tree.map(lambda x: x[k],
    found.shape)` is the k-th shape. First feet are the nearest of a grid of samples, so that shapes which fold back on
    themselves need a start near by. Differentiable like `fit`. Raises `InputError` on clouds that are empty or not finite.
    """
    points, weights = padded(clouds, weights, shape.dtype)
    for name in ("progress", "phase", "start", "parameters", "solver", "rest"):
        if name in options:
            raise InputError(f"`fit_many` takes no `{name}`; leave it out, or fit the clouds one by one with `fit`.")
    free = options.pop("free", None)
    if stacked and any(x.shape[:1] != points.shape[:1] for x in jax.tree.leaves(eqx.filter(shape, eqx.is_array))):
        raise InputError(f"With `stacked=True` every array of `shape` must have {points.shape[0]} entries, one a cloud.")
    return _fit_many(shape, points, weights, stacked, free, options)


@eqx.filter_jit
def _fit_many(shape: Any, points: Array, weights: Array, stacked: bool, free: Any, options: dict[str, Any]) -> Fit:
    arrays, others = eqx.partition(shape, eqx.is_array)
    plain = []  # what is no array in the result, the same for all

    def one(row: Any) -> Any:
        own, points, weights = row
        member = eqx.combine(own if stacked else arrays, others)
        feet = nearest_samples(member, points)
        if isinstance(member, AbstractCurve):
            feet = feet[:, 0]
        found = fit(member, points, weights=weights, start=feet, free=free, **options)
        distance = jnp.where(weights > 0, found.deviation.signed, 0)
        found, static = eqx.partition(eqx.tree_at(lambda f: f.deviation.signed, found, distance), eqx.is_array)
        plain.append(static)
        return found

    count = points.shape[0]
    batches = -(-count // max(1, _TOGETHER // points.shape[1]))
    together = -(-count // batches)
    # whole batches only: a shorter last one would be compiled a second time
    fill = lambda x: jnp.concatenate([x, jnp.repeat(x[-1:], batches * together - count, axis=0)])
    rows = jax.tree.map(fill, (arrays if stacked else None, points, weights))
    found = jax.lax.map(one, rows, batch_size=together)
    return eqx.combine(jax.tree.map(lambda x: x[:count], found), plain[0])


def padded(clouds: Any, weights: Any, dtype: Any) -> tuple[Float[Array, "K N d"], Float[Array, "K N"]]:
    """Clouds of equal length and their weights, 0 where points are copies that fill up."""
    try:
        rows = [clouds] if isinstance(clouds, jax.Array | np.ndarray) else [as_float(c, dtype) for c in clouds]
    except TypeError as error:
        raise InputError(f"`clouds` must be a sequence of arrays (N, 3), got {type(clouds).__name__}.") from error
    if isinstance(clouds, jax.Array | np.ndarray):
        points = as_float(clouds, dtype)
        if points.ndim != 3 or points.shape[0] == 0 or points.shape[1] == 0:
            raise InputError(f"`clouds` must have shape (K, N, 3) with K and N above 0, got {points.shape}.")
        given = jnp.ones(points.shape[:2], dtype) if weights is None else as_float(weights, dtype)
        if given.shape != points.shape[:2]:
            raise InputError(f"`weights` must have shape {points.shape[:2]}, one for each point, got {given.shape}.")
    else:
        for k, cloud in enumerate(rows):
            if cloud.ndim != 2 or cloud.shape[0] == 0:
                raise InputError(f"`clouds` must hold arrays (N, 3) with points, but number {k + 1} is {cloud.shape}.")
        if not rows:
            raise InputError("`clouds` must hold at least one cloud, got none.")
        longest = max(len(cloud) for cloud in rows)
        points = jnp.stack([jnp.pad(c, ((0, longest - len(c)), (0, 0)), mode="edge") for c in rows])
        marks = [jnp.ones(len(c), dtype) for c in rows] if weights is None else [as_float(w, dtype) for w in weights]
        if [mark.shape for mark in marks] != [cloud.shape[:1] for cloud in rows]:
            raise InputError(
                "`weights` must hold an array for each of the `clouds`, with one weight for each of its points."
            )
        given = jnp.stack([jnp.pad(mark, (0, longest - len(mark))) for mark in marks])
    if is_concrete(points) and not np.all(np.isfinite(concrete(points))):
        k = int(np.argmin(np.all(np.isfinite(concrete(points)), axis=(1, 2))))
        raise InputError(f"`clouds` must be finite, but number {k + 1} is not; remove its points that are not.")
    return points, given
