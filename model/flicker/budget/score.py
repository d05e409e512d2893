"""What each Gaussian gives to pictures and takes from the chip, over views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numba
import numpy as np

from ..fit.parameters import Parameters
from ..fit.raster import (
    _FAST,
    BLUE,
    GREEN,
    HALF_A,
    HALF_C,
    HALF_HEIGHT,
    LIMIT,
    MARGIN,
    MIXED,
    MX,
    MY,
    OPACITY,
    PER_A,
    PER_YY,
    RED,
    SLOPE,
)
from ..fit.render import Frame, render
from ..params import ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN
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



@numba.njit(fastmath=_FAST, cache=True)
def _score_tile(t, rows, start, entry, tiles_x, image, used, sums):
    """Walks the list as `fit.raster` does. A pixel's state: the transmittance, and what is yet to come of its three channels."""
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    right, bottom = columns - 1.0, lines - 1.0
    remains = np.ones((TILE, TILE))
    rest = np.zeros((TILE, TILE, 3))
    for y in range(lines):
        for x in range(columns):
            for k in range(3):
                rest[y, x, k] = image[top + y, left + x, k]
    for e in range(start[t], start[t + 1]):
        if not used[e]:
            continue
        i = np.uint64(entry[e])
        mx, my = rows[i, MX] - left, rows[i, MY] - top
        half = rows[i, HALF_HEIGHT]
        low, high = max(np.ceil(my - half), 0.0), min(np.floor(my + half), bottom)
        half_a, mixed, half_c, limit = rows[i, HALF_A], rows[i, MIXED], rows[i, HALF_C], rows[i, LIMIT]
        opacity, per_yy, per_a, slope = rows[i, OPACITY], rows[i, PER_YY], rows[i, PER_A], rows[i, SLOPE]
        red, green, blue = rows[i, RED], rows[i, GREEN], rows[i, BLUE]
        total, peak, change, pixels, square = 0.0, 0.0, 0.0, 0.0, 0.0
        for y in range(np.uint64(np.int64(low)), np.uint64(np.int64(high) + 1)):
            dy = np.float64(y) - my
            half = np.sqrt(max(limit - dy * dy * per_yy, 0.0) * per_a) + MARGIN
            middle = mx + slope * dy
            low_x, high_x = max(np.ceil(middle - half), 0.0), min(np.floor(middle + half), right)
            if high_x < low_x:
                continue
            along, constant_part = mixed * dy, half_c * dy * dy
            for x in range(np.uint64(np.int64(low_x)), np.uint64(np.int64(high_x) + 1)):
                before = remains[y, x]
                if before < 0.0:
                    continue
                dx = np.float64(x) - mx
                energy = (half_a * dx + along) * dx + constant_part
                if energy < 0.0:
                    continue
                alpha = min(ALPHA_MAX, opacity * np.exp(-energy))
                if alpha < ALPHA_MIN:
                    continue
                after = before * (1.0 - alpha)
                if after < TRANSMITTANCE_MIN:
                    remains[y, x] = -before
                    continue
                weight = alpha * before
                per = 1.0 / after
                remains[y, x] = after
                rest[y, x, 0] -= weight * red
                rest[y, x, 1] -= weight * green
                rest[y, x, 2] -= weight * blue
                d_red, d_green, d_blue = red - rest[y, x, 0] * per, green - rest[y, x, 1] * per, blue - rest[y, x, 2] * per
                change += weight * weight * (d_red * d_red + d_green * d_green + d_blue * d_blue)
                total += weight
                square += weight * weight
                peak = max(peak, weight)
                pixels += 1.0
        sums[e, WEIGHT] = total
        sums[e, PEAK] = peak
        sums[e, CHANGE] = change
        sums[e, PIXELS] = pixels
        sums[e, SQUARE] = square


@numba.njit(parallel=True, cache=True)
def _score(rows, start, entry, tiles_x, image, used, sums):
    for t in numba.prange(len(start) - 1):
        _score_tile(np.int64(t), rows, start, entry, tiles_x, image, used, sums)


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
    _score(frame.rows, frame.start, frame.entry, -(-frame.camera.width // TILE), frame.image, frame.used, sums)
    before = tiles[frame.index]
    _gather(frame.index, frame.entry, frame.used, sums, total, tiles)
    frames[frame.index[tiles[frame.index] > before]] += 1


def scores(parameters: Parameters, cameras: Sequence[Camera], steps: Steps | None = None) -> Scores:
    """Look at Gaussians through cameras, over black."""
    total, tiles, frames = np.zeros((len(parameters), COLUMNS)), np.zeros(len(parameters), np.int64), np.zeros(len(parameters), np.int64)
    with (steps or Steps()).bar("scores") as report:
        for k, camera in enumerate(cameras):
            report(k, len(cameras))
            score_frame(render(parameters, camera), total, tiles, frames)
    return Scores(
        total[:, WEIGHT], total[:, PEAK], total[:, CHANGE], total[:, PIXELS], tiles.astype(np.float64), frames.astype(np.float64), len(cameras),
    )
