"""ff numbers (docs/ff.md): the model against numpy's float32 and exact rationals, error bounds of the functions, units against the model.

Not covered: mantissas other than those named in the tests; the units have no case of their own for them.
"""

from __future__ import annotations

from fractions import Fraction

import numba
import numpy as np
import pytest
from flicker_tb.runner import seed

from flicker.arithmetic import ff
from flicker.arithmetic import ff_tables as tables

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
    """|model - exact| in units in the last place of the exact result, for mantissas in [1, 4), of exp2 for exponents in [-2, 2)."""
    one = 1 + mantissas * 2.0**-M
    x = np.concatenate([one, 2 * one])
    if function == tables.EXP2:
        x = np.arange(-(2 << 14), 2 << 14).astype(np.float64)
    exact = (lambda: 1 / x, lambda: 1 / np.sqrt(x), lambda: np.sqrt(x), lambda: np.exp2(x / 2.0**14))[function]()
    ulp = np.exp2(np.frexp(exact)[1] - 1.0 - M)
    return np.abs(_function(function, x, M) - exact) / ulp


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
    """Every mantissa; prints what docs/ff.md has in its table."""
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
