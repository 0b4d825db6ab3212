"""Triangles inside the loops of a trimmed surface."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from .._errors import InputError
from ..curve import BSplineCurve
from ..surface import AbstractSurface
from ._boundary import Boundary
from ._error import chordal_errors, sound_faces, used_vertices
from ._evaluate import normals_at, points_at, precision
from ._mesh import Mesh
from ._polygon import inside, segments

ROUNDS = 12


def trimmed_mesh(surface: AbstractSurface, loops: Sequence[BSplineCurve], lines: list[np.ndarray], wanted: float) -> Mesh:
    """Delaunay triangles between points of the loops and the crossings of `lines` inside them.

    The plane of parameters is stretched so that its lengths are near those of the surface. A piece of a loop
    that is not yet an edge is halved on the loop until it is one: every boundary vertex lies on its loop.
    Then the longest side of each triangle that is off by more than `wanted` is halved, at most 12 rounds in
    all.
    """
    stretch = _stretch(surface, lines)
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    boundary = Boundary.through(surface, loops, stretch, _spacing(lines, stretch), wanted)
    for remaining in reversed(range(ROUNDS)):
        polygons = boundary.polygons()
        parameters, faces, missing = _triangles(grid, polygons, stretch)
        if missing.any() and remaining:
            boundary = boundary.halved(missing)
            continue
        vertices = points_at(surface, parameters)
        faces = sound_faces(vertices, faces, precision(surface, vertices))
        errors = chordal_errors(surface, vertices, parameters, faces)
        bad = errors > wanted
        if not remaining or not bad.any():
            break
        sides = _longest_sides(vertices, faces[bad])
        split, kept = _to_halve(parameters[sides].mean(axis=1) * stretch, sides, polygons, stretch)
        boundary = boundary.halved(split)
        grid = np.concatenate([grid, parameters[sides[kept]].mean(axis=1)])
    if not len(faces):
        raise InputError("The `loops` of the trimmed surface enclose no part of it; check where they run.")
    used, faces = used_vertices(faces, len(vertices))
    vertices, parameters = vertices[used], parameters[used]
    error = max(float(errors.max()), boundary.max_error)
    return Mesh(vertices, faces, parameters, normals_at(surface, parameters), error)


def _stretch(surface: AbstractSurface, lines: list[np.ndarray]) -> Float[np.ndarray, "2"]:
    """Mean lengths of the surface per unit of u and of v, over the rectangle that the lines span."""
    u, v = (np.linspace(line[0], line[-1], 17) for line in lines)
    points = points_at(surface, np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)).reshape(17, 17, 3)
    lengths = [np.linalg.norm(np.diff(points, axis=i), axis=-1).mean() * 16 for i in (0, 1)]
    widths = [u[-1] - u[0], v[-1] - v[0]]
    return np.maximum(np.array(lengths), 1e-9 * max(lengths)) / np.array(widths)


def _spacing(lines: list[np.ndarray], stretch: np.ndarray) -> float:
    """Longest piece of a loop: a cell's side, lest its circle sweep away points that the surface needs."""
    return min(float(np.median(np.diff(line))) * factor for line, factor in zip(lines, stretch, strict=True))


def _triangles(
    grid: Float[np.ndarray, "n 2"], polygons: list[np.ndarray], stretch: np.ndarray
) -> tuple[Float[np.ndarray, "p 2"], Int[np.ndarray, "m 3"], np.ndarray]:
    """Points (the polygons' first), triangles inside, and which of the polygons' sides are no edges yet."""
    from scipy.spatial import Delaunay, KDTree

    inner = grid[inside(grid, polygons)]
    if len(inner):
        near = KDTree(inner * stretch).query_ball_point(*_circles(polygons, stretch))
        swept = np.unique(np.concatenate([np.array(n, dtype=int) for n in near]))
        inner = np.delete(inner, swept, axis=0)
    parameters = np.concatenate([*polygons, inner])
    faces = Delaunay(parameters * stretch).simplices.astype(np.int64)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    ends = np.sort(_side_indices(polygons), axis=1)
    count = len(parameters)
    missing = ~np.isin(ends[:, 0] * count + ends[:, 1], edges[:, 0] * count + edges[:, 1])
    return parameters, faces[inside(parameters[faces].mean(axis=1), polygons)], missing


def _side_indices(polygons: list[np.ndarray]) -> Int[np.ndarray, "s 2"]:
    starts = np.cumsum([0, *map(len, polygons)])
    return np.concatenate(
        [
            first + np.stack([np.arange(len(p)), np.roll(np.arange(len(p)), -1)], axis=1)
            for first, p in zip(starts, polygons, strict=False)
        ]
    )


def _longest_sides(vertices: np.ndarray, faces: Int[np.ndarray, "m 3"]) -> Int[np.ndarray, "s 2"]:
    sides = np.stack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]], axis=1)
    lengths = np.linalg.norm(vertices[sides[..., 1]] - vertices[sides[..., 0]], axis=-1)
    return np.unique(np.sort(sides[np.arange(len(faces)), lengths.argmax(axis=1)], axis=1), axis=0)


def _to_halve(
    middles: Float[np.ndarray, "s 2"],
    sides: Int[np.ndarray, "s 2"],
    polygons: list[np.ndarray],
    stretch: np.ndarray,
) -> tuple[Bool[np.ndarray, "p"], Bool[np.ndarray, "s"]]:
    """Pieces of the loops to halve, and which sides' middles can be points: those in no piece's circle."""
    numbers = {tuple(sorted(pair)): i for i, pair in enumerate(_side_indices(polygons).tolist())}
    centre, radius = _circles(polygons, stretch)
    halve, kept = np.zeros(len(centre), dtype=bool), np.ones(len(sides), dtype=bool)
    for i, (side, middle) in enumerate(zip(sides.tolist(), middles, strict=True)):
        own = numbers.get(tuple(side))
        within = np.flatnonzero(np.linalg.norm(centre - middle, axis=1) <= radius) if own is None else [own]
        halve[within] = True
        kept[i] = not len(within)
    return halve, kept


def _circles(polygons: list[np.ndarray], stretch: np.ndarray) -> tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, "p"]]:
    """Circles that hold no other point, about the sides, which are then edges of every Delaunay net."""
    ends = segments(polygons) * stretch
    # A fifth more than the circle on the side as diameter keeps slivers away.
    return ends.mean(axis=1), 1.2 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1) / 2
