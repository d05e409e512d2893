"""Bit-true arithmetic on float32 carriers.

A value of a narrow format (FP16, E4M3, E5M2, ...) is held in a float32. One float32 operation followed by one rounding
gives the correctly rounded result of an addition or multiplication, because 24 >= 2 (man_bits + 1) + 2 for
man_bits <= 10. All functions are numba scalars, branch-free so that LLVM can vectorise loops over them.

`formats.py` defines the same formats on bit patterns; tests compare the two exhaustively.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from .formats import E4M3, E5M2, FP16, FloatFormat


@intrinsic
def _bits(typingctx, x):
    """float32 to its uint32 bit pattern."""
    if x != types.float32:
        return None
    return types.uint32(types.float32), lambda ctx, b, sig, args: b.bitcast(args[0], ir.IntType(32))


@intrinsic
def _float(typingctx, x):
    """uint32 bit pattern to float32."""
    if x != types.uint32:
        return None
    return types.float32(types.uint32), lambda ctx, b, sig, args: b.bitcast(args[0], ir.FloatType())


bits_of = _bits
float_of = _float


def rounding(fmt: FloatFormat) -> tuple:
    """Constants of `rnd` for a format: (drop, half - 1, keep mask, min normal bits, magic, max bits, overflow bits)."""
    drop = 23 - fmt.man_bits
    as_bits = lambda v: int(np.float32(v).view(np.uint32))  # noqa: E731
    max_bits = as_bits(fmt.max_finite)
    return (
        np.uint32(drop),
        np.uint32((1 << (drop - 1)) - 1),
        np.uint32(0xFFFFFFFF ^ ((1 << drop) - 1)),
        np.uint32(as_bits(fmt.min_normal)),
        np.float32(fmt.min_subnormal * 2.0**23),  # adding it leaves one unit in the last place = min_subnormal
        np.uint32(max_bits),
        np.uint32(max_bits if fmt.saturate else 0x7F800000),
    )


FP16_R = rounding(FP16)
E4M3_R = rounding(E4M3)
E5M2_R = rounding(E5M2)


@numba.njit(forceinline=True)
def rnd(x, r):
    """Round the float32 `x` to the format with constants `r` (nearest, ties to even, subnormals, -0 kept)."""
    drop, half, keep, min_normal, magic, max_bits, over = r
    b = _bits(x)
    a = np.uint32(b & np.uint32(0x7FFFFFFF))  # numba widens the results of integer operations: cast back
    normal = np.uint32(np.uint32(a + half + ((a >> drop) & np.uint32(1))) & keep)
    small = _bits(np.float32(np.float32(_float(a) + magic) - magic))
    m = small if a < min_normal else normal
    m = over if m > max_bits else m
    is_nan = a > np.uint32(0x7F800000)
    m = np.uint32(0x7FC00000) if is_nan else m
    s = np.uint32(0) if is_nan else np.uint32(b & np.uint32(0x80000000))
    return _float(np.uint32(s | m))


@numba.njit(forceinline=True)
def mul(a, b, r):
    """Product in the format."""
    return rnd(np.float32(a * b), r)


@numba.njit(forceinline=True)
def add(a, b, r):
    """Sum in the format."""
    return rnd(np.float32(a + b), r)


@numba.njit(forceinline=True)
def sub(a, b, r):
    """Difference in the format."""
    return rnd(np.float32(a - b), r)


@numba.njit
def fp16_value(h):
    """FP16 bit pattern (uint16) to float32."""
    h = np.uint32(h)
    s = np.uint32((h & np.uint32(0x8000)) << np.uint32(16))
    e = np.uint32((h >> np.uint32(10)) & np.uint32(0x1F))
    m = np.uint32(h & np.uint32(0x3FF))
    if e == 0:
        a = _bits(np.float32(np.float32(m) * np.float32(2.0**-24)))
    elif e == 31:
        a = np.uint32(np.uint32(0x7F800000) | (m << np.uint32(13)))
    else:
        a = np.uint32(((e + np.uint32(112)) << np.uint32(23)) | (m << np.uint32(13)))
    return _float(np.uint32(s | a))


@numba.njit
def fp16_bits(x):
    """float32 holding an FP16 value to its bit pattern (uint16)."""
    b = _bits(x)
    s = np.uint32((b >> np.uint32(16)) & np.uint32(0x8000))
    a = np.uint32(b & np.uint32(0x7FFFFFFF))
    if a > np.uint32(0x7F800000):
        return np.uint16(0x7E00)
    if a == np.uint32(0x7F800000):
        return np.uint16(s | np.uint32(0x7C00))
    if a < np.uint32(0x38800000):
        return np.uint16(s | np.uint32(_float(a) * np.float32(2.0**24)))
    return np.uint16(s | ((a >> np.uint32(13)) - np.uint32(112 << 10)))


@numba.njit
def fp16_from_f64(x):
    """Round a float64 to FP16 in one step; the result is held in a float32. Overflow gives infinity."""
    if not abs(x) < np.inf:
        return np.float32(x)
    _, e = math.frexp(x)  # 2^(e-1) <= |x| < 2^e
    ulp = math.ldexp(1.0, max(e - 11, -24))
    return rnd(np.float32(np.rint(x / ulp) * ulp), FP16_R)
