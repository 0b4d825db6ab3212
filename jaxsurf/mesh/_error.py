"""How far a surface is from the triangles that stand for it."""

import numpy as np
from jaxtyping import Float, Int

from ..surface import AbstractSurface
from ._distance import to_triangle
from ._evaluate import points_at

# Barycentric places: the edges' middles, where chords are worst; the centroid; and three off the symmetry
# lines' ends.
PLACES = (
    np.array(
        [
            [0, 1, 1],
            [1, 0, 1],
            [1, 1, 0],
            [2 / 3, 2 / 3, 2 / 3],
            [1.4, 0.3, 0.3],
            [0.3, 1.4, 0.3],
            [0.3, 0.3, 1.4],
        ]
    )
    / 2
)


def chordal_errors(
    surface: AbstractSurface,
    vertices: Float[np.ndarray, "n 3"],
    parameters: Float[np.ndarray, "n 2"],
    faces: Int[np.ndarray, "m 3"],
) -> Float[np.ndarray, "m"]:
    """For each triangle its largest distance from seven points of the surface above it."""
    if not len(faces):
        return np.zeros(0)
    places = np.einsum("pc,mcd->mpd", PLACES, parameters[faces])
    points = points_at(surface, places.reshape(-1, 2))
    corners = np.repeat(vertices[faces], len(PLACES), axis=0)
    return to_triangle(points, corners).reshape(len(faces), -1).max(axis=1)


def sound_faces(
    vertices: Float[np.ndarray, "n 3"], faces: Int[np.ndarray, "m 3"], smallest: float
) -> Int[np.ndarray, "f 3"]:
    """The faces whose smallest height exceeds `smallest`: of a cell at a pole one is left."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
    longest = np.max([np.linalg.norm(e, axis=-1) for e in (b - a, c - b, a - c)], axis=0)
    return faces[twice_area > smallest * longest]


def used_vertices(faces: Int[np.ndarray, "m 3"], count: int) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "m 3"]]:
    """Indices of the vertices that some face needs, and the faces renumbered to them."""
    used = np.zeros(count, dtype=bool)
    used[faces] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[faces]
