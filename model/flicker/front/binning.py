"""Which blocks of the picture a splat meets, and the lists of the blocks.

A block meets a splat when one of its pixel centres, which lie at whole numbers, is in the splat's box; vanilla 3DGS has a rule of its own.
"""

from __future__ import annotations

import numba
import numpy as np

from .projection import tile_range


@numba.njit(cache=True)
def span(low, high, size, count):
    """First and one-past-last block of `size` pixels with a pixel centre in [low, high], clipped to [0, count)."""
    first = np.ceil(max(low, 0.0))
    last = np.floor(min(high, size * count - 1.0))
    if not first <= last:
        return 0, 0
    return np.int64(first) // size, np.int64(last) // size + 1


@numba.njit(cache=True)
def pixel_boxes(mean, radii, size, cols, rows, width, height):
    """int32 (N, 4): first and one-past-last column, then row, of the blocks of `size` pixels with a pixel centre of the picture in mean +- radii.

    mean, radii: float64 (N, 2). Empty where both bounds of an axis are 0.
    """
    box = np.empty((mean.shape[0], 4), np.int32)
    for i in range(mean.shape[0]):
        x0, x1 = span(mean[i, 0] - radii[i, 0], min(mean[i, 0] + radii[i, 0], width - 1.0), size, cols)
        y0, y1 = span(mean[i, 1] - radii[i, 1], min(mean[i, 1] + radii[i, 1], height - 1.0), size, rows)
        box[i] = x0, x1, y0, y1
    return box


@numba.njit(cache=True)
def circle_boxes(mean, circle, tiles_x, tiles_y):
    """int32 (N, 4), as `pixel_boxes`: 16x16 tiles that the bounding square of the 3-sigma circle touches (INRIA rasterizer)."""
    box = np.empty((mean.shape[0], 4), np.int32)
    for i in range(mean.shape[0]):
        x0, x1 = tile_range(mean[i, 0], circle[i], tiles_x)
        y0, y1 = tile_range(mean[i, 1], circle[i], tiles_y)
        box[i] = x0, x1, y0, y1
    return box


@numba.njit(cache=True)
def bin_boxes(box, cols, rows):
    """Lists of the blocks in the order of the boxes: entries of block b are entry[start[b]:start[b + 1]]; int64 (blocks + 1,), int32 (E,)."""
    count = np.zeros(cols * rows + 1, np.int64)
    for i in range(box.shape[0]):
        for y in range(box[i, 2], box[i, 3]):
            for x in range(box[i, 0], box[i, 1]):
                count[y * cols + x + 1] += 1
    start = np.cumsum(count)
    fill = start[:-1].copy()
    entry = np.empty(start[-1], np.int32)
    for i in range(box.shape[0]):
        for y in range(box[i, 2], box[i, 3]):
            for x in range(box[i, 0], box[i, 1]):
                b = y * cols + x
                entry[fill[b]] = i
                fill[b] += 1
    return start, entry


def pairs(box: np.ndarray) -> int:
    """Entries of all lists."""
    sides = np.maximum(box[:, 1::2].astype(np.int64) - box[:, ::2], 0)
    return int(sides.prod(axis=1).sum())
