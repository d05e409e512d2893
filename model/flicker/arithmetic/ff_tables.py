"""Tables of reciprocal, square roots and power of two of ff numbers: piecewise quadratic, in integers (docs/reference/ff.md).

A function of the mantissa m in [0, 1) is cut into segments of equal width. With `dc` the distance from a segment's middle, in 2^-arg_bits:

    s = |dc + 1/2| >> drop                            (unsigned, `square_bits` bits)
    q = s (s + 1) >> square_drop
    value = c0 +- (c1 dc >> c1_drop) +- (c2 q >> c2_drop)    in 2^-frac_bits, floors

`c1` and `c2` are magnitudes; the signs are the function's. Tables are made for four lengths of the mantissa (`GROUPS`); a format
takes the shortest that holds it. `scripts/gen_tables.py` writes them into `flk_ff_table_pkg.sv`.

Only additions, multiplications, divisions and square roots of float64 are used, so that the tables are the same everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

RECIP, RSQRT, SQRT, EXP2 = range(4)
NAMES = ("recip", "rsqrt", "sqrt", "exp2")
GROUPS = (11, 15, 19, 23)  # mantissa bits that the tables are made for
MIN_MAN_BITS, MAX_MAN_BITS = 10, 23
EXP2_ARG_BITS = 14  # most fraction bits of the argument of exp2

# Bits of the mantissa that choose a segment, by function and group; the square roots have as many segments for either parity of the exponent.
INDEX_BITS = ((6, 7, 7, 8), (5, 6, 7, 7), (4, 5, 6, 7), (5, 6, 6, 7))
# Of the slopes and the curvatures: is it subtracted?
NEGATIVE = ((True, False), (True, False), (False, True), (False, False))
# Fraction bits of the result before rounding, beside those of the mantissa: results below 1 have one more.
GUARD_BITS = (5, 5, 4, 4)
# Curvatures are at most 1, 3/8, 1/8, 1/2: so many bits less are needed of the square.
SMALLER_SQUARE = (0, 1, 3, 1)


def _recip(m: np.ndarray, odd: bool) -> np.ndarray:
    return 1 / (1 + m)


def _rsqrt(m: np.ndarray, odd: bool) -> np.ndarray:
    return 1 / np.sqrt((1 + m) * (2 if odd else 1))


def _sqrt(m: np.ndarray, odd: bool) -> np.ndarray:
    return np.sqrt((1 + m) * (2 if odd else 1))


def _exp2(m: np.ndarray, odd: bool) -> np.ndarray:
    """Product of repeated square roots of 2, one for each bit of m."""
    x, root = np.ones_like(m), 2.0
    rest = np.array(m)
    for _ in range(40):
        root = float(np.sqrt(root))
        rest = rest * 2
        bit = rest >= 1
        x = np.where(bit, x * root, x)
        rest = rest - bit
    return x


_FUNCTIONS: tuple[Callable[[np.ndarray, bool], np.ndarray], ...] = (_recip, _rsqrt, _sqrt, _exp2)


@dataclass(frozen=True)
class Table:
    """Coefficients (segments, ) and the places of their bits; see the head of this module."""

    function: int
    group: int
    index_bits: int  # of the mantissa
    arg_bits: int
    frac_bits: int
    square_bits: int
    drop: int
    square_drop: int
    c1_drop: int
    c2_drop: int
    c0: np.ndarray
    c1: np.ndarray
    c2: np.ndarray

    @property
    def delta_bits(self) -> int:
        """Bits of dc, two's complement."""
        return self.arg_bits - self.index_bits

    def value(self, segment: np.ndarray, dc: np.ndarray) -> np.ndarray:
        """The function in 2^-frac_bits, before the rounding; int64."""
        s = (dc ^ (dc >> 63)) >> self.drop
        q = (s * (s + 1)) >> self.square_drop
        one, two = ((-1 if negative else 1) for negative in NEGATIVE[self.function])
        return self.c0[segment] + one * ((self.c1[segment] * dc) >> self.c1_drop) + two * ((self.c2[segment] * q) >> self.c2_drop)


@cache
def table(function: int, group: int) -> Table:
    """The table of RECIP, RSQRT, SQRT or EXP2 for `group` mantissa bits, one of GROUPS."""
    f = _FUNCTIONS[function]
    k = INDEX_BITS[function][GROUPS.index(group)]
    arg = EXP2_ARG_BITS if function == EXP2 else group
    frac = group + GUARD_BITS[function]
    delta = arg - k
    wanted = frac - 2 * k - SMALLER_SQUARE[function]
    square = min(delta - 1, wanted - 2)
    drop = delta - 1 - square
    square_drop = max(2 * square - wanted, 0)
    c1_frac, c2_frac = frac - k, frac - 2 * k - 2
    width = 2.0**-k
    dc = np.unique(np.linspace(-(1 << (delta - 1)), (1 << (delta - 1)) - 1, 129).astype(np.int64))
    parts: list[list[np.ndarray]] = [[], [], []]
    for odd in (False, True) if function in (RSQRT, SQRT) else (False,):
        middle = (np.arange(1 << k) + 0.5) * width
        node = float(np.sqrt(3.0)) / 4 * width  # zeros of the third Chebyshev polynomial: +-node and 0
        low, mid, high = (f(middle + at, odd) for at in (-node, 0.0, node))
        a2 = (high + low - 2 * mid) / (2 * node * node)
        a1 = (high - low) / (2 * node) - a2 * 2.0**-arg  # the square is that of dc + 1/2
        c1, c2 = (np.rint(np.abs(a) * 2.0**bits).astype(np.int64) for a, bits in ((a1, c1_frac), (a2, c2_frac)))
        part = Table(
            function, group, k, arg, frac, square, drop, square_drop, c1_frac + arg - frac,
            c2_frac + 2 * (arg - drop) - square_drop - frac, np.zeros(1 << k, np.int64), c1, c2,
        )
        segment = np.arange(1 << k)[:, None]
        error = f(middle[:, None] + dc * 2.0**-arg, odd) * 2.0**frac - part.value(segment, dc[None, :])
        c0 = np.rint((error.max(1) + error.min(1)) / 2).astype(np.int64)
        for whole, piece in zip(parts, (c0, c1, c2)):
            whole.append(piece)
    c0, c1, c2 = (np.concatenate(pieces) for pieces in parts)
    return Table(
        function, group, k, arg, frac, square, drop, square_drop, part.c1_drop, part.c2_drop, c0, c1, c2,
    )
