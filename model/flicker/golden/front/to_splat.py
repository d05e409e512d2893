"""A record and a sub-tile to the splat that the rendering stage takes, in integers, with every intermediate value: what `flk_record_to_splat` does.

`record.decode_records`, `fp16_features` and `fp16_means` say the same for whole frames, in floating point. Bits that encode no number (NaN, infinity) in a
record of 32 bytes pass as they are; the front end writes none.
"""

from __future__ import annotations

from typing import NamedTuple

from ...params import SUBTILE
from .record import COLOUR_FRACTION, MEAN_EXPONENTS, MEAN_FIELD, SHAPE_BIAS, SHAPE_MANTISSA, RecordKind
from .setup import MEAN_FRACTION

MAN = 10  # of FP16
BIAS = 15
TOP = 0x7BFF  # largest finite number


class MeanSteps(NamedTuple):
    """absolute, relative: 1/128 pixel, from the picture's corner and from the sub-tile's. saturated: the magnitude has more than 24 bits, all ones then.
    zeros: above its leading one. fp16: the result."""

    absolute: int
    relative: int
    saturated: bool
    zeros: int
    fp16: int


class ToSplat(NamedTuple):
    """A splat, FP16 bits but spiky, and the steps of its mean."""

    x: MeanSteps
    y: MeanSteps
    shape: tuple[int, int, int]
    opacity: int
    red: int
    green: int
    blue: int
    spiky: bool


def mean_to_fp16(absolute: int, place: int) -> MeanSteps:
    """A mean in 1/128 pixel, relative to sub-tile number `place` of its axis, nearest FP16 number, ties to even, at most +-65504."""
    relative = absolute - (place * SUBTILE << MEAN_FRACTION)
    bits = BIAS + MEAN_FRACTION + 2  # a number of more is at least 2^17 pixels, far beyond FP16
    magnitude = abs(relative)
    saturated = magnitude >> bits != 0
    magnitude = (1 << bits) - 1 if saturated else magnitude
    zeros = bits - magnitude.bit_length()
    normal = magnitude << zeros
    keep = normal >> bits - 1 - MAN
    rest = normal & (1 << bits - 1 - MAN) - 1
    half = 1 << bits - 2 - MAN
    exponent = bits - 1 - MEAN_FRACTION + BIAS - zeros
    code = ((exponent << MAN) + (keep & (1 << MAN) - 1) + (rest > half or (rest == half and keep & 1 == 1))) if magnitude else 0
    return MeanSteps(absolute, relative, saturated, zeros, min(code, TOP) | (0x8000 if relative < 0 else 0))


def shape_to_fp16(code: int, negative: bool = False) -> int:
    """Shape number of 14 bits: exponent (bias 30) and 9 bits of mantissa. Below 2^-14 subnormal, nearest, ties to even; the sign stays with zero."""
    exponent, mantissa = code >> SHAPE_MANTISSA, code & (1 << SHAPE_MANTISSA) - 1
    lowest = SHAPE_BIAS - BIAS  # exponent code of the numbers from 2^-15 on, whose last place is FP16's smallest step
    value = 0
    if exponent > lowest:
        value = (exponent - lowest << MAN) | mantissa << MAN - SHAPE_MANTISSA
    elif exponent > 0:
        full, drop = 1 << SHAPE_MANTISSA | mantissa, lowest - exponent
        value = full >> drop
        if drop:
            rest, half = full & (1 << drop) - 1, 1 << drop - 1
            value += rest > half or (rest == half and value & 1)
    return value | (0x8000 if negative else 0)


def opacity_to_fp16(code: int) -> int:
    """code / 255: the eight bits, repeated without end behind the point. Never a tie: what follows the rounding bit is not 0."""
    if code == 0:
        return 0
    zeros = 8 - code.bit_length()
    normal = (code * 0x010101 << zeros) & 0xFFFFFF
    return ((BIAS - 1 - zeros) << MAN) + (normal >> 13 & (1 << MAN) - 1) + (normal >> 12 & 1)


def colour_to_fp16(code: int) -> int:
    """code / 512, of 10 bits: exact."""
    zeros = COLOUR_FRACTION + 1 - code.bit_length()
    return (BIAS - zeros) << MAN | (code << zeros + 1) & (1 << MAN) - 1 if code else 0


def _mean_field(field: int) -> int:
    m = field & (1 << MEAN_FIELD) - 1
    m -= m >> MEAN_FIELD - 1 << MEAN_FIELD
    return m << 2 * (field >> MEAN_FIELD & MEAN_EXPONENTS - 1)


def record_to_splat(record: int, kind: RecordKind, col: int, row: int) -> ToSplat:
    """The splat of a record (its bytes, the first lowest) in the sub-tile at column `col`, row `row`."""
    def field(low: int, bits: int) -> int:
        return record >> low & (1 << bits) - 1

    if kind is RecordKind.CONIC32:
        x, y = ((field(low, 32) ^ 1 << 31) - (1 << 31) for low in (0, 32))
        half = [field(64 + 16 * k, 16) for k in range(7)]
        return ToSplat(mean_to_fp16(x, col), mean_to_fp16(y, row), (half[0], half[1], half[2]), half[3], half[4], half[5], half[6], field(176, 1) == 1)
    means = mean_to_fp16(_mean_field(field(0, 23)), col), mean_to_fp16(_mean_field(field(23, 23)), row)
    shape = shape_to_fp16(field(46, 14)), shape_to_fp16(field(60, 14), field(74, 1) == 1), shape_to_fp16(field(75, 14))
    red, green, blue = (colour_to_fp16(field(97 + 10 * k, 10)) for k in range(3))
    return ToSplat(*means, shape, opacity_to_fp16(field(89, 8)), red, green, blue, field(127, 1) == 1)
