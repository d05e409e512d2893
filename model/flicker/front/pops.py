"""Pops: pairs of Gaussians that overlap in a pixel and change their order from one frame to the next (docs/reference/motion.md).

    before, after = seen_in(projected, camera), seen_in(next_projected, next_camera)
    pops(before, after).pops

Two overlap in a pixel where both have an alpha of at least 1/255, by the list of its sub-tile. Gaussians that come into the picture or leave it have no order
in one of the frames and count nowhere. Both are blended, so a change of order is a step in the picture however little the camera moves: Radl et al.,
"StopThePop: Sorted Gaussian Splatting for View-Consistent Real-time Rendering" (2024), Sec. 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..params import ALPHA_MIN, SUBTILE
from ..scene.camera import Camera
from .projection import Projected
from .records import bin_splats

AT_ONCE = 1 << 25  # pairs in sub-tiles that are kept at a time: 256 MB


@dataclass(eq=False)
class Seen:
    """A frame: what is blended, in which order, where (M Gaussians, S sub-tiles row by row, E list entries).

    gaussian: int64 (M,), numbers in the scene, near to far. start: int64 (S + 1,), entry: int32 (E,), places in `gaussian`, rising in every list. pixels:
    uint64 (E,), bit 8 y + x: the pixels of the sub-tile where the entry has an alpha of at least 1/255. size: width and height of the picture.
    """

    gaussian: np.ndarray
    start: np.ndarray
    entry: np.ndarray
    pixels: np.ndarray
    size: tuple[int, int]

    @classmethod
    def of(
        cls, gaussian: np.ndarray, order: np.ndarray, mean: np.ndarray, energy: np.ndarray, opacity: np.ndarray, start: np.ndarray, entry: np.ndarray,
        camera: Camera,
    ) -> Seen:
        """From splats of a frame: number in the scene, mean float64 (M, 2) in pixels, energy float64 (M, 3) with alpha = opacity exp(-(e0 dx^2 + e1 dx dy +
        e2 dy^2)), opacity. order: int64 (M,), splats near to far. start, entry: lists of splats, each near to far."""
        rank = np.empty(len(order), np.int32)
        rank[order] = np.arange(len(order), dtype=np.int32)
        with np.errstate(divide="ignore"):
            reach = np.log(np.asarray(opacity, np.float64) / ALPHA_MIN)
        pixels = np.zeros(len(entry), np.uint64)
        _pixels(
            np.ascontiguousarray(mean, np.float64), np.ascontiguousarray(energy, np.float64), reach, start, entry, -(-camera.width // SUBTILE), camera.width,
            camera.height, pixels,
        )
        return cls(gaussian[order].astype(np.int64), start, rank[entry], pixels, (camera.width, camera.height))


@dataclass(frozen=True)
class Pops:
    """From a frame to the next. pops: pairs. popped: share of the pixels of the later frame in which at least one pair overlaps."""

    pops: int
    popped: float


@numba.njit(parallel=True, cache=True)
def _pixels(mean, energy, reach, start, entry, cols, width, height, pixels):
    for s in numba.prange(len(start) - 1):
        left, top = s % cols * SUBTILE, s // cols * SUBTILE
        wide, high = min(SUBTILE, width - left), min(SUBTILE, height - top)
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            found = np.uint64(0)
            for y in range(high):
                dy = top + y - mean[i, 1]
                for x in range(wide):
                    dx = left + x - mean[i, 0]
                    if (energy[i, 0] * dx + energy[i, 1] * dy) * dx + energy[i, 2] * dy * dy <= reach[i]:
                        found |= np.uint64(1) << np.uint64(SUBTILE * y + x)
            pixels[n] = found


@numba.njit(cache=True)
def _pairs(first, last, entry, pixels, rank, low, high, at, pairs):
    """Pairs of entries first..last - 1 whose ranks fall while they stand behind each other, that share a pixel, and of which the second is of low..high - 1:
    their number and their pixels. pairs: where they are written, from `at` on; of no length: only counted."""
    order = np.empty(last - first, np.int64)  # entries so far by their rank
    n = 0
    found, where = 0, np.uint64(0)
    for k in range(first, last):
        r = rank[entry[k]]
        if r < 0 or pixels[k] == 0:
            continue
        place = n
        while place > 0 and rank[entry[order[place - 1]]] > r:
            other = order[place - 1]
            order[place] = other
            place -= 1
            both = pixels[k] & pixels[other]
            if both != 0 and low <= entry[k] < high:
                if len(pairs):
                    pairs[at + found] = np.uint64(entry[other]) << np.uint64(32) | np.uint64(entry[k])
                found += 1
                where |= both
        order[place] = k
        n += 1
    return found, where


@numba.njit(parallel=True, cache=True)
def _counted(start, entry, pixels, rank, low, high, count, popped):
    for s in numba.prange(len(start) - 1):
        found, where = _pairs(start[s], start[s + 1], entry, pixels, rank, low, high, 0, np.empty(0, np.uint64))
        count[s] = found
        bits = 0
        while where != 0:
            where &= where - np.uint64(1)
            bits += 1
        popped[s] = bits


@numba.njit(parallel=True, cache=True)
def _listed(start, entry, pixels, rank, low, high, at, pairs):
    for s in numba.prange(len(start) - 1):
        if at[s + 1] > at[s]:
            _pairs(start[s], start[s + 1], entry, pixels, rank, low, high, at[s], pairs)


def pops(before: Seen, after: Seen) -> Pops:
    """Pairs that overlap in a pixel of the later frame and whose order there is not that of the frame before, each counted once."""
    place = np.full(max(before.gaussian.max(initial=-1), after.gaussian.max(initial=-1)) + 1, -1, np.int64)
    place[before.gaussian] = np.arange(len(before.gaussian))
    rank = place[after.gaussian]
    lists, gaussians = (after.start, after.entry, after.pixels, rank), len(rank)
    count, popped, rest = np.zeros((3, len(after.start) - 1), np.int64)
    _counted(*lists, 0, gaussians, count, popped)
    turns, found = -(-int(count.sum()) // AT_ONCE), 0
    for turn in range(turns):  # a pair is found in every sub-tile that it shares: counted once, so many Gaussians at a time
        low, high = gaussians * turn // turns, gaussians * (turn + 1) // turns
        if turns > 1:
            _counted(*lists, low, high, count, rest)
        at = np.concatenate([[0], np.cumsum(count)])
        pairs = np.empty(at[-1], np.uint64)
        if len(pairs):
            _listed(*lists, low, high, at, pairs)
        found += len(np.unique(pairs))
    return Pops(found, float(popped.sum() / (after.size[0] * after.size[1])))


def seen_in(projected: Projected, camera: Camera) -> Seen:
    """What the float64 front end lists, with the boxes of its sub-tiles."""
    bins = bin_splats(projected, camera)
    a, b, c = projected.conic.T
    energy = np.stack([0.5 * a, b, 0.5 * c], axis=1)
    return Seen.of(projected.index, np.arange(projected.n_visible), projected.mean, energy, projected.opacity, bins.start, bins.entry, camera)
