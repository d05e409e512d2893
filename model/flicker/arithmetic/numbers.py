"""Number systems of the exploration: any small floating-point or fixed-point format, with directed rounding.

A value is held in a float64. One float64 operation on values of a format (significand up to 13 bits, exponent up to 5 bits) is exact
or further from a tie than float64 can blur, so one operation followed by one `quantise` is the directly rounded result.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from ..errors import FlickerError
from .formats import E4M3, E5M2, FP16, FloatFormat

DOWN, NEAREST, UP = -1, 0, 1


@intrinsic
def _bits64(typingctx, x):
    """float64 to its bit pattern, int64."""
    if x != types.float64:
        return None
    return types.int64(types.float64), lambda ctx, b, sig, args: b.bitcast(args[0], ir.IntType(64))


@intrinsic
def _float64(typingctx, x):
    """int64 bit pattern to float64."""
    if x != types.int64:
        return None
    return types.float64(types.int64), lambda ctx, b, sig, args: b.bitcast(args[0], ir.DoubleType())


class Numbers(NamedTuple):
    """Constants of `quantise`: mantissa bits, smallest exponent, largest number, smallest positive number.

    Fixed point is the case in which every number is below the smallest exponent: one unit in the last place throughout.
    """

    man: int
    emin: int
    top: float
    tiny: float


def floating(fmt: FloatFormat) -> Numbers:
    """Constants of a floating-point format."""
    return Numbers(fmt.man_bits, 1 - fmt.bias, fmt.max_finite, fmt.min_subnormal)


def fixed(integer_bits: int, fraction_bits: int) -> Numbers:
    """Constants of signed fixed point: |x| < 2^integer_bits, unit 2^-fraction_bits."""
    return Numbers(integer_bits + fraction_bits, integer_bits, 2.0**integer_bits - 2.0**-fraction_bits, 2.0**-fraction_bits)


E5M3 = FloatFormat("E5M3", 5, 3, saturate=True)
E4M4 = FloatFormat("E4M4", 4, 4, fn=True, saturate=True)
E5M6 = FloatFormat("E5M6", 5, 6, saturate=True)

FORMATS: dict[str, Numbers] = {
    "fp16": floating(FP16),
    "e5m6": floating(E5M6),
    "e4m4": floating(E4M4),
    "e5m3": floating(E5M3),
    "e4m3": floating(E4M3),
    "e5m2": floating(E5M2),
    "q8.8": fixed(8, 8),
    "q8.4": fixed(8, 4),
}


def numbers(name: str) -> Numbers:
    """The number system of a name; FlickerError when there is none."""
    if name not in FORMATS:
        raise FlickerError(f"unknown number format '{name}'; known are {', '.join(FORMATS)}")
    return FORMATS[name]


@numba.njit(forceinline=True)
def quantise(x, man, emin, top, direction):
    """Round the float64 x: DOWN (toward -infinity), NEAREST (ties to even) or UP.

    Beyond `top`: NEAREST saturates; a directed rounding gives `top` on the inner and infinity on the outer side, so that it stays a bound.
    """
    e = ((_bits64(x) >> 52) & 0x7FF) - 1023
    e = max(e, emin)
    unit = _float64((e - man + 1023) << 52)
    steps = x * _float64((man - e + 1023) << 52)
    if direction == NEAREST:
        y = np.rint(steps) * unit
        return min(max(y, -top), top)
    if direction == DOWN:
        y = np.floor(steps) * unit
        return -np.inf if y < -top else min(y, top)
    y = np.ceil(steps) * unit
    return np.inf if y > top else max(y, -top)
