"""What every surface is: a rectangle of parameters and a map from it to space."""

import abc
from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array, Float

from .._array import Numbers, as_float, float_type, map_points
from .._derivative import PartialDerivative, check_orders
from .._errors import InputError
from .._prepared import Preparable, point_of, prepare


class AbstractSurface(Preparable):
    """A surface as a pure function of its control data.

    A construction gives `domain`, `point` and `grid_points`; batches, derivatives, `jit`, `vmap` and `grad` follow.
    """

    @property
    @abc.abstractmethod
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """((first u, last u), (first v, last v))."""

    @abc.abstractmethod
    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        """The point at one pair of parameters, inside traced code; from outside call the surface itself."""

    @abc.abstractmethod
    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        """All points S(u_i, v_j), using what the construction has of tensor structure."""

    @property
    def dtype(self) -> Any:
        """The floating type of the control data, and so of all results."""
        return float_type(self)

    def __call__(self, u: Numbers, v: Numbers) -> Float[Array, "*batch 3"]:
        """Points at parameters `u`, `v`, broadcast against each other; converted to the type of the control data."""
        return map_points(point_of, self, as_float(u, self.dtype), as_float(v, self.dtype))

    def grid(self, u: Numbers, v: Numbers) -> Float[Array, "m k 3"]:
        """Points S(u_i, v_j) for u (m,) and v (k,)."""
        u, v = as_float(u, self.dtype), as_float(v, self.dtype)
        if u.ndim != 1 or v.ndim != 1:
            raise InputError(f"`u` and `v` of a grid must be one-dimensional, got shapes {u.shape} and {v.shape}.")
        return _grid(self, u, v)

    def derivative(self, u: Numbers, v: Numbers, order: tuple[int, int] = (1, 0)) -> Float[Array, "*batch 3"]:
        """Partial derivatives, `order` = (times by u, times by v); at breaks, from the right."""
        derived = PartialDerivative(point_of, check_orders(order, 2))
        return map_points(derived, self, as_float(u, self.dtype), as_float(v, self.dtype))


def point_by_point(surface: AbstractSurface, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
    """`grid_points` for surfaces without tensor structure."""
    return map_points(point_of, surface, u[:, None], v[None, :])


@eqx.filter_jit
def _grid(surface: AbstractSurface, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
    return prepare(surface).grid_points(u, v)


def row_by_row(surface: AbstractSurface, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
    """`grid_points` by nested maps, for surfaces of which a row shares work that the compiler can hoist."""
    return jax.vmap(lambda s: jax.vmap(lambda t: surface.point(s, t))(v))(u)
