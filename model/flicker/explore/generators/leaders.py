"""Masks from leader pixels: FLICKER's contribution-aware test in all modes, and SeeLe's 2x2 groups."""

from __future__ import annotations

import numba
import numpy as np

from ...golden.cat import SCRATCH, is_dense, splat_mask
from ...arithmetic.fp import FP16_R, mul, sub
from ...front.records import SubtileLists
from ...golden.vru import ALPHA_MIN, CONIC, alpha_of
from ...golden.weight import conic_axis, conic_pixel, factored_pixel, factored_row
from ...params import (
    AUTO_DECAY_SHIFT, AUTO_SENT_BITS, AUTO_TEST_BITS, CHANNELS, CORES, FIXED_FRAC_BITS, FIXED_INT_BITS, CatMode, Form, Precision,
    RenderConfig,
)
from ...cost.operations import Op, Operation, Operations
from ...golden.masked import load_splat

DENSE_LEADERS = 16
SPARSE_LEADERS = 8


@numba.njit(parallel=True, cache=True)
def _cat(gauss, spiky, start, entry, mean, mode, form, precision, mask, cycles):
    for s in numba.prange(len(start) - 1):
        scratch = np.empty(SCRATCH, np.float32)
        f = np.empty(9, np.float32)
        for n in range(start[s], start[s + 1]):
            i = entry[n]
            load_splat(n, i, gauss, mean, f)
            dense = is_dense(mode, spiky[i])
            cycles[n] = 2 if dense else 1
            mask[n] = splat_mask(f[0], f[1], f[2], f[3], f[4], f[5], dense, form, precision, scratch)


def _saturated(x: int, bits: int) -> int:
    return min(x, (1 << bits) - 1)


def _fallen(
    order: np.ndarray, core_start: np.ndarray, base_test: np.ndarray, sent: np.ndarray, sent_sparse: np.ndarray, per_vru: int,
) -> np.ndarray:
    """Sub-tiles in which the automatic mode has fallen (docs/ctu.md). base_test (S,), sent and sent_sparse (S, 4) per sub-tile; per_vru:
    pixels of a VRU."""
    fallen = np.zeros(len(base_test), bool)
    for core in range(CORES):
        test_avg = sent_avg = 0
        decided = latest = False
        for s in order[core_start[core] : core_start[core + 1]]:
            fallen[s] = decided
            counts = sent_sparse[s] if decided else sent[s]
            test_avg += _saturated(int(base_test[s]), AUTO_TEST_BITS) - (test_avg >> AUTO_DECAY_SHIFT)
            sent_avg += per_vru * _saturated(int(counts.max()), AUTO_SENT_BITS) - (sent_avg >> AUTO_DECAY_SHIFT)
            decided, latest = latest, test_avg > sent_avg
    return fallen


def per_subtile(values: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Sums of per-element values (E,) or (E, k) over each sub-tile, int64."""
    total = np.zeros((len(values) + 1, *values.shape[1:]), np.int64)
    np.cumsum(values, axis=0, out=total[1:])
    return total[start[1:]] - total[start[:-1]]


def cat_masks(
    lists: SubtileLists, config: RenderConfig, order: np.ndarray, core_start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mask uint8 (E,), test cycles uint8 (E,), fallen bool (S,)) of the contribution-aware test."""
    n = len(lists.entry)

    def fixed(mode: CatMode) -> tuple[np.ndarray, np.ndarray]:
        mask, cycles = np.empty(n, np.uint8), np.empty(n, np.uint8)
        _cat(
            lists.gauss, lists.spiky, lists.start, lists.entry, lists.mean,
            int(mode), int(config.form), int(config.precision), mask, cycles,
        )
        return mask, cycles

    fallen = np.zeros(lists.cols * lists.rows, bool)
    if config.cat == CatMode.OFF:
        return np.full(n, 15, np.uint8), np.ones(n, np.uint8), fallen
    if config.cat != CatMode.AUTO:
        return *fixed(config.cat), fallen
    mask, cycles = fixed(CatMode.SMOOTH)
    sparse_mask, sparse_cycles = fixed(CatMode.SPARSE)
    bits = np.arange(CHANNELS, dtype=np.uint8)
    sent, sent_sparse = (per_subtile((m[:, None] >> bits) & 1, lists.start) for m in (mask, sparse_mask))
    fallen = _fallen(order, core_start, per_subtile(cycles, lists.start), sent, sent_sparse, config.pixels_per_vru)
    down = np.repeat(fallen, np.diff(lists.start))
    return np.where(down, sparse_mask, mask), np.where(down, sparse_cycles, cycles), fallen


def cat_operations(config: RenderConfig) -> Operations:
    """Two PRTUs: one pixel rectangle of four leaders each per cycle."""
    if config.cat == CatMode.OFF:
        return Operations()
    fmt = "FP16" if config.precision == Precision.FP16 else "E4M3"
    difference = {
        Precision.FP8: "E4M3", Precision.FIXED: f"fixed {FIXED_INT_BITS + FIXED_FRAC_BITS + 2}",
    }.get(config.precision, "FP16")
    if config.form == Form.CONIC:  # per rectangle: xx, yy, sx, sy twice each, xy, t four times, h and E four times
        operations = [Operation(Op.MUL, fmt, 2 * 12), Operation(Op.MUL, fmt, 2 * 4, sqr=True), Operation(Op.ADD, fmt, 2 * 8)]
    else:  # per rectangle: p, q, v and vv twice each, u four times, uu four times, E four times
        operations = [Operation(Op.MUL, fmt, 2 * 6), Operation(Op.MUL, fmt, 2 * 6, sqr=True), Operation(Op.ADD, fmt, 2 * 8)]
    operations += [Operation(Op.ADD, difference, 2 * 4), Operation(Op.CMP, fmt, 2 * 4), Operation(Op.LOG, fmt, 1)]
    if config.precision == Precision.FIXED:
        operations.append(Operation(Op.SHIFT, f"FP16 -> q{FIXED_INT_BITS}.{FIXED_FRAC_BITS}", 2 * 2, note="means"))
    if config.precision in (Precision.MIXED, Precision.FIXED):
        operations.append(Operation(Op.SHIFT, "FP16 -> E4M3", 2 * 7, note="conversion"))
    elif config.precision == Precision.FP8:
        operations.append(Operation(Op.SHIFT, "FP16 -> E4M3", 2 * 5, note="conversion"))
    return Operations(tuple(operations))


@numba.njit(parallel=True, cache=True)
def _seele(gauss, start, entry, mean, form, mask, visit):
    for s in numba.prange(len(start) - 1):
        f = np.empty(9, np.float32)
        col = np.empty((2, 4), np.float32)
        row = np.empty((2, 4), np.float32)
        for n in range(start[s], start[s + 1]):
            load_splat(n, entry[n], gauss, mean, f)
            for k in range(4):
                dx = sub(np.float32(2 * k), f[0], FP16_R)
                dy = sub(np.float32(2 * k), f[1], FP16_R)
                if form == CONIC:
                    col[0, k] = dx
                    row[0, k] = dy
                    col[1, k] = conic_axis(dx, f[2], FP16_R)[1]
                    row[1, k] = conic_axis(dy, f[4], FP16_R)[1]
                else:
                    col[0, k] = mul(f[2], dx, FP16_R)
                    row[0, k], _, row[1, k] = factored_row(dy, f[3], f[4], FP16_R)
            send = 0
            for m in range(4):
                v = 0
                for g in range(4):
                    x = (m % 2) * 2 + g % 2
                    y = (m // 2) * 2 + g // 2
                    if form == CONIC:
                        e = conic_pixel(col[0, x], row[0, y], col[1, x], row[1, y], f[3], FP16_R)[3]
                    else:
                        e = factored_pixel(col[0, x], row[0, y], row[1, y], FP16_R)[2]
                    if e >= 0 and alpha_of(e, f[5], form != CONIC)[1] >= ALPHA_MIN:
                        v |= 0x33 << ((g // 2) * 8 + (g % 2) * 2)
                visit[n, m] = v
                send |= int(v != 0) << m
            mask[n] = send


def seele_masks(lists: SubtileLists) -> tuple[np.ndarray, np.ndarray]:
    """(mask, visit): a 2x2 group of pixels is visited when its leader, the top-left pixel, has alpha >= 1/255 (FP16, as the VRU)."""
    n = len(lists.entry)
    mask, visit = np.empty(n, np.uint8), np.empty((n, 4), np.uint16)
    _seele(lists.gauss, lists.start, lists.entry, lists.mean, int(lists.form), mask, visit)
    return mask, visit


def seele_operations(form: Form) -> Operations:
    """Sixteen leaders per element: four columns, four rows; alpha itself is compared, as in the renderer."""
    common = (Operation(Op.ADD, "FP16", 8), Operation(Op.TABLE, "FP16 exp", 16), Operation(Op.MUL, "FP16", 16, note="opacity"), Operation(Op.CMP, "FP16", 16))
    if form == Form.CONIC:
        own = (Operation(Op.MUL, "FP16", 8 + 32), Operation(Op.MUL, "FP16", 8, sqr=True), Operation(Op.ADD, "FP16", 32))
    else:
        own = (Operation(Op.MUL, "FP16", 4 + 8), Operation(Op.MUL, "FP16", 4 + 16, sqr=True), Operation(Op.ADD, "FP16", 32))
    return Operations(common + own, cycles=2)
