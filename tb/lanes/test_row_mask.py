"""flk_row_mask against golden.lanes.mask, bit for bit: any numbers, splats about the sub-tile, pixels and rows exactly at the ends of intervals."""

from __future__ import annotations

from functools import cache

import numba
import numpy as np
import pytest
from flicker_tb.runner import seed
from pipeline_bench import SPLAT, SPLAT_BITS, Bench, pack_splat

from flicker.golden.lanes.formats import FORMATS, OPACITIES, tables
from flicker.golden.lanes.mask import row_interval, row_mask
from flicker.golden.lanes.setup import SplatSetup, column_step
from flicker.params import LANE_ROW_MASK_STAGES, SUBTILE_PIXELS

T = tables(FORMATS)
CUT = T.guard + T.drop
TOP = T.top
SLOPE_TOP = 1023 << 5  # the largest half slope
ALL = np.uint64((1 << SUBTILE_PIXELS) - 1)

Splats = dict[str, np.ndarray]


@cache
def bench() -> Bench:
    return Bench("flk_row_mask", {"splat_i": SPLAT_BITS}, "mask_o", SUBTILE_PIXELS, LANE_ROW_MASK_STAGES)


def generator(stream: int) -> np.random.Generator:
    return np.random.default_rng([seed(), 99, stream])


@numba.njit
def _splat(w, z, s0, s1, s2, opacity):
    return SplatSetup(0, 0, 0, 0, w, z, s0, s1, s2, opacity, 0, 0, 0, 0)


@numba.njit
def _golden(w, z, s0, s1, s2, opacity, t, masks, rows, columns):
    for i in range(len(w)):
        s = _splat(w[i], z[i], s0[i], s1[i], s2[i], opacity[i])
        masks[i] = row_mask(s, t)
        for j in range(8):
            r = row_interval(s, j, t)
            rows[i, j, 0], rows[i, j, 1], rows[i, j, 2], rows[i, j, 3] = r.s, r.y, r.rest, r.radius
            columns[i, j] = column_step(s, j) >> (t.guard + t.drop)


def golden(s: Splats) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masks uint64 (n,); s, y, rest and radius of each row, int64 (n, 8, 4); column terms, int64 (n, 8)."""
    n = len(s["w"])
    masks, rows, columns = np.zeros(n, np.int64), np.zeros((n, 8, 4), np.int64), np.zeros((n, 8), np.int64)
    _golden(s["w"], s["z"], s["s0"], s["s1"], s["s2"], s["opacity"], T, masks, rows, columns)
    return masks.view(np.uint64), rows, columns


def same(s: Splats) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Runs the unit and compares; the golden values."""
    want = golden(s)
    got = bench()(pack_splat(s | {"lo": T.lo[s["opacity"]]}))[:, 0]
    bad = np.flatnonzero(got != want[0])
    if len(bad):
        i = bad[0]
        numbers = ", ".join(f"{k} {v[i]}" for k, v in s.items())
        pytest.fail(f"{len(bad)} of {len(got)} differ, first at {i}: {got[i]:016x} instead of {want[0][i]:016x}; {numbers}")
    return want


def splats(rng: np.random.Generator, n: int, **given: np.ndarray) -> Splats:
    """Numbers of all sizes that flk_splat_setup can give, but for what is given."""
    size = lambda low, high: np.minimum(2.0 ** rng.uniform(low, high, n), SLOPE_TOP).astype(np.int64)  # noqa: E731
    sign = lambda: rng.choice([-1, 1], n)  # noqa: E731
    made = {
        "w": sign() * size(0, 19), "z": sign() * size(0, 18), "s0": size(-1, 15), "s1": sign() * size(-1, 15), "s2": size(-1, 15),
        "opacity": np.arange(n) % OPACITIES, **{c: rng.integers(0, 1024, n) for c in ("red", "green", "blue")},
    }
    return made | given


def inside(rng: np.random.Generator, n: int, **given: np.ndarray) -> Splats:
    """Splats whose middle lies in or about the sub-tile."""
    s = splats(rng, n, **given)
    place = rng.uniform(-9, 9, (2, n))
    s["w"] = np.clip(place[0] * s["s0"] + place[1] * s["s1"], -TOP - 1, TOP).astype(np.int64)
    s["z"] = np.clip(place[1] * s["s2"], -TOP - 1, TOP).astype(np.int64)
    return s


def test_bound_is_computed() -> None:
    """The unit takes -log2 of the opacity, not its code: the bound follows from it."""
    drop = 2 * FORMATS.mask - FORMATS.log
    assert drop >= 1
    assert np.array_equal(T.mask_bound, ((T.limit + 1 - T.lo) << drop) - (1 << (drop - 1)))
    assert np.array_equal(T.mask_bound - 1, ((T.limit - T.lo) << drop) + (1 << (drop - 1)) - 1)


def test_any_numbers() -> None:
    """All bits random, and the ends of what a field can hold."""
    rng, n = generator(1), 40_000
    s = splats(rng, n)
    for name in ("w", "z", "s0", "s1", "s2"):
        bits, signed = SPLAT[name]
        low, high = (-(1 << (bits - 1)), 1 << (bits - 1)) if signed else (0, 1 << bits)
        value = np.where(rng.random(n) < 0.2, rng.choice([low, low + 1, -1 if signed else 0, 0, 1, high - 1], n), rng.integers(low, high, n))
        s[name] = np.where(rng.random(n) < 0.5, value, s[name])
    s["opacity"] = rng.integers(0, OPACITIES, n)
    masks, _, columns = same(s)
    assert (masks == 0).sum() > 1000 < (masks != 0).sum()
    assert columns.max() == 895 and columns.min() == -896


def test_inside() -> None:
    rng, n = generator(2), 60_000
    s = inside(rng, n)
    masks, rows, columns = same(s)
    partial = (masks != 0) & (masks != ALL)
    assert partial.sum() > n // 4 and (masks == 0).sum() > 300 < (masks == ALL).sum()
    for bit in range(SUBTILE_PIXELS):
        on = (masks[partial] >> np.uint64(bit) & np.uint64(1)).sum()
        assert partial.sum() // 50 < on < partial.sum()
    # Each number of places that a rest is shifted, each opacity, both signs of what is compared.
    rest, radius = rows[..., 2], rows[..., 3]
    for p in range(T.root_shift + 1):
        low, high = (0 if p == 0 else 1 << (2 * p + T.root_bits - 2)), 1 << (2 * p + T.root_bits)
        assert ((rest >= low) & (rest < high)).sum() > 50, p
    address = np.where(rest >= 0, rest, 0)
    for _ in range(T.root_shift):
        address = np.where(address >> T.root_bits, address >> 2, address)
    assert set(range(1 << (T.root_bits - 2), 1 << T.root_bits)) <= set(address[rest >= 0].tolist())
    live = radius >= 0
    assert len(np.unique(s["opacity"][live.any(axis=1)])) == OPACITIES - 1
    for end in (radius - rows[..., 0], -radius - 3 - rows[..., 0]):
        for some in ((end >= 0), (end < 0), (end >= 1024), (end < -1024)):
            assert (live & some).sum() > 500
    assert ((columns[:, 3] == 0) & (columns[:, 4] == 0)).sum() > 100  # nothing was cut there


def test_pixels_at_ends() -> None:
    """w such that a pixel of a live row is on its interval's last place, or one beyond, on both sides."""
    rng, n = generator(3), 80_000
    s = inside(rng, n)
    _, rows, columns = golden(s)
    i, j, every = rng.integers(0, 8, n), rng.integers(0, 8, n), np.arange(n)
    radius = rows[every, j, 3]
    place = rows[every, j, 0] + columns[every, i]
    kind = rng.integers(0, 4, n)
    target = np.select([kind == 0, kind == 1, kind == 2], [radius, radius + 1, -radius - 2], -radius - 3)
    moved = s["w"] + ((target - place) << CUT)
    use = (radius >= 0) & (moved >= -TOP - 1) & (moved <= TOP)
    s["w"] = np.where(use, moved, s["w"])
    masks, rows, columns = same(s)
    bit = j // 4 * 32 + i // 4 * 16 + j % 4 * 4 + i % 4
    on = (masks >> bit.astype(np.uint64) & np.uint64(1)) == 1
    for k, expected in enumerate((True, False, True, False)):
        for column in range(8):
            chosen = use & (kind == k) & (i == column)
            assert chosen.sum() > 500 and (on[chosen] == expected).all()
            assert chosen[columns[every, i] != 0].any()


def test_rows_at_ends() -> None:
    """z such that a row is the last with pixels, or just has none; V of more bits than are squared is empty."""
    rng, n = generator(4), 40_000
    s = inside(rng, n)
    _, rows, _ = golden(s)
    j, every = rng.integers(0, 8, n), np.arange(n)
    last = np.array([int(np.sqrt(max(b - 1, 0))) for b in T.mask_bound])[s["opacity"]]
    least = np.where(rng.random(n) < 0.8, last + rng.integers(0, 2, n), rng.choice([254, 255, 256, 257, 511, 512, 513], n))
    target = np.where(rng.random(n) < 0.5, least, -1 - least)
    moved = s["z"] + ((target - rows[every, j, 1]) << CUT)
    use = (moved >= -TOP - 1) & (moved <= TOP)
    s["z"] = np.where(use, moved, s["z"])
    # u of the row about 0 in a column.
    _, rows, columns = golden(s)
    column = columns[every, rng.integers(0, 8, n)]
    s["w"] = np.clip(s["w"] - ((rows[every, j, 0] + column) << CUT), -TOP - 1, TOP)
    masks, rows, _ = same(s)
    rest, y = rows[every, j, 2], rows[every, j, 1]
    row = np.uint64(0xF000F) << (4 * (j % 4) + 32 * (j // 4)).astype(np.uint64)
    assert ((rest >= 0) & (rest < 8)).sum() > 200 and (rest == -1).sum() > 100
    assert (((masks & row) != 0) & (rest >= 0)).sum() > 5000 and not ((masks & row) != 0)[rest < 0].any()
    small = T.mask_bound[:, None] - 1 - np.arange(256) ** 2
    assert set(rest[(rest >= 0) & (rest < 16)].tolist()) == set(small[(small >= 0) & (small < 16)].tolist())
    for value in (255, 256, 512, -256, -257, -513):
        assert (y == value).sum() > 20
