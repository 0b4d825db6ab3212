"""Surfaces of the drawing board: plane, sphere, cylinder, cone, torus; normals point outward.

In all surfaces about an axis u is the angle, from `start` and right-handed about the axis; `start` is a
direction (3,), made perpendicular to the axis, with a default that is never singular: (1, 0, 0) for the axes
(0, 0, ±1).
"""

import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._arguments import as_number, as_vector
from .._array import Numbers, concrete, eps, is_concrete
from .._errors import InputError
from .._frame import frame
from .._registry import register
from ..curve._elementary import normal_and_start
from ._abstract import AbstractSurface, row_by_row


@register
class Plane(AbstractSurface):
    """S(u, v) = point + u x + v y on the square [-size/2, size/2]²; u, v are lengths, x × y is the normal.

    point, normal: (3,); size: positive length. direction: (3,), the direction x, made perpendicular to
    `normal`; default (1, 0, 0) for the normals (0, 0, ±1), never singular. The field of `point` is called
    `origin`.
    """

    origin: Float[Array, "3"]
    normal: Float[Array, "3"]
    size: Float[Array, ""]
    direction: Float[Array, "3"]

    def __init__(self, point: Numbers, normal: Numbers, size: Numbers = 10.0, direction: Numbers | None = None):
        self.origin = as_vector(point, "point")
        dtype = self.origin.dtype
        self.normal, self.direction = normal_and_start(normal, direction, dtype, ("normal", "direction"))
        self.size = as_number(size, "size", dtype, positive=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        side = (-self.size / 2, self.size / 2)
        return side, side

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        x, y, _ = frame(self.normal, self.direction)
        return self.origin + u * x + v * y

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return row_by_row(self, u, v)


@register
class Sphere(AbstractSurface):
    """S(u, v) = center + radius (cos v cos u, cos v sin u, sin v), by longitude and latitude.

    u in [0, 2π], v in [-π/2, π/2]. center: (3,); radius: positive length. The poles are on the z axis;
    `js.rotate` moves them.
    """

    center: Float[Array, "3"]
    radius: Float[Array, ""]

    def __init__(self, center: Numbers, radius: Numbers):
        self.center = as_vector(center, "center")
        self.radius = as_number(radius, "radius", self.center.dtype, positive=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return (0.0, 2 * math.pi), (-math.pi / 2, math.pi / 2)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        outward = jnp.stack([jnp.cos(v) * jnp.cos(u), jnp.cos(v) * jnp.sin(u), jnp.sin(v)])
        return self.center + self.radius * outward

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return row_by_row(self, u, v)


@register
class Cylinder(AbstractSurface):
    """S(u, v) = center + radius (cos u x + sin u y) + v z: angle u in [0, 2π], height v in [0, height].

    center: (3,), amid the base circle; axis: (3,), any length; radius, height: positive lengths. Both ends
    are open.
    """

    center: Float[Array, "3"]
    axis: Float[Array, "3"]
    radius: Float[Array, ""]
    height: Float[Array, ""]
    start: Float[Array, "3"]

    def __init__(self, center: Numbers, axis: Numbers, radius: Numbers, height: Numbers, start: Numbers | None = None):
        self.center = as_vector(center, "center")
        dtype = self.center.dtype
        self.axis, self.start = normal_and_start(axis, start, dtype, ("axis", "start"))
        self.radius = as_number(radius, "radius", dtype, positive=True)
        self.height = as_number(height, "height", dtype, positive=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return (0.0, 2 * math.pi), (0.0, self.height)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        return _around(self.center, self.axis, self.start, u, self.radius, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return row_by_row(self, u, v)


@register
class Cone(AbstractSurface):
    """S(u, v) = center + (radius + v tan α) (cos u x + sin u y) + v z, on [0, 2π] × [0, height].

    center: (3,), amid the base circle of `radius` ≥ 0; axis: (3,), any length; half_angle α in (-π/2, π/2)
    radians: positive widens along the axis, negative tapers; height: positive, along the axis and at most up
    to the apex. A whole cone: radius 0 (the apex is `center`), or half_angle = -atan(radius / height). Both
    ends are open.
    """

    center: Float[Array, "3"]
    axis: Float[Array, "3"]
    radius: Float[Array, ""]
    half_angle: Float[Array, ""]
    height: Float[Array, ""]
    start: Float[Array, "3"]

    def __init__(
        self,
        center: Numbers,
        axis: Numbers,
        radius: Numbers,
        half_angle: Numbers,
        height: Numbers,
        start: Numbers | None = None,
    ):
        self.center = as_vector(center, "center")
        dtype = self.center.dtype
        self.axis, self.start = normal_and_start(axis, start, dtype, ("axis", "start"))
        self.radius = as_number(radius, "radius", dtype)
        self.half_angle = as_number(half_angle, "half_angle", dtype)
        self.height = as_number(height, "height", dtype, positive=True)

    def __check_init__(self):
        if not is_concrete(self.radius, self.half_angle, self.height):
            return
        radius, angle, height = (float(concrete(x)) for x in (self.radius, self.half_angle, self.height))
        if not abs(angle) < math.pi / 2:
            raise InputError(f"`half_angle` must lie between -π/2 and π/2 radians, got {angle:g}.")
        far = radius + height * math.tan(angle)
        if min(radius, far) < -8 * eps(self.dtype) * max(radius, height):
            raise InputError(
                f"A cone must end at its apex at the latest, but its radius goes from {radius:g} to {far:g} "
                f"over `height` = {height:g}; shorten it."
            )
        if max(radius, far) <= 0:
            raise InputError("`radius` and `half_angle` of a cone are both 0: it would be a line.")

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return (0.0, 2 * math.pi), (0.0, self.height)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        radius = self.radius + v * jnp.tan(self.half_angle)
        return _around(self.center, self.axis, self.start, u, radius, v)

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return row_by_row(self, u, v)


@register
class Torus(AbstractSurface):
    """S(u, v) = center + (R + r cos v) (cos u x + sin u y) + r sin v z on [0, 2π]²; v runs about the tube.

    center, axis: (3,); R, r: positive lengths, kept as `major_radius` and `minor_radius`. With r > R the
    torus cuts itself.
    """

    center: Float[Array, "3"]
    axis: Float[Array, "3"]
    major_radius: Float[Array, ""]
    minor_radius: Float[Array, ""]
    start: Float[Array, "3"]

    def __init__(self, center: Numbers, axis: Numbers, R: Numbers, r: Numbers, start: Numbers | None = None):
        self.center = as_vector(center, "center")
        dtype = self.center.dtype
        self.axis, self.start = normal_and_start(axis, start, dtype, ("axis", "start"))
        self.major_radius = as_number(R, "R", dtype, positive=True)
        self.minor_radius = as_number(r, "r", dtype, positive=True)

    @property
    def domain(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        return (0.0, 2 * math.pi), (0.0, 2 * math.pi)

    def point(self, u: Float[Array, ""], v: Float[Array, ""]) -> Float[Array, "3"]:
        radius = self.major_radius + self.minor_radius * jnp.cos(v)
        return _around(self.center, self.axis, self.start, u, radius, self.minor_radius * jnp.sin(v))

    def grid_points(self, u: Float[Array, "m"], v: Float[Array, "k"]) -> Float[Array, "m k 3"]:
        return row_by_row(self, u, v)


def _around(
    center: Float[Array, "3"],
    axis: Float[Array, "3"],
    start: Float[Array, "3"],
    u: Float[Array, ""],
    radius: Float[Array, ""],
    height: Float[Array, ""],
) -> Float[Array, "3"]:
    """The point at angle u about the axis, at this radius and height."""
    x, y, z = frame(axis, start)
    return center + radius * (jnp.cos(u) * x + jnp.sin(u) * y) + height * z
