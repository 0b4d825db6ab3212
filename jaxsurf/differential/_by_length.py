"""A curve run through at constant speed."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._registry import register
from ..curve import AbstractCurve
from ..curve._breaks import breaks
from ._arc_length import LengthTable, length_table, parameter_within


@register
class ByArcLength(AbstractCurve):
    """The same curve over the same domain, with constant speed: equal steps of the parameter are equal lengths.

    Lengths are tabled once per call; each point takes a few Newton steps. Derivatives are those of the implicit function.
    """

    curve: AbstractCurve

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.curve.domain

    def prepared(self) -> "PreparedByArcLength":
        curve = self.curve.prepared()
        return PreparedByArcLength(self, curve, length_table(self.curve))

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return self.prepared().point(u)


class PreparedByArcLength(AbstractCurve):
    """A `ByArcLength` with its table."""

    whole: ByArcLength
    curve: Any
    table: LengthTable

    @property
    def domain(self) -> tuple[Any, Any]:
        return self.whole.domain

    def prepared(self) -> "PreparedByArcLength":
        return self

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        a, b = self.domain
        return self.curve.point(parameter_within(self.curve, self.table, (u - a) / (b - a) * self.table.lengths[-1]))


@breaks.register(ByArcLength)
def _(shape: ByArcLength) -> Any:
    return _moved(breaks(shape.curve), length_table(shape.curve), shape)


@breaks.register(PreparedByArcLength)
def _(shape: PreparedByArcLength) -> Any:
    return breaks(shape.whole)


def _moved(places: Any, table: LengthTable, shape: ByArcLength) -> Any:
    """Breaks of the curve, which are places of the table, in shares of the length."""
    a, b = (jnp.asarray(end, shape.dtype) for end in shape.domain)
    share = jnp.interp(jnp.asarray(places), table.places, table.lengths) / table.lengths[-1]
    moved = (a + (b - a) * share).at[0].set(a).at[-1].set(b)
    return np.unique(concrete(moved)) if is_concrete(moved) else moved
