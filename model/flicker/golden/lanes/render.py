"""Whole frames by lanes: records and lists in, pixels out, with the counts that do not depend on timing or on the number of lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ...params import SUBTILE_PIXELS
from ..render import assemble
from .formats import FORMATS, LaneFormats, tables
from .lane import FINISHED, SKIPPED, blend, colour_bits, log_alpha, pair, transmittance_bits
from .lists import RecordLists
from .mask import place_of, row_mask
from .setup import splat_setup, u_of, v_of

# Per sub-tile, columns of `LaneFrame.counts`. splats: taken from the list, up to the one that finishes the last pixel. empty: whose mask has no bit. masked:
# mask bits. visited: of them those of unfinished pixels. skipped: visits that the lane's own test ends. clamped: blended with alpha 0.99.
COUNTS = ("splats", "empty", "masked", "visited", "skipped", "blended", "clamped", "pixels_finished")
N_COUNTS = len(COUNTS)
ALL = -1  # 64 bits


@numba.njit(forceinline=True)
def _ones(mask):
    n = 0
    while mask:
        mask &= mask - 1
        n += 1
    return n


@numba.njit
def _subtile(s, records, start, entry, cols, t, pixels, counts):
    total = np.zeros(SUBTILE_PIXELS, np.int64)
    colour = np.zeros((SUBTILE_PIXELS, 3), np.int64)
    unfinished = np.int64(ALL)
    needed = start[s + 1] - start[s]
    for n in range(start[s], start[s + 1]):
        i = entry[n]
        f = splat_setup(records[i, 0], records[i, 1], s % cols, s // cols, t)
        mask = row_mask(f, t)
        counts[0] += 1
        if mask == 0:
            counts[1] += 1
            continue
        counts[2] += _ones(mask)
        mask &= unfinished
        for p in range(SUBTILE_PIXELS):
            if not (mask >> p) & 1:
                continue
            counts[3] += 1
            col, row = place_of(p)
            r = pair(log_alpha(u_of(f, col, row, t), v_of(f, row, t), f.lo, t), total[p], t)
            if r.outcome == SKIPPED:
                counts[4] += 1
            elif r.outcome == FINISHED:
                unfinished &= ~(np.int64(1) << p)
                counts[7] += 1
            else:
                total[p] = r.s_next
                colour[p, 0] = blend(colour[p, 0], r.exponent, r.mantissa, f.red, t)[1]
                colour[p, 1] = blend(colour[p, 1], r.exponent, r.mantissa, f.green, t)[1]
                colour[p, 2] = blend(colour[p, 2], r.exponent, r.mantissa, f.blue, t)[1]
                counts[5] += 1
                counts[6] += r.clamped
        if unfinished == 0:
            needed = n + 1 - start[s]
            break
    for p in range(SUBTILE_PIXELS):
        pixels[p, 0] = transmittance_bits(total[p], t)
        for k in range(3):
            pixels[p, 1 + k] = colour_bits(colour[p, k], t)
    return needed


@numba.njit(parallel=True, cache=True)
def _render(records, start, entry, cols, t, pixels, counts, needed):
    for s in numba.prange(len(start) - 1):
        needed[s] = _subtile(s, records, start, entry, cols, t, pixels[s], counts[s])


@numba.njit(parallel=True, cache=True)
def _finish(records, start, entry, cols, t, mask, passes, finish, contributing):
    for s in numba.prange(len(start) - 1):
        total = np.zeros(SUBTILE_PIXELS, np.int64)
        unfinished = np.int64(ALL)
        finish[s, :] = start[s + 1] - start[s]
        for n in range(start[s], start[s + 1]):
            both = mask[n] & passes[n] & unfinished
            contributing[n] = both
            if both == 0:
                continue
            i = entry[n]
            f = splat_setup(records[i, 0], records[i, 1], s % cols, s // cols, t)
            for p in range(SUBTILE_PIXELS):
                if not (both >> p) & 1:
                    continue
                col, row = place_of(p)
                r = pair(log_alpha(u_of(f, col, row, t), v_of(f, row, t), f.lo, t), total[p], t)
                if r.outcome == FINISHED:
                    unfinished &= ~(np.int64(1) << p)
                    finish[s, p] = n - start[s]
                else:
                    total[p] = r.s_next


@numba.njit(parallel=True, cache=True)
def _masks(records, start, entry, cols, t, mask, passes):
    for s in numba.prange(len(start) - 1):
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            f = splat_setup(records[i, 0], records[i, 1], s % cols, s // cols, t)
            mask[n] = row_mask(f, t)
            for p in range(SUBTILE_PIXELS):
                col, row = place_of(p)
                if log_alpha(u_of(f, col, row, t), v_of(f, row, t), f.lo, t) <= t.limit:
                    passes[n] |= np.int64(1) << p


@dataclass
class LaneFrame:
    """A rendered frame.

    pixels: uint16 (S, 64, 4) FP16 bits, as in `golden.render.Frame`: transmittance, red, green, blue of pixel 16 m + i. counts: int64 (S, len(COUNTS)).
    needed: int64 (S,), records of a list up to the one that finishes the sub-tile's last pixel; all, where a pixel stays unfinished.
    """

    lists: RecordLists
    pixels: np.ndarray
    counts: np.ndarray
    needed: np.ndarray

    def image(self, background=(0.0, 0.0, 0.0)) -> np.ndarray:
        """float32 (H, W, 3), unquantised."""
        return assemble(self.lists, self.pixels, background)

    def total(self, name: str) -> int:
        """Sum of a count over the frame."""
        return int(self.counts[:, COUNTS.index(name)].sum())


def render_lanes(lists: RecordLists, formats: LaneFormats = FORMATS) -> LaneFrame:
    """Render a frame, bit for bit."""
    n = lists.cols * lists.rows
    pixels, counts, needed = np.zeros((n, SUBTILE_PIXELS, 4), np.uint16), np.zeros((n, N_COUNTS), np.int64), np.zeros(n, np.int64)
    _render(lists.records, lists.start, lists.entry, lists.cols, tables(formats), pixels, counts, needed)
    return LaneFrame(lists, pixels, counts, needed)


def lane_masks(lists: RecordLists, formats: LaneFormats = FORMATS) -> tuple[np.ndarray, np.ndarray]:
    """uint64 (E,) each: the masks of all entries, and the pixels whose pair passes the lane's own test, every pixel taken as unfinished."""
    mask, passes = np.zeros(len(lists.entry), np.int64), np.zeros(len(lists.entry), np.int64)
    _masks(lists.records, lists.start, lists.entry, lists.cols, tables(formats), mask, passes)
    return mask.view(np.uint64), passes.view(np.uint64)


def finish_positions(lists: RecordLists, mask: np.ndarray, passes: np.ndarray, formats: LaneFormats = FORMATS) -> tuple[np.ndarray, np.ndarray]:
    """int64 (S, 64): position in the list of the entry that finishes each pixel 16 m + i; the list's length when none does. uint64 (E,): pixels that each entry
    is blended into or finishes. mask, passes: of `lane_masks`."""
    finish, contributing = np.zeros((lists.cols * lists.rows, SUBTILE_PIXELS), np.int64), np.zeros(len(mask), np.int64)
    _finish(lists.records, lists.start, lists.entry, lists.cols, tables(formats), mask.view(np.int64), passes.view(np.int64), finish, contributing)
    return finish, contributing.view(np.uint64)
