"""What each Gaussian gives to pictures and takes from the chip, over views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numba
import numpy as np

from ..fit.parameters import Parameters
from ..fit.raster import BLUE, GREEN, RED, visit
from ..fit.render import Draw, Frame, render
from ..params import TILE
from ..progress import Steps
from ..scene.camera import Camera

# Sums of an entry: of alpha T, its largest, squared change of the picture without the Gaussian, pixels, of (alpha T)^2.
WEIGHT, PEAK, CHANGE, PIXELS, SQUARE = range(5)
COLUMNS = 5


class Score(str, Enum):
    """What decides which Gaussians stay; fields of `Scores`."""

    CHANGE = "change"
    WEIGHT = "weight"
    PEAK = "peak"


@numba.njit(cache=True)
def _score_tile(t, rows, start, entry, mask, tiles_x, image, used, sums):
    """Walks the list as `fit.raster` does. A pixel's state: the transmittance, and what is yet to come of its three channels."""
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    remains = np.ones((TILE, TILE))
    rest = np.zeros((TILE * TILE, 3))
    place, alpha, before = np.empty(TILE * TILE, np.uint8), np.empty(TILE * TILE), np.empty(TILE * TILE)
    for y in range(lines):
        for x in range(columns):
            for k in range(3):
                rest[y * TILE + x, k] = image[top + y, left + x, k]
    for e in range(start[t], start[t + 1]):
        if not used[e]:
            continue
        i = np.uint64(entry[e])
        count, _ = visit(rows, i, np.uint64(mask[e]), left, top, columns - 1.0, lines - 1.0, remains, place, alpha, before)
        red, green, blue = rows[i, RED], rows[i, GREEN], rows[i, BLUE]
        total, peak, change, square = 0.0, 0.0, 0.0, 0.0
        for k in range(count):
            at, weight = np.uint64(place[k]), alpha[k] * before[k]
            per = 1.0 / (before[k] * (1.0 - alpha[k]))
            rest[at, 0] -= weight * red
            rest[at, 1] -= weight * green
            rest[at, 2] -= weight * blue
            d_red, d_green, d_blue = red - rest[at, 0] * per, green - rest[at, 1] * per, blue - rest[at, 2] * per
            change += weight * weight * (d_red * d_red + d_green * d_green + d_blue * d_blue)
            total += weight
            square += weight * weight
            peak = max(peak, weight)
        sums[e, WEIGHT] = total
        sums[e, PEAK] = peak
        sums[e, CHANGE] = change
        sums[e, PIXELS] = count
        sums[e, SQUARE] = square


@numba.njit(parallel=True, cache=True)
def _score(rows, start, entry, mask, tiles_x, image, used, sums):
    for t in numba.prange(len(start) - 1):
        _score_tile(np.int64(t), rows, start, entry, mask, tiles_x, image, used, sums)


@numba.njit(cache=True)
def _gather(index, entry, used, sums, total, tiles):
    """Add the entries' sums to those of their Gaussians, the largest of the largest, in the order of the lists."""
    for e in range(len(entry)):
        i = index[entry[e]]
        tiles[i] += 1
        if used[e]:
            total[i, WEIGHT] += sums[e, WEIGHT]
            total[i, PEAK] = max(total[i, PEAK], sums[e, PEAK])
            total[i, CHANGE] += sums[e, CHANGE]
            total[i, PIXELS] += sums[e, PIXELS]
            total[i, SQUARE] += sums[e, SQUARE]


@dataclass(eq=False)
class Scores:
    """Of N Gaussians over V views, float64 (N,). T is the transmittance in front of a Gaussian in a pixel.

    weight: sum of alpha T over all pixels. peak: largest alpha T. change: sum over pixels and channels of the squared difference that the picture would show
    without this one Gaussian, (alpha T (c - b))^2, c its colour, b that of what lies behind it. pixels: how many it is blended in. tiles: entries in lists of
    16x16 tiles. frames: views in which it is in any list.
    """

    weight: np.ndarray
    peak: np.ndarray
    change: np.ndarray
    pixels: np.ndarray
    tiles: np.ndarray
    frames: np.ndarray
    views: int

    def by(self, score: Score) -> np.ndarray:
        return getattr(self, score.value)


def score_frame(frame: Frame, total: np.ndarray, tiles: np.ndarray, frames: np.ndarray) -> None:
    """Add one view: total float64 (N, COLUMNS), tiles and frames int64 (N,)."""
    sums = np.empty((len(frame.entry), COLUMNS))
    _score(frame.rows, frame.start, frame.entry, frame.mask, -(-frame.camera.width // TILE), frame.image, frame.used, sums)
    before = tiles[frame.index]
    _gather(frame.index, frame.entry, frame.used, sums, total, tiles)
    frames[frame.index[tiles[frame.index] > before]] += 1


def scores(parameters: Parameters, cameras: Sequence[Camera], steps: Steps | None = None, draw: Draw = render) -> Scores:
    """Look at Gaussians through cameras, over black. draw: what makes a view's frame."""
    total, tiles, frames = np.zeros((len(parameters), COLUMNS)), np.zeros(len(parameters), np.int64), np.zeros(len(parameters), np.int64)
    with (steps or Steps()).bar("scores") as report:
        for k, camera in enumerate(cameras):
            report(k, len(cameras))
            score_frame(draw(parameters, camera), total, tiles, frames)
    return Scores(
        total[:, WEIGHT], total[:, PEAK], total[:, CHANGE], total[:, PIXELS], tiles.astype(np.float64), frames.astype(np.float64), len(cameras),
    )
