"""Distances from points to segments and triangles, one of each per row."""

import numpy as np
from jaxtyping import Float


def to_segment(
    point: Float[np.ndarray, "*#n d"], start: Float[np.ndarray, "*#n d"], end: Float[np.ndarray, "*#n d"]
) -> Float[np.ndarray, "..."]:
    """Distance from each point to its segment; a segment without length is a point. The arrays broadcast."""
    along, offset = end - start, point - start
    square = np.sum(along * along, axis=-1)
    t = np.sum(offset * along, axis=-1) / np.where(square > 0, square, 1.0)
    return np.linalg.norm(offset - np.clip(t, 0.0, 1.0)[..., None] * along, axis=-1)


def to_triangle(point: Float[np.ndarray, "n 3"], corners: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n"]:
    """Distance from each point to its triangle: to the plane if the foot lies inside, else to an edge."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1)
    normal = normal / np.where(length > 0, length, 1.0)[:, None]
    inside = length > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.sum(np.cross(end - start, point - start) * normal, axis=-1) >= 0
    edges = np.minimum(to_segment(point, a, b), np.minimum(to_segment(point, b, c), to_segment(point, c, a)))
    return np.where(inside, np.abs(np.sum((point - a) * normal, axis=-1)), edges)
