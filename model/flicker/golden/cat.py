"""Contribution-aware test (CAT): pixel rectangles, masks, modes (paper, Sec. III and Alg. 1).

A pixel rectangle (PR) is given by two columns and two rows; its four leader pixels are numbered as in Alg. 1:
0 = (top x, top y), 1 = (bottom x, top y), 2 = (top x, bottom y), 3 = (bottom x, bottom y). A leader passes when
`threshold > E`, with threshold = log(255 o) rounded up to the format, base 2 in the factored and base e in the conic form.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from ..arithmetic.fp import E4M3_R, FP16_R, mul, rnd, sub
from ..arithmetic.functions import log_opacity_f32
from ..params import FIXED_FRAC_BITS, FIXED_INT_BITS, CatMode, Form, Precision
from .weight import conic_axis, conic_pixel, factored_pixel, factored_row

CONIC = int(Form.CONIC)
P_FP16 = int(Precision.FP16)
P_FP8 = int(Precision.FP8)
P_FIXED = int(Precision.FIXED)
FIXED_SCALE = np.float32(2.0**FIXED_FRAC_BITS)
FIXED_MAX = np.float32(2.0**FIXED_INT_BITS - 2.0**-FIXED_FRAC_BITS)
M_OFF = int(CatMode.OFF)
M_DENSE = int(CatMode.DENSE)
M_SPARSE = int(CatMode.SPARSE)
M_SPIKY = int(CatMode.SPIKY)

# Leader rectangles (x top, x bottom, y top, y bottom). Dense: rectangle m holds the corners of mini-tile m.
# Sparse: rectangle 0 the top-left, rectangle 1 the bottom-right pixels of the four mini-tiles.
DENSE_RECTS = np.array([[0, 3, 0, 3], [4, 7, 0, 3], [0, 3, 4, 7], [4, 7, 4, 7]], np.int64)
SPARSE_RECTS = np.array([[0, 4, 0, 4], [3, 7, 3, 7]], np.int64)


@numba.njit
def fixed_mean(mean):
    """A mean in fixed point, FIXED_INT_BITS.FIXED_FRAC_BITS and a sign: nearest even; infinity and NaN are the largest of their sign."""
    if not abs(mean) < FIXED_MAX:
        return np.copysign(FIXED_MAX, mean)
    return np.rint(mean * FIXED_SCALE) / FIXED_SCALE


@numba.njit
def difference(pixel, mean, precision):
    """Pixel minus mean in the format of the test (Alg. 1, line 1)."""
    if precision == P_FP16:
        return sub(np.float32(pixel), mean, FP16_R)
    if precision == P_FP8:
        return sub(np.float32(pixel), rnd(mean, E4M3_R), E4M3_R)
    if precision == P_FIXED:
        return rnd(np.float32(pixel) - fixed_mean(mean), E4M3_R)
    return rnd(sub(np.float32(pixel), mean, FP16_R), E4M3_R)


@numba.njit
def threshold(opacity, form, precision):
    """log(255 o) rounded up to the format of the test."""
    return log_opacity_f32(opacity, form != CONIC, precision == P_FP16)


# What `rect_weights` leaves in its scratch array: the four weights, then every intermediate value.
# Column terms (dx, xx, sx, p) have two entries, top and bottom; row terms (dy, yy, sy, q, v, vv) too; leader terms four.
SCRATCH = 31
COMMON_TERMS = {"shape": slice(28, 31), "dx": slice(4, 6), "dy": slice(6, 8)}
TERMS = {
    Form.CONIC: COMMON_TERMS
    | {"xx": slice(8, 10), "yy": slice(10, 12), "xy": slice(16, 20), "sx": slice(12, 14), "sy": slice(14, 16)}
    | {"t": slice(20, 24), "h": slice(24, 28)},
    Form.FACTORED: COMMON_TERMS
    | {"p": slice(8, 10), "q": slice(10, 12), "v": slice(12, 14), "u": slice(16, 20)}
    | {"uu": slice(20, 24), "vv": slice(14, 16)},
}


@numba.njit(cache=True)
def rect_weights(x_top, x_bot, y_top, y_bot, mean_x, mean_y, s0, s1, s2, form, precision, e):
    """Weights of the leaders of a pixel rectangle into `e` (float32[SCRATCH]), intermediate values behind them.

    Means and shape numbers are FP16 values in float32.
    """
    r = FP16_R if precision == P_FP16 else E4M3_R
    e[28] = s0 if precision == P_FP16 else rnd(s0, r)
    e[29] = s1 if precision == P_FP16 else rnd(s1, r)
    e[30] = s2 if precision == P_FP16 else rnd(s2, r)
    e[4] = difference(x_top, mean_x, precision)
    e[5] = difference(x_bot, mean_x, precision)
    e[6] = difference(y_top, mean_y, precision)
    e[7] = difference(y_bot, mean_y, precision)
    if form == CONIC:
        for k in range(2):
            e[8 + k], e[12 + k] = conic_axis(e[4 + k], e[28], r)
            e[10 + k], e[14 + k] = conic_axis(e[6 + k], e[30], r)
        for i in range(4):
            x = i % 2
            y = i // 2
            e[16 + i], e[20 + i], e[24 + i], e[i] = conic_pixel(e[4 + x], e[6 + y], e[12 + x], e[14 + y], e[29], r)
    else:
        for k in range(2):
            e[8 + k] = mul(e[28], e[4 + k], r)
            e[10 + k], e[12 + k], e[14 + k] = factored_row(e[6 + k], e[29], e[30], r)
        for i in range(4):
            e[16 + i], e[20 + i], e[i] = factored_pixel(e[8 + i % 2], e[10 + i // 2], e[14 + i // 2], r)


@numba.njit(forceinline=True)
def is_dense(mode, spiky):
    """Whether a splat takes dense sampling (two cycles) in a mode; AUTO's base mode is Smooth-Focused."""
    if mode == M_DENSE:
        return True
    if mode == M_SPARSE or mode == M_OFF:
        return False
    if mode == M_SPIKY:
        return spiky
    return not spiky


@numba.njit(cache=True)
def splat_mask(mean_x, mean_y, s0, s1, s2, opacity, dense, form, precision, e):
    """Four-bit mini-tile mask of a splat; `e` is scratch, float32[SCRATCH]."""
    t = threshold(opacity, form, precision)
    mask = 0
    if dense:
        for m in range(4):
            x0, x1, y0, y1 = DENSE_RECTS[m, 0], DENSE_RECTS[m, 1], DENSE_RECTS[m, 2], DENSE_RECTS[m, 3]
            rect_weights(x0, x1, y0, y1, mean_x, mean_y, s0, s1, s2, form, precision, e)
            if t > e[0] or t > e[1] or t > e[2] or t > e[3]:
                mask |= 1 << m
    else:
        for k in range(2):
            x0, x1, y0, y1 = SPARSE_RECTS[k, 0], SPARSE_RECTS[k, 1], SPARSE_RECTS[k, 2], SPARSE_RECTS[k, 3]
            rect_weights(x0, x1, y0, y1, mean_x, mean_y, s0, s1, s2, form, precision, e)
            for m in range(4):
                if t > e[m]:
                    mask |= 1 << m
    return mask


class RectTrace(NamedTuple):
    """What a PRTU computes for one splat and one rectangle, as float32 values of the narrow format.

    terms: intermediate values by name (TERMS), in the order of the hardware's stages. passes: bit i for leader i.
    """

    threshold: np.float32
    terms: dict[str, np.ndarray]
    weights: np.ndarray
    passes: int


def trace_rect(rect, features: np.ndarray, form: Form, precision: Precision) -> RectTrace:
    """Model of one PRTU operation on the rectangle `rect` (x top, x bottom, y top, y bottom).

    `features` are the nine FP16 bit patterns of `feature_t`, mean_x first.
    """
    f = np.asarray(features, np.uint16).view(np.float16).astype(np.float32)
    e = np.zeros(SCRATCH, np.float32)
    rect_weights(*map(int, rect), *f[:5], int(form), int(precision), e)
    t = np.float32(threshold(f[5], int(form), int(precision)))
    terms = {name: e[place] for name, place in TERMS[form].items()}
    return RectTrace(t, terms, e[:4], sum(int(t > e[i]) << i for i in range(4)))
