"""A scene to an array of pixels without OpenGL."""

import numpy as np
from jaxtyping import Float, UInt8

from ._camera import Camera
from ._raster import barycentric, nearest_faces
from ._scene import BACK, FILL, KEY, Dots, Facets, Scene, Strokes, stroke_scale

SAMPLES = 2  # per pixel and direction
TOGETHER = 50_000  # pixels shaded at once: their temporaries stay in the caches


def paint(scene: Scene, camera: Camera, size: tuple[int, int]) -> UInt8[np.ndarray, "h w 3"]:
    """The scene as an (h, w, 3) picture; `size` = (w, h)."""
    width, height = size[0] * SAMPLES, size[1] * SAMPLES
    scale = height / (2 * camera.half_height)

    def to_pixels(points: np.ndarray) -> np.ndarray:
        seen = camera.seen(points) * scale
        return np.stack([seen[:, 0] + width / 2, height / 2 - seen[:, 1], seen[:, 2]], axis=-1)

    rise = np.linspace(0.0, 1.0, height)[:, None]
    image = np.repeat(((1 - rise) * scene.sky[0] + rise * scene.sky[1])[:, None, :], width, axis=1)
    depth = np.full((height, width), -np.inf)
    for facets in scene.facets:
        seen = to_pixels(facets.vertices)
        own, face = nearest_faces(seen, facets.faces, width, height)
        nearer = own > depth
        depth[nearer] = own[nearer]
        rows, columns = np.nonzero(nearer)
        for start in range(0, len(rows), TOGETHER):
            row, column = rows[start : start + TOGETHER], columns[start : start + TOGETHER]
            image[row, column] = _shaded(scene, facets, camera, seen, (row, column), face[row, column])
    bias = 0.004 * camera.half_depth * scale + 2.0
    brush = SAMPLES * stroke_scale(size[0])
    for strokes in scene.strokes:
        _stroke(image, depth, strokes, to_pixels, brush, bias)
    for dots in scene.dots:
        _dot(image, depth, scene, dots, to_pixels, brush, bias)
    return reduced(np.clip(image, 0, 1) * 255)


def reduced(image: Float[np.ndarray, "_ _ 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """Each pixel the mean of its samples, so that edges are smooth; `image` holds 0 to 255."""
    steps = [(i, j) for i in range(SAMPLES) for j in range(SAMPLES)]
    total = np.zeros_like(image[::SAMPLES, ::SAMPLES])
    for i, j in steps:
        total += image[i::SAMPLES, j::SAMPLES]
    return (total / len(steps) + 0.5).astype(np.uint8)


def _shaded(scene: Scene, facets: Facets, camera: Camera, seen, pixels, face) -> Float[np.ndarray, "p 3"]:
    corners = facets.faces[face]
    weights = barycentric(seen[corners], pixels[1] + 0.5, pixels[0] + 0.5)
    normal = np.einsum("pc,pcd->pd", weights, facets.normals[corners]) @ camera.axes.T
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    behind = normal[:, 2] < 0
    if facets.values is None:
        colour = np.where(behind[:, None], BACK, facets.colour)
    else:
        colour = scene.colours_of(np.einsum("pc,pc->p", weights, facets.values[corners]))
    normal = np.where(behind[:, None], -normal, normal)
    light = facets.light
    strength = light.ambient + light.key * np.maximum(normal @ KEY, 0) + light.fill * np.maximum(normal @ FILL, 0)
    half = (KEY + [0, 0, 1]) / np.linalg.norm(KEY + [0, 0, 1])
    shine = light.shine * np.maximum(normal @ half, 0) ** 40
    return np.clip(colour * strength[:, None] + shine[:, None], 0, 1)


def _stroke(image, depth, strokes: Strokes, to_pixels, brush: float, bias: float) -> None:
    touched = np.zeros(depth.shape, dtype=bool)
    offsets = _disc(strokes.width * brush / 2)
    for line in strokes.lines:
        seen = to_pixels(line)
        lengths = np.abs(np.diff(seen[:, :2], axis=0)).max(axis=1)
        place = np.concatenate([[0.0], np.cumsum(np.maximum(lengths, 1e-9))])
        dense = np.linspace(0, place[-1], int(min(place[-1] * 1.5, 200_000)) + 2)
        points = np.stack([np.interp(dense, place, seen[:, i]) for i in range(3)], axis=-1)
        rows, columns, kept = _visible(points, offsets, depth, bias)
        touched[rows[kept], columns[kept]] = True
    image[touched] = (1 - strokes.strength) * image[touched] + strokes.strength * np.array(strokes.colour)


def _dot(image, depth, scene: Scene, dots: Dots, to_pixels, brush: float, bias: float) -> None:
    seen = to_pixels(dots.points)
    order = np.argsort(seen[:, 2])
    colour = np.broadcast_to(dots.colour, (len(seen), 3)) if dots.values is None else scene.colours_of(dots.values)
    hidden = depth.copy()
    for offset in _disc(dots.size * brush / 2):
        rows, columns, kept = _visible(seen[order], offset[None], hidden, bias)
        z = seen[order[kept[:, 0]], 2]
        rows, columns = rows[kept], columns[kept]
        # From far to near again; a nearer dot that another offset has put there stays.
        free = z >= np.where(depth[rows, columns] > hidden[rows, columns], depth[rows, columns], -np.inf)
        depth[rows[free], columns[free]] = z[free]
        image[rows[free], columns[free]] = colour[order[kept[:, 0]]][free]


def _visible(points, offsets, depth, bias):
    """Pixels of a brush set down at points: rows, columns, and whether they can be seen."""
    height, width = depth.shape
    finite = np.nan_to_num(points)
    columns = np.floor(finite[:, None, 0] + offsets[None, :, 0]).astype(int)
    rows = np.floor(finite[:, None, 1] + offsets[None, :, 1]).astype(int)
    kept = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    rows, columns = np.where(kept, rows, 0), np.where(kept, columns, 0)
    return rows, columns, kept & (finite[:, None, 2] + bias >= depth[rows, columns])


def _disc(radius: float) -> np.ndarray:
    reach = np.arange(-np.ceil(radius), np.ceil(radius) + 1)
    x, y = np.meshgrid(reach, reach)
    inside = x**2 + y**2 <= (radius + 0.15) ** 2  # a little more: the finest lines are then not lost
    return np.stack([x[inside], y[inside]], axis=-1)
