"""ff numbers (docs/reference/ff.md): the model against numpy's float32 and exact rationals, error bounds of the functions, units against the model.
`flk_ff_poly` and the tables behind it, `flk_ff_rom`, run inside the units of functions (recip, rsqrt, sqrt, exp2).

With SLOW=1 more formats in the same tests, and every mantissa for the bounds of the functions. Not covered: mantissas other than those named in the tests; the
units have no case of their own for them.
"""

from __future__ import annotations

import ctypes
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import seed

from flicker.arithmetic import ff
from flicker.arithmetic import ff_tables as tables
from flicker.toolchain import verilate

HERE = Path(__file__).parent
MAN_BITS = tuple(range(tables.MIN_MAN_BITS, tables.MAX_MAN_BITS + 1))
OPERATIONS = ("add", "sub", "mul")
TOP = 254 << 23 | (1 << 23) - 1  # code of the largest number, M = 23


def random(stream: int) -> np.random.Generator:
    """Random numbers of this run's seed; `stream` tells the tests apart."""
    return np.random.default_rng([seed(), stream])


@numba.njit
def _values(codes, M):
    out = np.empty(codes.size)
    for i in range(codes.size):
        out[i] = ff.ff_value(codes[i], M)
    return out


@numba.njit
def _codes(x, M):
    out = np.empty(x.size, np.uint32)
    for i in range(x.size):
        out[i] = ff.ff_bits(x[i], M)
    return out


@numba.njit
def _pairs(a, b, M):
    out = np.empty((3, a.size))
    for i in range(a.size):
        out[0, i] = ff.ff_add(a[i], b[i], M)
        out[1, i] = ff.ff_sub(a[i], b[i], M)
        out[2, i] = ff.ff_mul(a[i], b[i], M)
    return out


def numbers(rng: np.random.Generator, n: int, M: int, low: int = 1, high: int = 254) -> np.ndarray:
    """Codes with exponents low to high; half of the mantissas sparse, which makes ties and carries; some zeros."""
    mantissa = rng.integers(0, 1 << M, n)
    ones = (1 << M) - 1
    sparse = (1 << rng.integers(0, M, n)) + rng.integers(-1, 2, n)
    sparse = np.where(rng.random(n) < 0.5, sparse, -sparse) & ones
    mantissa = np.where(rng.random(n) < 0.5, mantissa, sparse)
    code = rng.integers(0, 2, n) << (8 + M) | rng.integers(low, high + 1, n) << M | mantissa
    return np.where(rng.random(n) < 0.01, 0, code).astype(np.uint32)


def operand_kinds(rng: np.random.Generator, n: int, M: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Operand pairs (codes) by kind."""

    def at(exponent: np.ndarray) -> np.ndarray:
        code = numbers(rng, n, M, 1, 1)
        return np.where(code == 0, 0, code + ((np.clip(exponent, 1, 254) - 1) << M)).astype(np.uint32)

    e = rng.integers(1, 255, n)
    a = at(e)
    # Products near a power of two, at the ends of the range: 1 <= x < 2 and its reciprocal in [1, 2), with last places beside it.
    x = 1 + rng.integers(0, 1 << M, n) * 2.0**-M
    inverse = np.clip(np.rint((2 / x - 1) * 2**M).astype(np.int64) + rng.integers(-1, 2, n), 0, (1 << M) - 1)
    place = rng.integers(1, 254, n)
    edge = np.clip(rng.choice([126, 127, 128, 380, 381, 382], n) - place, 1, 254)
    cancel = (a.astype(np.int64) ^ 1 << (8 + M)) + rng.integers(-9, 10, n)
    magnitude = np.clip(cancel & (1 << (8 + M)) - 1, 1 << M, (255 << M) - 1)
    return {
        "any": (at(e), at(rng.integers(1, 255, n))),
        "near exponents": (a, at(e + rng.integers(-M - 4, M + 5, n))),
        "cancellation": (a, (cancel & 1 << (8 + M) | magnitude).astype(np.uint32)),
        "smallest": (at(rng.integers(1, M + 4, n)), at(rng.integers(1, M + 4, n))),
        "largest": (at(rng.integers(252, 255, n)), at(rng.integers(252, 255, n))),
        "small products": (a, at(rng.integers(124, 131, n) - e)),
        "large products": (a, at(rng.integers(378, 385, n) - e)),
        "near powers of two": (((x - 1) * 2.0**M).astype(np.uint32) | (place << M).astype(np.uint32), (inverse | edge << M).astype(np.uint32)),
        "sums near the largest": (((255 << M) - 1 - rng.integers(0, 3, n)).astype(np.uint32), at(rng.integers(251, 255, n) - M)),
        "zeros": (np.where(rng.random(n) < 0.5, 0, a).astype(np.uint32), np.where(rng.random(n) < 0.5, 0, at(e)).astype(np.uint32)),
    }


# ---- model -------------------------------------------------------------------------------------


def test_against_float32() -> None:
    """M = 23 is float32 without subnormal and infinite results."""
    for kind, (a, b) in operand_kinds(random(0), 200_000, 23).items():
        x, y = _values(a, 23), _values(b, 23)
        assert np.array_equal(_codes(x, 23), a), kind
        assert np.array_equal(x, a.view(np.float32).astype(np.float64)), kind
        with np.errstate(over="ignore", under="ignore"):
            fx, fy = a.view(np.float32), b.view(np.float32)
            want = np.stack([fx + fy, fx - fy, fx * fy])
        got = _codes(_pairs(x, y, 23).ravel(), 23).reshape(3, -1)
        code = want.view(np.uint32)
        sign, magnitude = code & np.uint32(1 << 31), code & np.uint32((1 << 31) - 1)
        code = sign | np.minimum(magnitude, np.uint32(TOP))
        # float32 rounds subnormal results in other places; just below 2^-126 that can make 2^-126 of them.
        clear = (magnitude < 1 << 23) | (magnitude > 1 << 23)
        assert np.array_equal(got[clear], np.where(magnitude < 1 << 23, 0, code)[clear]), kind


def rounded(x: Fraction, M: int) -> Fraction:
    """Exact rounding by its definition."""
    if x == 0:
        return x
    a = abs(x)
    e = a.numerator.bit_length() - a.denominator.bit_length()
    e -= a < Fraction(2) ** e
    unit = Fraction(2) ** (e - M)
    a = round(a / unit) * unit  # Fraction rounds ties to even
    a = Fraction(0) if a < Fraction(2) ** -126 else min(a, (2 - Fraction(1, 1 << M)) * 2**127)
    return a if x > 0 else -a


@pytest.mark.parametrize("M", [10, 15, 19, 23])
def test_against_rationals(M: int) -> None:
    for kind, (a, b) in operand_kinds(random(M), 500, M).items():
        x, y = _values(a, M), _values(b, M)
        for p, q, got in zip(x, y, _pairs(x, y, M).T):
            p, q = Fraction(float(p)), Fraction(float(q))
            for name, exact, value in zip(OPERATIONS, (p + q, p - q, p * q), got):
                assert Fraction(float(value)) == rounded(exact, M), (kind, name, float(p), float(q))
                assert not (value == 0 and np.signbit(value)), (kind, name, float(p), float(q))


@pytest.mark.parametrize("M", [11, *(pytest.param(M, marks=pytest.mark.slow) for M in (19, 23))])
def test_stimulus(M: int) -> None:
    """The operand pairs reach what they are meant to reach."""
    found: dict[str, int] = {}
    for _, (a, b) in operand_kinds(random(20 + M), 4000, M).items():
        for x, y in zip(_values(a, M), _values(b, M)):
            for name, exact in (("add", Fraction(float(x)) + Fraction(float(y))), ("mul", Fraction(float(x)) * Fraction(float(y)))):
                if exact == 0:
                    continue
                magnitude, value = abs(exact), abs(rounded(exact, M))
                largest = min(abs(x), abs(y)) if name == "mul" else max(abs(x), abs(y))
                least = Fraction(2) ** -126
                cases = {
                    "too small": value == 0, "smallest": value == least, "rounded to the smallest": value == least > magnitude,
                    "largest": value == Fraction(ff.ff_max(M)), "just below the largest": value == Fraction(ff.ff_max(M)) > magnitude,
                    "tie": magnitude != value and value != 0 and _is_tie(magnitude, M), "cancellation": value != 0 and magnitude < largest / 64,
                }
                for case, is_so in cases.items():
                    found[f"{name} {case}"] = found.get(f"{name} {case}", 0) + is_so
    impossible = {"add rounded to the smallest", "mul cancellation"}
    assert {case: count for case, count in found.items() if count < 10 and case not in impossible} == {}


def _is_tie(x: Fraction, M: int) -> bool:
    """Does x have exactly M + 2 significant bits?"""
    odd = x.numerator
    odd //= odd & -odd
    return odd.bit_length() == M + 2


def test_largest_and_smallest() -> None:
    for M in MAN_BITS:
        top = ff.ff_max(M)
        assert ff.ff_round(np.inf, M) == ff.ff_round(1e300, M) == top == ff.ff_add(top, top, M)
        assert ff.ff_round(-np.inf, M) == -top
        assert ff.ff_round(ff.MIN_NORMAL, M) == ff.MIN_NORMAL
        half_ulp = 2.0 ** (-127 - M)
        assert ff.ff_round(ff.MIN_NORMAL - half_ulp / 2, M) == ff.MIN_NORMAL  # a tie, and 2^-126 is even
        assert ff.ff_round(ff.MIN_NORMAL - half_ulp, M) == 0
        assert not np.signbit(ff.ff_round(-0.0, M)) and not np.signbit(ff.ff_mul(-1.0, 0.0, M)) and not np.signbit(ff.ff_neg(0.0))
        assert ff.ff_bits(top, M) == (255 << M) - 1 and ff.ff_bits(-1.0, M) == (1 << (8 + M)) | 127 << M
        assert ff.ff_value(np.uint32(255 << M), M) == top and ff.ff_value(np.uint32(1), M) == 0


@pytest.mark.parametrize("M", [11, 19, 23])
def test_fixed(M: int) -> None:
    rng = random(50 + M)
    for i in (int(v) for v in rng.integers(-(1 << 40), 1 << 40, 300) >> rng.integers(0, 40, 300)):
        for frac in (0, 6, 14):
            got = ff.ff_from_fixed(i, frac, M)
            assert Fraction(float(got)) == rounded(Fraction(i, 1 << frac), M)
            assert got == i * 2.0**-frac or abs(i) > 2 << M
    for x in (float(v) for v in _values(numbers(rng, 2000, M, 80, 160), M)):
        for frac, bits in ((0, 8), (6, 20), (14, 21)):
            low, high = -(1 << (bits - 1)), (1 << (bits - 1)) - 1
            scaled = Fraction(x) * (1 << frac)
            assert ff.ff_to_fixed_floor(x, frac, bits) == min(max(scaled.__floor__(), low), high)
            assert ff.ff_to_fixed_round(x, frac, bits) == min(max((scaled + Fraction(1, 2)).__floor__(), low), high)


# ---- functions ---------------------------------------------------------------------------------


@numba.njit
def _function(function, x, M):
    """Model at x; exp2: of x in 2^-14."""
    out = np.empty(x.size)
    for i in range(x.size):
        if function == tables.RECIP:
            out[i] = ff.ff_recip(x[i], M)
        elif function == tables.RSQRT:
            out[i] = ff.ff_rsqrt(x[i], M)
        elif function == tables.SQRT:
            out[i] = ff.ff_sqrt(x[i], M)
        else:
            out[i] = ff.ff_exp2_fixed(np.int64(x[i]), 14, M)
    return out


def error_ulp(function: int, M: int, mantissas: np.ndarray) -> np.ndarray:
    """|model - exact| in units in the last place of the exact result, for numbers in [1, 4), of exp2 for exponents in [-2, 2).

    Asserts that the model is monotone.
    """
    one = 1 + mantissas * 2.0**-M
    x = np.concatenate([one, 2 * one])
    if function == tables.EXP2:
        x = np.arange(-(2 << 14), 2 << 14).astype(np.float64)
    exact = (lambda: 1 / x, lambda: 1 / np.sqrt(x), lambda: np.sqrt(x), lambda: np.exp2(x / 2.0**14))[function]()
    ulp = np.exp2(np.frexp(exact)[1] - 1.0 - M)
    got = _function(function, x, M)
    order = np.argsort(x, kind="stable")
    steps = np.diff(got[order])
    assert np.all(steps <= 0 if function in (tables.RECIP, tables.RSQRT) else steps >= 0), "not monotone"
    return np.abs(got - exact) / ulp


@pytest.mark.parametrize("function", range(4), ids=tables.NAMES)
def test_function_bounds(function: int) -> None:
    """Every mantissa up to 15 bits, above it 2^16 with both ends."""
    for M in MAN_BITS:
        m = np.arange(1 << M)
        if M > 15:
            m = np.concatenate([m[:64], random(100 + M).integers(0, 1 << M, 1 << 16), m[-64:]])
        assert error_ulp(function, M, m).max() <= ff.FF_MAX_ULP[function], M


@pytest.mark.slow
@pytest.mark.parametrize("function", range(4), ids=tables.NAMES)
def test_function_bounds_all(function: int) -> None:
    """Every mantissa; prints the largest error for each number of mantissa bits."""
    worst = [float(error_ulp(function, M, np.arange(1 << M)).max()) for M in MAN_BITS]
    print(tables.NAMES[function], " ".join(f"{M}: {error:.3f}" for M, error in zip(MAN_BITS, worst)))
    assert max(worst) <= ff.FF_MAX_ULP[function]


@pytest.mark.parametrize("M", MAN_BITS)
def test_function_exponents(M: int) -> None:
    """Powers of two are exact at every exponent; results outside of the range; special arguments."""
    top = ff.ff_max(M)
    e = np.arange(-126, 128)
    x = np.exp2(e.astype(np.float64))
    for sign in (1, -1):
        assert np.array_equal(_function(tables.RECIP, sign * x, M), np.where(e < 127, sign / x, 0.0))
    even = e % 2 == 0
    assert np.array_equal(_function(tables.SQRT, x, M)[even], np.sqrt(x[even]))
    assert np.array_equal(_function(tables.RSQRT, x, M)[even], 1 / np.sqrt(x[even]))
    y = x * (2 - 2.0**-M)
    exact = (1 / y, 1 / np.sqrt(y), np.sqrt(y))
    for function, want in zip((tables.RECIP, tables.RSQRT, tables.SQRT), exact):
        got = _function(function, y, M)
        want = np.where(want < ff.MIN_NORMAL, got, want)
        assert np.all(np.abs(got - want) <= 2.0**-M * want)
    assert _function(tables.RECIP, y[-2:], M).tolist() == [0.0, 0.0]
    for value, want in ((0.0, (top, top, 0.0)), (-2.0, (-0.5, 0.0, 0.0))):
        assert [float(_function(f, np.array([value]), M)[0]) for f in range(3)] == list(want)
    whole = np.arange(-300, 300)
    with np.errstate(over="ignore"):
        want = np.exp2(np.minimum(whole, 200).astype(np.float64))
    want = np.where(whole > 127, top, np.where(whole < -126, 0.0, want))
    for frac in (0, 12, 14):
        assert [ff.ff_exp2_fixed(int(w) << frac, frac, M) for w in whole] == want.tolist()


# ---- units -------------------------------------------------------------------------------------

FORMATS = (10, 11, 15, 19, 23)  # mantissas of ff_harness.sv: the ends of the range, and each group of tables
UNITS = ("add", "mul", "recip", "rsqrt", "sqrt", "exp2", "exp2 wide", "from 24.8", "from 11.0", "floor to 14.6", "round to 7.14", "lt", "from FP16")


@numba.njit
def _model(a, b, M):
    """What ff_harness.sv gives for operand patterns: (n, units), uint32."""
    out = np.empty((a.size, 13), np.uint32)
    for i in range(a.size):
        x, y, word = ff.ff_value(a[i] & ((1 << (9 + M)) - 1), M), ff.ff_value(b[i] & ((1 << (9 + M)) - 1), M), np.int64(b[i])
        out[i, 0] = ff.ff_bits(ff.ff_add(x, y, M), M)
        out[i, 1] = ff.ff_bits(ff.ff_mul(x, y, M), M)
        out[i, 2] = ff.ff_bits(ff.ff_recip(x, M), M)
        out[i, 3] = ff.ff_bits(ff.ff_rsqrt(x, M), M)
        out[i, 4] = ff.ff_bits(ff.ff_sqrt(x, M), M)
        out[i, 5] = ff.ff_bits(ff.ff_exp2_fixed((word << 43) >> 43, 14, M), M)
        out[i, 6] = ff.ff_bits(ff.ff_exp2_fixed((word << 49) >> 49, 5, M), M)
        out[i, 7] = ff.ff_bits(ff.ff_from_fixed((word << 32) >> 32, 8, M), M)
        out[i, 8] = ff.ff_bits(ff.ff_from_int((word << 53) >> 53, M), M)
        out[i, 9] = np.uint32(ff.ff_to_fixed_floor(x, 6, 20) & 0xFFFFFFFF)
        out[i, 10] = np.uint32(ff.ff_to_fixed_round(x, 14, 21) & 0xFFFFFFFF)
        out[i, 11] = np.uint32(ff.ff_lt(x, y))
        exponent, mantissa = word >> 10 & 31, word & 1023
        half = mantissa * 2.0**-24 if exponent == 0 else (1024 + mantissa) * 2.0 ** (exponent - 25)
        out[i, 12] = ff.ff_bits(-half if word >> 15 & 1 and half else half, M)
    return out


class Harness:
    """All units with the mantissas of FORMATS, evaluated in batches."""

    def __init__(self) -> None:
        table = int.from_bytes(bytes(FORMATS), "little")
        path = verilate(
            "ff_harness", extra=[HERE / "ff_harness.sv"],
            args=[f"-GFormats={len(FORMATS)}", f"-GManBitsOf={8 * len(FORMATS)}'h{table:x}", "--output-split", "0"],
            cpp=[HERE / "ff_harness.cpp"], shared=True, name="ff",
        )
        self._lib = ctypes.CDLL(str(path))
        self._lib.ff_reset()

    def batch(self, M: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Results (n, units) of the combinational units."""
        out = np.zeros((a.size, len(UNITS)), np.uint32)
        self._call("ff_batch", M, a, b, out)
        return out

    def pipes(self, M: int, a: np.ndarray, b: np.ndarray, enable: np.ndarray) -> np.ndarray:
        """Wrong cycles (stages, units) of the pipelines."""
        bad = np.zeros((4, len(UNITS)), np.int64)
        self._call("ff_pipes", M, a, b, enable, bad)
        return bad

    def _call(self, name: str, M: int, *arrays: np.ndarray) -> None:
        a, b = arrays[:2]
        assert a.dtype == b.dtype == np.uint32 and a.size == b.size and all(x.flags.c_contiguous for x in arrays)
        getattr(self._lib, name)(FORMATS.index(M), ctypes.c_int64(a.size), *(ctypes.c_void_p(x.ctypes.data) for x in arrays))


@pytest.fixture(scope="module")
def harness() -> Harness:
    return Harness()


def check(harness: Harness, M: int, kind: str, a: np.ndarray, b: np.ndarray) -> None:
    """Every unit of a format against the model."""
    got, want = harness.batch(M, a, b), _model(a, b, M)
    wrong = np.flatnonzero((got != want).any(0))
    if wrong.size:
        lines = []
        for unit in wrong:
            rows = np.flatnonzero(got[:, unit] != want[:, unit])
            lines.append(f"  {UNITS[unit]}: {rows.size} of {a.size} differ")
            lines += [f"    {a[i]:#010x}, {b[i]:#010x}: got {got[i, unit]:#010x}, want {want[i, unit]:#010x}" for i in rows[:3]]
        raise AssertionError("\n".join([f"M = {M}, {kind}", *lines]))


def anything(rng: np.random.Generator, n: int, M: int) -> tuple[np.ndarray, np.ndarray]:
    """A number, and 32 bits of any magnitude that are a number too."""
    words = (rng.integers(-(1 << 31), 1 << 31, n) >> rng.integers(0, 32, n)).astype(np.uint32)
    exponent = words >> np.uint32(M) & np.uint32(255)
    return numbers(rng, n, M), np.where((exponent == 0) | (exponent == 255), words & np.uint32((1 << M) - 1) | np.uint32(127 << M), words)


@pytest.mark.parametrize("M", FORMATS)
def test_units(harness: Harness, M: int) -> None:
    rng = random(200 + M)
    for kind, (a, b) in operand_kinds(rng, 100_000, M).items():
        check(harness, M, kind, a, b)
    for kind, low, high in (("near 1", 120, 134), ("of fixed point", 100, 142)):
        a, b = (numbers(rng, 100_000, M, low, high) for _ in range(2))
        check(harness, M, kind, a, b)
    a, b = anything(rng, 300_000, M)
    check(harness, M, "fixed point", a, b)


@pytest.mark.parametrize("M", [*(pytest.param(M, marks=pytest.mark.slow) for M in (10, 15)), 11, 19, 23])
def test_functions(harness: Harness, M: int) -> None:
    """Every mantissa up to 15 bits, above it 2^17, for both parities of the exponent; every fraction of exp2."""
    m = np.arange(1 << M) if M <= 15 else np.concatenate([np.arange(256), random(300 + M).integers(0, 1 << M, 1 << 17), (1 << M) - 1 - np.arange(256)])
    for exponent in (1, 126, 127, 128, 252, 253, 254):
        a = (m | exponent << M).astype(np.uint32)
        check(harness, M, f"exponent {exponent}", a, np.full_like(a, 127 << M))
    halves = np.arange(1 << 16, dtype=np.uint32)
    check(harness, M, "FP16", np.full_like(halves, 127 << M), halves | np.uint32(128 << M))
    words = np.arange(1 << 21, dtype=np.uint32)
    words = words[((words >> M) & 255 != 255) & ((words >> M != 0) | (words == 0))]
    check(harness, M, "exp2", np.full_like(words, 127 << M), words)


@pytest.mark.parametrize("M", FORMATS)
def test_pipelines(harness: Harness, M: int) -> None:
    """Every number of stages against none, with pauses."""
    rng = random(400 + M)
    n = 20_000
    pairs = [pair for kind, pair in operand_kinds(rng, n // 8, M).items()] + [anything(rng, n, M)]
    a, b = (np.concatenate(side) for side in zip(*pairs))
    order = rng.permutation(a.size)
    for rate in (1.0, 0.5):
        enable = (rng.random(a.size) < rate).astype(np.uint8)
        assert not harness.pipes(M, a[order], b[order], enable).any()


@pytest.mark.parametrize(
    ("unit", "parameters", "message"),
    [
        ("flk_ff_add", {"ExpBits": 1}, "ExpBits must be at least 2"),
        ("flk_ff_add", {"Stages": 4}, "Stages must be 0 to 3"),
        ("flk_ff_mul", {"ManBits": 2}, "ManBits at least 3"),
        ("flk_ff_mul", {"Stages": 5}, "Stages must be 0 to 4"),
        ("flk_ff_poly", {"Stages": 5}, "Stages must be 0 to 4"),
        ("flk_ff_exp2", {"FracBits": 15}, "FracBits 1 to 14"),
        ("flk_ff_from_fixed", {"Bits": 65}, "Bits must be 2 to 64"),
        ("flk_ff_to_fixed", {"Bits": 49}, "Bits must be 2 to 48"),
        ("flk_ff_to_fixed", {"Stages": 3}, "Stages must be 0 to 2"),
    ],
)
def test_illegal_parameters(unit: str, parameters: dict[str, int], message: str) -> None:
    refused(unit, parameters, message)
