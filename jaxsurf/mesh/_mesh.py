"""Triangles that stand for a surface."""

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from .._errors import InputError


class Mesh(eqx.Module):
    """Triangles on a surface, with the parameters and the unit normals of their corners.

    vertices: (n, 3) in the surface's unit; faces: (m, 3) indices, counter-clockwise seen from the normals'
    side; parameters: (n, 2), the (u, v) of each vertex; normals: (n, 3), S_u × S_v made unit; max_error: the
    largest measured distance of the surface from its triangle. Seams are not welded: the two sides of a
    closed surface have their own vertices, because their parameters differ. Raises `InputError` on shapes
    that do not fit.
    """

    vertices: Float[np.ndarray, "n 3"] = eqx.field(converter=np.asarray)
    faces: Int[np.ndarray, "m 3"] = eqx.field(converter=np.asarray)
    parameters: Float[np.ndarray, "n 2"] = eqx.field(converter=np.asarray)
    normals: Float[np.ndarray, "n 3"] = eqx.field(converter=np.asarray)
    max_error: float

    def __check_init__(self):
        count = len(self.vertices)
        for name, width in (("vertices", 3), ("parameters", 2), ("normals", 3)):
            shape = getattr(self, name).shape
            if shape != (count, width):
                raise InputError(f"`{name}` must have shape ({count}, {width}), got {shape}.")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise InputError(f"`faces` must have shape (m, 3), got {self.faces.shape}.")
        if self.faces.size and (self.faces.min() < 0 or self.faces.max() >= count):
            raise InputError(
                f"`faces` must hold indices from 0 to {count - 1}, got {self.faces.min()} to {self.faces.max()}."
            )
