"""What a fit found, and how it depends on what was given."""

from statistics import NormalDist
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from .. import _safe
from ..query import Foot
from ._deviation import Deviation
from ._losses import noise_scale
from ._pose import diagonal
from ._problem import Problem, unknowns_of
from ._uncertainty import Uncertainty, uncertainty_of


class Fit(eqx.Module):
    """What a fit found.

    shape: the fitted member of the family; foot: the feet of all points on it; deviation: their distances; result: how
    the solver ended, an `optimistix.RESULTS`; steps: solver steps in all; stopped: whether `progress` asked to stop;
    problem: what was solved, in the end, with the resistance to gliding that all its steps amount to. Of `fit_many` all
    arrays have an axis K in front.
    """

    shape: Any
    foot: Foot
    deviation: Deviation
    result: Any
    steps: Int[Array, "*K"]
    stopped: bool = False
    problem: Any = None

    @property
    def converged(self) -> Any:
        """Whether the solver met its tolerance."""
        return self.result == optx.RESULTS.successful

    @property
    def rms(self) -> Float[Array, "*K"]:
        """Root of the weighted mean square distance, of each cloud where there are many."""
        counted = self.problem.weights
        square = jnp.sum(counted * self.deviation.signed**2, axis=-1) / jnp.sum(counted, axis=-1)
        return jnp.sqrt(square)

    @property
    def outliers(self) -> Bool[Array, "*K N"]:
        """Which points lie so far off that noise would put one of twenty such clouds there; the noise is taken from the
        median of the distances."""
        counted = self.problem.weights
        noise = noise_scale(self.deviation.signed, counted)
        chance = 0.05 / max(counted.shape[-1], 1)
        return jnp.abs(self.deviation.signed) > noise[..., None] * NormalDist().inv_cdf(1 - chance / 2)

    def uncertainty(self, noise: float | None = None) -> Uncertainty:
        """Variances of the control data and of the shape's places; see `Uncertainty`.

        noise: standard deviation of a measurement of weight 1, so 1 if weights are 1/variance; by default taken from the
        distances.
        """
        return uncertainty_of(self.problem, self.problem.unknowns(self.shape), self._feet, noise)

    @property
    def _feet(self) -> Array:
        return self.foot.parameters.reshape(self.problem.points.shape[0], -1)


def frozen(tree: Any) -> Any:
    """The same numbers, without derivatives."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_inexact_array(x) else x, tree)


def given_way(problem: Problem, freed: Float[Array, ""]) -> Problem:
    """The problem with the resistance to gliding that all steps together amount to."""
    return eqx.tree_at(lambda p: p.sliding, problem, jnp.minimum(problem.sliding, _safe.divide(jnp.ones_like(freed), freed)))


def attached(problem: Problem, shape: Any, points: Any, weights: Any, rest: Any = None, fixed: Any = None) -> Problem:
    """The problem with the numbers that were given, which carry derivatives: all but what was free."""
    leaves, structure = jax.tree.flatten(problem.shape)
    given = jax.tree.leaves(shape)
    if len(given) == len(leaves):
        leaves = [old if free else new for old, new, free in zip(leaves, given, problem.free, strict=True)]
    trimmed = jax.lax.stop_gradient(_safe.divide(problem.weights, jax.lax.stop_gradient(weights)))
    known = (jax.tree.unflatten(structure, leaves), points, weights * trimmed, diagonal(points))
    problem = eqx.tree_at(lambda p: (p.shape, p.points, p.weights, p.size), problem, known)
    if fixed:
        problem = eqx.tree_at(lambda p: p.fixed, problem, fixed)
    return problem if rest is None else eqx.tree_at(lambda p: p.rest, problem, unknowns_of(rest, problem.free))
