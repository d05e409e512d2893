"""Entries of tile lists by the exact test, in float64: which 16x16 tiles a splat has pixels in, and in which of their four sub-tiles.

A splat has a pixel where the pixel's centre lies in its 3-sigma box and in the ellipse alpha = 1/255. Per row of pixels both are intervals, so a row costs one
square root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..params import ALPHA_MIN, SUBTILE, TILE
from ..scene.camera import Camera
from .projection import Projected


@dataclass(eq=False)
class TileEntries:
    """Entries in the order in which splats are seen, a splat's tiles row by row (E of them).

    splat: int32 (E,). tile: int32 (E,), column + cols * row. mask: uint8 (E,), bit 2 y + x for the sub-tile in column x, row y of the tile, never 0.
    cols, rows: grid of tiles.
    """

    splat: np.ndarray
    tile: np.ndarray
    mask: np.ndarray
    cols: int
    rows: int

    def __len__(self) -> int:
        return len(self.splat)


@numba.njit(cache=True)
def _emit(mean, conic, radii, reach, order, cols, width, height, splat, tile, mask):
    """Entries of the splats `order`; counts them only where `splat` is empty. Returns their number."""
    n = 0
    found = np.zeros(cols, np.uint8)
    for r in range(len(order)):
        i = order[r]
        if not reach[i] >= 0.0:
            continue
        a, b, c = conic[i, 0], conic[i, 1], conic[i, 2]
        top = max(np.ceil(mean[i, 1] - radii[i, 1]), 0.0)
        bottom = min(np.floor(mean[i, 1] + radii[i, 1]), height - 1.0)
        left = max(np.ceil(mean[i, 0] - radii[i, 0]), 0.0)
        right = min(np.floor(mean[i, 0] + radii[i, 0]), width - 1.0)
        if not (top <= bottom and left <= right):
            continue
        first, last = np.int64(left) // TILE, np.int64(right) // TILE
        for row in range(np.int64(top) // TILE, np.int64(bottom) // TILE + 1):
            for t in range(first, last + 1):
                found[t] = 0
            for y in range(max(row * TILE, np.int64(top)), min(row * TILE + TILE - 1, np.int64(bottom)) + 1):
                dy = y - mean[i, 1]
                # a dx^2 + 2 b dx dy + c dy^2 <= 2 reach
                inside = (b * dy) ** 2 - a * (c * dy * dy - 2.0 * reach[i])
                if inside < 0.0:
                    continue
                half = np.sqrt(inside) / a
                middle = mean[i, 0] - b * dy / a
                low = max(np.ceil(middle - half), left)
                high = min(np.floor(middle + half), right)
                if not low <= high:
                    continue
                part = y % TILE // SUBTILE
                for s in range(np.int64(low) // SUBTILE, np.int64(high) // SUBTILE + 1):
                    found[s // 2] |= 1 << (2 * part + s % 2)
            for t in range(first, last + 1):
                if found[t]:
                    if len(splat):
                        splat[n], tile[n], mask[n] = r, row * cols + t, found[t]
                    n += 1
    return n


def tile_entries(projected: Projected, order: np.ndarray, camera: Camera) -> TileEntries:
    """Entries of the splats order[0], order[1], ... (int64, numbers in `projected`); `splat` counts along `order`."""
    cols, rows = -(-camera.width // TILE), -(-camera.height // TILE)
    reach = np.log(projected.opacity / ALPHA_MIN)
    args = (projected.mean, projected.conic, projected.radii, reach, np.asarray(order, np.int64), cols, camera.width, camera.height)
    count = _emit(*args, np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0, np.uint8))
    splat, tile, mask = np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.uint8)
    if count:
        _emit(*args, splat, tile, mask)
    return TileEntries(splat, tile, mask, cols, rows)
