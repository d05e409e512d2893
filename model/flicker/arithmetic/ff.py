"""ff: the floating-point numbers of the preprocessing core, bit for bit (docs/reference/ff.md).

Sign, 8-bit exponent (bias 127), M mantissa bits. Round to nearest, ties to even. No subnormal numbers: a rounded result below 2^-126 is zero.
No infinity and no NaN: what is too large becomes the largest number of its sign. There is one zero, +0. Exponent code 255 is not used.

A value is held in a float64 and M is an argument of every function, 10 to 23. One float64 operation followed by `ff_round` is correctly
rounded, because 53 >= 2 (M + 1) + 2. All functions are numba scalars; the hot ones are inlined and branch-free.
Reciprocal, square roots and power of two are the integer algorithms of the hardware (`ff_tables`). `FF_MAX_ULP` states their errors.

Numba's cache does not see a change of the tables in kernels of other modules: clear it then.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from . import ff_tables as tables
from .numbers import _bits64, _float64

MIN_NORMAL = 2.0**-126
# Largest error of recip, rsqrt, sqrt, exp2 in units in the last place of the exact result, for every M; measured by tb/common/test_ff.py.
FF_MAX_ULP = (0.70, 0.71, 0.66, 0.61)

_MIN64 = (1023 - 126) << 52  # float64 bits of MIN_NORMAL
_MAGNITUDE = 0x7FFFFFFFFFFFFFFF
_SIGN = -0x8000000000000000


def ff_max(man_bits: int) -> float:
    """The largest number."""
    return (2.0 - 2.0**-man_bits) * 2.0**127


@numba.njit(forceinline=True)
def ff_round(x, M):
    """Round the float64 x (finite or infinite) to M mantissa bits."""
    b = _bits64(x)
    drop = 52 - M
    a = b & _MAGNITUDE
    a = (a + ((1 << (drop - 1)) - 1) + ((a >> drop) & 1)) & -(1 << drop)
    a = min(a, ((1023 + 128) << 52) - (1 << drop))
    return _float64(a | (b & _SIGN)) if a >= _MIN64 else 0.0


@numba.njit(forceinline=True)
def ff_add(a, b, M):
    """a + b."""
    return ff_round(a + b, M)


@numba.njit(forceinline=True)
def ff_sub(a, b, M):
    """a - b."""
    return ff_round(a - b, M)


@numba.njit(forceinline=True)
def ff_mul(a, b, M):
    """a b."""
    return ff_round(a * b, M)


@numba.njit(forceinline=True)
def ff_neg(a):
    """-a; the zero stays +0."""
    return 0.0 - a


@numba.njit(forceinline=True)
def ff_lt(a, b):
    """a < b."""
    return a < b


@numba.njit(forceinline=True)
def pick(condition, a, b):
    """a where the condition holds, else b: a choice that hardware makes with a multiplexer."""
    return a if condition else b


@numba.njit(forceinline=True)
def ff_ldexp(x, shift, M):
    """x 2^shift."""
    return ff_round(math.ldexp(x, shift), M)


# ---- conversions -------------------------------------------------------------------------------


@numba.njit(forceinline=True)
def ff_bits(x, M):
    """Bit pattern of the ff number x, uint32: sign, 8 bits of exponent, M of mantissa."""
    b = _bits64(x)
    code = ((b & _MAGNITUDE) >> (52 - M)) - ((1023 - 127) << M)
    sign = (b >> 63) & 1
    return np.uint32((sign << (8 + M)) | code) if x != 0.0 else np.uint32(0)


@numba.njit(forceinline=True)
def ff_value(bits, M):
    """The number of a bit pattern; a code with exponent 0 is zero, one with exponent 255 counts as the largest number."""
    b = np.int64(bits)
    code = min(b & ((1 << (8 + M)) - 1), (255 << M) - 1)
    magnitude = (code << (52 - M)) + ((1023 - 127) << 52)
    return _float64(magnitude | (((b >> (8 + M)) & 1) << 63)) if code >= 1 << M else 0.0


@numba.njit(forceinline=True)
def ff_from_fixed(i, frac_bits, M):
    """The integer i (|i| < 2^53) times 2^-frac_bits, rounded; exact where |i| <= 2^(M + 1)."""
    return ff_round(np.float64(i) * _float64((1023 - frac_bits) << 52), M)


@numba.njit(forceinline=True)
def ff_from_int(i, M):
    """The integer i (|i| < 2^53), rounded; exact where |i| <= 2^(M + 1)."""
    return ff_round(np.float64(i), M)


@numba.njit(forceinline=True)
def _saturated(y, bits):
    """The integral float64 y as an integer of `bits` bits in two's complement (at most 48), saturated."""
    top = np.float64(1 << (bits - 1))
    return np.int64(min(max(y, -top), top - 1.0))


@numba.njit(forceinline=True)
def ff_to_fixed_floor(x, frac_bits, bits):
    """floor(x 2^frac_bits), saturated to `bits` bits in two's complement (at most 48); int64."""
    return _saturated(np.floor(x * _float64((1023 + frac_bits) << 52)), bits)


@numba.njit(forceinline=True)
def ff_to_fixed_round(x, frac_bits, bits):
    """floor(x 2^frac_bits + 1/2): to nearest, ties upwards; saturated to `bits` bits in two's complement (at most 48); int64."""
    return _saturated(np.floor(x * _float64((1023 + frac_bits) << 52) + 0.5), bits)


# ---- functions by table ------------------------------------------------------------------------

_F, _G = len(tables.NAMES), len(tables.GROUPS)
_ALL = [[tables.table(function, group) for group in tables.GROUPS] for function in range(_F)]
_FIELDS = ("index_bits", "arg_bits", "frac_bits", "drop", "square_drop", "c1_drop", "c2_drop")
_PLACES = np.array([[[getattr(t, field) for field in _FIELDS] for t in row] for row in _ALL], np.int64)
_STARTS = np.cumsum([0] + [t.c0.size for row in _ALL for t in row])[:-1].reshape(_F, _G)
# c0, c1, c2 of every segment of every table.
_COEFFICIENTS = np.concatenate([np.stack([t.c0, t.c1, t.c2], 1) for row in _ALL for t in row])
_SIGNS = np.where(tables.NEGATIVE, -1, 1)


@numba.njit(forceinline=True)
def _evaluate(function, group, odd, arg, result_bits):
    """The function at `arg` (arg_bits bits of mantissa), rounded to `result_bits` fraction bits."""
    place = _PLACES[function, group]
    delta = place[1] - place[0]
    dc = (arg & ((1 << delta) - 1)) - (1 << (delta - 1))
    row = _STARTS[function, group] + ((odd << place[0]) | (arg >> delta))
    s = (dc ^ (dc >> 63)) >> place[3]
    q = (s * (s + 1)) >> place[4]
    v = _COEFFICIENTS[row, 0] + _SIGNS[function, 0] * ((_COEFFICIENTS[row, 1] * dc) >> place[5])
    v += _SIGNS[function, 1] * ((_COEFFICIENTS[row, 2] * q) >> place[6])
    shift = place[2] - result_bits
    return (v + (1 << (shift - 1))) >> shift


@numba.njit(forceinline=True)
def _mantissa(b, group):
    """First bits of the mantissa of float64 bits, as many as the group's tables have."""
    return (b >> (41 - 4 * group)) & ((1 << (11 + 4 * group)) - 1)


@numba.njit(forceinline=True)
def _group(M):
    """The first of GROUPS with M bits or more."""
    return max((M - 8) >> 2, 0)


@numba.njit(forceinline=True)
def ff_recip(x, M):
    """1 / x; the largest number for 0; 0 where the result is below 2^-126."""
    b = _bits64(x)
    e = ((b >> 52) & 0x7FF) - 1023
    group = _group(M)
    v = _evaluate(tables.RECIP, group, 0, _mantissa(b, group), M + 1)  # 2^M to 2^(M + 1)
    a = ((1023 - 2 - e) << 52) + (v << (52 - M))  # the leading bit of v adds to the exponent
    y = _float64(a | (b & _SIGN)) if a >= _MIN64 else 0.0
    return y if x != 0.0 else _float64(((1023 + 128) << 52) - (1 << (52 - M)))


@numba.njit(forceinline=True)
def ff_rsqrt(x, M):
    """1 / sqrt(x); the largest number for 0; 0 for negative x."""
    b = _bits64(x)
    e = ((b >> 52) & 0x7FF) - 1023
    group = _group(M)
    v = _evaluate(tables.RSQRT, group, e & 1, _mantissa(b, group), M + 1)  # 2^M to 2^(M + 1)
    y = _float64(((1023 - 2 - (e >> 1)) << 52) + (v << (52 - M)))
    y = y if x > 0.0 else 0.0
    return y if x != 0.0 else _float64(((1023 + 128) << 52) - (1 << (52 - M)))


@numba.njit(forceinline=True)
def ff_sqrt(x, M):
    """sqrt(x); 0 for negative x."""
    b = _bits64(x)
    e = ((b >> 52) & 0x7FF) - 1023
    group = _group(M)
    v = _evaluate(tables.SQRT, group, e & 1, _mantissa(b, group), M)  # 2^M to 2^(M + 1)
    return _float64(((1023 - 1 + (e >> 1)) << 52) + (v << (52 - M))) if x > 0.0 else 0.0


@numba.njit(forceinline=True)
def ff_exp2_fixed(L, frac_bits, M):
    """2^(L 2^-frac_bits) of the integer L, |L| < 2^30, frac_bits at most 14; saturates, 0 where the result is below 2^-126."""
    whole = L >> frac_bits
    fraction = (L & ((1 << frac_bits) - 1)) << (tables.EXP2_ARG_BITS - frac_bits)
    v = _evaluate(tables.EXP2, _group(M), 0, fraction, M)  # 2^M to 2^(M + 1)
    top = ((1023 + 128) << 52) - (1 << (52 - M))
    whole = min(max(whole, -200), 200)
    a = min(((1023 - 1 + whole) << 52) + (v << (52 - M)), top)
    return _float64(a) if a >= _MIN64 else 0.0
