"""Sections turned through given orientations."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete, take
from .._errors import InputError
from .._registry import register
from ..basis import BSplineBasis, averaged_knots, collocation_matrix
from ..quaternion import conjugate, exp, from_matrix, log, multiply, normalize, to_matrix
from ._guides import Guides, Station
from ._rotation import AbstractRotation, FrameRotation


class _Turns(NamedTuple):
    """The first orientation, half the turns from each to the next, their shares as a spline, (k, k − 1)."""

    first: Float[Array, "4"]
    turns: Float[Array, "j 3"]
    shares: Float[Array, "k j"]
    basis: BSplineBasis


@register
class OrientationRotation(FrameRotation):
    """A quaternion spline through orientations at parameters of the guide, turning the shorter way from one to the next.

    parameters: (k,), ascending, the first and the last of the guide's domain among them; orientations: (k, 4) unit
    quaternions, q and −q alike, or (k, 3, 3) rotation matrices. Cubic, or of degree k − 1 for fewer than 4:
    q(v) = exp(ω_k φ_k(v)) … exp(ω_2 φ_2(v)) q_1, ω_i half the rotation vector from q_(i−1) to q_i and φ_i the spline, with
    the knots of interpolation, that is 0 at the first i − 1 parameters and 1 at the others. So it passes through all q_i
    exactly; about one axis it is the interpolating spline of the angle.
    """

    parameters: Float[Array, "k"]
    orientations: Float[Array, "k 4"]

    def __init__(self, parameters: Numbers, orientations: Numbers):
        given = as_float(orientations)
        if given.shape[1:] == (3, 3):
            given = from_matrix(given)
        if given.ndim != 2 or given.shape[1] != 4 or given.shape[0] < 2:
            raise InputError(f"`orientations` must have shape (k, 4) or (k, 3, 3) with k ≥ 2, got {given.shape}.")
        self.orientations = normalize(given)
        self.parameters = as_float(parameters, given.dtype)
        if self.parameters.shape != given.shape[:1]:
            raise InputError(
                f"`parameters` must be one for each of {given.shape[0]} orientations, got {self.parameters.shape}."
            )
        if is_concrete(self.parameters) and not np.all(np.diff(concrete(self.parameters)) > 0):
            raise InputError(f"`parameters` must ascend, got {concrete(self.parameters).tolist()}.")

    def settled(self, guides: Guides) -> AbstractRotation:
        if is_concrete(guides, self.parameters):
            wanted = [float(end) for end in guides.domain]
            got = [float(self.parameters[0]), float(self.parameters[-1])]
            if max(abs(a - b) for a, b in zip(wanted, got, strict=True)) > 1e-9 * (wanted[1] - wanted[0]):
                raise InputError(f"`parameters` of orientations must run over the guide's domain {wanted}, got {got}.")
        return self

    def table(self, guides: Guides) -> _Turns:
        parameters = self.parameters.astype(guides.dtype)
        count = parameters.shape[0]
        degree = min(3, count - 1)
        knots = averaged_knots(parameters, degree)
        steps = jnp.tri(count, count - 1, -1, dtype=parameters.dtype)
        units = self.orientations.astype(guides.dtype)
        turns = log(multiply(units[1:], conjugate(units[:-1])))
        shares = jnp.linalg.solve(collocation_matrix(knots, degree, parameters), steps)
        return _Turns(units[0], turns, shares, BSplineBasis(knots, degree))

    def frame(self, table: _Turns, here: Station) -> Float[Array, "3 3"]:
        first, values = table.basis.local(here.v)
        shares = jnp.stack(values) @ jnp.stack([take(table.shares, first + i) for i in range(len(values))])
        q = table.first
        for turn in exp(shares[:, None] * table.turns):
            q = multiply(turn, q)
        return to_matrix(q)
