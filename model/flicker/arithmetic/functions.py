"""The two special functions of the chip, as integer table algorithms: model and RTL do the same, bit for bit.

* `exp_neg`: g = 2^-E or e^-E, FP16 to FP16 (`flk_exp_neg`).
* `log_opacity`: t = log2(255 o) or ln(255 o), FP16 to any format, never below the exact value (`flk_log_opacity`).

Each has a vectorised version on bit patterns and a numba scalar on float32 that holds values of the formats.
Numba's cache does not see a change of the tables in kernels of other modules: clear it then.
`scripts/gen_tables.py` writes the tables into `flk_table_pkg.sv`. Errors and derivation: docs/reference/arithmetic.md.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from .formats import FP16, FloatFormat


@intrinsic
def _bits_of(typingctx, x):
    """float32 to its bit pattern, int32."""
    if x != types.float32:
        return None
    return types.int32(types.float32), lambda ctx, b, sig, args: b.bitcast(args[0], ir.IntType(32))


# ---- tables ------------------------------------------------------------------------------------

EXP_FRAC_BITS = 13  # fraction bits of the fixed-point exponent x = E or E log2(e)
EXP_INDEX_BITS = 5  # of these, table index
EXP_DELTA_BITS = EXP_FRAC_BITS - EXP_INDEX_BITS  # the others, times the slope
EXP_BASE_BITS = 14  # fraction bits of a table value
EXP_VALUE_BITS = 20  # fraction bits of value minus slope times delta
EXP_LOG2E = 23637  # log2(e) in 2^-14: 23 * 2^10 + 5 * 17, five additions
EXP_LOG2E_BITS = 14

LOG_FRAC_BITS = 12  # fraction bits of the fixed-point result
LOG_INDEX_BITS = 4  # mantissa bits that index the table
LOG_DELTA_BITS = FP16.man_bits - LOG_INDEX_BITS  # the others, times the slope
LOG_SLOPE_BITS = 3  # further fraction bits of value plus slope times delta
LOG_STEP = (2839, 4096)  # one exponent, in units of the result: ln 2 (natural), 1 (base 2)
LOG_OFFSET = (-20480, -32768)  # constant part, -5 and -8


def _exp_table() -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes of 2^-f, f in [0, 1): value(i) - slope(i) delta, minimax in each segment.

    Values are one unit low on purpose: x is truncated, so 2^-x comes out high.
    """
    n = 1 << EXP_DELTA_BITS
    delta = np.arange(n)
    values, slopes = [], []
    for i in range(1 << EXP_INDEX_BITS):
        exact = np.exp2(-(i * n + delta) / 2.0**EXP_FRAC_BITS)
        middle = math.log(2) * 2.0 ** (EXP_VALUE_BITS - EXP_FRAC_BITS - (i + 0.5) / 2**EXP_INDEX_BITS)
        best = math.inf
        for slope in range(int(middle) - 2, int(middle) + 4):
            line = exact * 2.0**EXP_BASE_BITS + delta * slope * 2.0 ** (EXP_BASE_BITS - EXP_VALUE_BITS)
            value = min(round((line.max() + line.min()) / 2 - 1), 1 << EXP_BASE_BITS)
            error = max(line.max() - value, value - line.min())
            if error < best - 1e-6:  # clear of the last bits of the mathematics library
                best, choice = error, (value, slope)
        values.append(choice[0])
        slopes.append(choice[1])
    return np.array(values, np.int32), np.array(slopes, np.int32)


def _log_table(base2: bool) -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes of log(255 m) - 15 LOG_STEP - LOG_OFFSET, m in [1, 2): an upper bound in each segment.

    (value(i) + slope(i) delta) >> LOG_SLOPE_BITS, in 2^-LOG_FRAC_BITS, is nowhere less than exact.
    """
    log = math.log2 if base2 else math.log
    n = 1 << LOG_DELTA_BITS
    scale = 1 << LOG_SLOPE_BITS
    constant = 15 * LOG_STEP[base2] + LOG_OFFSET[base2]
    values, slopes = [], []
    for i in range(1 << LOG_INDEX_BITS):
        exact = [log(255 * (1 + (i * n + d) / 1024)) * 2.0**LOG_FRAC_BITS - constant for d in range(n)]
        middle = (exact[-1] - exact[0]) / (n - 1) * scale
        best = math.inf
        for slope in range(int(middle) - 2, int(middle) + 4):
            value = max(math.ceil(y) * scale - slope * d for d, y in enumerate(exact))
            error = max((value + slope * d) // scale - y for d, y in enumerate(exact))
            if error < best - 1e-6:  # clear of the last bits of the mathematics library
                best, choice = error, (value, slope)
        values.append(choice[0])
        slopes.append(choice[1])
    return np.array(values, np.int32), np.array(slopes, np.int32)


EXP_VALUES, EXP_SLOPES = _exp_table()
LOG_VALUES, LOG_SLOPES = (np.stack(pair) for pair in zip(_log_table(False), _log_table(True)))  # [base2][segment]

# ---- exp ---------------------------------------------------------------------------------------


def exp_neg(e: np.ndarray, base2: bool) -> np.ndarray:
    """2^-e (`base2`) or e^-e of FP16 bit patterns (uint16), FP16 bit patterns.

    Results below the smallest normal number are +0, and so is the result of a set sign bit, infinity or NaN.
    """
    e = np.asarray(e, np.uint16)
    exponent = (e >> FP16.man_bits) & 31
    # Subnormals get a hidden bit they don't have: they lie below the last bit of x either way.
    mantissa = (e & 1023 | 1024).astype(np.int32)
    # x = E log2(e) or E, in 2^-EXP_FRAC_BITS, as if in [8, 16), then shifted down to its place and truncated.
    if base2:
        x = mantissa << (EXP_FRAC_BITS + 3 - FP16.man_bits)
    else:
        x = (mantissa * EXP_LOG2E) >> (FP16.man_bits + EXP_LOG2E_BITS - 3 - EXP_FRAC_BITS)
    x >>= np.clip(18 - exponent.astype(np.int32), 0, 31)
    whole, fraction = x >> EXP_FRAC_BITS, x & ((1 << EXP_FRAC_BITS) - 1)
    index, delta = fraction >> EXP_DELTA_BITS, fraction & ((1 << EXP_DELTA_BITS) - 1)
    g = (EXP_VALUES[index] << (EXP_VALUE_BITS - EXP_BASE_BITS)) - EXP_SLOPES[index] * delta
    drop = EXP_VALUE_BITS - 11  # 2^-fraction lies in [1/2, 1]: last place 2^-11
    g = (g + (1 << (drop - 1))) >> drop
    bits = ((13 - whole) << FP16.man_bits) + g  # hidden bit and carry add to the exponent
    zero = (e >= FP16.sign_bit) | (exponent > 18) | (bits < 1024)
    return np.where(zero, 0, bits).astype(np.uint16)


# Results from 2^-15 (x = 0: 1) up to 16, then 0: what exp_neg_f32 looks up, by base2.
_EXP_FIRST = 112 << 10  # float32 bits of 2^-15 over the 13 bits FP16 lacks
_EXP_LOOKUP = np.stack([
    np.append(exp_neg(np.arange(19 << 10), base2).view(np.float16), np.float16(0)).astype(np.float32)
    for base2 in (False, True)
])
_EXP_LAST = _EXP_LOOKUP.shape[1] - 1


@numba.njit(forceinline=True)
def exp_neg_f32(e, base2):
    """`exp_neg` of a float32 that holds an FP16 value; the result too is an FP16 value in a float32."""
    b = _bits_of(e)
    index = min(max((b >> 13) - _EXP_FIRST, 0), _EXP_LAST)
    return _EXP_LOOKUP[int(base2), index] if b >= 0 else np.float32(0)


# ---- log ---------------------------------------------------------------------------------------


@numba.njit(forceinline=True)
def _log_core(exponent, mantissa, base2):
    """t in 2^-LOG_FRAC_BITS. `exponent` biased (FP16), `mantissa` without the hidden bit."""
    mantissa = mantissa if exponent > 0 else np.int32(0)  # a subnormal counts as 2^-14
    exponent = min(max(exponent, np.int32(1)), np.int32(15))  # 2 and more count as [1, 2)
    index = mantissa >> LOG_DELTA_BITS
    delta = mantissa & ((1 << LOG_DELTA_BITS) - 1)
    base = int(base2)
    line = (LOG_VALUES[base, index] + LOG_SLOPES[base, index] * delta) >> LOG_SLOPE_BITS
    return exponent * LOG_STEP[base] + LOG_OFFSET[base] + line


@numba.njit
def _round_up(t, man_bits, min_exponent):
    """Fixed-point t rounded toward +infinity to `man_bits`, exponent at least `min_exponent`; exact value, -0 kept."""
    magnitude = abs(t)
    top = -1
    while magnitude >> (top + 1):
        top += 1
    last = max(top, min_exponent + LOG_FRAC_BITS) - man_bits  # place of the result's last bit
    if last > 0:
        magnitude += (1 << last) - 1 if t > 0 else 0
        magnitude = (magnitude >> last) << last
    return math.copysign(magnitude * 2.0**-LOG_FRAC_BITS, float(t))


@numba.njit
def log_opacity_f32(o, base2, fp16):
    """Threshold of the opacity `o` (float32 holding an FP16 value), rounded up to FP16 (`fp16`) or E4M3, in a float32."""
    b = _bits_of(o)
    exponent = ((b >> np.int32(23)) & np.int32(255)) - np.int32(112)
    t = _log_core(exponent, (b >> np.int32(13)) & np.int32(1023), base2)
    return np.float32(_round_up(t, 10, -14) if fp16 else _round_up(t, 3, -6))


@numba.vectorize
def _log_values(h, base2, man_bits, min_exponent):
    t = _log_core(np.int32(h >> 10) & np.int32(31), np.int32(h) & np.int32(1023), base2)
    return _round_up(t, man_bits, min_exponent)


def log_opacity(o: np.ndarray, base2: bool, fmt: FloatFormat) -> np.ndarray:
    """log2(255 o) (`base2`) or ln(255 o) of FP16 bit patterns, rounded toward +infinity: bit patterns of `fmt`.

    The sign of `o` is ignored; a subnormal counts as 2^-14, 2 and more as [1, 2).
    """
    values = _log_values(np.asarray(o, np.uint16), base2, fmt.man_bits, 1 - fmt.bias)
    return fmt.encode(values)
