"""The order in which the chip renders tiles (rtl/sort/flk_tile_walk.sv, docs/reference/rendering.md): near each other in time what is near in the
picture, so that records are still in the cache."""

from __future__ import annotations

import numpy as np

BAND = 8  # rows of tiles


def tile_walk(pairs: int, rows: int, band: int = BAND) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows, int64 (2 * pairs * rows,), of all tiles in their order.

    Bands of rows, from the left and from the right in turn; in a band columns of pairs of tiles, the first one downward, then upward and downward in turn; in a
    column pairs with the left or the right tile first in turn, beginning with the one that the band comes from.
    """
    x, y = [], []
    for first in range(0, rows, band):
        right = first // band % 2  # the band comes from the right
        down = np.arange(first, min(first + band, rows))
        for k in range(pairs):
            pair = pairs - 1 - k if right else k
            half = (np.arange(len(down)) + right) % 2
            x.append((2 * pair + np.stack([half, 1 - half], axis=1)).ravel())
            y.append(np.repeat(down[::-1] if k % 2 else down, 2))
    return np.concatenate(x), np.concatenate(y)


def borders(pairs: int, rows: int, band: int = BAND) -> np.ndarray:
    """uint8 (2 * pairs * rows, 2): of each tile of the walk the sub-tiles (bit k: column k % 2, row k / 2) that touch the next tile, and those that touch the
    one behind that, where these are in the same column of the same band; 0 elsewhere."""
    x, y = tile_walk(pairs, rows, band)
    found = np.zeros((len(x), 2), np.uint8)
    column, row = np.arange(4) % 2, np.arange(4) // 2
    for ahead in (1, 2):
        dx, dy = x[ahead:] - x[:-ahead], y[ahead:] - y[:-ahead]
        same = (x[ahead:] // 2 == x[:-ahead] // 2) & (y[ahead:] // band == y[:-ahead] // band)
        touches = ((dx == 0)[:, None] | (column == (dx[:, None] > 0))) & ((dy == 0)[:, None] | (row == (dy[:, None] > 0)))
        found[:-ahead, ahead - 1] = np.where(same, (touches << np.arange(4)).sum(axis=1), 0)
    return found
