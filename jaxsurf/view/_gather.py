"""From shapes to what a picture shows of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from .._errors import InputError
from ..curve import AbstractCurve
from ..mesh import Mesh, polyline, tessellate
from ..surface import AbstractSurface
from ._isolines import isolines
from ._scene import EDGE, FRONT, STROKE, Facets, Scene, Strokes

# Of the bounding box's diagonal: below a pixel on the outline of a picture 1200 wide.
SURFACE_TOLERANCE = 4e-4
CURVE_TOLERANCE = 1e-4


def as_list(shapes: Any) -> list[Any]:
    """One shape or a sequence of shapes, as a list."""
    return list(shapes) if isinstance(shapes, Sequence) else [shapes]


def gathered(shapes: Any, *, edges: bool) -> Scene:
    """Surfaces as triangles, each in its colour, with outlines and parameter lines; curves as strokes."""
    facets, outlines, inner, strokes = [], [], [], []
    for shape in as_list(shapes):
        colour = FRONT[len(facets) % len(FRONT)]
        if isinstance(shape, AbstractCurve):
            strokes.append(Strokes((curve_line(shape),), STROKE[len(strokes) % len(STROKE)], width=3.0))
        elif isinstance(shape, AbstractSurface):
            mesh = surface_mesh(shape)
            facets.append(Facets(mesh.vertices, mesh.faces, mesh.normals, colour))
            if edges:
                own = isolines(shape)
                outlines += own.outline
                inner += own.inner
        elif hasattr(shape, "vertices") and hasattr(shape, "faces"):
            facets.append(_mesh_facets(shape, colour))
        else:
            raise InputError(f"Only surfaces, curves and meshes can be shown, got {type(shape).__name__}.")
    lines = (
        Strokes(tuple(inner), EDGE, width=0.9, strength=0.28),
        Strokes(tuple(outlines), EDGE, width=1.8, strength=0.9),
    )
    return Scene(tuple(facets), (*(s for s in lines if s.lines), *strokes))


def surface_mesh(surface: AbstractSurface) -> Mesh:
    """Triangles fine enough for a picture."""
    coarse = tessellate(surface, resolution=(17, 17))
    size = np.linalg.norm(np.ptp(coarse.vertices, axis=0))
    return tessellate(surface, tolerance=SURFACE_TOLERANCE * float(size) or None)


def curve_line(curve: AbstractCurve) -> Float[np.ndarray, "n 3"]:
    """A polyline fine enough for a picture; a plane curve lies at z = 0."""
    points = polyline(curve, resolution=65)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    points = polyline(curve, tolerance=CURVE_TOLERANCE * size or None)
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def checked_points(points: Any) -> Float[np.ndarray, "n 3"]:
    """Points as float64. Raises `InputError` unless their shape is (n, 3), n > 0, and all are finite."""
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise InputError(f"`points` must have shape (n, 3), n > 0, got {array.shape}.")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise InputError(f"`points` must be finite; row {bad[0]} is {array[bad[0]].tolist()}.")
    return array


def _mesh_facets(mesh: Any, colour: Any) -> Facets:
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    if isinstance(mesh, Mesh):
        return Facets(vertices, faces, mesh.normals, colour)
    # A bare mesh is shown flat, facet by facet, as it is.
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
    flat = vertices[faces].reshape(-1, 3)
    return Facets(flat, np.arange(len(flat)).reshape(-1, 3), np.repeat(normal, 3, axis=0), colour)
