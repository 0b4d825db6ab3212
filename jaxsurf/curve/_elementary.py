"""Curves of the drawing board: line, arc, circle, helix."""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_direction, as_number, as_vector
from .._array import Numbers, concrete, eps, is_concrete
from .._errors import InputError
from .._frame import check_not_parallel, frame, perpendicular
from .._registry import register
from .._safe import angle as angle_between, divide, norm
from ._abstract import AbstractCurve


@register
class Line(AbstractCurve):
    """C(u) = (1 - u) start + u end on [0, 1]; both ends are met exactly, equal ones are allowed.

    start, end: (3,), or (2,) for a line in a parameter plane.
    """

    start: Float[Array, "d"]
    end: Float[Array, "d"]

    def __init__(self, start: Numbers, end: Numbers):
        self.start = as_vector(start, "start", sizes=(2, 3))
        self.end = as_vector(end, "end", self.start.dtype, sizes=self.start.shape)

    @property
    def domain(self) -> tuple[Any, Any]:
        return 0.0, 1.0

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        return (1 - u) * self.start + u * self.end


@register
class Arc(AbstractCurve):
    """A circular arc from `start`, right-handed about `normal`, over `angle`; on [0, 1], at constant speed.

    C(u) = center + cos(φ) x + sin(φ) y with φ = u · angle, x = start - center, y = n × x; n is `normal` made
    unit and perpendicular to x. The domain stays [0, 1] while the arc is bent, so that its ends stay its
    ends. center, start, normal: (3,); angle: radians, 0 < angle ≤ 2π. Raises `InputError` on concrete data
    that give no arc.
    """

    center: Float[Array, "3"]
    start: Float[Array, "3"]
    normal: Float[Array, "3"]
    angle: Float[Array, ""]

    def __init__(self, center: Numbers, start: Numbers, normal: Numbers, angle: Numbers):
        self.center = as_vector(center, "center")
        self.start = as_vector(start, "start", self.center.dtype)
        self.normal = as_direction(normal, "normal", self.center.dtype)
        self.angle = as_number(angle, "angle", self.center.dtype, positive=True)

    def __check_init__(self):
        if not is_concrete(self):
            return
        if np.array_equal(concrete(self.center), concrete(self.start)):
            raise InputError("`start` of an arc must differ from its `center`: the radius would be 0.")
        check_not_parallel(self.normal, self.start - self.center, ("normal", "start - center"))
        if float(self.angle) > 2 * math.pi * (1 + 4 * eps(self.dtype)):
            raise InputError(f"`angle` of an arc must be at most 2π, got {float(self.angle):g}; use `js.Helix`.")

    @classmethod
    def through(cls, p0: Numbers, p1: Numbers, p2: Numbers) -> "Arc":
        """The arc from `p0` through `p1` to `p2`, each (3,).

        Its angle is twice the angle between p1 - p0 and p2 - p1 (inscribed angle). Points on one line are
        refused on concrete data; under tracing they give the point `p0`, with finite gradients.
        """
        p0 = as_vector(p0, "p0")
        p1, p2 = as_vector(p1, "p1", p0.dtype), as_vector(p2, "p2", p0.dtype)
        _check_not_straight(p0, p1, p2)
        a, b = p1 - p0, p2 - p0
        normal = jnp.cross(a, b)
        away = jnp.cross(jnp.sum(a * a) * b - jnp.sum(b * b) * a, normal)
        center = p0 + divide(away, 2 * jnp.sum(normal * normal, keepdims=True))
        return cls(center, p0, normal, 2 * angle_between(a, p2 - p1))

    @property
    def radius(self) -> Float[Array, ""]:
        """Distance of the start from the centre."""
        return norm(self.start - self.center)

    @property
    def domain(self) -> tuple[Any, Any]:
        return 0.0, 1.0

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        x = self.start - self.center
        unit_normal, _, _ = frame(x, self.normal)
        y = jnp.cross(unit_normal, x)
        turned = u * self.angle
        # from the start and not from the centre: a flat arc has a far centre, whose digits would be lost
        return self.start + jnp.sin(turned) * y - 2 * jnp.sin(turned / 2) ** 2 * x


@register
class Circle(AbstractCurve):
    """C(u) = center + radius (cos(u) x + sin(u) y) on [0, 2π], right-handed about `normal`.

    center, normal: (3,); radius: positive length. start: (3,), the direction x of u = 0, made perpendicular
    to `normal`; by default the one of `perpendicular`: (1, 0, 0) for the normals (0, 0, ±1), never singular.
    """

    center: Float[Array, "3"]
    normal: Float[Array, "3"]
    radius: Float[Array, ""]
    start: Float[Array, "3"]

    def __init__(self, center: Numbers, normal: Numbers, radius: Numbers, start: Numbers | None = None):
        self.center = as_vector(center, "center")
        self.normal, self.start = normal_and_start(normal, start, self.center.dtype, ("normal", "start"))
        self.radius = as_number(radius, "radius", self.center.dtype, positive=True)

    @property
    def domain(self) -> tuple[Any, Any]:
        return 0.0, 2 * math.pi

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        x, y, _ = frame(self.normal, self.start)
        return self.center + self.radius * (jnp.cos(u) * x + jnp.sin(u) * y)


@register
class Helix(AbstractCurve):
    """C(u) = center + radius (cos(u) x + sin(u) y) + pitch u / 2π z on [0, 2π turns], u the angle in radians.

    center, axis: (3,); radius, turns: positive; pitch: rise along `axis` per turn, negative for a left-handed
    helix. start: (3,), the direction x of u = 0, made perpendicular to `axis`; default as for `Circle`.
    """

    center: Float[Array, "3"]
    axis: Float[Array, "3"]
    radius: Float[Array, ""]
    pitch: Float[Array, ""]
    turns: Float[Array, ""]
    start: Float[Array, "3"]

    def __init__(
        self,
        center: Numbers,
        axis: Numbers,
        radius: Numbers,
        pitch: Numbers,
        turns: Numbers,
        start: Numbers | None = None,
    ):
        self.center = as_vector(center, "center")
        dtype = self.center.dtype
        self.axis, self.start = normal_and_start(axis, start, dtype, ("axis", "start"))
        self.radius = as_number(radius, "radius", dtype, positive=True)
        self.pitch = as_number(pitch, "pitch", dtype)
        self.turns = as_number(turns, "turns", dtype, positive=True)

    @property
    def domain(self) -> tuple[Any, Any]:
        return 0.0, 2 * math.pi * self.turns

    def point(self, u: Float[Array, ""]) -> Float[Array, "3"]:
        x, y, z = frame(self.axis, self.start)
        around = self.radius * (jnp.cos(u) * x + jnp.sin(u) * y)
        return self.center + around + self.pitch * u / (2 * math.pi) * z


def normal_and_start(
    normal: Numbers, start: Numbers | None, dtype: Any, names: tuple[str, str]
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Convert an axis and the direction in which an angle about it starts, with its default."""
    axis = as_direction(normal, names[0], dtype)
    if start is None:
        return axis, perpendicular(axis)
    direction = as_direction(start, names[1], dtype)
    check_not_parallel(axis, direction, names)
    return axis, direction


def _check_not_straight(p0: Array, p1: Array, p2: Array) -> None:
    if not is_concrete(p0, p1, p2):
        return
    points = np.stack([concrete(p) for p in (p0, p1, p2)])
    a, b = points[1] - points[0], points[2] - points[0]
    longest = max(np.linalg.norm(a), np.linalg.norm(b), np.linalg.norm(b - a))
    doubt = 8 * eps(p0.dtype) * max(float(np.max(np.abs(points))), longest)
    if np.linalg.norm(np.cross(a, b)) <= doubt * longest:
        raise InputError(
            f"`p0`, `p1` and `p2` lie on one line and define no arc, got {points.tolist()}; "
            f"move `p1`, or use `js.Line(p0, p2)`."
        )
