"""Triangles to pixels in numpy, with hidden surfaces removed: pictures where no OpenGL is."""

import numpy as np
from jaxtyping import Float, Int

CANDIDATES = 2_000_000  # pixels tried together: keeps the temporaries near 100 MB


def nearest_faces(
    seen: Float[np.ndarray, "n 3"], faces: Int[np.ndarray, "m 3"], width: int, height: int
) -> tuple[Float[np.ndarray, "h w"], Int[np.ndarray, "h w"]]:
    """For each pixel the depth (larger is nearer) and index of the nearest face; -inf and -1 where is none.

    `seen` is in pixels: x to the right, y downwards, depth toward the eye; a pixel's centre has half-integer
    coordinates.
    """
    depth = np.full(width * height, -np.inf)
    owner = np.full(width * height, -1, dtype=np.int64)
    corners = seen[faces]
    low = np.floor(corners[:, :, :2].min(axis=1)).astype(int)
    high = np.ceil(corners[:, :, :2].max(axis=1)).astype(int)
    visible = (high > 0).all(axis=1) & (low[:, 0] < width) & (low[:, 1] < height)
    low, high = np.maximum(low, 0), np.minimum(high, (width, height))
    # Faces whose boxes have nearly the same size are tried together, as one block of pixels each.
    box = np.maximum((high - low + 3) // 4 * 4, 4)
    for wide, high_box in np.unique(box[visible], axis=0):
        group = np.flatnonzero(visible & (box == (wide, high_box)).all(axis=1))
        together = max(1, CANDIDATES // int(wide * high_box))
        for start in range(0, len(group), together):
            chunk = group[start : start + together]
            _try_block(corners[chunk], chunk, low[chunk], int(wide), int(high_box), width, height, depth, owner)
    return depth.reshape(height, width), owner.reshape(height, width)


def barycentric(
    corners: Float[np.ndarray, "n 3 3"], x: Float[np.ndarray, "n"], y: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 3"]:
    """Weights of a triangle's corners at (x, y); those of a triangle seen edge-on are not finite numbers."""
    (ax, ay), (bx, by), (cx, cy) = (np.moveaxis(corners[:, i, :2], -1, 0) for i in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        whole = 1.0 / ((by - cy) * (ax - cx) + (cx - bx) * (ay - cy))
        first = ((by - cy) * (x - cx) + (cx - bx) * (y - cy)) * whole
        second = ((cy - ay) * (x - cx) + (ax - cx) * (y - cy)) * whole
    return np.stack([first, second, 1.0 - first - second], axis=-1)


def _try_block(corners, index, low, wide, high, width, height, depth, owner):
    x = low[:, None, 0] + np.tile(np.arange(wide), high)[None, :]
    y = low[:, None, 1] + np.repeat(np.arange(high), wide)[None, :]
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (corners[:, i].T[:, :, None] for i in range(3))
    px, py = x + 0.5 - cx, y + 0.5 - cy
    with np.errstate(divide="ignore", invalid="ignore"):
        whole = 1.0 / ((by - cy) * (ax - cx) + (cx - bx) * (ay - cy))
        first = ((by - cy) * whole) * px + ((cx - bx) * whole) * py
        second = ((cy - ay) * whole) * px + ((ax - cx) * whole) * py
        slack = -1e-9
        hit = (first >= slack) & (second >= slack) & (first + second <= 1 - slack) & (x < width) & (y < height)
        z = cz + first * (az - cz) + second * (bz - cz)
    row, column = np.nonzero(hit)
    pixel, z = (y * width + x)[row, column], z[row, column]
    nearer = z > depth[pixel]
    row, pixel, z = row[nearer], pixel[nearer], z[nearer]
    # Written from far to near, the nearest of several candidates for a pixel stays.
    order = np.argsort(z, kind="stable")
    depth[pixel[order]] = z[order]
    owner[pixel[order]] = index[row[order]]
