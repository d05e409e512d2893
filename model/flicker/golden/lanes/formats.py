"""Number formats of the lanes, and the constants and tables that follow from them (docs/reference/lanes.md).

All numbers are integers. "Unit 2^-n" means that the integer k stands for k 2^-n. Logarithms have base 2.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass, fields
from functools import cache

import numpy as np

from ...errors import FlickerError
from ...params import ALPHA_MAX

OPACITIES = 256  # codes of a record; code / 255 is the opacity
SATURATION = 5  # w and z saturate at +-2^SATURATION: what a sub-tile adds to them is below 28, so no pixel of a saturated splat comes near 4
ACCUMULATOR_INT_BITS = 2  # colours of a record are below 2, weights add up to 1
RESULT_FRACTION = 12  # of S, as the table of T takes it
LINE_GUARD = 2  # further fraction bits of the lines of h


@dataclass(frozen=True)
class LaneFormats:
    """Widths of the lanes.

    uv: fraction bits of u and v. guard: further fraction bits of what they are summed from. log: fraction bits of La = -log2 alpha. sum: fraction bits of h and
    S = -log2 T. mantissa: bits of a weight's mantissa with its leading one, and address bits of its table. accumulator: fraction bits of colours.
    With 7 bits or more of log the limit log2 255 = 7.9944 stays below 8.
    pieces: h by lines, 2^pieces of them in an octave of La; 0: h by a table with an entry for every La. mask: fraction bits of u and v in the masks.
    root: address bits of the masks' table of roots.
    """

    uv: int = 9
    guard: int = 5
    log: int = 9
    sum: int = 16
    mantissa: int = 10
    accumulator: int = 14
    pieces: int = 4
    mask: int = 6
    root: int = 6

    def __post_init__(self) -> None:
        ranges = {
            "uv": (6, 13), "guard": (5, 8), "log": (7, min(14, 2 * self.uv - 1)), "sum": (self.log, 24), "mantissa": (4, 12), "accumulator": (8, 24),
            "pieces": (0, 6), "mask": (4, self.uv), "root": (4, 10),
        }
        for field in fields(self):
            low, high = ranges[field.name]
            if not low <= (bits := getattr(self, field.name)) <= high:
                raise FlickerError(f"lanes: {field.name} must be {low} to {high}, not {bits}")
        if self.root % 2:
            raise FlickerError(f"lanes: root must be even, not {self.root}")

    @property
    def place(self) -> int:
        """Fraction bits of w, z and half slopes."""
        return self.uv + self.guard

    @property
    def name(self) -> str:
        h = f"{1 << self.pieces} lines" if self.pieces else "table"
        return f"{self.uv} / {self.log} / {self.sum}, {h}; {self.mantissa}; {self.accumulator}"


FORMATS = LaneFormats()  # the default; docs/decisions/051-logarithms.md says why

# ints: uv, guard, place, log, sum, mantissa, accumulator, limit, clamp, x_max, h_max, s_max, top, drop, root_bits, root_shift. Arrays, int64: lo, bound,
# mask_bound (by opacity code), h (by La), exp2 (by the top bits of a fraction), root (by significant bits), result (by fraction of S).
LaneTables = namedtuple(
    "LaneTables",
    "uv guard place log sum mantissa accumulator limit clamp x_max h_max s_max top drop root_bits root_shift lo bound mask_bound h exp2 root result",
)


def h_of(x: np.ndarray) -> np.ndarray:
    """h(x) = -log2(1 - 2^-x) for x > 0, float64: what a layer of alpha = 2^-x adds to S."""
    return -np.log2(-np.expm1(-np.asarray(x, np.float64) * math.log(2.0)))


def opacity_logs(bits: int) -> np.ndarray:
    """int64 (256,): -log2(code / 255), unit 2^-bits, nearest. Code 0 is one more than code 1, the limit: it never passes."""
    code = np.arange(1, OPACITIES)
    logs = np.rint(-np.log2(code / 255.0) * 2.0**bits).astype(np.int64)
    return np.concatenate([[logs[0] + 1], logs])


def h_table(formats: LaneFormats, first: int, last: int) -> np.ndarray:
    """int64 (last + 1,): h of every La from `first` on, unit 2^-sum, nearest; 0 below, where nothing reads it."""
    table = np.zeros(last + 1, np.int64)
    table[first:] = np.rint(h_of(np.arange(first, last + 1) / 2.0**formats.log) * 2.0**formats.sum)
    return table


def h_lines(formats: LaneFormats, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
    """Lines of h: value at the left end and fall over the piece, both int64 (octaves, 2^pieces), unit 2^-(sum + LINE_GUARD).

    Octave o holds 2^o <= La < 2^(o + 1); its pieces are equally long. Each line is the least-squares fit to h over the La of its piece, so that the error
    has mean 0 there.
    """
    octaves, pieces = formats.log + 3, 1 << formats.pieces
    value, fall = np.zeros((octaves, pieces), np.int64), np.zeros((octaves, pieces), np.int64)
    unit = 2.0 ** (formats.sum + LINE_GUARD)
    for o in range(octaves):
        for k in range(pieces):
            left, right = (1 << o) + (k << o) / pieces, (1 << o) + ((k + 1) << o) / pieces
            la = np.arange(max(math.ceil(left), first), min(math.ceil(right) - 1, last) + 1)
            if len(la) == 0:
                continue
            h = h_of(la / 2.0**formats.log) * unit
            slope, start = np.polyfit((la - left) / (right - left), h, 1) if len(la) > 1 else (0.0, h[0])
            value[o, k], fall[o, k] = round(start), round(-slope)
    return value, fall


def h_by_line(la: int, value: np.ndarray, fall: np.ndarray, formats: LaneFormats) -> int:
    """h of one La from the lines: La is shifted until its leading one stands at bit log + 2; below it follow the piece's number and the rest. The line is exact
    and rounded once."""
    octave, top = la.bit_length() - 1, formats.log + 2
    shifted = la << (top - octave)
    width = top - formats.pieces
    piece, rest = shifted >> width & (1 << formats.pieces) - 1, shifted & (1 << width) - 1
    line = (int(value[octave, piece]) << width) - int(fall[octave, piece]) * rest
    return max(line + (1 << width + LINE_GUARD - 1) >> width + LINE_GUARD, 0)


def root_table(bits: int, places: int) -> np.ndarray:
    """int64 (2^bits,): sqrt(m + 1), unit 2^-places, rounded up, for m = 0 to 2^bits - 1."""
    return np.array([math.isqrt(((m + 1) << 2 * places) - 1) + 1 for m in range(1 << bits)], np.int64)


@cache
def tables(formats: LaneFormats) -> LaneTables:
    """Constants and tables of the formats.

    limit: La of alpha = 1/255, the opacity code 1's own logarithm. clamp: the largest La that counts as alpha >= 0.99; x_max, h_max: -log2 0.99 and h there,
    unit 2^-sum. s_max: two layers of 0.99, which is T = 1e-4. bound: u^2 + v^2 of a pair that passes is below it, unit 2^-2uv. mask_bound: the same
    with `mask` fraction bits, rounded up.
    """
    f = formats
    lo = opacity_logs(f.log)
    limit = int(lo[1])
    clamp = math.floor(-math.log2(ALPHA_MAX) * 2.0**f.log)
    if f.pieces > f.log + 2:
        raise FlickerError(f"lanes: pieces must be at most log + 2, not {f.pieces}")
    h = h_table(f, clamp + 1, limit)
    if f.pieces:
        lines = h_lines(f, clamp + 1, limit)
        h[clamp + 1 :] = [h_by_line(la, *lines, f) for la in range(clamp + 1, limit + 1)]
    h_max = round(-math.log2(1.0 - ALPHA_MAX) * 2.0**f.sum)
    drop = 2 * f.uv - f.log
    bound = ((limit + 1 - lo) << drop) - (1 << (drop - 1))
    coarse = 2 * (f.uv - f.mask)
    mantissa = np.rint(2.0 ** (f.mantissa - (np.arange(1 << f.mantissa) + 0.5) / (1 << f.mantissa))).astype(np.int64)
    result = np.exp2(-np.arange(1 << RESULT_FRACTION) / (1 << RESULT_FRACTION)).astype(np.float16).view(np.uint16).astype(np.int64)
    # What is left of the bound has up to 2 mask + 3 bits; its root is read with as many fraction bits as the largest needs none of.
    shift = max(-(-(2 * f.mask + 3 - f.root) // 2), 0)
    return LaneTables(
        f.uv, f.guard, f.place, f.log, f.sum, f.mantissa, f.accumulator, limit, clamp, round(-math.log2(ALPHA_MAX) * 2.0**f.sum), h_max, 2 * h_max,
        (1 << (SATURATION + f.place)) - 1, f.uv - f.mask, f.root, shift, lo, bound, -(-bound >> coarse), h,
        np.minimum(mantissa, (1 << f.mantissa) - 1), root_table(f.root, shift), result,
    )
