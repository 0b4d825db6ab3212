"""Where a picture is seen from: a parallel projection that fits the shapes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .._errors import InputError
from ._scene import Facets

# Directions from the shapes to the eye. "iso" has x to the right front, y to the back and z up.
NAMED = {
    "iso": (1.0, -1.6, 1.2),
    "top": (0.0, 0.0, 1.0),
    "bottom": (0.0, 0.0, -1.0),
    "front": (0.0, -1.0, 0.0),
    "back": (0.0, 1.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
}
MARGIN = 1.08
ViewDirection = str | Sequence[float] | np.ndarray | None


@dataclass(frozen=True)
class Camera:
    """An eye at infinity.

    axes: rows right, up, and toward the eye; centre: of the picture; half_height and half_depth: of the box
    it shows, in the shapes' unit; aspect: width / height.
    """

    axes: Float[np.ndarray, "3 3"]
    centre: Float[np.ndarray, "3"]
    half_height: float
    half_depth: float
    aspect: float

    def seen(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Points as (right, up, toward the eye), from the picture's centre, in the shapes' unit."""
        return (points - self.centre) @ self.axes.T


def fitted_camera(
    points: Float[np.ndarray, "n 3"], facets: Sequence[Facets], direction: ViewDirection, aspect: float
) -> Camera:
    """A camera whose picture, `aspect` wide to high, holds all `points` and little else.

    `direction`: a name ("iso" "top" "front" …), a vector from the shapes to the eye, or `None` to look
    obliquely at the front side of a sheet.
    """
    toward = _direction(direction, points, facets)
    toward = toward / np.linalg.norm(toward)
    up = np.array([0.0, 0.0, 1.0]) if abs(toward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(toward, right), toward])
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = (high - low) / 2
    size = float(np.linalg.norm(half)) or 1.0
    half_height = MARGIN * max(half[1], half[0] / aspect, 0.02 * size)
    return Camera(axes, (low + high) / 2 @ axes, float(half_height), float(max(half[2], 0.02 * size)), aspect)


def _direction(direction: ViewDirection, points: np.ndarray, facets: Sequence[Facets]) -> np.ndarray:
    if isinstance(direction, str):
        if direction not in NAMED:
            raise InputError(f"`camera` must be one of {', '.join(NAMED)}, a vector or None, got {direction!r}.")
        return np.array(NAMED[direction])
    if direction is not None:
        vector = np.asarray(direction, dtype=float)
        if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
            raise InputError(f"`camera` must be a vector of three numbers, not all 0, got {direction!r}.")
        return vector
    return _oblique(_mean_normal(facets) if facets else _flat_normal(points), points)


def _mean_normal(facets: Sequence[Facets]) -> np.ndarray:
    """Mean unit normal, weighted by area: near unit length for a sheet, near 0 for a closed body."""
    total, area = np.zeros(3), 0.0
    for part in facets:
        a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
        doubled = np.cross(b - a, c - a)
        total += doubled.sum(axis=0)
        area += float(np.linalg.norm(doubled, axis=-1).sum())
    return total / area if area else total


def _flat_normal(points: np.ndarray) -> np.ndarray:
    """Normal, upwards or to the front, of points that lie near a plane; 0 for others."""
    values, vectors = np.linalg.eigh(np.cov(points.T) if len(points) > 1 else np.zeros((3, 3)))
    normal = vectors[:, 0]
    if values[0] > 0.2 * values[1]:
        return np.zeros(3)
    return normal if normal @ (0.1, -0.3, 1.0) > 0 else -normal


def _oblique(normal: np.ndarray, points: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(normal)
    if length < 0.25:
        return np.array(NAMED["iso"])
    normal = normal / length
    if abs(normal[2]) > 0.7:
        # A lying sheet: its long side runs across the picture, turned a little, seen from 50 degrees above
        # (or below).
        flat = (points - points.mean(axis=0))[:, :2]
        long = np.linalg.eigh(flat.T @ flat)[1][:, 1]
        across = long if (long[0], long[1]) > (0.0, 0.0) else -long
        azimuth = np.arctan2(across[1], across[0]) - np.radians(90 - 25)
        elevation = np.copysign(np.radians(48), normal[2])
    else:
        azimuth = np.arctan2(normal[1], normal[0]) - np.radians(28)
        elevation = np.clip(np.arcsin(normal[2]) + np.radians(18), np.radians(-50), np.radians(50))
    flat = np.array([np.cos(azimuth), np.sin(azimuth)])
    return np.append(np.cos(elevation) * flat, np.sin(elevation))
