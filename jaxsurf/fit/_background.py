"""What holds the control data that no point determines in shapes that are no B-spline nets: as few turns as may be."""

from functools import singledispatch
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._safe import unit
from ..curve import QICurve
from ..surface import QISurface
from ._problem import Problem

_HOLD = 0.1  # how firmly control tangents keep the length that means nothing


@singledispatch
def turning(shape: Any) -> Any:
    """Rows whose sum of squares grows as a shape bends, and rows that only fix numbers without meaning; neither has a unit.

    None for shapes that need no background.
    """
    return None


@turning.register
def _(shape: QICurve) -> tuple[Float[Array, "r"], Float[Array, "s"]]:
    return jnp.diff(unit(shape.tangents), axis=0).reshape(-1), _off_unit(shape.tangents)


@turning.register
def _(shape: QISurface) -> tuple[Float[Array, "r"], Float[Array, "s"]]:
    units = unit(shape.tangents)
    spine, off = turning(shape.spine)
    relative = jnp.diff(shape.lengths) / jnp.mean(shape.lengths)
    rows = [jnp.diff(units, axis=0).reshape(-1), jnp.diff(units, axis=1).reshape(-1), relative, spine]
    return jnp.concatenate(rows), jnp.concatenate([_off_unit(shape.tangents), off])


def background_terms(
    problem: Problem, theta: Float[Array, "P"]
) -> tuple[Float[Array, ""], Float[Array, "P"], Float[Array, "P P"]] | None:
    """Value, gradient and Gauss-Newton matrix of ½ bending |rows|² and of what fixes numbers without meaning."""
    if turning(problem.shape) is None:
        return None

    def rows(x: Float[Array, "P"]) -> Float[Array, "r"]:
        bent, fixed = turning(problem.member(x))
        return jnp.concatenate([jnp.sqrt(problem.bending) * bent, _HOLD * fixed])

    values, jacobian = rows(theta), jax.jacfwd(rows)(theta)
    return 0.5 * values @ values, values @ jacobian, jacobian.T @ jacobian


def _off_unit(directions: Float[Array, "*n 3"]) -> Float[Array, "r"]:
    return 0.5 * (jnp.sum(directions**2, axis=-1).reshape(-1) - 1)
