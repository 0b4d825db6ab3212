"""Sections turned through given orientations."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import Numbers, as_float, concrete, is_concrete
from .._errors import InputError
from .._registry import register
from ..basis import averaged_knots
from ..quaternion import QuaternionSpline, conjugate, from_matrix, multiply, normalize, to_matrix
from ._guides import Guides, Station
from ._rotation import AbstractRotation, FrameRotation

_ROUNDS = 40


@register
class OrientationRotation(FrameRotation):
    """A quaternion spline through orientations at parameters of the guide, turning the shorter way from one to the next.

    parameters: (k,), ascending, the first and the last of the guide's domain among them; orientations: (k, 4) unit
    quaternions, q and −q alike, or (k, 3, 3) rotation matrices. Cubic, or of degree k − 1 for fewer than 4. Its control
    orientations are found by adding to each what the spline lacks there, which converges like a Jacobi iteration.
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

    def table(self, guides: Guides) -> QuaternionSpline:
        degree = min(3, self.parameters.shape[0] - 1)
        knots = averaged_knots(self.parameters, degree)

        def mend(controls: Float[Array, "k 4"], _: Any) -> tuple[Float[Array, "k 4"], None]:
            spline = QuaternionSpline(controls, knots, degree)
            lacks = multiply(self.orientations, conjugate(jax.vmap(spline.orientation)(self.parameters)))
            # the shorter way: a lack of q and of −q is the same turn
            lacks = jnp.where(lacks[:, :1] < 0, -lacks, lacks)
            return normalize(multiply(lacks, controls)), None

        controls = jax.lax.scan(mend, self.orientations, None, length=_ROUNDS)[0]
        return QuaternionSpline(controls, knots, degree)

    def frame(self, table: QuaternionSpline, here: Station) -> Float[Array, "3 3"]:
        return to_matrix(table.orientation(here.v)).astype(here.guides.dtype)
