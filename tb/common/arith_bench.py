"""Bench of the arithmetic units: the compiled harness, operands, a reference rounding, the comparison.

Bit patterns travel in uint16 arrays whatever the format.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flicker.arithmetic.formats import E4M3, E5M2, FP16, FloatFormat
from flicker.toolchain import verilate

HERE = Path(__file__).parent

# The formats of the chip, then shapes that it does not use: IEEE-like 8-bit formats, one with a mantissa as long as
# its exponent, one with a short exponent, one with a mantissa far longer than its exponent, the smallest.
E5M3 = FloatFormat("E5M3", 5, 3)
E4M4 = FloatFormat("E4M4", 4, 4)
E3M4 = FloatFormat("E3M4", 3, 4)
E2M8 = FloatFormat("E2M8", 2, 8)
E2M1 = FloatFormat("E2M1", 2, 1)
FORMATS = (FP16, E4M3, E5M2, E5M3, E4M4, E3M4, E2M8, E2M1)
LOG_FORMATS = tuple(fmt for fmt in FORMATS if fmt.exp_bits >= 4)
BLOCK = 1 << 19  # operands at a time: what fits the caches of the model's array operations


class Harness:
    """All units in all `FORMATS`, evaluated in batches."""

    def __init__(self) -> None:
        table = 0
        for fmt in reversed(FORMATS):
            table = table << 10 | fmt.exp_bits << 6 | fmt.man_bits << 2 | fmt.fn << 1 | fmt.saturate
        path = verilate(
            "arith_harness",
            extra=[HERE / "arith_harness.sv"],
            # One piece of C++ compiles in a third of the time.
            args=[f"-GFormats={len(FORMATS)}", f"-GTable={10 * len(FORMATS)}'h{table:x}", "--output-split", "0"],
            cpp=[HERE / "arith_harness.cpp"],
            shared=True,
            name="arith",
        )
        self._lib = ctypes.CDLL(str(path))
        self._lib.arith_reset()

    def pairs(self, fmt: FloatFormat, a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
        """Sum, sum by the adder for operands of one sign (`Cancel` 0), product and less-than of operands (n,)."""
        out = {name: np.zeros(a.size, np.uint16) for name in ("add", "like", "mul", "cmp")}
        self._call("arith_pairs", FORMATS.index(fmt), a, b, *out.values())
        return out

    def convert(self, fmt: FloatFormat, a: np.ndarray) -> np.ndarray:
        """Operands (n,) in every format: (n, formats)."""
        out = np.zeros((a.size, len(FORMATS)), np.uint16)
        self._call("arith_convert", FORMATS.index(fmt), a, out)
        return out

    def functions(self, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """exp_neg (n, bases) and log_opacity (n, bases, formats; 0 where there is no unit) of FP16 operands (n,)."""
        exp = np.zeros((a.size, 2), np.uint16)
        log = np.zeros((a.size, 2, len(FORMATS)), np.uint16)
        self._call("arith_functions", None, a, exp, log)
        return exp, log

    def _call(self, name: str, index: int | None, *arrays: np.ndarray) -> None:
        if any(x.dtype != np.uint16 or not x.flags.c_contiguous for x in arrays):
            raise ValueError("bit patterns must be contiguous uint16 arrays")
        head = [] if index is None else [ctypes.c_int(index)]
        count = ctypes.c_int64(arrays[0].size)
        getattr(self._lib, name)(*head, count, *(ctypes.c_void_p(x.ctypes.data) for x in arrays))


# ---- operands ----------------------------------------------------------------------------------


def all_bits(fmt: FloatFormat) -> np.ndarray:
    """Every bit pattern."""
    return np.arange(1 << fmt.width, dtype=np.uint32).astype(np.uint16)


def cross(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of two sets."""
    return np.repeat(a, b.size), np.tile(b, a.size)


def specials() -> np.ndarray:
    """FP16: both signs of zeros, ends of the subnormal and normal range, 1 and neighbours, infinity, NaNs."""
    low = [0x0000, 0x0001, 0x0002, 0x01FF, 0x0200, 0x03FE, 0x03FF]
    normal = [0x0400, 0x0401, 0x07FF, 0x0800, 0x3800, 0x3BFF, 0x3C00, 0x3C01, 0x4000, 0x77FF, 0x7800, 0x7BFE, 0x7BFF]
    high = [0x7C00, 0x7C01, 0x7DFF, 0x7E00, 0x7FFF]
    positive = np.array(low + normal + high, np.uint16)
    return np.concatenate([positive, positive | np.uint16(0x8000)])


def sparse() -> np.ndarray:
    """FP16: mantissas of one bit, or its neighbours, in every exponent; what makes halfway cases and carries."""
    mantissas = sorted({m & 0x3FF for k in range(10) for m in ((1 << k) - 1, 1 << k, (1 << k) + 1, -(1 << k))})
    exponents = np.arange(32, dtype=np.uint16) << np.uint16(10)
    return (exponents[:, None] | np.array(mantissas, np.uint16)).ravel()


def fp16_pairs(rng: np.random.Generator, random_pairs: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """FP16 operand pairs by kind, at most BLOCK at a time.

    `random_pairs` of kind `random` (whole blocks), a block of each other random kind, the sets of the rest in full.
    """
    special, few, every = specials(), sparse(), all_bits(FP16)
    n = BLOCK

    def bits(size: int = n) -> np.ndarray:
        return rng.integers(0, 1 << 16, size).astype(np.uint16)

    def number(exponent: np.ndarray) -> np.ndarray:
        """Random sign and mantissa."""
        return (bits(exponent.size) & 0x83FF | np.clip(exponent, 0, 31).astype(np.uint16) << 10).astype(np.uint16)

    kinds = [("specials", *cross(special, special))]
    kinds += [("special, any", *cross(special, every)), ("any, special", *cross(every, special))]
    a, b = cross(few, few)
    kinds.append(("sparse", a | bits(a.size) & 0x8000, b | bits(b.size) & 0x8000))
    a = bits()
    kinds.append(("any, sparse", a, rng.choice(few, n) | bits() & 0x8000))
    exponent = rng.integers(0, 32, n)
    kinds.append(("near exponents", number(exponent), number(exponent + rng.integers(-14, 15, n))))
    a = number(rng.integers(0, 31, n))
    b = (a.astype(np.int32) ^ 0x8000) + rng.integers(-12, 13, n)
    kinds.append(("cancellation", a, b.astype(np.uint16)))
    kinds.append(("subnormals", number(np.zeros(n, np.int64)), number(rng.integers(0, 4, n))))
    exponent = rng.integers(0, 31, n)
    kinds.append(("small products", number(exponent), number(rng.integers(2, 19, n) - exponent)))
    kinds.append(("large products", number(exponent), number(rng.integers(43, 48, n) - exponent)))
    for kind, a, b in kinds:
        for first in range(0, a.size, BLOCK):
            yield kind, a[first : first + BLOCK], b[first : first + BLOCK]
    for _ in range(0, random_pairs, BLOCK):
        yield "random", bits(), bits()


# ---- reference and comparison ------------------------------------------------------------------


def nearest(fmt: FloatFormat, x: np.ndarray, round_up: bool = False) -> np.ndarray:
    """Round float64 by looking up the two neighbours in the table of finite numbers; bit patterns.

    Ties go to the even bit pattern; the number after the largest finite one stands for infinity.
    """
    finite = fmt.decode(np.arange(fmt.max_bits + 1))
    table = np.append(finite, 2 * finite[-1] - finite[-2])
    infinite = fmt.max_bits if fmt.saturate else fmt.max_bits + 1
    a = np.abs(x)
    low = np.clip(np.searchsorted(table, a, "right") - 1, 0, fmt.max_bits)
    below, above = a - table[low], table[low + 1] - a
    if round_up:
        up = (below > 0) & (x > 0)
    else:
        up = (below > above) | ((below == above) & (low % 2 == 1))
    bits = np.minimum(low + up, infinite)
    bits = np.where(np.isinf(x), infinite, bits) | np.signbit(x) * fmt.sign_bit
    return np.where(np.isnan(x), fmt.nan_bits, bits).astype(np.uint16)


def kinds_of(fmt: FloatFormat, bits: np.ndarray) -> np.ndarray:
    """Class of each bit pattern."""
    values = fmt.decode(bits)
    a = np.abs(values)
    cases = [np.isnan(values), np.isinf(values), a == 0, a < fmt.min_normal]
    return np.select(cases, ["nan", "inf", "zero", "subnormal"], "normal")


def assert_same(
    what: str, fmt: FloatFormat, operands: tuple[np.ndarray, ...], got: np.ndarray, want: np.ndarray
) -> None:
    """Fail if `got` differs anywhere from `want`: counts by class of the operands (`fmt`), three examples each."""
    wrong = np.flatnonzero(got != want)
    if not wrong.size:
        return
    labels = [", ".join(kinds) for kinds in zip(*(kinds_of(fmt, x[wrong]) for x in operands))]
    buckets: dict[str, list[int]] = {}
    for label, i in zip(labels, wrong):
        buckets.setdefault(label, []).append(i)
    lines = [f"{what}: {wrong.size} of {got.size} differ"]
    for label, indices in sorted(buckets.items(), key=lambda item: -len(item[1])):
        lines.append(f"  {label}: {len(indices)}")
        for i in indices[:3]:
            inputs = ", ".join(f"{int(x[i]):#06x}" for x in operands)
            lines.append(f"    {inputs}: got {int(got[i]):#06x}, want {int(want[i]):#06x}")
    raise AssertionError("\n".join(lines))
