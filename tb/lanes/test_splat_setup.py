"""flk_splat_setup against golden.lanes.setup, bit for bit: records of any bits, near ones, sums that cancel or saturate, ties."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numba
import numpy as np
import pytest
from flicker_tb.runner import seed
from pipeline_bench import SPLAT, SPLAT_BITS, Bench, unpack_splat

from flicker.golden.front.record import encode_mean
from flicker.golden.lanes.formats import FORMATS, OPACITIES, tables
from flicker.golden.lanes.setup import MIDDLE, SplatSetup, fields_of, splat_setup
from flicker.params import LANE_SETUP_STAGES, SUBTILE_COORD_BITS

T = tables(FORMATS)
COORDS = 1 << SUBTILE_COORD_BITS
FIELDS = (*SplatSetup._fields, "e0", "m0", "e1", "m1", "e2", "m2")
TOP = T.top  # w and z saturate there and at its complement


@dataclass
class Records:
    """n records and the sub-tile of each. low, high: int64 (n,)."""

    low: np.ndarray
    high: np.ndarray
    col: np.ndarray
    row: np.ndarray


@cache
def bench() -> Bench:
    return Bench("flk_splat_setup", {"record_i": 128, "subtile_i": 2 * SUBTILE_COORD_BITS}, "splat_o", SPLAT_BITS, LANE_SETUP_STAGES)


def generator(stream: int) -> np.random.Generator:
    return np.random.default_rng([seed(), 88, stream])


@numba.njit
def _golden(low, high, col, row, t, out):
    for i in range(len(low)):
        s = splat_setup(low[i], high[i], col[i], row[i], t)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5], out[i, 6], out[i, 7] = s.x, s.y, s.p, s.q, s.w, s.z, s.s0, s.s1
        out[i, 8], out[i, 9], out[i, 10], out[i, 11], out[i, 12], out[i, 13] = s.s2, s.opacity, s.lo, s.red, s.green, s.blue
        f = fields_of(low[i], high[i])
        out[i, 14], out[i, 15], out[i, 16], out[i, 17], out[i, 18], out[i, 19] = f.e0, f.m0, f.e1, f.m1, f.e2, f.m2


def golden(r: Records) -> dict[str, np.ndarray]:
    out = np.zeros((len(r.low), len(FIELDS)), np.int64)
    _golden(r.low, r.high, r.col, r.row, T, out)
    return {name: out[:, k] for k, name in enumerate(FIELDS)}


def same(r: Records) -> dict[str, np.ndarray]:
    """Runs the unit and compares all fields; the golden values."""
    want = golden(r)
    subtile = r.row << SUBTILE_COORD_BITS | r.col
    got = unpack_splat(bench()(np.stack([r.low.view(np.uint64), r.high.view(np.uint64), subtile.view(np.uint64)], 1)))
    for name in SPLAT:
        bad = np.flatnonzero(got[name] != want[name])
        if len(bad):
            i = bad[0]
            record = f"{r.high.view(np.uint64)[i]:016x}{r.low.view(np.uint64)[i]:016x} in ({r.col[i]}, {r.row[i]})"
            numbers = ", ".join(f"{k} {v[i]}" for k, v in want.items())
            pytest.fail(f"{name}: {len(bad)} of {len(r.low)} differ, first at {i}: {got[name][i]} instead of {want[name][i]}; record {record}: {numbers}")
    return want


# ---- records ---------------------------------------------------------------------------------------------


def records(rng: np.random.Generator, n: int, **given: np.ndarray | int) -> Records:
    """Random bits but for what is given. x, y: fields of 23 bits. e0, m0 and so on: exponent code and mantissa without the leading one."""
    widths = {
        "x": 23, "y": 23, "m0": 9, "e0": 5, "m1": 9, "e1": 5, "negative": 1, "m2": 9, "e2": 5, "opacity": 8, "red": 10, "green": 10, "blue": 10, "spiky": 1,
    }
    words, at = np.zeros((n, 2), np.uint64), 0
    for name, bits in widths.items():
        value = np.broadcast_to(given[name], n) if name in given else rng.integers(0, 1 << bits, n)
        assert (value >= 0).all() and (value < 1 << bits).all(), name
        word, shift = divmod(at, 64)
        words[:, word] |= value.astype(np.uint64) << np.uint64(shift)
        if shift + bits > 64:
            words[:, word + 1] |= value.astype(np.uint64) >> np.uint64(64 - shift)
        at += bits
    assert at == 128
    col, row = (np.broadcast_to(given.get(name, rng.integers(0, COORDS, n)), n).astype(np.int64) for name in ("col", "row"))
    return Records(words[:, 0].view(np.int64), words[:, 1].view(np.int64), col, row)


@numba.njit
def encode_means(x):
    out = np.empty(len(x), np.int64)
    for i in range(len(x)):
        out[i] = encode_mean(x[i])
    return out


def middle(coord: np.ndarray) -> np.ndarray:
    return (coord << 10) + MIDDLE


def some(rng: np.random.Generator, values, n: int) -> np.ndarray:
    return rng.choice(np.asarray(values), n)


def saturated(w: np.ndarray) -> np.ndarray:
    return (w == TOP) | (w == -TOP - 1)


# ---- tests -----------------------------------------------------------------------------------------------


def test_any_bits() -> None:
    """Nothing is no record; fields of all zeros and all ones among them."""
    rng, n = generator(1), 60_000
    words = rng.integers(0, 1 << 64, (n, 2), dtype=np.uint64)
    words[rng.random((n, 2)) < 0.02] = 0
    words[rng.random((n, 2)) < 0.02] = np.uint64((1 << 64) - 1)
    col, row = (np.where(rng.random(n) < 0.05, rng.choice([0, COORDS - 1], n), rng.integers(0, COORDS, n)) for _ in range(2))
    want = same(Records(words[:, 0].view(np.int64), words[:, 1].view(np.int64), col, row))
    for name in ("w", "z"):
        assert (want[name] == TOP).sum() > 1000 and (want[name] == -TOP - 1).sum() > 1000 and (~saturated(want[name])).sum() > 1000
    assert len(np.unique(want["opacity"])) == OPACITIES and np.array_equal(np.unique(want["lo"]), np.unique(T.lo))


def test_near() -> None:
    """Splats of all sizes with their mean about the sub-tile, of every opacity."""
    rng, n = generator(2), 40_000
    col, row = rng.integers(0, COORDS, n), rng.integers(0, COORDS, n)
    reach = (2.0 ** rng.uniform(0, 14, n)).astype(np.int64)
    x, y = (middle(c) + (rng.uniform(-1, 1, n) * reach).astype(np.int64) for c in (col, row))
    size = np.clip(31 - np.log2(reach / 64).astype(np.int64), 1, 31)
    e = {f"e{k}": np.clip(size - rng.integers(-2, 8, n), 0, 31) for k in range(3)}
    r = records(rng, n, x=encode_means(x), y=encode_means(y), col=col, row=row, opacity=np.arange(n) % OPACITIES, **e)
    want = same(r)
    free = ~saturated(want["w"]) & ~saturated(want["z"])
    assert free.sum() > n // 2 and (np.abs(want["w"][free]) > 1 << 14).sum() > 1000 and (want["w"] < 0).sum() > 1000 < (want["z"] < 0).sum()
    assert len(np.unique(want["x"] & 63)) == 64


def test_exponents() -> None:
    """The ends of the exponent codes, with means of every scale."""
    rng, n = generator(3), 30_000
    r = records(rng, n, **{f"e{k}": some(rng, (0, 0, 1, 2, 6, 7, 25, 26, 30, 31), n) for k in range(3)}, **{f"m{k}": some(rng, (0, 1, 2, 256, 510, 511), n)
                for k in range(3)})
    want = same(r)
    for k in range(3):
        for code in (0, 1, 31):
            assert (want[f"e{k}"] == code).sum() > 1000
    assert ((want["e0"] == 0) & (want["e1"] == 0)).sum() > 500 and (want["w"] == 0).sum() > 500


def test_cancelling() -> None:
    """Thin slanted splats far away: l0 X and l1 Y are large, their sum is not, or lies about where it saturates."""
    rng, n = generator(4), 60_000
    col, row = rng.integers(0, COORDS, n), rng.integers(0, COORDS, n)
    e0, m0, m1 = rng.integers(1, 32, n), rng.integers(0, 512, n), rng.integers(0, 512, n)
    # Y within 2^32, and of a mean whose own steps are not too long.
    x_far = (rng.choice([-1, 1], n) * 2.0 ** rng.uniform(8, 31.9, n)).astype(np.int64)
    e1 = np.clip(e0 + rng.integers(-3, 4, n), 1, 31)
    x_field = encode_means(middle(col) - x_far)
    x = middle(col) - _decoded(x_field)
    l0, l1 = (512.0 + m0) * 2.0 ** (e0 - 32), (512.0 + m1) * 2.0 ** (e1 - 32)
    wanted = some(rng, (0, TOP, -TOP - 1), n) + (rng.normal(size=n) * 2.0 ** rng.uniform(0, 18, n))
    negative = rng.integers(0, 2, n)
    y = np.clip((wanted - l0 * x) / np.where(negative, -l1, l1), -(2.0**32), 2.0**32).astype(np.int64)
    y_field = encode_means(middle(row) - y)
    want = same(records(rng, n, x=x_field, y=y_field, e0=e0, e1=e1, m0=m0, m1=m1, negative=negative, col=col, row=row))
    p, q, w = (want[name] for name in "pqw")
    large = np.minimum(np.abs(p), np.abs(q))
    assert ((large > 1 << 24) & ~saturated(w)).sum() > 1000 and ((large > 1 << 20) & ~saturated(w)).sum() > 5000
    # Sums next to the ends, on both sides; sums that leave few bits at the top; both signs of both.
    total = p + q
    assert (np.abs(total - TOP) < 64).sum() > 50 and (np.abs(total + TOP) < 64).sum() > 50
    for bits in (20, 21, 22, 23):
        assert ((total >> (bits - 1)) == 1).sum() > 20 < ((total >> (bits - 1)) == -2).sum()
    assert ((p > 0) & (q < 0) & ~saturated(w)).sum() > 1000 < ((p < 0) & (q > 0) & ~saturated(w)).sum()


@numba.njit
def _decoded(field):
    number = field & 0xFFFFF
    return (number - ((number >> 19) << 20)) << (2 * (field >> 20))


def ends(rng: np.random.Generator, e: np.ndarray, m: np.ndarray) -> np.ndarray:
    """Distances whose product with a shape number is about where it saturates, within 2^18."""
    value = some(rng, (TOP + 0.5, -TOP - 1.5), len(e)) + rng.normal(size=len(e)) * 2.0 ** rng.uniform(-2, 8, len(e))
    return np.clip(value / ((512.0 + m) * 2.0 ** (e - 32)), -(2.0**18), 2.0**18).astype(np.int64)


def test_saturating() -> None:
    """One product that is just at an end: the rounding carries it there, or not."""
    rng, n = generator(5), 40_000
    col, row = rng.integers(0, 4, n), rng.integers(0, 4, n)
    e, m = rng.integers(23, 32, (2, n)), rng.integers(0, 512, (2, n))
    x, y = ends(rng, e[0], m[0]), ends(rng, e[1], m[1])
    want = same(records(
        rng, n, x=encode_means(middle(col) - x), y=encode_means(middle(row) - y), e0=e[0], m0=m[0], e1=0, e2=e[1], m2=m[1], col=col, row=row,
    ))
    for name, product, exp, distance in (("w", "m0", "e0", "x"), ("z", "m2", "e2", "y")):
        exact = want[product] * want[distance] / 2.0 ** (32 - want[exp])
        assert ((exact >= TOP + 0.5) & (exact < TOP + 1)).sum() > 20  # only the rounding saturates
        assert ((exact >= TOP) & (exact < TOP + 0.5)).sum() > 20 and ((exact > -TOP - 3) & (exact < -TOP)).sum() > 20
        assert (want[name] == TOP).sum() > 1000 < (want[name] == -TOP - 1).sum()


def test_ties() -> None:
    """Products and slopes that end in exactly a half go upwards, negative ones too."""
    rng, n = generator(6), 40_000
    col, row = rng.integers(0, 8, n), rng.integers(0, 8, n)
    e = rng.integers(14, 32, (3, n))
    m = rng.integers(0, 256, (3, n)) * 2 + 1
    odd = rng.integers(-15, 16, (2, n)) * 2 + 1
    # One distance serves l1 and l2: of one exponent here.
    x, y = odd[0] << (31 - e[0]), odd[1] << (31 - e[1])
    near = (np.abs(x) < 1 << 18) & (np.abs(y) < 1 << 18)
    x, y = np.where(near, x, 0), np.where(near, y, 0)
    want = same(records(
        rng, n, x=encode_means(middle(col) - x), y=encode_means(middle(row) - y), e0=e[0], e1=e[1], e2=e[1], m0=m[0], m1=m[1], m2=m[2], col=col, row=row,
    ))
    for number, distance in ((0, "x"), (1, "y"), (2, "y")):
        right = 32 - want[f"e{number}"]
        product = want[f"m{number}"] * want[distance]
        tie = product & ((1 << right) - 1) == 1 << (right - 1)
        assert (tie & (product > 0)).sum() > 1000 < (tie & (product < 0)).sum()
    tie = want["e1"] == 25  # a half slope of an odd mantissa
    assert (tie & (want["m1"] < 0)).sum() > 100 < (tie & (want["m1"] > 0)).sum()
