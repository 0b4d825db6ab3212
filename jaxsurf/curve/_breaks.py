"""Breaks: the parameters between which a shape is smooth."""

from functools import singledispatch
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._array import concrete, float_type, is_concrete
from ..basis import BSplineBasis
from ._abstract import AbstractCurve
from ._bspline import BSplineCurve

SPANS = 8
"""Into how many spans a domain is split of which nothing is known."""


@singledispatch
def breaks(shape: Any) -> Any:
    """Ascending parameters from the first to the last of the domain, between which the shape is smooth.

    A curve gives one array, a surface a pair of arrays (u, v). Knots and joints are breaks; a shape of which
    nothing is known is split in 8 equal spans. The arrays are concrete and without repetitions; of a traced
    shape they are traced and keep repeated knots, as spans of no length. A class gives its own rule by
    `@breaks.register`.
    """
    raise TypeError(f"`breaks` knows no rule for {type(shape).__name__}.")


def even_breaks(domain: tuple[Any, Any], dtype: Any) -> Any:
    """A domain of which nothing is known, split in 8 equal spans."""
    start, end = (jnp.asarray(bound, dtype) for bound in domain)
    if is_concrete(start, end):
        return np.linspace(concrete(start), concrete(end), SPANS + 1, dtype=start.dtype)
    return jnp.linspace(start, end, SPANS + 1)


def knot_breaks(basis: BSplineBasis) -> Any:
    """The knots inside the domain and its ends."""
    first, last = (0, basis.size) if basis.periodic else (basis.degree, basis.size)
    if not is_concrete(basis.knots):
        return basis.knots[first : last + 1]
    # known knots stay known while other data are traced: no jax operation on them
    return np.unique(concrete(basis.knots)[first : last + 1])


@breaks.register(AbstractCurve)
def _(shape: AbstractCurve) -> np.ndarray | Array:
    return even_breaks(shape.domain, float_type(shape))


@breaks.register(BSplineCurve)
def _(shape: BSplineCurve) -> np.ndarray | Array:
    return knot_breaks(shape.basis)
