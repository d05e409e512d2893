"""Contribution-aware test (CAT): pixel rectangles, masks, modes (paper, Sec. III and Alg. 1).

A pixel rectangle (PR) is given by two columns and two rows; its four leader pixels are numbered as in Alg. 1:
0 = (top x, top y), 1 = (bottom x, top y), 2 = (top x, bottom y), 3 = (bottom x, bottom y). A leader passes when
`threshold > E`, with threshold = log(255 o) rounded up to the format, base 2 in the factored and base e in the conic form.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from ..functions import log_opacity_f32
from ..params import CatMode, Form, Precision
from .fp import E4M3_R, FP16_R, mul, rnd, sub
from .weight import conic_axis, conic_pixel, factored_pixel, factored_row

CONIC = int(Form.CONIC)
P_FP16 = int(Precision.FP16)
P_FP8 = int(Precision.FP8)
M_OFF = int(CatMode.OFF)
M_DENSE = int(CatMode.DENSE)
M_SPARSE = int(CatMode.SPARSE)
M_SPIKY = int(CatMode.SPIKY)

# Leader rectangles (x top, x bottom, y top, y bottom). Dense: rectangle m holds the corners of mini-tile m.
# Sparse: rectangle 0 the top-left, rectangle 1 the bottom-right pixels of the four mini-tiles.
DENSE_RECTS = np.array([[0, 3, 0, 3], [4, 7, 0, 3], [0, 3, 4, 7], [4, 7, 4, 7]], np.int32)
SPARSE_RECTS = np.array([[0, 4, 0, 4], [3, 7, 3, 7]], np.int32)


@numba.njit(inline="always")
def difference(pixel, mean, precision):
    """Pixel minus mean in the format of the test (Alg. 1, line 1)."""
    if precision == P_FP16:
        return sub(np.float32(pixel), mean, FP16_R)
    if precision == P_FP8:
        return sub(np.float32(pixel), rnd(mean, E4M3_R), E4M3_R)
    return rnd(sub(np.float32(pixel), mean, FP16_R), E4M3_R)


@numba.njit
def threshold(opacity, form, precision):
    """log(255 o) rounded up to the format of the test."""
    return log_opacity_f32(opacity, form != CONIC, precision == P_FP16)


@numba.njit
def _rect_weights(rect, mean_x, mean_y, s0, s1, s2, form, precision, r, e):
    dx0 = difference(rect[0], mean_x, precision)
    dx1 = difference(rect[1], mean_x, precision)
    dy0 = difference(rect[2], mean_y, precision)
    dy1 = difference(rect[3], mean_y, precision)
    if precision != P_FP16:
        s0 = rnd(s0, r)
        s1 = rnd(s1, r)
        s2 = rnd(s2, r)
    if form == CONIC:
        _, sx0 = conic_axis(dx0, s0, r)
        _, sx1 = conic_axis(dx1, s0, r)
        _, sy0 = conic_axis(dy0, s2, r)
        _, sy1 = conic_axis(dy1, s2, r)
        e[0] = conic_pixel(dx0, dy0, sx0, sy0, s1, r)[3]
        e[1] = conic_pixel(dx1, dy0, sx1, sy0, s1, r)[3]
        e[2] = conic_pixel(dx0, dy1, sx0, sy1, s1, r)[3]
        e[3] = conic_pixel(dx1, dy1, sx1, sy1, s1, r)[3]
    else:
        p0 = mul(s0, dx0, r)
        p1 = mul(s0, dx1, r)
        q0, _, vv0 = factored_row(dy0, s1, s2, r)
        q1, _, vv1 = factored_row(dy1, s1, s2, r)
        e[0] = factored_pixel(p0, q0, vv0, r)[2]
        e[1] = factored_pixel(p1, q0, vv0, r)[2]
        e[2] = factored_pixel(p0, q1, vv1, r)[2]
        e[3] = factored_pixel(p1, q1, vv1, r)[2]


@numba.njit
def rect_weights(rect, mean_x, mean_y, s0, s1, s2, form, precision, e):
    """The four weights of a pixel rectangle into `e` (float32[4]); arguments are FP16 values in float32."""
    if precision == P_FP16:
        _rect_weights(rect, mean_x, mean_y, s0, s1, s2, form, precision, FP16_R, e)
    else:
        _rect_weights(rect, mean_x, mean_y, s0, s1, s2, form, precision, E4M3_R, e)


@numba.njit(inline="always")
def is_dense(mode, spiky):
    """Whether a splat takes dense sampling (two cycles) in a mode; AUTO's base mode is Smooth-Focused."""
    if mode == M_DENSE:
        return True
    if mode == M_SPARSE or mode == M_OFF:
        return False
    if mode == M_SPIKY:
        return spiky
    return not spiky


@numba.njit
def splat_mask(mean_x, mean_y, s0, s1, s2, opacity, dense, form, precision, e):
    """Four-bit mini-tile mask of a splat; `e` is scratch, float32[4]."""
    t = threshold(opacity, form, precision)
    mask = 0
    if dense:
        for m in range(4):
            rect_weights(DENSE_RECTS[m], mean_x, mean_y, s0, s1, s2, form, precision, e)
            if t > e[0] or t > e[1] or t > e[2] or t > e[3]:
                mask |= 1 << m
    else:
        for k in range(2):
            rect_weights(SPARSE_RECTS[k], mean_x, mean_y, s0, s1, s2, form, precision, e)
            for m in range(4):
                if t > e[m]:
                    mask |= 1 << m
    return mask


class RectTrace(NamedTuple):
    """What a PRTU computes for one splat and one rectangle, as float32 values of the narrow format."""

    threshold: float
    weights: np.ndarray
    passes: int


def trace_rect(rect, features: np.ndarray, form: Form, precision: Precision) -> RectTrace:
    """Model of one PRTU operation. `features` are the nine FP16 bit patterns of `feature_t`, mean_x first."""
    f = np.asarray(features, np.uint16).view(np.float16).astype(np.float32)
    e = np.zeros(4, np.float32)
    rect_weights(np.asarray(rect, np.int32), f[0], f[1], f[2], f[3], f[4], int(form), int(precision), e)
    t = threshold(f[5], int(form), int(precision))
    return RectTrace(float(t), e, int(sum(int(t > e[i]) << i for i in range(4))))
