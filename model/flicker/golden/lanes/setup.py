"""A record and a sub-tile to the numbers that masks and lanes share: what `flk_splat_setup` is to do.

With X, Y from the mean to the middle of the sub-tile (3.5 pixels right of and below its first pixel's centre):

    w = l0 X + l1 Y,  z = l2 Y          u(i, j) = w + (i - 3.5) l0 + (j - 3.5) l1,  v(j) = z + (j - 3.5) l2

w and z are sums of products that may cancel: X and Y are exact, products are rounded to 2^-place, their sum is exact, and only the sum saturates.
"""

from __future__ import annotations

from collections import namedtuple

import numba

from ...params import SUBTILE
from ..front.record import MEAN_FIELD, SHAPE_BIAS, SHAPE_MANTISSA, decode_mean
from ..front.setup import MEAN_FRACTION

MIDDLE = 7 << (MEAN_FRACTION - 1)  # 3.5 pixels
_MEAN_BITS = MEAN_FIELD + 3
_HIDDEN = 1 << SHAPE_MANTISSA
_SHAPE_BITS = SHAPE_MANTISSA + 5

# Fields of a record. x, y: 1/128 pixel. e0, m0: exponent code and mantissa with the leading one (0 for a zero) of l0, and so on; m1 has l1's sign.
Fields = namedtuple("Fields", "x y e0 m0 e1 m1 e2 m2 opacity red green blue")

# x, y: mean to middle, 1/128 pixel. p, q: l0 X, l1 Y. w, z: saturated. s0, s1, s2: half slopes. p to s2: unit 2^-place. opacity: code. lo: -log2 of it, unit
# 2^-log. red, green, blue: codes, 1/512.
SplatSetup = namedtuple("SplatSetup", "x y p q w z s0 s1 s2 opacity lo red green blue")


@numba.njit(forceinline=True)
def shift_round(value, right):
    """value 2^-right to the nearest integer, ties upwards."""
    return (value + (1 << (right - 1))) >> right if right > 0 else value << -right


@numba.njit(forceinline=True)
def _significand(code):
    return _HIDDEN | (code & (_HIDDEN - 1)) if code >> SHAPE_MANTISSA else 0


@numba.njit
def fields_of(low, high):
    """Fields of a record, given as two int64: its bits 63:0 and 127:64. Every bit pattern is a record; none holds an infinity or a NaN."""
    l0 = (low >> 46) & ((1 << _SHAPE_BITS) - 1)
    l1 = ((low >> 60) & 15) | (high & 0x3FF) << 4
    l2 = (high >> 11) & ((1 << _SHAPE_BITS) - 1)
    m1 = _significand(l1)
    return Fields(
        decode_mean(low & ((1 << _MEAN_BITS) - 1)), decode_mean((low >> _MEAN_BITS) & ((1 << _MEAN_BITS) - 1)),
        l0 >> SHAPE_MANTISSA, _significand(l0), l1 >> SHAPE_MANTISSA, -m1 if (high >> 10) & 1 else m1, l2 >> SHAPE_MANTISSA, _significand(l2),
        (high >> 25) & 0xFF, (high >> 33) & 0x3FF, (high >> 43) & 0x3FF, (high >> 53) & 0x3FF,
    )


@numba.njit(forceinline=True)
def wide_product(mantissa, exponent, distance, place):
    """l times a distance in 1/128 pixel, unit 2^-place, nearest: at most 45 bits and a sign before the shift."""
    return shift_round(mantissa * distance, SHAPE_BIAS + SHAPE_MANTISSA + MEAN_FRACTION - place - exponent)


@numba.njit(forceinline=True)
def half_slope(mantissa, exponent, place):
    """l / 2, unit 2^-place, nearest."""
    return shift_round(mantissa, SHAPE_BIAS + SHAPE_MANTISSA + 1 - place - exponent)


@numba.njit
def splat_setup(low, high, col, row, t):
    """Setup of a record in the sub-tile at column `col`, row `row`. t: LaneTables."""
    f = fields_of(low, high)
    x = (col * SUBTILE << MEAN_FRACTION) + MIDDLE - f.x
    y = (row * SUBTILE << MEAN_FRACTION) + MIDDLE - f.y
    p = wide_product(f.m0, f.e0, x, t.place)
    q = wide_product(f.m1, f.e1, y, t.place)
    z = wide_product(f.m2, f.e2, y, t.place)
    return SplatSetup(
        x, y, p, q, min(max(p + q, -t.top - 1), t.top), min(max(z, -t.top - 1), t.top),
        half_slope(f.m0, f.e0, t.place), half_slope(f.m1, f.e1, t.place), half_slope(f.m2, f.e2, t.place),
        f.opacity, t.lo[f.opacity], f.red, f.green, f.blue,
    )


@numba.njit(forceinline=True)
def column_step(s, i):
    """(i - 3.5) l0, unit 2^-place."""
    return (2 * i - 7) * s.s0


@numba.njit(forceinline=True)
def row_u(s, j, t):
    """w + (j - 3.5) l1 and half a unit 2^-uv, unit 2^-place."""
    return s.w + (2 * j - 7) * s.s1 + (1 << (t.guard - 1))


@numba.njit(forceinline=True)
def row_v(s, j, t):
    """z + (j - 3.5) l2 and half a unit 2^-uv, unit 2^-place."""
    return s.z + (2 * j - 7) * s.s2 + (1 << (t.guard - 1))


@numba.njit(forceinline=True)
def u_of(s, i, j, t):
    """u at column i, row j of the sub-tile, unit 2^-uv: exact sum, rounded once, ties upwards."""
    return (row_u(s, j, t) + column_step(s, i)) >> t.guard


@numba.njit(forceinline=True)
def v_of(s, j, t):
    """v in row j, unit 2^-uv."""
    return row_v(s, j, t) >> t.guard
