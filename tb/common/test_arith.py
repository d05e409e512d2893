"""Arithmetic units against the model, the model against independent rounding, and error bounds.

State space: 8-bit and odd formats, every operand pair; conversions, exp and log, every input;
FP16 pairs: specials x specials, the structured pairs of `structured_pairs`, and millions at random
(all bits, and exponents close to each other). Parameter space: FP16, E4M3, E5M2 and three formats
that the chip does not use, so that no width is right by accident. Not covered: all 2^32 FP16 pairs.

The units are one Verilator library (arith_harness.sv), called through ctypes.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import ml_dtypes
import numba
import numpy as np
import pytest
from flicker_tb import runner

from flicker import toolchain
from flicker.errors import FlickerError
from flicker.formats import E4M3, E5M2, FP16, FloatFormat, fp_add, fp_convert, fp_lt, fp_mul
from flicker.functions import exp_neg, exp_neg_f32, log_opacity, log_opacity_f32

HERE = Path(__file__).resolve().parent
E5M3 = FloatFormat("E5M3", 5, 3)
E4M4 = FloatFormat("E4M4", 4, 4, saturate=True)
E3M4 = FloatFormat("E3M4", 3, 4)
FORMATS = (FP16, E4M3, E5M2, E5M3, E4M4, E3M4)  # order of arith_harness.sv
SMALL = FORMATS[1:]
WORDS = 8
OPERATIONS = (("add", fp_add), ("mul", fp_mul), ("lt", fp_lt))
ALL_FP16 = np.arange(1 << 16, dtype=np.uint16)
RANDOM_PAIRS = 4_000_000

Evaluate = Callable[..., np.ndarray]


@pytest.fixture(scope="module")
def evaluate() -> Evaluate:
    """`evaluate(group, a, b)`: results of a group of units, uint16 (n, WORDS)."""
    library = ctypes.CDLL(str(toolchain.verilate(
        "arith_harness", extra=[HERE / "arith_harness.sv"], cpp=[HERE / "arith_harness.cpp"],
        shared=True, name="arith",
    )))

    def run(group: int, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
        a = np.ascontiguousarray(a, np.uint16)
        b = a if b is None else np.ascontiguousarray(b, np.uint16)
        out = np.empty((a.size, WORDS), np.uint16)
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (a, b, out)]
        library.arith_run(ctypes.c_uint32(group), ctypes.c_uint64(a.size), *pointers)
        return out

    return run


def kind(fmt: FloatFormat, bits: int) -> str:
    """Class of a number, for the report of mismatches."""
    x = float(fmt.decode(np.array(bits)))
    if not np.isfinite(x):
        return "nan" if np.isnan(x) else "inf"
    if x == 0:
        return "zero"
    return "subnormal" if abs(x) < fmt.min_normal else "normal"


def check(name: str, got: np.ndarray, want: np.ndarray, fmt: FloatFormat, *operands: np.ndarray) -> None:
    """Fail if bit patterns differ: mismatches counted by kind of operands, the first few in hex."""
    assert got.size == want.size > 0
    bad = np.flatnonzero(got != want)
    if bad.size:
        kinds = Counter(tuple(kind(fmt, int(x[i])) for x in operands) for i in bad[:100_000])
        first = [
            f"{', '.join(f'{int(x[i]):#x}' for x in operands)}: {int(got[i]):#x}, model {int(want[i]):#x}"
            for i in bad[:8]
        ]
        pytest.fail(f"{name}: {bad.size} of {got.size} differ, {dict(kinds)}\n" + "\n".join(first))


def check_pairs(evaluate: Evaluate, fmt: FloatFormat, a: np.ndarray, b: np.ndarray) -> None:
    """Compare sum, product and comparison with the model."""
    out = evaluate(FORMATS.index(fmt), a, b)
    for word, (name, function) in enumerate(OPERATIONS):
        check(f"{fmt.name} {name}", out[:, word], function(fmt, a, b).astype(np.uint16), fmt, a, b)


def all_pairs(bits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every ordered pair of an array's elements."""
    a, b = np.meshgrid(bits, bits, indexing="ij")
    return a.ravel(), b.ravel()


def structured_pairs(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """FP16 pairs where rounding, alignment and normalisation are difficult."""
    n = 100_000
    sign = rng.integers(0, 2, n) << 15
    a = rng.integers(0, 0x7C00, n)
    near = np.clip(a + rng.integers(-3, 4, n), 0, 0x7BFF)  # cancellation
    apart = np.clip((a >> 10) + rng.integers(-15, 16, n), 0, 30) << 10  # powers of two: halfway cases
    few = apart | (1 << rng.integers(0, 10, n)) | (1 << rng.integers(0, 10, n))
    ones = apart | 0x3FF  # carries
    tiny = rng.integers(0, 0x800, n)  # subnormals and the lowest normals
    # Factor whose product with a lies about the smallest normal or the largest finite number.
    to_small = np.clip(16 - (a >> 10) + rng.integers(-13, 3, n), 0, 30) << 10 | rng.integers(0, 1024, n)
    to_large = np.clip(45 - (a >> 10) + rng.integers(-2, 3, n), 0, 30) << 10 | rng.integers(0, 1024, n)
    seconds = [near, apart, few, ones, tiny, to_small, to_large]
    first = np.tile(a | sign, len(seconds))
    second = np.concatenate(seconds) | rng.integers(0, 2, first.size) << 15
    tiny_pair = [tiny, rng.permutation(tiny)]
    a, b = np.append(first, tiny_pair[0]), np.append(second, tiny_pair[1])
    return np.append(a, b).astype(np.uint16), np.append(b, a).astype(np.uint16)


# ---- RTL against model --------------------------------------------------------------------------


@pytest.mark.parametrize("fmt", SMALL, ids=lambda f: f.name)
def test_small_format_all_pairs(evaluate: Evaluate, fmt: FloatFormat) -> None:
    check_pairs(evaluate, fmt, *all_pairs(np.arange(1 << fmt.width, dtype=np.uint16)))


def test_fp16_specials(evaluate: Evaluate) -> None:
    edges = [0, 1, 2, 0x1FF, 0x200, 0x3FE, 0x3FF, 0x400, 0x401, 0x7FF, 0x800, 0x3BFF, 0x3C00, 0x3C01, 0x5C00,
             0x7800, 0x7BFE, 0x7BFF, 0x7C00, 0x7C01, 0x7DFF, 0x7E00, 0x7FFF]
    powers = [e << 10 for e in range(1, 31)] + [1 << k for k in range(10)]
    bits = np.unique(np.array(edges + powers, np.uint16))
    check_pairs(evaluate, FP16, *all_pairs(np.append(bits, bits | 0x8000)))


def test_fp16_structured(evaluate: Evaluate) -> None:
    check_pairs(evaluate, FP16, *structured_pairs(np.random.default_rng(runner.seed())))


def test_fp16_random(evaluate: Evaluate) -> None:
    rng = np.random.default_rng(runner.seed() + 1)
    a, b = rng.integers(0, 1 << 16, (2, RANDOM_PAIRS), dtype=np.uint16)
    half = RANDOM_PAIRS // 2
    exponent = np.clip((a[:half] >> 10 & 31).astype(int) + rng.integers(-12, 13, half), 0, 31)
    b[:half] = b[:half] & 0x83FF | (exponent << 10).astype(np.uint16)
    check_pairs(evaluate, FP16, a, b)


@pytest.mark.parametrize("src", FORMATS, ids=lambda f: f.name)
def test_convert(evaluate: Evaluate, src: FloatFormat) -> None:
    a = np.arange(1 << src.width, dtype=np.uint16)
    out = evaluate(len(FORMATS) + FORMATS.index(src), a)
    for word, dst in enumerate(FORMATS):
        check(f"{src.name} to {dst.name}", out[:, word], fp_convert(src, dst, a), src, a)


def test_functions(evaluate: Evaluate) -> None:
    out = evaluate(2 * len(FORMATS), ALL_FP16)
    for base2 in (False, True):
        check(f"exp base2={base2}", out[:, int(base2)], exp_neg(ALL_FP16, base2), FP16, ALL_FP16)
        for word, fmt in enumerate(FORMATS[:3], start=2 + 3 * base2):
            want = log_opacity(ALL_FP16, base2, fmt)
            check(f"log base2={base2} {fmt.name}", out[:, word], want, FP16, ALL_FP16)


def test_table_package() -> None:
    script = toolchain.ROOT / "scripts" / "gen_tables.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


# ---- model against independent rounding ---------------------------------------------------------


def same(got: np.ndarray, want: np.ndarray) -> None:
    """Equal bit patterns, where a NaN may have any."""
    want = want.ravel()
    nan = np.isnan(want.astype(np.float32))
    bits = want.view(np.uint16 if want.itemsize == 2 else np.uint8)
    assert np.array_equal(got[~nan], bits[~nan])
    canonical = {np.dtype(np.float16): FP16, np.dtype(ml_dtypes.float8_e4m3fn): E4M3}.get(want.dtype, E5M2)
    assert np.all(got[nan] == canonical.nan_bits)


def test_model_fp16() -> None:
    rng = np.random.default_rng(runner.seed() + 2)
    a, b = rng.integers(0, 1 << 16, (2, 1_000_000), dtype=np.uint16)
    s, t = structured_pairs(rng)
    a, b = np.append(a, s), np.append(b, t)
    x, y = a.view(np.float16), b.view(np.float16)
    with np.errstate(all="ignore"):
        same(fp_add(FP16, a, b), x + y)
        same(fp_mul(FP16, a, b), x * y)
        assert np.array_equal(fp_lt(FP16, a, b), x < y)
        assert np.array_equal(FP16.decode(ALL_FP16), ALL_FP16.view(np.float16).astype(np.float64), equal_nan=True)


@pytest.mark.parametrize(
    ("fmt", "dtype"), [(E4M3, ml_dtypes.float8_e4m3fn), (E5M2, ml_dtypes.float8_e5m2)], ids=["E4M3", "E5M2"]
)
def test_model_fp8(fmt: FloatFormat, dtype: type) -> None:
    codes = np.arange(256, dtype=np.uint8)
    assert np.array_equal(fmt.decode(codes), codes.view(dtype).astype(np.float64), equal_nan=True)
    a, b = all_pairs(codes)
    x, y = (bits.view(dtype).astype(np.float32) for bits in (a, b))
    limit = np.float32(fmt.max_finite)  # these types do not saturate
    with np.errstate(all="ignore"):
        # float32 holds the products and, but for sums it rounds in the same place, the sums.
        same(fp_add(fmt, a, b), np.clip(x + y, -limit, limit).astype(dtype))
        same(fp_mul(fmt, a, b), np.clip(x * y, -limit, limit).astype(dtype))
        halves = np.clip(ALL_FP16.view(np.float16).astype(np.float32), -limit, limit)
        same(fp_convert(FP16, fmt, ALL_FP16), halves.astype(dtype))
        assert np.array_equal(fp_lt(fmt, a, b), x < y)


def test_model_round_up() -> None:
    finite = ALL_FP16[(ALL_FP16 & 0x7C00) != 0x7C00]
    x = FP16.decode(finite)
    for fmt in FORMATS[1:]:
        up = fmt.decode(fp_convert(FP16, fmt, finite, round_up=True))
        values = np.sort(fmt.decode(np.arange(1 << fmt.width)))
        values = np.unique(values[np.isfinite(values)])
        place = np.searchsorted(values, x)
        over = fmt.max_finite if fmt.saturate else np.inf
        assert np.array_equal(up, np.append(values, over)[place]), fmt.name


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("F", 6, 3), "exp_bits"), (("F", 1, 3), "exp_bits"), (("F", 5, 11), "man_bits"), (("F", 4, 3, True), "saturate")],
)
def test_bad_format(arguments: tuple, message: str) -> None:
    with pytest.raises(FlickerError, match=message):
        FloatFormat(*arguments)


# ---- error bounds of docs/arithmetic.md ---------------------------------------------------------


@pytest.mark.parametrize("base2", [False, True])
def test_exp_bounds(base2: bool) -> None:
    codes = np.arange(0x7C00, dtype=np.uint16)  # all E >= 0
    x = FP16.decode(codes)
    g = FP16.decode(exp_neg(codes, base2))
    exact = np.exp2(-x) if base2 else np.exp(-x)
    alive = g > 0
    ulp = np.exp2(np.floor(np.log2(exact[alive])) - 10)
    error = (g[alive] - exact[alive]) / ulp
    low, high = (-0.718, 0.665) if base2 else (-0.702, 0.722)
    assert low <= error.min() and error.max() <= high
    assert g[alive].min() >= FP16.min_normal and exact[~alive].max() < FP16.min_normal
    assert np.all(np.diff(g) <= 0)
    assert g[0] == 1.0
    assert np.mean(np.abs(error) <= 0.5) > 0.95
    rest = np.arange(0x7C00, 0x10000, dtype=np.uint16)  # infinity, NaN, sign bit
    assert not exp_neg(rest, base2).any()


@pytest.mark.parametrize("fmt", [FP16, E4M3, E5M2], ids=lambda f: f.name)
@pytest.mark.parametrize("base2", [False, True])
def test_log_bounds(base2: bool, fmt: FloatFormat) -> None:
    codes = np.arange(0x3C01, dtype=np.uint16)  # opacities 0 to 1
    o = np.maximum(FP16.decode(codes), FP16.min_normal)
    exact = np.log2(255 * o) if base2 else np.log(255 * o)
    t = fmt.decode(log_opacity(codes, base2, fmt))
    bound = 0.0012 if base2 else 0.0014
    tightest = fmt.decode(fmt.encode(exact, round_up=True))
    loosest = fmt.decode(fmt.encode(exact + bound, round_up=True))
    assert np.all(tightest <= t) and np.all(t <= loosest)
    assert np.all(np.diff(t) >= 0)
    subnormal = codes < 0x400
    assert np.all(t[subnormal] == t[0x400]) and t[0] < 0


# ---- float32 carriers ---------------------------------------------------------------------------


@numba.njit
def _all_exp(x, base2, y):
    for i in range(x.size):
        y[i] = exp_neg_f32(x[i], base2)


@numba.njit
def _all_log(x, base2, wide, y):
    for i in range(x.size):
        y[i] = log_opacity_f32(x[i], base2, wide)


@pytest.mark.parametrize("base2", [False, True])
def test_float32_carriers(base2: bool) -> None:
    with np.errstate(invalid="ignore"):
        x = ALL_FP16.view(np.float16).astype(np.float32)
    y = np.empty_like(x)
    _all_exp(x, base2, y)
    assert np.array_equal(y.astype(np.float64), FP16.decode(exp_neg(ALL_FP16, base2)))
    for fmt in (FP16, E4M3):
        _all_log(x, base2, fmt is FP16, y)
        want = fmt.decode(log_opacity(ALL_FP16, base2, fmt))
        assert np.array_equal(y.astype(np.float64), want)
        assert np.array_equal(np.signbit(y), np.signbit(want))
