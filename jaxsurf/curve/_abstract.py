"""What every curve is: a domain and a map from one parameter to a point."""

import abc
from typing import Any

from jaxtyping import Array, Float

from .._array import Numbers, as_float, float_type, map_points
from .._derivative import PartialDerivative, check_orders
from .._prepared import Preparable, point_of


class AbstractCurve(Preparable):
    """A curve as a pure function of its control data.

    A construction gives `domain` and `point`; batches, derivatives, `jit`, `vmap` and `grad` follow from them.
    """

    @property
    @abc.abstractmethod
    def domain(self) -> tuple[Any, Any]:
        """First and last parameter."""

    @abc.abstractmethod
    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        """The point at one parameter, inside traced code; from outside call the curve itself."""

    @property
    def dtype(self) -> Any:
        """The floating type of the control data, and so of all results."""
        return float_type(self)

    def __call__(self, u: Numbers) -> Float[Array, "*batch d"]:
        """Points at parameters `u` of any shape; they are converted to the type of the control data."""
        return map_points(point_of, self, as_float(u, self.dtype))

    def derivative(self, u: Numbers, order: int = 1) -> Float[Array, "*batch d"]:
        """Derivatives of order ≥ 0 with respect to the parameter; at breaks, from the right."""
        derived = PartialDerivative(point_of, check_orders(order, 1))
        return map_points(derived, self, as_float(u, self.dtype))
