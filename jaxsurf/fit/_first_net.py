"""The first net of a cloud, from its unrolling, and nets of least squares at known parameters."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import as_float
from .._progress import Progress
from ..basis import clamped_knots
from ..surface import BSplineSurface
from ._bending import bending_of
from ._fit import fit
from ._linear import linear_fit
from ._parametrise import Parametrisation
from ._pose import faint_bending
from ._shard import at_home
from ._sharded_points import ShardedPoints, whole_points

SLIDING = 0.1  # keeps the isolines of the net even: they follow the unrolled sheet
ATTENUATION = 0.1  # share of the shortest ripple of the net that the background bending takes away
_STIFF = 1.0  # the same for the first net, which must not fold


def linear_start(
    cloud: ShardedPoints,
    parameters: Float[Array, "N 2"],
    knots_u: Float[Array, "k"],
    knots_v: Float[Array, "l"],
    degree: int,
    sides: tuple[Any, ...],
    attenuation: float = ATTENUATION,
) -> BSplineSurface:
    """The net of least squares at known parameters, held by its bending energy where there are no points."""
    count = knots_u.shape[0] - degree - 1, knots_v.shape[0] - degree - 1
    flat = BSplineSurface(jnp.asarray(np.zeros((*count, 3)), knots_u.dtype), knots_u, knots_v, degree, degree)
    bending = bending_of(flat, sides)
    assert bending is not None
    weight = faint_bending(max(count), attenuation)
    net = linear_fit(flat, cloud.points, cloud.spread(parameters), cloud.counted, bending, weight, cloud.mesh)
    return eqx.tree_at(lambda s: s.control_points, flat, at_home(net, cloud.mesh))


def best_start(
    sample: Float[np.ndarray, "N 3"],
    candidates: list[Parametrisation],
    spans: tuple[int, int],
    degree: int,
    progress: Progress,
) -> tuple[BSplineSurface, Array | None]:
    """A first net, stiff, and the feet on it: of the candidate whose short fit comes closest to the thinned cloud."""
    best, best_rms = None, np.inf
    thinned = sample[candidates[0].index]
    points = whole_points(thinned)
    knots_u, knots_v = (as_float(clamped_knots(n + degree, degree), thinned.dtype) for n in spans)
    for candidate in candidates:
        parameters = jnp.asarray(candidate.parameters, thinned.dtype)
        start = linear_start(points, parameters, knots_u, knots_v, degree, candidate.sides, _STIFF)
        start, parameters = _facing_outwards(start, parameters, thinned.mean(axis=0))
        stiff = faint_bending(max(spans) + degree, _STIFF)
        trial = fit(
            start,
            points,
            start=parameters,
            bending=stiff,
            sliding=SLIDING,
            release=1.0,
            rtol=1e-5,
            max_steps=6,
            progress=progress,
            phase="unroll",
        )
        if float(trial.deviation.rms) < best_rms:
            best, best_rms = trial, float(trial.deviation.rms)
        if trial.stopped:
            break
    assert best is not None
    return best.shape, best.foot.parameters if len(thinned) == len(sample) else None


def _facing_outwards(surface: BSplineSurface, parameters: Array, centre: np.ndarray) -> tuple[BSplineSurface, Array]:
    """Turn u round if the normal points to the hollow side, or, on a flat sheet, against its main axis."""
    net = np.asarray(surface.control_points)
    # twice the area vector of the net, and where its middle lies from the centre of the points
    normal = np.cross(net[1:, 1:] - net[:-1, :-1], net[:-1, 1:] - net[1:, :-1]).sum(axis=(0, 1))
    outwards = net[net.shape[0] // 2, net.shape[1] // 2] - centre
    extent = np.linalg.norm(np.ptp(net.reshape(-1, 3), axis=0))
    if np.linalg.norm(outwards) < 0.02 * extent:
        outwards = np.eye(3)[int(np.argmax(np.abs(normal)))]
    if float(normal @ outwards) >= 0:
        return surface, parameters
    knots = np.asarray(surface.knots_u)
    turned = (jnp.asarray(net[::-1]), jnp.asarray((knots[0] + knots[-1] - knots)[::-1]))
    flipped = np.asarray(parameters) * [-1, 1] + [knots[0] + knots[-1], 0]
    return eqx.tree_at(lambda s: (s.control_points, s.knots_u), surface, turned), jnp.asarray(flipped, parameters.dtype)
