"""Arithmetic units and the model of their formats and functions (docs/reference/arithmetic.md).

Units (`arith_harness.sv`, against `flicker.arithmetic.formats` and `flicker.arithmetic.functions`, bit for bit):
  every pair of operands of all formats but FP16, of the largest of them (E2M8) with SLOW=1; FP16 by special, structured and random pairs
  (all 2^32 with SLOW=1); conversions and functions: every input, between all formats.
Model: against numpy's and ml_dtypes' types and a rounding of its own (`arith_bench.nearest`); the float32 carriers of
  the golden model against it; error bounds of the functions against float64.
Parameter space: the chip's formats and five that it does not use (`arith_bench.FORMATS`). Not covered: other formats,
  for which the units have no case of their own.
"""

from __future__ import annotations

from collections.abc import Callable

import gen_params
import gen_tables
import ml_dtypes
import numba
import numpy as np
import pytest
from arith_bench import (
    BLOCK,
    E3M4,
    FORMATS,
    LOG_FORMATS,
    Harness,
    all_bits,
    assert_same,
    cross,
    fp16_pairs,
    nearest,
)
from flicker_tb.bench import rounds
from flicker_tb.elaboration import refused
from flicker_tb.runner import seed

from flicker.arithmetic import fp, functions
from flicker.arithmetic.formats import E4M3, E5M2, FP16, FloatFormat, fp_add, fp_convert, fp_lt, fp_mul
from flicker.errors import FlickerError

RANDOM_PAIRS = rounds(1 << 20, 1 << 22)
PAIRED = [pytest.param(fmt, marks=pytest.mark.slow) if fmt.name == "E2M8" else fmt for fmt in FORMATS]  # it has 16 million pairs, and no unit uses it
OPERATIONS = {"add": fp_add, "mul": fp_mul, "cmp": fp_lt}
# Types of other libraries with the same numbers; those of 8 bits don't saturate.
TYPES = {FP16: np.float16, E4M3: ml_dtypes.float8_e4m3fn, E5M2: ml_dtypes.float8_e5m2, E3M4: ml_dtypes.float8_e3m4}
BASES = pytest.mark.parametrize("base2", [False, True], ids=["natural", "base2"])


def by_name(fmt: FloatFormat) -> str:
    """Test identifier of a format."""
    return fmt.name


@pytest.fixture(scope="module")
def harness() -> Harness:
    return Harness()


def random(stream: int) -> np.random.Generator:
    """Random numbers of this run's seed; `stream` tells the tests apart."""
    return np.random.default_rng([seed(), stream])


def check_pairs(harness: Harness, fmt: FloatFormat, kind: str, a: np.ndarray, b: np.ndarray) -> None:
    """Adder, multiplier and comparator of a format against the model; the adder without cancellation where both signs are equal."""
    got = harness.pairs(fmt, a, b)
    like = (a ^ b) & fmt.sign_bit == 0
    x, y = a[like], b[like]
    assert_same(f"{fmt.name} add, Cancel=0, {kind}", fmt, (x, y), got["like"][like], fp_add(fmt, x, y))
    for name, operation in OPERATIONS.items():
        assert_same(f"{fmt.name} {name}, {kind}", fmt, (a, b), got[name], operation(fmt, a, b))


# ---- units against the model -------------------------------------------------------------------


@pytest.mark.parametrize("fmt", PAIRED[1:], ids=by_name)
def test_all_pairs(harness: Harness, fmt: FloatFormat) -> None:
    check_pairs(harness, fmt, "all", *cross(all_bits(fmt), all_bits(fmt)))


def test_fp16_pairs(harness: Harness) -> None:
    for kind, a, b in fp16_pairs(random(0), RANDOM_PAIRS):
        check_pairs(harness, FP16, kind, a, b)


@pytest.mark.slow
def test_fp16_all_pairs(harness: Harness) -> None:
    every = all_bits(FP16)
    for first in range(0, every.size, 8):
        check_pairs(harness, FP16, "all", *cross(every[first : first + 8], every))


@pytest.mark.parametrize("src", FORMATS, ids=by_name)
def test_convert(harness: Harness, src: FloatFormat) -> None:
    bits = all_bits(src)
    got = harness.convert(src, bits)
    for i, dst in enumerate(FORMATS):
        assert_same(f"{src.name} to {dst.name}", src, (bits,), got[:, i], fp_convert(src, dst, bits))


@BASES
def test_functions(harness: Harness, base2: bool) -> None:
    bits = all_bits(FP16)
    exp, log = harness.functions(bits)
    assert_same(f"exp_neg, base2={base2}", FP16, (bits,), exp[:, int(base2)], functions.exp_neg(bits, base2))
    for fmt in LOG_FORMATS:
        want = functions.log_opacity(bits, base2, fmt)
        got = log[:, int(base2), FORMATS.index(fmt)]
        assert_same(f"log_opacity to {fmt.name}, base2={base2}", FP16, (bits,), got, want)


@pytest.mark.parametrize(
    ("unit", "parameters", "message"),
    [
        ("flk_fp_add", {"Fn": 1}, "Saturate must be set"),
        ("flk_fp_add", {"ExpBits": 1}, "ExpBits must be at least 2"),
        ("flk_fp_add", {"ManBits": 0}, "ManBits at least 1"),
        ("flk_fp_mul", {"Fn": 1}, "Saturate must be set"),
        ("flk_fp_mul", {"ExpBits": 1}, "ExpBits must be at least 2"),
        ("flk_fp_mul", {"ManBits": 0}, "ManBits at least 1"),
        ("flk_fp_cmp", {"ExpBits": 1}, "ExpBits must be at least 2"),
        ("flk_fp_cmp", {"ManBits": 0}, "ManBits at least 1"),
        ("flk_fp_convert", {"DstFn": 1, "DstSaturate": 0}, "DstSaturate must be set"),
        ("flk_fp_convert", {"SrcExpBits": 1}, "ExpBits must be at least 2"),
        ("flk_fp_convert", {"DstManBits": 0}, "ManBits at least 1"),
        ("flk_log_opacity", {"Fn": 1}, "Saturate must be set"),
        ("flk_log_opacity", {"ExpBits": 3}, "ExpBits must be 4 or 5"),
        ("flk_log_opacity", {"ExpBits": 6}, "ExpBits must be 4 or 5"),
        ("flk_log_opacity", {"ManBits": 11}, "ManBits must be 1 to 10"),
    ],
)
def test_illegal_parameters(unit: str, parameters: dict[str, int], message: str) -> None:
    refused(unit, parameters, message)


@pytest.mark.parametrize("generate", [gen_params.main, gen_tables.main], ids=["params", "tables"])
def test_generated_packages(generate: Callable[[], int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr("sys.argv", ["", "--check"])
    assert generate() == 0, capsys.readouterr().err


# ---- the model against other roundings ---------------------------------------------------------


def test_stimulus() -> None:
    """The FP16 pairs reach what they are meant to reach: classes of exact results, each at least a hundred times."""
    found: dict[str, int] = {}
    for _, a, b in fp16_pairs(random(0), BLOCK):
        x, y = FP16.decode(a), FP16.decode(b)
        usable = np.isfinite(x) & np.isfinite(y)
        x, y = x[usable], y[usable]
        for name, exact in (("sum", x + y), ("product", x * y)):
            size = np.abs(exact)
            steps = np.ldexp(size, 11 - np.maximum(np.frexp(size)[1], -13))  # in units of the last place
            tie = steps % 1 == 0.5
            subnormal = (size < FP16.min_normal) & (exact != 0)
            classes = {
                "tie, even below": tie & (steps % 2 == 0.5),
                "tie, even above": tie & (steps % 2 == 1.5),
                "subnormal": subnormal,
                "largest number": (size >= 65488) & (size < 65520),
                "rounds to infinity": (size >= 65520) & (size < 65536),
                "overflow": size >= 65536,
            }
            if name == "sum":  # never inexact where subnormal
                classes["zero"] = (exact == 0) & (x != 0)
                classes["cancellation"] = size < np.abs(x) / 64
            else:
                classes["subnormal tie"] = subnormal & tie
                classes["below half of the smallest"] = subnormal & (steps < 0.5)
                classes["rounds to the smallest normal"] = subnormal & (np.rint(steps) == 1024)
            for label, hits in classes.items():
                key = f"{name}: {label}"
                found[key] = found.get(key, 0) + int(np.count_nonzero(hits))
    print(found)
    assert min(found.values()) >= 100, found


def rounding_points(fmt: FloatFormat, rng: np.random.Generator, dtype: type = np.float64) -> np.ndarray:
    """All numbers of a format, all midpoints, the float64 (`dtype`) beside each, random ones of all sizes, specials."""
    numbers = fmt.decode(np.arange(fmt.max_bits + 1)).astype(dtype)
    numbers = np.append(numbers, 2 * numbers[-1] - numbers[-2])
    points = np.concatenate([numbers, (numbers[1:] + numbers[:-1]) / 2])
    points = np.concatenate([points, np.nextafter(points, dtype(np.inf)), np.nextafter(points, dtype(0))])
    anything = np.exp2(rng.uniform(-30, 20, 200_000)).astype(dtype)
    ends = np.array([np.finfo(dtype).smallest_subnormal, np.finfo(dtype).max, np.inf, np.nan], dtype)
    points = np.concatenate([points, anything, ends])
    return np.concatenate([points, -points])


@pytest.mark.parametrize("fmt", FORMATS, ids=by_name)
@pytest.mark.parametrize("round_up", [False, True], ids=["nearest", "up"])
def test_encode(fmt: FloatFormat, round_up: bool) -> None:
    x = rounding_points(fmt, random(1))
    got, want = fmt.encode(x, round_up), nearest(fmt, x, round_up)
    # A negative number beyond the range, rounded up, is the largest finite one; nearest() has no such case.
    beyond = round_up & np.isfinite(x) & (x < -fmt.max_finite)
    want[beyond] = fmt.sign_bit | fmt.max_bits
    wrong = np.flatnonzero(got != want)
    assert not wrong.size, [(x[i].hex(), hex(got[i]), hex(want[i])) for i in wrong[:5]]


def as_type(fmt: FloatFormat, x: np.ndarray) -> np.ndarray:
    """float64 to bit patterns by the other library's type, saturated first where the format is; canonical NaN."""
    limit = fmt.max_finite if fmt.saturate else np.inf
    with np.errstate(over="ignore", invalid="ignore"):
        y = np.clip(x, -limit, limit).astype(TYPES[fmt])
    return np.where(np.isnan(x), fmt.nan_bits, y.view(fmt.dtype))


@pytest.mark.parametrize("fmt", TYPES, ids=by_name)
def test_model_against_types(fmt: FloatFormat) -> None:
    """Decoding, rounding, arithmetic and comparison; every bit pattern, every pair of an 8-bit format."""
    bits = all_bits(fmt)
    values = bits.astype(fmt.dtype).view(TYPES[fmt])
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(fmt.decode(bits), values.astype(np.float64))
    # The 8-bit types round by way of float32: give them float32 numbers.
    x = rounding_points(fmt, random(2), np.float64 if fmt == FP16 else np.float32).astype(np.float64)
    np.testing.assert_array_equal(fmt.encode(x), as_type(fmt, x))

    pairs = fp16_pairs(random(3), BLOCK) if fmt == FP16 else [("all", *cross(bits, bits))]
    for kind, a, b in pairs:
        with np.errstate(over="ignore", invalid="ignore"):
            x, y = values[a], values[b]
            if fmt == FP16:  # by the type's own operations
                both = {"add": (x + y).astype(np.float64), "mul": (x * y).astype(np.float64)}
            else:  # which saturate nowhere: by float64, rounded by the type
                both = {"add": x.astype(np.float64) + y.astype(np.float64)}
                both["mul"] = x.astype(np.float64) * y.astype(np.float64)
            for name, exact in both.items():
                assert_same(f"{fmt.name} {name}, {kind}", fmt, (a, b), OPERATIONS[name](fmt, a, b), as_type(fmt, exact))
            assert_same(f"{fmt.name} cmp, {kind}", fmt, (a, b), fp_lt(fmt, a, b), x < y)


def test_illegal_formats() -> None:
    for name, arguments, message in (
        ("E6M3", (6, 3), "E6M3: exp_bits must be 2 to 5"),
        ("E5M11", (5, 11), "E5M11: man_bits must be 1 to 10"),
        ("E4M3", (4, 3, True), "E4M3: fn has no infinity"),
    ):
        with pytest.raises(FlickerError, match=message):
            FloatFormat(name, *arguments)


# ---- float32 carriers of the golden model ------------------------------------------------------


@numba.njit
def _round_all(x, r, out):
    for i in range(x.size):
        out[i] = fp.rnd(x[i], r)


@numba.njit
def _pairs_all(a, b, r, sums, differences, products):
    for i in range(a.size):
        sums[i] = fp.add(a[i], b[i], r)
        differences[i] = fp.sub(a[i], b[i], r)
        products[i] = fp.mul(a[i], b[i], r)


@numba.njit
def _fp16_all(h, values, back):
    for i in range(h.size):
        values[i] = fp.fp16_value(h[i])
        back[i] = fp.fp16_bits(values[i])


@numba.njit
def _from_f64_all(x, out):
    for i in range(x.size):
        out[i] = fp.fp16_from_f64(x[i])


def carrier(fmt: FloatFormat, bits: np.ndarray) -> np.ndarray:
    """Bit patterns to the float32 that stand for them; a NaN is the positive quiet one."""
    values = fmt.decode(bits)
    return np.where(np.isnan(values), np.nan, values).astype(np.float32)


def assert_carriers(
    what: str, fmt: FloatFormat, operands: tuple[np.ndarray, ...], got: np.ndarray, want: np.ndarray
) -> None:
    """float32 `got` is the carrier of bit patterns `want`, to the last bit (sign of zero, NaN)."""
    assert_same(f"{what} (float32 bits)", fmt, operands, got.view(np.uint32), carrier(fmt, want).view(np.uint32))


@pytest.mark.parametrize("fmt", FORMATS, ids=by_name)
def test_carrier_rounding(fmt: FloatFormat) -> None:
    """Every float32 up to the low 13 bits, which no format has: of these all classes of guard and sticky bits."""
    high = np.arange(1 << 19, dtype=np.uint32) << np.uint32(13)
    r = fp.rounding(fmt)
    out = np.empty(high.size, np.float32)
    for low in (0x0000, 0x0001, 0x0FFF, 0x1000, 0x1001, 0x1FFF):
        bits = high | np.uint32(low)
        x = bits.view(np.float32)
        _round_all(x, r, out)
        with np.errstate(invalid="ignore"):  # signalling NaNs
            want = carrier(fmt, fmt.encode(x)).view(np.uint32)
        wrong = np.flatnonzero(out.view(np.uint32) != want)
        assert not wrong.size, [(hex(bits[i]), hex(out.view(np.uint32)[i]), hex(want[i])) for i in wrong[:5]]


@pytest.mark.parametrize("fmt", PAIRED, ids=by_name)
def test_carrier_arithmetic(fmt: FloatFormat) -> None:
    bits = all_bits(fmt)
    pairs = fp16_pairs(random(4), RANDOM_PAIRS) if fmt == FP16 else [("all", *cross(bits, bits))]
    r = fp.rounding(fmt)
    for kind, a, b in pairs:
        sums, differences, products = np.empty((3, a.size), np.float32)
        _pairs_all(carrier(fmt, a), carrier(fmt, b), r, sums, differences, products)
        assert_carriers(f"{fmt.name} add, {kind}", fmt, (a, b), sums, fp_add(fmt, a, b))
        want = fp_add(fmt, a, b ^ fmt.dtype(fmt.sign_bit))
        assert_carriers(f"{fmt.name} sub, {kind}", fmt, (a, b), differences, want)
        assert_carriers(f"{fmt.name} mul, {kind}", fmt, (a, b), products, fp_mul(fmt, a, b))


def test_carrier_fp16() -> None:
    bits = all_bits(FP16)
    values, back = np.empty(bits.size, np.float32), np.empty(bits.size, np.uint16)
    _fp16_all(bits, values, back)
    nan = np.isnan(FP16.decode(bits))
    assert np.isnan(values[nan]).all()
    assert_carriers("fp16_value", FP16, (bits[~nan],), values[~nan], bits[~nan])
    assert_same("fp16_bits", FP16, (bits,), back, np.where(nan, FP16.nan_bits, bits))
    x = rounding_points(FP16, random(5))
    out = np.empty(x.size, np.float32)
    _from_f64_all(x, out)
    want = FP16.decode(FP16.encode(x))
    np.testing.assert_array_equal(out, want)
    np.testing.assert_array_equal(np.signbit(out[~np.isnan(x)]), np.signbit(want[~np.isnan(x)]))


@numba.njit
def _functions_all(x, base2, exp, log_fp16, log_e4m3):
    for i in range(x.size):
        exp[i] = functions.exp_neg_f32(x[i], base2)
        log_fp16[i] = functions.log_opacity_f32(x[i], base2, True)
        log_e4m3[i] = functions.log_opacity_f32(x[i], base2, False)


@BASES
def test_carrier_functions(base2: bool) -> None:
    """The scalar functions on float32 carriers are those on bit patterns, for every input but NaN of either sign."""
    bits = all_bits(FP16)
    bits = bits[~np.isnan(FP16.decode(bits))]
    out = np.empty((3, bits.size), np.float32)
    _functions_all(carrier(FP16, bits), base2, *out)
    assert_carriers("exp_neg_f32", FP16, (bits,), out[0], functions.exp_neg(bits, base2))
    for fmt, got in ((FP16, out[1]), (E4M3, out[2])):
        want = carrier(fmt, functions.log_opacity(bits, base2, fmt))
        assert_same(f"log_opacity_f32 to {fmt.name}", FP16, (bits,), got.view(np.uint32), want.view(np.uint32))


# ---- error bounds of the functions (docs/reference/arithmetic.md) ----------------------------------------

EXP_ULP = {False: 0.73, True: 0.73}
LOG_ERROR = {False: 1.4e-3, True: 1.2e-3}


@BASES
def test_exp_error(base2: bool) -> None:
    e_bits = np.arange(FP16.inf_bits, dtype=np.uint16)  # all finite E >= 0
    function: Callable = (lambda x: np.exp2(-x)) if base2 else (lambda x: np.exp(-x))
    exact = function(FP16.decode(e_bits))
    g_bits = functions.exp_neg(e_bits, base2)
    g = FP16.decode(g_bits)
    assert g[0] == 1.0
    assert (np.diff(g) <= 0).all(), "not monotone"
    np.testing.assert_array_equal(g == 0, exact < FP16.min_normal)
    normal = g > 0
    ulp = np.exp2(np.floor(np.log2(exact[normal])) - FP16.man_bits)
    error = (g - exact)[normal] / ulp
    print(f"exp_neg, base2={base2}: {error.min():.4f} to {error.max():.4f} ulp")
    assert np.abs(error).max() <= EXP_ULP[base2]
    rest = np.arange(FP16.inf_bits, 1 << 16).astype(np.uint16)  # infinity, NaN, sign bit set
    assert not functions.exp_neg(rest, base2).any()


@BASES
@pytest.mark.parametrize("fmt", LOG_FORMATS, ids=by_name)
def test_log_error(fmt: FloatFormat, base2: bool) -> None:
    bits = np.arange(0x4000, dtype=np.uint16)  # 0 to below 2
    opacity = np.where(bits < 0x400, FP16.min_normal, FP16.decode(bits))
    exact = (np.log2 if base2 else np.log)(255 * opacity)
    t = fmt.decode(functions.log_opacity(bits, base2, fmt))
    assert (np.diff(t) >= 0).all(), "not monotone"
    ulp = np.exp2(np.maximum(np.frexp(t)[1] - 1, 1 - fmt.bias) - fmt.man_bits)
    error = t - exact
    print(f"log_opacity to {fmt.name}, base2={base2}: {error.min():.2e} to {error.max():.3e}, "
          f"beyond one ulp {(error - ulp).max():.2e}")
    assert error.min() >= 0
    assert (error <= LOG_ERROR[base2] + ulp).all()
    # Outside the range: the sign is ignored, 2 and more count as [1, 2).
    every = functions.log_opacity(all_bits(FP16), base2, fmt)
    np.testing.assert_array_equal(every[:0x8000], every[0x8000:])
    np.testing.assert_array_equal(every[0x4000:0x8000], np.tile(every[0x3C00:0x4000], 16))
