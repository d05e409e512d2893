"""Fixed point in whole numbers: products and sums from which fraction bits are rounded off, to the nearest, ties upwards.

As numba scalars, which `flicker.datapath` also traces; numbers of the hardware never leave 63 bits.
"""

from __future__ import annotations

import numba


@numba.njit(forceinline=True)
def fixed_mul(a, b, drop):
    """a b with `drop` bits rounded off, at least 1."""
    return (a * b + (1 << (drop - 1))) >> drop


@numba.njit(forceinline=True)
def fixed_mix(a, factor_a, b, factor_b, offset, drop):
    """factor_a a + factor_b b + offset, with `drop` bits rounded off, which may be 0; factors and offset are constants."""
    return (a * factor_a + b * factor_b + offset + ((1 << drop) >> 1)) >> drop


@numba.njit(forceinline=True)
def fixed_sum(a, b, c):
    """a + b + c in one step."""
    return a + b + c


@numba.njit(forceinline=True)
def fixed_wrap(x, bits):
    """The low bits of x as a number in two's complement: x itself where it fits."""
    half = 1 << (bits - 1)
    return ((x + half) & (2 * half - 1)) - half
