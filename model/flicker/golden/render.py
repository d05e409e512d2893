"""Golden model of a whole frame: lists of records in, pixels out, with the counts every engine must agree on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np

from ..arithmetic.fp import FP16_R, fp16_bits, fp16_value, mul, sub
from ..front.records import SubtileLists
from ..params import (
    AUTO_DECAY_SHIFT,
    AUTO_SENT_BITS,
    AUTO_TEST_BITS,
    CORES,
    MINITILE,
    SUBTILE,
    CatMode,
    RenderConfig,
)
from .cat import M_OFF, M_SPARSE, SCRATCH, is_dense, splat_mask
from .vru import ALPHA_MIN, CONIC, TRANSMITTANCE_MIN, alpha_of, blend, next_transmittance
from .weight import conic_axis, conic_pixel, factored_pixel, factored_row

AUTO = int(CatMode.AUTO)

# Per-sub-tile counts, columns of `Frame.counts`.
COUNTS = ("gaussians", "rejected", "test_cycles", "minitiles_tested", "minitiles_sent", "pairs_blended", "pixels_finished", "fallen")
N_COUNTS = len(COUNTS)

# Above these weights alpha < 1/255 whatever the opacity: 2^-8 and e^-5.6 are below 1/255.
CUT_BASE2 = np.float32(8.0)
CUT_NATURAL = np.float32(5.6)


@numba.njit
def minitile_weights(f, m, form, col, row, e):
    """Weights E of the 16 pixels of mini-tile m in the VRU's arithmetic; col and row are scratch, float32 (2, 4)."""
    x0 = (m % 2) * MINITILE
    y0 = (m // 2) * MINITILE
    if form == CONIC:
        for i in range(4):
            col[0, i] = sub(np.float32(x0 + i), f[0], FP16_R)
            col[1, i] = conic_axis(col[0, i], f[2], FP16_R)[1]
            row[0, i] = sub(np.float32(y0 + i), f[1], FP16_R)
            row[1, i] = conic_axis(row[0, i], f[4], FP16_R)[1]
        for j in range(4):
            for i in range(4):
                e[j * 4 + i] = conic_pixel(col[0, i], row[0, j], col[1, i], row[1, j], f[3], FP16_R)[3]
    else:
        for i in range(4):
            col[0, i] = mul(f[2], sub(np.float32(x0 + i), f[0], FP16_R), FP16_R)
            row[0, i], _, row[1, i] = factored_row(sub(np.float32(y0 + i), f[1], FP16_R), f[3], f[4], FP16_R)
        for j in range(4):
            for i in range(4):
                e[j * 4 + i] = factored_pixel(col[0, i], row[0, j], row[1, j], FP16_R)[2]


@numba.njit(cache=True)
def minitile(f, m, form, state, finished, col, row, e):
    """Blend one splat into mini-tile m; returns (pairs blended, pixels finished)."""
    minitile_weights(f, m, form, col, row, e)
    cut = CUT_NATURAL if form == CONIC else CUT_BASE2
    blended = 0
    ended = 0
    for k in range(16):
        p = m * 16 + k
        if not (e[k] <= cut) or finished[p]:
            continue
        _, alpha = alpha_of(e[k], f[5], form != CONIC)
        if alpha < ALPHA_MIN:
            continue
        t = state[0, p]
        _, t_next = next_transmittance(t, alpha)
        if t_next < TRANSMITTANCE_MIN:
            finished[p] = True
            ended += 1
            continue
        w = mul(t, alpha, FP16_R)
        for c in range(3):
            state[1 + c, p] = blend(state[1 + c, p], w, f[8 - c])[1]
        state[0, p] = t_next
        blended += 1
    return blended, ended


@numba.njit
def _subtile(s, gauss, spiky, start, entry, mean, mode, form, precision, pixels, counts, needed, auto):
    """Render sub-tile s. `auto` takes (base-mode test cycles, mini-tiles of the busiest channel), saturated."""
    state = np.zeros((4, 64), np.float32)
    state[0, :] = 1.0
    finished = np.zeros(64, np.bool_)
    left = np.full(4, 16, np.int64)
    col = np.empty((2, 4), np.float32)
    row = np.empty((2, 4), np.float32)
    e16 = np.empty(16, np.float32)
    scratch = np.empty(SCRATCH, np.float32)
    f = np.empty(9, np.float32)
    sent = np.zeros(4, np.int64)
    base_test = 0
    needed[s] = start[s + 1] - start[s]
    for n in range(start[s], start[s + 1]):
        i = entry[n]
        f[0] = fp16_value(mean[n, 0])
        f[1] = fp16_value(mean[n, 1])
        for k in range(2, 9):
            f[k] = fp16_value(gauss[i, k])
        if mode == M_OFF:
            mask = 15
            cycles = 1
        else:
            dense = is_dense(mode, spiky[i])
            cycles = 2 if dense else 1
            mask = splat_mask(f[0], f[1], f[2], f[3], f[4], f[5], dense, form, precision, scratch)
        base_test += 2 if is_dense(AUTO, spiky[i]) else 1
        counts[0] += 1
        counts[1] += mask == 0
        counts[2] += cycles
        for m in range(4):
            if not (mask >> m) & 1:
                continue
            counts[3] += 1
            sent[m] += 1
            if left[m] == 0:
                continue
            counts[4] += 1
            blended, ended = minitile(f, m, form, state, finished, col, row, e16)
            left[m] -= ended
            counts[5] += blended
            counts[6] += ended
            if ended and left.sum() == 0:
                needed[s] = n + 1 - start[s]
    for c in range(4):
        for p in range(64):
            pixels[p, c] = fp16_bits(state[c, p])
    auto[0] = min(base_test, (1 << AUTO_TEST_BITS) - 1)
    auto[1] = min(max(max(sent[0], sent[1]), max(sent[2], sent[3])), (1 << AUTO_SENT_BITS) - 1)


@numba.njit(parallel=True, cache=True)
def _render_fixed(order, gauss, spiky, start, entry, mean, mode, form, precision, pixels, counts, needed):
    for k in numba.prange(len(order)):
        s = order[k]
        auto = np.zeros(2, np.int64)
        _subtile(s, gauss, spiky, start, entry, mean, mode, form, precision, pixels[s], counts[s], needed, auto)


@numba.njit(parallel=True, cache=True)
def _render_auto(order, core_start, gauss, spiky, start, entry, mean, form, precision, pixels, counts, needed, per_vru):
    for core in numba.prange(CORES):
        auto = np.zeros(2, np.int64)
        test_avg = 0
        sent_avg = 0
        decided = False  # from the sub-tiles up to the last but one
        latest = False  # from the last one too
        for k in range(core_start[core], core_start[core + 1]):
            s = order[k]
            fall = decided
            _subtile(s, gauss, spiky, start, entry, mean, M_SPARSE if fall else AUTO, form, precision, pixels[s], counts[s], needed, auto)
            counts[s, 7] = fall
            test_avg += auto[0] - (test_avg >> AUTO_DECAY_SHIFT)
            sent_avg += per_vru * auto[1] - (sent_avg >> AUTO_DECAY_SHIFT)
            decided = latest
            latest = test_avg > sent_avg


class Streamed(Protocol):
    """Sub-tiles of a picture, row by row, with their lists: that of s has start[s + 1] - start[s] splats."""

    cols: int
    rows: int
    start: np.ndarray


def stream_order(lists: Streamed, empty: bool = True, walk: tuple[np.ndarray, np.ndarray] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Order in which the cores see sub-tiles: (sub-tile numbers core by core, start of each core's part). empty: with those whose list is empty.

    Core k has column k % 2, row k / 2 of each tile. walk: columns and rows of tiles in their order; None: row by row.
    """
    grid = np.arange(lists.rows * lists.cols).reshape(lists.rows, lists.cols)
    if walk is None:
        parts = [grid[k // 2 :: 2, k % 2 :: 2].ravel() for k in range(CORES)]
    else:
        x, y = walk
        parts = [grid[2 * y + k // 2, 2 * x + k % 2] for k in range(CORES)]
    if not empty:
        parts = [part[np.diff(lists.start)[part] > 0] for part in parts]
    return np.concatenate(parts), np.cumsum([0] + [len(p) for p in parts])


@dataclass
class Frame:
    """A rendered frame.

    pixels: uint16 (S, 64, 4) FP16 bits: transmittance, red, green, blue of pixel 16 m + i of each sub-tile.
    counts: int64 (S, len(COUNTS)).
    needed: int64 (S,), records of a list up to the one that finishes the sub-tile's last pixel, those behind change nothing there; all, where a pixel
        stays unfinished.
    """

    lists: SubtileLists
    pixels: np.ndarray
    counts: np.ndarray
    needed: np.ndarray

    def image(self, background=(0.0, 0.0, 0.0)) -> np.ndarray:
        """float32 (H, W, 3), unquantised."""
        return assemble(self.lists, self.pixels, background)

    def total(self, name: str) -> int:
        """Sum of a count over the frame."""
        return int(self.counts[:, COUNTS.index(name)].sum())


class Grid(Protocol):
    """Size of a picture and of its grid of sub-tiles."""

    width: int
    height: int
    cols: int
    rows: int


def assemble(lists: Grid, pixels: np.ndarray, background=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Pixels of sub-tiles to a float32 picture (H, W, 3) over a background colour."""
    v = pixels.view(np.float16).astype(np.float32)
    rgb = v[..., 1:4] + v[..., 0:1] * np.asarray(background, np.float32)
    # (rows, cols, minitile y, minitile x, pixel y, pixel x, 3) -> rows of pixels
    rgb = rgb.reshape(lists.rows, lists.cols, 2, 2, 4, 4, 3).transpose(0, 2, 4, 1, 3, 5, 6)
    rgb = rgb.reshape(lists.rows * SUBTILE, lists.cols * SUBTILE, 3)
    return np.ascontiguousarray(rgb[: lists.height, : lists.width])


def coverage(lists: Grid, pixels: np.ndarray) -> np.ndarray:
    """float64 (H, W): alpha of a picture whose pixels `assemble` takes, 1 less the transmittance that is left."""
    clear = pixels.copy()
    clear[..., 1:] = 0
    return 1.0 - assemble(lists, clear, (1.0, 1.0, 1.0))[..., 0].astype(np.float64)


def render_golden(lists: SubtileLists, config: RenderConfig, walk: tuple[np.ndarray, np.ndarray] | None = None) -> Frame:
    """Render a frame bit for bit as the RTL does. walk: of `stream_order`, on which the automatic mode depends."""
    n = lists.cols * lists.rows
    pixels = np.zeros((n, 64, 4), np.uint16)
    counts = np.zeros((n, N_COUNTS), np.int64)
    needed = np.zeros(n, np.int64)
    order, core_start = stream_order(lists, walk=walk)
    args = (lists.gauss, lists.spiky, lists.start, lists.entry, lists.mean)
    tail = (int(config.form), int(config.precision), pixels, counts, needed)
    if config.form != lists.form:
        raise ValueError(f"lists are in {lists.form.name} form, the configuration in {config.form.name}")
    if config.cat == CatMode.AUTO:
        _render_auto(order, core_start, *args, *tail, config.pixels_per_vru)
    else:
        _render_fixed(order, *args, int(config.cat), *tail)
    return Frame(lists, pixels, counts, needed)
