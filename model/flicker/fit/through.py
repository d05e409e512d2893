"""Masks of a machine's contribution test in the lists of a fit: pictures are then optimised as the chip draws them (docs/reference/fit.md).

The masks are the machine's own, bit for bit: records in its formats, its lists, its mask generator (`explore.machine`). They count as constants: what they
leave out has no part in the derivatives.
"""

from __future__ import annotations

import numba
import numpy as np

from ..errors import FlickerError
from ..explore.configurations import get_configuration
from ..explore.machine import Configuration
from ..front.projection import Projected
from ..front.view import View
from ..golden.render import stream_order
from ..params import SUBTILE, TILE
from ..scene.camera import Camera

ALL = 0xFFFF
_SIDE = TILE // SUBTILE


def through(name: str) -> Configuration:
    """The configuration of that name; FlickerError for one whose masks are not of mini-tiles."""
    configuration = get_configuration(name)
    if configuration.generator.pixels or configuration.stop:
        raise FlickerError(f"--through: {name}: its masks are not of 4x4 mini-tiles, as those of a contribution test are")
    return configuration


@numba.njit(error_model="numpy", cache=True)
def _join_tile(t, start, entry, tiles_x, sub_start, sub_entry, sub_mask, cols, rows, mask):
    left, top = t % tiles_x * _SIDE, t // tiles_x * _SIDE
    for k in range(_SIDE * _SIDE):
        x, y = k % _SIDE, k // _SIDE
        if left + x >= cols or top + y >= rows:
            continue
        s = (top + y) * cols + left + x
        p, end = sub_start[s], sub_start[s + 1]
        for e in range(start[t], start[t + 1]):
            while p < end and sub_entry[p] < entry[e]:
                p += 1
            if p == end:
                break
            if sub_entry[p] == entry[e]:
                for m in range(4):
                    if (sub_mask[p] >> m) & 1:
                        mask[e] |= np.uint16(1) << np.uint16((2 * y + m // 2) * 4 + 2 * x + m % 2)


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _join(start, entry, tiles_x, sub_start, sub_entry, sub_mask, cols, rows, mask):
    for t in numba.prange(len(start) - 1):
        _join_tile(np.int64(t), start, entry, tiles_x, sub_start, sub_entry, sub_mask, cols, rows, mask)


def tile_masks(configuration: Configuration, projected: Projected, camera: Camera, start: np.ndarray, entry: np.ndarray) -> np.ndarray:
    """uint16 (E,): mini-tiles of a 16x16 tile that the machine visits for each entry of lists of such tiles, bit 4 row + column.

    start: int64 (tiles + 1,); entry: int32 (E,), numbers in `projected`, growing within a list.
    """
    view = View(camera, projected=projected)
    lists = view.lists(configuration.form, configuration.lists)
    order, core_start = stream_order(lists)
    found = configuration.generator.masks(view, lists, order, core_start, configuration.stage)
    mask = np.zeros(len(entry), np.uint16)
    _join(start, entry, -(-camera.width // TILE), lists.start, lists.entry, found.mask, lists.cols, lists.rows, mask)
    return mask
