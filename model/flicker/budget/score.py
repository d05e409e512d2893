"""What each Gaussian gives to pictures and takes from the chip, over views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numba
import numpy as np

from ..fit.parameters import Parameters
from ..fit.raster import BLUE, GREEN, LANES, PITCH, PLANE, RED, new_tile, spans, visit, window
from ..fit.render import Draw, Frame, render
from ..params import TILE
from ..progress import Steps
from ..scene.camera import Camera

# Sums of an entry: of alpha T, its largest, squared change of the picture without the Gaussian, pixels, of (alpha T)^2.
WEIGHT, PEAK, CHANGE, PIXELS, SQUARE = range(5)
COLUMNS = 5
_RED, _GREEN, _BLUE = np.uint64(PLANE), np.uint64(2 * PLANE), np.uint64(3 * PLANE)  # what is yet to come of a pixel's channels


class Score(str, Enum):
    """What decides which Gaussians stay; fields of `Scores`."""

    CHANGE = "change"
    WEIGHT = "weight"
    PEAK = "peak"


@numba.njit(error_model="numpy", cache=True)
def _score_tile(t, rows, start, entry, mask, tiles_x, image, used, sums):
    """Walks the list as `fit.raster` does. A pixel's state: the transmittance, and what is yet to come of its three channels."""
    height, width = image.shape[:2]
    left, top = t % tiles_x * TILE, t // tiles_x * TILE
    columns, lines = min(TILE, width - left), min(TILE, height - top)
    state = new_tile(3, columns, lines, rows.dtype)
    first, last = np.empty(TILE, np.int32), np.empty(TILE, np.int32)
    for y in range(lines):
        for x in range(columns):
            for k in range(3):
                state[(k + 1) * PLANE + y * PITCH + x] = image[top + y, left + x, k]
    for e in range(start[t], start[t + 1]):
        if not used[e]:
            continue
        row = rows[entry[e]]
        red, green, blue = row[RED], row[GREEN], row[BLUE]
        total, peak, change, square, count = 0.0, 0.0, 0.0, 0.0, 0
        low, high = spans(row, left, top, columns - 1.0, lines - 1.0, first, last)
        for y in range(low, high):
            for x in range(first[y], last[y] + 1, LANES):
                common, place = window(row, np.uint64(mask[e]), left, top, y, np.uint64(x))
                for k in range(np.uint64(LANES)):
                    _, alpha, before, _ = visit(k, common, state, place, rows.dtype.type)
                    if alpha > 0.0:
                        weight, per, at = alpha * before, 1.0 / (before * (1.0 - alpha)), place + k
                        state[_RED + at] -= weight * red
                        state[_GREEN + at] -= weight * green
                        state[_BLUE + at] -= weight * blue
                        d_red, d_green, d_blue = red - state[_RED + at] * per, green - state[_GREEN + at] * per, blue - state[_BLUE + at] * per
                        change += weight * weight * (d_red * d_red + d_green * d_green + d_blue * d_blue)
                        total += weight
                        square += weight * weight
                        peak = max(peak, weight)
                        count += 1
        sums[e, WEIGHT] = total
        sums[e, PEAK] = peak
        sums[e, CHANGE] = change
        sums[e, PIXELS] = count
        sums[e, SQUARE] = square


@numba.njit(error_model="numpy", parallel=True, cache=True)
def _score(rows, start, entry, mask, tiles_x, image, used, sums):
    for t in numba.prange(len(start) - 1):
        _score_tile(np.int64(t), rows, start, entry, mask, tiles_x, image, used, sums)


@numba.njit(error_model="numpy", cache=True)
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
