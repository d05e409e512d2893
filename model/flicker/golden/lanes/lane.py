"""A lane: one pixel-Gaussian pair in the log domain, and the result of a pixel.

    La = u^2 + v^2 - log2 o     -log2 alpha                La > log2 255: skipped
    La <= -log2 0.99: clamped, La and h are constants      h = -log2(1 - 2^-La)
    S + h > -log2 1e-4: not blended, the pixel is finished
    weight = 2^-(La + S), C += weight colour, S += h       S = -log2 T
"""

from __future__ import annotations

from collections import namedtuple

import numba

from ...arithmetic.fp import fp16_bits, fp16_from_f64
from ..front.colour import COLOUR_FRACTION
from .formats import ACCUMULATOR_INT_BITS, RESULT_FRACTION
from .setup import shift_round

# What becomes of a pair.
SKIPPED, BLENDED, FINISHED = 0, 1, 2

# outcome: of the pair. clamped: alpha is 0.99. x: La, or the constant; h; s_next: S + h; unit 2^-sum. exponent, mantissa: of the weight, mantissa
# 2^-(exponent + mantissa bits).
Pair = namedtuple("Pair", "outcome clamped x h s_next exponent mantissa")


@numba.njit(forceinline=True)
def log_alpha(u, v, lo, t):
    """La, unit 2^-log: the exact sum, rounded once, ties upwards. u, v: unit 2^-uv, |u|, |v| < 4. lo: -log2 o."""
    drop = 2 * t.uv - t.log
    return (u * u + v * v + (lo << drop) + (1 << (drop - 1))) >> drop


@numba.njit(forceinline=True)
def weight_of(x, total, t):
    """(exponent, mantissa) of 2^-(x + total), unit 2^-sum: the table has the value in the middle of its step."""
    sum_ = x + total
    fraction = sum_ & ((1 << t.sum) - 1)
    address = fraction >> (t.sum - t.mantissa) if t.sum >= t.mantissa else fraction << (t.mantissa - t.sum)
    return sum_ >> t.sum, t.exp2[address]


@numba.njit
def pair(la, total, t):
    """A pair. la: of `log_alpha`. total: S, unit 2^-sum."""
    if la > t.limit:
        return Pair(SKIPPED, False, 0, 0, total, 0, 0)
    clamped = la <= t.clamp
    x = t.x_max if clamped else la << (t.sum - t.log)
    h = t.h_max if clamped else t.h[la]
    exponent, mantissa = weight_of(x, total, t)
    return Pair(BLENDED if total + h <= t.s_max else FINISHED, clamped, x, h, total + h, exponent, mantissa)


@numba.njit(forceinline=True)
def blend(c, exponent, mantissa, colour, t):
    """(weight colour, C + weight colour), unit 2^-accumulator; the product is rounded once, the sum saturates. colour: code, 1/512."""
    m = shift_round(mantissa * colour, exponent + t.mantissa + COLOUR_FRACTION - t.accumulator)
    return m, min(c + m, (1 << (ACCUMULATOR_INT_BITS + t.accumulator)) - 1)


@numba.njit
def transmittance_bits(total, t):
    """FP16 bits of T = 2^-S. S is rounded to RESULT_FRACTION bits; S = 0 gives exactly 1, and T stays a normal number."""
    address = shift_round(total, t.sum - RESULT_FRACTION)
    return t.result[address & ((1 << RESULT_FRACTION) - 1)] - ((address >> RESULT_FRACTION) << 10)


@numba.njit
def colour_bits(c, t):
    """FP16 bits of a colour, nearest, ties to even."""
    return fp16_bits(fp16_from_f64(c / 2.0**t.accumulator))
