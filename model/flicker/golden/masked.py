"""The VRUs under masks: pictures, contributing pixels and the element that finishes each pixel.

Same arithmetic as `golden.render` (its kernels), other book-keeping: whole mini-tiles or single pixels are visited as the masks
say. With the masks of the contribution test the pixels equal the golden model's (tb/model/test_configurations.py).
"""

from __future__ import annotations

import numba
import numpy as np

from ..arithmetic.fp import FP16_R, fp16_bits, fp16_value, mul
from ..arithmetic.thresholds import thresholds
from ..front.records import SubtileLists
from .render import CUT_BASE2, CUT_NATURAL, minitile_weights
from .vru import ALPHA_MIN, CONIC, TRANSMITTANCE_MIN, alpha_of, blend, next_transmittance

ACCUMULATOR_INT_BITS = 3  # of fixed-point colour accumulators: up to 8


@numba.njit
def load_splat(n, i, gauss, mean, f):
    """Nine FP16 values of entry n (splat i) as float32, mean_x first."""
    f[0] = fp16_value(mean[n, 0])
    f[1] = fp16_value(mean[n, 1])
    for k in range(2, 9):
        f[k] = fp16_value(gauss[i, k])


@numba.njit(forceinline=True)
def accumulate(c, w, colour, fraction):
    """C + w colour in an unsigned fixed-point accumulator of ACCUMULATOR_INT_BITS and `fraction` bits, saturating; the product is FP16's."""
    unit = np.float32(2.0**fraction)
    m = np.float32(np.floor(mul(w, abs(colour), FP16_R) * unit + np.float32(0.5))) / unit
    return min(c + m, np.float32(2.0**ACCUMULATOR_INT_BITS) - np.float32(1.0) / unit)


@numba.njit
def _visit_minitile(f, m, visit, unfinished, form, fraction, state, col, row, e):
    """Blend one splat into the unfinished pixels of mini-tile m that `visit` names; returns (contributing, finished) masks."""
    minitile_weights(f, m, form, col, row, e)
    cut = CUT_NATURAL if form == CONIC else CUT_BASE2
    visit &= unfinished
    contributing = 0
    ended = 0
    for k in range(16):
        if not (visit >> k) & 1 or not (e[k] <= cut):
            continue
        _, alpha = alpha_of(e[k], f[5], form != CONIC)
        if alpha < ALPHA_MIN:
            continue
        contributing |= 1 << k
        p = m * 16 + k
        t = state[0, p]
        _, t_next = next_transmittance(t, alpha)
        if t_next < TRANSMITTANCE_MIN:
            ended |= 1 << k
            continue
        w = mul(t, alpha, FP16_R)
        for c in range(3):
            if fraction == 0:
                state[1 + c, p] = blend(state[1 + c, p], w, f[8 - c])[1]
            else:
                state[1 + c, p] = accumulate(state[1 + c, p], w, f[8 - c], fraction)
        state[0, p] = t_next
    return contributing, ended


@numba.njit(parallel=True, cache=True)
def _render(order, gauss, start, entry, mean, mask, visit, form, fraction, pixels, contributing, pixel_finish):
    whole = len(visit) == 0
    for o in numba.prange(len(order)):
        s = order[o]
        state = np.zeros((4, 64), np.float32)
        state[0, :] = 1.0
        unfinished = np.full(4, 0xFFFF, np.int64)
        col = np.empty((2, 4), np.float32)
        row = np.empty((2, 4), np.float32)
        e = np.empty(16, np.float32)
        f = np.empty(9, np.float32)
        pixel_finish[s, :] = start[s + 1] - start[s]
        for n in range(start[s], start[s + 1]):
            if mask[n] == 0:
                continue
            if (unfinished[0] | unfinished[1] | unfinished[2] | unfinished[3]) == 0:
                break
            load_splat(n, entry[n], gauss, mean, f)
            for m in range(4):
                if not (mask[n] >> m) & 1 or unfinished[m] == 0:
                    continue
                v = np.int64(0xFFFF) if whole else np.int64(visit[n, m])
                hit, ended = _visit_minitile(f, m, v, unfinished[m], form, fraction, state, col, row, e)
                contributing[n, m] = hit
                if ended:
                    unfinished[m] &= ~ended
                    for k in range(16):
                        if (ended >> k) & 1:
                            pixel_finish[s, m * 16 + k] = n - start[s]
        for c in range(4):
            for p in range(64):
                pixels[s, p, c] = fp16_bits(state[c, p])


def render_masked(
    lists: SubtileLists, order: np.ndarray, mask: np.ndarray, visit: np.ndarray | None, fraction: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run the VRUs: (pixels uint16 (S, 64, 4) as in `golden.render.Frame`, contributing (E, 4), pixel_finish (S, 64)).

    fraction: bits behind the point of colour accumulators, whose sum is rounded to FP16 once, at the end; 0: FP16 accumulators, as the RTL's.
    """
    n = lists.cols * lists.rows
    pixels = np.empty((n, 64, 4), np.uint16)
    contributing = np.zeros((len(lists.entry), 4), np.uint16)
    pixel_finish = np.empty((n, 64), np.int32)
    visit = np.zeros((0, 4), np.uint16) if visit is None else visit
    _render(
        order, lists.gauss, lists.start, lists.entry, lists.mean, mask, visit, int(lists.form), fraction, pixels, contributing, pixel_finish,
    )
    return pixels, contributing, pixel_finish


@numba.njit(parallel=True, cache=True)
def _misses(gauss, start, entry, mean, mask, visit, form, pixel_finish, missed):
    whole = len(visit) == 0
    for s in numba.prange(len(start) - 1):
        col = np.empty((2, 4), np.float32)
        row = np.empty((2, 4), np.float32)
        e = np.empty(16, np.float32)
        f = np.empty(9, np.float32)
        for n in range(start[s], start[s + 1]):
            load_splat(n, entry[n], gauss, mean, f)
            for m in range(4):
                seen = 0
                if (mask[n] >> m) & 1:
                    seen = np.int64(0xFFFF) if whole else np.int64(visit[n, m])
                if seen == 0xFFFF:
                    continue
                minitile_weights(f, m, form, col, row, e)
                for k in range(16):
                    if (seen >> k) & 1 or n - start[s] > pixel_finish[s, m * 16 + k] or not e[k] >= 0:
                        continue
                    missed[n, m] |= np.uint16(int(alpha_of(e[k], f[5], form != CONIC)[1] >= ALPHA_MIN) << k)


def missed_pixels(lists: SubtileLists, mask: np.ndarray, visit: np.ndarray | None, pixel_finish: np.ndarray | None = None) -> np.ndarray:
    """uint16 (E, 4): pixels that the masks leave out although the VRU's own alpha test would have passed.

    With `pixel_finish` only pixels unfinished at that element count, else all.
    """
    if pixel_finish is None:
        pixel_finish = np.full((lists.cols * lists.rows, 64), np.iinfo(np.int32).max, np.int32)
    missed = np.zeros((len(lists.entry), 4), np.uint16)
    visit = np.zeros((0, 4), np.uint16) if visit is None else visit
    _misses(lists.gauss, lists.start, lists.entry, lists.mean, mask, visit, int(lists.form), pixel_finish, missed)
    return missed


@numba.njit(parallel=True, cache=True)
def _pixel_tests(gauss, limit, start, entry, mean, form, mask, visit):
    for s in numba.prange(len(start) - 1):
        col = np.empty((2, 4), np.float32)
        row = np.empty((2, 4), np.float32)
        e = np.empty(16, np.float32)
        f = np.empty(9, np.float32)
        for n in range(start[s], start[s + 1]):
            load_splat(n, entry[n], gauss, mean, f)
            t = np.float32(limit[gauss[entry[n], 5]])
            send = 0
            for m in range(4):
                minitile_weights(f, m, form, col, row, e)
                v = 0
                for k in range(16):
                    v |= int(e[k] >= 0 and t > e[k]) << k
                visit[n, m] = v
                send |= int(v != 0) << m
            mask[n] = send


def pixel_tests(lists: SubtileLists) -> tuple[np.ndarray, np.ndarray]:
    """(mask, visit) when every pixel is tested: 0 <= E < log(255 o), all in FP16 as in the VRU."""
    n = len(lists.entry)
    mask, visit = np.empty(n, np.uint8), np.empty((n, 4), np.uint16)
    limit = thresholds(lists.form)
    _pixel_tests(lists.gauss, limit, lists.start, lists.entry, lists.mean, int(lists.form), mask, visit)
    return mask, visit
