"""From a surface to triangles, to a tolerance."""

import numpy as np
from jaxtyping import Float, Int

from .._errors import InputError
from ..surface import AbstractSurface, TrimmedSurface
from ._boundary import loop_points
from ._chords import chord_indices
from ._distance import to_segment
from ._error import chordal_errors, sound_faces, used_vertices
from ._evaluate import between_breaks, breaks_within, domain_corners, grid_at, normals_at, precision
from ._mesh import Mesh
from ._polyline import RELATIVE_TOLERANCE, check_density, chord_parameters, diagonal
from ._trimmed import trimmed_mesh

MOST_LINES = 513
PROBES = (64, 256, 1024)
ROUNDS = 16


def tessellate(
    surface: AbstractSurface, *, tolerance: float | None = None, resolution: tuple[int, int] | None = None
) -> Mesh:
    """Triangles on a grid of parameter lines, or inside the loops of a trimmed surface.

    `tolerance` (default: 1e-3 of the bounding box's diagonal) bounds the distance from the surface to its
    triangles; lines lie close where the surface bends. `resolution=(m, k)` takes m lines along u and k along
    v instead, evenly spaced. The distance is measured and stated as `max_error`; it may exceed `tolerance`
    where 513 lines in a direction do not do. Raises `InputError` if both are given, on values that make no
    mesh and on a surface that is not finite.
    """
    check_density(tolerance, resolution is not None)
    base, loops = (surface.surface, surface.loops) if isinstance(surface, TrimmedSurface) else (surface, ())
    low, high = domain_corners(base)
    if loops:
        outline = np.concatenate([loop_points(base, loop, chord_parameters(loop, tolerance=None)) for loop in loops])
        low, high = outline.min(axis=0), outline.max(axis=0)
    if resolution is None:
        lines, wanted = _probed_lines(base, low, high, tolerance)
    else:
        if min(resolution) < 2:
            raise InputError(f"`resolution` must be at least (2, 2), got {tuple(resolution)}.")
        lines, wanted = [np.linspace(low[i], high[i], resolution[i]) for i in (0, 1)], np.inf
    return trimmed_mesh(base, loops, lines, wanted) if loops else _grid_mesh(base, lines, wanted)


def grid_faces(points: Float[np.ndarray, "m k 3"]) -> Int[np.ndarray, "f 3"]:
    """Two triangles for each cell of a grid of points, cut along the shorter diagonal, row by row."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    falling = np.linalg.norm(points[1:, 1:] - points[:-1, :-1], axis=-1) <= np.linalg.norm(
        points[1:, :-1] - points[:-1, 1:], axis=-1
    )
    first = np.where(falling[..., None], np.stack([a, b, c], axis=-1), np.stack([a, b, d], axis=-1))
    second = np.where(falling[..., None], np.stack([a, c, d], axis=-1), np.stack([b, c, d], axis=-1))
    return np.stack([first, second], axis=2).reshape(-1, 3)


def _probed_lines(
    surface: AbstractSurface, low: np.ndarray, high: np.ndarray, tolerance: float | None
) -> tuple[list[np.ndarray], float]:
    """Parameter lines whose chords stay within half the tolerance, and the tolerance as a length."""
    places = [breaks_within(surface, i, low[i], high[i]) for i in (0, 1)]
    # Four probes a span see every wave that its polynomials can make.
    counts = [next((n for n in PROBES if n >= 4 * (len(p) - 1)), PROBES[-1]) for p in places]
    proved = [False, False]
    lines: list[np.ndarray] = [np.zeros(0), np.zeros(0)]
    while True:
        dense, spans = zip(*(between_breaks(p, n) for p, n in zip(places, counts, strict=True)), strict=True)
        points = grid_at(surface, dense[0], dense[1])
        if not np.isfinite(points).all():
            raise InputError("The surface has points that are not finite numbers; check its control data.")
        wanted = RELATIVE_TOLERANCE * diagonal(points) if tolerance is None else tolerance
        for i in (0, 1):
            # Half: the cells' twist and the other direction add to what the chords of one direction leave.
            chosen, proved[i] = chord_indices(np.swapaxes(points, 0, i), wanted / 2, spans[i])
            lines[i] = dense[i][chosen]
        finer = [not proved[i] and counts[i] < PROBES[-1] for i in (0, 1)]
        if not any(finer):
            return [_thinned(line) for line in lines], wanted
        counts = [PROBES[PROBES.index(n) + 1] if more else n for n, more in zip(counts, finer, strict=True)]


def _thinned(line: np.ndarray) -> np.ndarray:
    if len(line) <= MOST_LINES:
        return line
    return line[np.linspace(0, len(line) - 1, MOST_LINES).round().astype(int)]


def _grid_mesh(surface: AbstractSurface, lines: list[np.ndarray], wanted: float) -> Mesh:
    for remaining in reversed(range(ROUNDS)):
        points = grid_at(surface, lines[0], lines[1])
        if not np.isfinite(points).all():
            raise InputError("The surface has points that are not finite numbers; check its control data.")
        vertices = points.reshape(-1, 3)
        parameters = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
        faces = grid_faces(points)
        errors = chordal_errors(surface, vertices, parameters, faces)
        bad = errors.reshape(len(lines[0]) - 1, len(lines[1]) - 1, 2).max(axis=-1) > wanted
        if not remaining or not bad.any():
            break
        split = _intervals_to_split(surface, lines, points, bad, wanted)
        if not (split[0].any() or split[1].any()):
            break
        for i in (0, 1):
            middles = (lines[i][1:] + lines[i][:-1])[split[i]] / 2
            lines[i] = np.sort(np.concatenate([lines[i], middles]))
    sound = sound_faces(vertices, faces, precision(surface, vertices))
    used, faces = used_vertices(sound, len(vertices))
    vertices, parameters = vertices[used], parameters[used]
    return Mesh(vertices, faces, parameters, normals_at(surface, parameters), float(errors.max()))


def _intervals_to_split(
    surface: AbstractSurface, lines: list[np.ndarray], points: np.ndarray, bad: np.ndarray, wanted: float
) -> list[np.ndarray]:
    """Which intervals to halve: those whose chords are at fault; for a mere twist, the cell's long side."""
    middle = [(line[1:] + line[:-1]) / 2 for line in lines]
    along_u = to_segment(grid_at(surface, middle[0], lines[1]), points[:-1], points[1:])
    along_v = to_segment(grid_at(surface, lines[0], middle[1]), points[:, :-1], points[:, 1:])
    fault_u = np.maximum(along_u[:, 1:], along_u[:, :-1]) > wanted / 2
    fault_v = np.maximum(along_v[1:], along_v[:-1]) > wanted / 2
    length_u, length_v = (np.linalg.norm(np.diff(points, axis=i), axis=-1) for i in (0, 1))
    long_u = length_u[:, 1:] + length_u[:, :-1] >= length_v[1:] + length_v[:-1]
    twist = ~fault_u & ~fault_v
    split = [
        (bad & (fault_u | twist & long_u)).any(axis=1),
        (bad & (fault_v | twist & ~long_u)).any(axis=0),
    ]
    room = [len(line) + which.sum() <= MOST_LINES for line, which in zip(lines, split, strict=True)]
    return [which & fits for which, fits in zip(split, room, strict=True)]
