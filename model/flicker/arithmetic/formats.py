"""Small binary floating-point formats and their arithmetic, bit for bit (docs/reference/number_formats.md).

Numbers travel as bit patterns in unsigned arrays. Every operation is one float64 operation and one rounding.
That is exact rounding for every format accepted here (exponent up to 5, mantissa up to 10 bits): a product has at
most 22 significant bits; a sum is a multiple of 2^-24 below 2^17, so 41 bits; float64 has 53 and a wider exponent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import FlickerError


@dataclass(frozen=True)
class FloatFormat:
    """Sign, `exp_bits` of exponent, `man_bits` of mantissa, subnormals, round to nearest even.

    `fn`: no infinity, all ones is the only NaN (so it must saturate). `saturate`: an infinite result becomes the largest
    finite number of its sign; an IEEE-like format that saturates still decodes infinities.
    """

    name: str
    exp_bits: int
    man_bits: int
    fn: bool = False
    saturate: bool = False

    def __post_init__(self) -> None:
        if not 2 <= self.exp_bits <= 5:
            raise FlickerError(f"format {self.name}: exp_bits must be 2 to 5, not {self.exp_bits}")
        if not 1 <= self.man_bits <= 10:
            raise FlickerError(f"format {self.name}: man_bits must be 1 to 10, not {self.man_bits}")
        if self.fn and not self.saturate:
            raise FlickerError(f"format {self.name}: fn has no infinity, so saturate must be set")

    @property
    def bias(self) -> int:
        """Exponent bias."""
        return (1 << (self.exp_bits - 1)) - 1

    @property
    def width(self) -> int:
        """Bits of a number."""
        return 1 + self.exp_bits + self.man_bits

    @property
    def dtype(self) -> type[np.unsignedinteger]:
        """Array type of bit patterns."""
        return np.uint8 if self.width <= 8 else np.uint16

    @property
    def sign_bit(self) -> int:
        """Bit pattern of -0."""
        return 1 << (self.width - 1)

    @property
    def inf_bits(self) -> int:
        """Bit pattern of infinity; not valid for an `fn` format."""
        return self.sign_bit - (1 << self.man_bits)

    @property
    def nan_bits(self) -> int:
        """The canonical NaN."""
        return self.sign_bit - 1 if self.fn else self.inf_bits + (1 << (self.man_bits - 1))

    @property
    def max_bits(self) -> int:
        """Bit pattern of the largest finite number."""
        return self.nan_bits - 1 if self.fn else self.inf_bits - 1

    @property
    def max_finite(self) -> float:
        """Largest finite number."""
        return float(_values(self)[self.max_bits])

    @property
    def min_normal(self) -> float:
        """Smallest positive normal number."""
        return 2.0 ** (1 - self.bias)

    @property
    def min_subnormal(self) -> float:
        """Smallest positive number."""
        return 2.0 ** (1 - self.bias - self.man_bits)

    def decode(self, bits: np.ndarray) -> np.ndarray:
        """Bit patterns to float64."""
        return _values(self)[bits]

    def encode(self, x: np.ndarray, round_up: bool = False) -> np.ndarray:
        """Round float64 to the format: bit patterns. `round_up`: toward +infinity instead of to nearest even."""
        x = np.asarray(x, np.float64)
        negative = np.signbit(x)
        finite = np.isfinite(x)
        a = np.where(finite, np.abs(x), 0.0)
        emin = 1 - self.bias
        exponent = np.where(a == 0, emin, np.maximum(np.frexp(a)[1] - 1, emin))
        steps = np.ldexp(a, self.man_bits - exponent)  # in units of the last place
        if round_up:
            steps = np.where(negative, np.floor(steps), np.ceil(steps))
        else:
            steps = np.rint(steps)
        # A normal number brings its hidden bit, a rounding carry the next exponent: both by this sum.
        bits = ((exponent - emin).astype(np.int64) << self.man_bits) + steps.astype(np.int64)
        infinite = self.max_bits if self.saturate else self.inf_bits
        to_zero = self.max_bits if round_up else infinite  # a negative overflow rounded up stays finite
        bits = np.where(bits > self.max_bits, np.where(negative, to_zero, infinite), bits)
        bits = np.where(finite, bits, infinite) + negative * self.sign_bit
        return np.where(np.isnan(x), self.nan_bits, bits).astype(self.dtype)

    def round(self, x: np.ndarray) -> np.ndarray:
        """Round float64 values to the format; the result is float64."""
        return self.decode(self.encode(x))


@cache
def _values(fmt: FloatFormat) -> np.ndarray:
    """Value of every bit pattern, float64."""
    bits = np.arange(1 << fmt.width)
    exponent = (bits >> fmt.man_bits) & ((1 << fmt.exp_bits) - 1)
    mantissa = bits & ((1 << fmt.man_bits) - 1)
    hidden = np.where(exponent > 0, 1 << fmt.man_bits, 0)
    x = np.ldexp((mantissa + hidden).astype(np.float64), np.maximum(exponent, 1) - fmt.bias - fmt.man_bits)
    low = bits & (fmt.sign_bit - 1)
    if fmt.fn:
        x[low == fmt.nan_bits] = np.nan
    else:
        x[low == fmt.inf_bits] = np.inf
        x[low > fmt.inf_bits] = np.nan
    x = np.where(bits & fmt.sign_bit, -x, x)
    x.flags.writeable = False
    return x


FP16 = FloatFormat("FP16", 5, 10)
E4M3 = FloatFormat("E4M3", 4, 3, fn=True, saturate=True)
E5M2 = FloatFormat("E5M2", 5, 2, saturate=True)


def fp_add(fmt: FloatFormat, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sum of bit patterns. A difference is the sum with the sign bit of `b` flipped."""
    with np.errstate(invalid="ignore"):
        return fmt.encode(fmt.decode(a) + fmt.decode(b))


def fp_mul(fmt: FloatFormat, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of bit patterns."""
    with np.errstate(invalid="ignore"):
        return fmt.encode(fmt.decode(a) * fmt.decode(b))


def fp_convert(src: FloatFormat, dst: FloatFormat, a: np.ndarray, round_up: bool = False) -> np.ndarray:
    """Bit patterns of `src` to `dst`, to nearest even or toward +infinity."""
    return dst.encode(src.decode(a), round_up)


def fp_lt(fmt: FloatFormat, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a < b of bit patterns; False with a NaN, -0 equals +0."""
    with np.errstate(invalid="ignore"):
        return fmt.decode(a) < fmt.decode(b)
