"""Tile walker: every entry, in order, and each splat's end against the golden `tiles_of`; splats of the demo scene and made-up ones.

State space: splats of one band to 512, of one tile to 65,536, without pixels, with bands that hold nothing, with gaps between two bands' intervals, at the
edges of pictures up to 4096x4096; idle and back-pressure patterns; reset with splats inside. Both kinds of lists. Parameter space: the defaults; with SLOW=1
the least queues, and a band every two cycles.
Noise at the input beside splats; the bounds of empty splats are noise.
"""

from __future__ import annotations

import ctypes
import random as stdlib_random
from functools import cache
from itertools import islice
from pathlib import Path

import numba
import numpy as np
import pytest
from datapath_bench import Bench
from flicker_tb import stalls
from flicker_tb.runner import seed

from flicker.arithmetic.ff import ff_bits, ff_round
from flicker.front.view import DEMO, load_view
from flicker.golden.front import frame, reach
from flicker.golden.front.setup import FORMATS
from flicker.golden.front.splat import MEAN_BITS
from flicker.scene.camera import Camera
from flicker.scene.packed import PackedFormat, PackedScene
from flicker.scene.packing import pack
from flicker.toolchain import verilate

HERE = Path(__file__).parent
S = FORMATS.shape
# listed_t and entry_t of flk_preproc_pkg, first field highest.
MEAN = MEAN_BITS + 1
LISTED = (("seq", 12), ("number", 24), ("key", 24), ("empty", 1), ("x", MEAN), ("y", MEAN), ("x0", 12), ("x1", 12), ("y0", 12), ("y1", 12),
          ("right", MEAN_BITS), ("l2", 9 + S), ("i0", 9 + S), ("kappa", 9 + S), ("limit", 9 + S))
ENTRY = (("seq", 12), ("row", 8), ("column", 8), ("key", 24), ("number", 24), ("mask", 4))
BITS = sum(b for _, b in LISTED)
IN_WORDS, OUT_WORDS = -(-BITS // 32), 3
NUMBERS = ("l2", "i0", "kappa", "limit")
COLS = 256

Columns = dict[str, np.ndarray]


def random(stream: int) -> np.random.Generator:
    return np.random.default_rng([seed(), 78, stream])


@cache
def walker(**parameters: int) -> ctypes.CDLL:
    flags = f"-DVL_USER_STOP -DVL_USER_FATAL -DIN_WORDS={IN_WORDS} -DOUT_WORDS={OUT_WORDS} -DIN_MASK={(1 << BITS % 32) - 1}u -DSEED={seed() % (2**31 - 1) or 1}"
    path = verilate("flk_tile_walker", parameters=parameters, args=["--assert", "--x-assign", "unique", "--x-initial", "unique"],
                    cpp=[HERE / "walker_harness.cpp"], cflags=flags, shared=True)
    library = ctypes.CDLL(str(path))
    library.error.restype = ctypes.c_char_p
    return library


@numba.njit
def _golden(box, splats, numbers, empty, cols, M, tile, mask, count):
    """Entries of splats (x, y, x0, x1, y0, y1, right; l2, i0, kappa, limit); their number. Empty arrays: only the number."""
    n = 0
    for j in range(len(splats)):
        a, b = splats[j], numbers[j]
        count[j] = 0
        if not empty[j]:
            r = reach.Reach(a[2], a[3], a[4], a[5], b[1], b[2], b[3], a[6])
            count[j] = reach.tiles_of(box, a[0], a[1], b[0], r, cols, M, n, tile, mask)
        n += count[j]
    return n


def golden(splats: Columns, box: bool, cols: int = COLS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Entries of each splat; tile and mask of each entry."""
    places = np.stack([splats[k] for k in ("x", "y", "x0", "x1", "y0", "y1", "right")], 1)
    numbers = np.stack([splats[k] for k in NUMBERS], 1)
    count = np.zeros(len(places), np.int64)
    tile, mask = np.empty(0, np.int32), np.empty(0, np.uint8)
    for _ in range(2):
        n = _golden(box, places, numbers, splats["empty"], cols, S, tile, mask, count)
        tile, mask = np.empty(n, np.int32), np.empty(n, np.uint8)
    _golden(box, places, numbers, splats["empty"], cols, S, tile, mask, count)
    return count, tile, mask


def words(splats: Columns) -> np.ndarray:
    """uint32 (n, IN_WORDS)."""
    codes = {k: [ff_bits(v, S) for v in splats[k].tolist()] if k in NUMBERS else splats[k].tolist() for k, _ in LISTED}
    out = bytearray()
    for j in range(len(splats["x"])):
        word = 0
        for name, bits in LISTED:
            word = word << bits | int(codes[name][j]) & (1 << bits) - 1
        out += word.to_bytes(4 * IN_WORDS, "little")
    return np.frombuffer(bytes(out), np.uint32).reshape(-1, IN_WORDS)


def entries_of(raw: np.ndarray) -> Columns:
    low = raw[:, 0].astype(np.uint64) | raw[:, 1].astype(np.uint64) << np.uint64(32)
    columns, at = {}, 0
    for name, bits in reversed(ENTRY):
        if at < 64 <= at + bits:  # the field across the words
            value = low >> np.uint64(at) | raw[:, 2].astype(np.uint64) << np.uint64(64 - at)
        else:
            value = low >> np.uint64(at) if at < 64 else raw[:, 2].astype(np.uint64) >> np.uint64(at - 64)
        columns[name] = (value & np.uint64((1 << bits) - 1)).astype(np.int64)
        at += bits
    return columns


class Run:
    """Splats through the walker. cycles: from the first one offered to the last output."""

    def __init__(self, splats: Columns, box: bool, idle: str = "never", stall: str = "never", limit: int | None = None, room: int = 0, **parameters: int):
        library, n = walker(**parameters), len(splats["x"])
        source, room = words(splats), room or 1 << 21
        out, done, result = np.zeros((room, OUT_WORDS), np.uint32), np.zeros(n, np.int64), np.zeros(4, np.int64)
        rng = stdlib_random.Random(f"{seed()} {idle} {stall} {n}")
        patterns = [np.array(list(islice(stalls.make(name, rng), 4093)), np.uint8) for name in (idle, stall)]
        for pattern in patterns:
            pattern[7] = 0
        p = lambda a: ctypes.c_void_p(a.ctypes.data)  # noqa: E731
        library.run(ctypes.c_int64(n), p(np.ascontiguousarray(source)), p(out), ctypes.c_int64(room), p(done), int(box), p(patterns[0]), p(patterns[1]),
                    ctypes.c_int64(4093), ctypes.c_int64(limit or 10_000_000), ctypes.c_uint64(seed()), p(result))
        error = library.error().decode()
        assert not error, error
        self.count, self.finished, self.cycles, self.first = (int(v) for v in result)
        self.done, self.entries = done, entries_of(out[: min(self.count, room)])


def check(splats: Columns, box: bool, idle: str = "never", stall: str = "never", **parameters: int) -> Run:
    count, tile, mask = golden(splats, box)
    run = Run(splats, box, idle, stall, room=len(tile) + 100, **parameters)
    of = np.repeat(np.arange(len(count)), count)
    want = {"seq": splats["seq"][of], "row": tile // COLS, "column": tile % COLS, "key": splats["key"][of], "number": splats["number"][of], "mask": mask}
    n = min(run.count, len(tile))
    for name, column in want.items():
        bad = np.flatnonzero(run.entries[name][:n] != column[:n])
        assert not len(bad), f"{name} of entry {bad[0]}, splat {of[bad[0]]}: {run.entries[name][bad[0]]} instead of {column[bad[0]]}"
    assert run.count == len(tile), f"{run.count} entries, {len(tile)} due"
    assert run.finished == len(count), f"{run.finished} splats finished of {len(count)}"
    assert np.array_equal(run.done, np.cumsum(count)), "ends of splats"
    return run


def tagged(splats: Columns, rng: np.random.Generator) -> Columns:
    """With seq, number and key; what an empty splat says otherwise is noise."""
    n = len(splats["x"])
    splats |= {"seq": (np.arange(n) + rng.integers(0, 4096)) % 4096, "number": rng.integers(0, 1 << 24, n), "key": rng.integers(0, 1 << 24, n)}
    empty = splats["empty"]
    for name, bits in LISTED:
        if name not in ("seq", "number", "key", "empty", *NUMBERS):
            top = 1 << (bits - 1)
            low, high = (-top, top) if name in ("x", "y", "right") else (0, 2 * top)
            splats[name] = np.where(empty, rng.integers(low, high, n), splats[name])
    return splats


# ---- made-up splats ----------------------------------------------------------------------------------


def made_up(rng: np.random.Generator, n: int, width: int = 4096, height: int = 4096, largest: float = 300.0) -> Columns:
    """Ellipses of any size and slant, about the picture."""
    radius = np.exp(rng.uniform(np.log(0.3), np.log(largest), (n, 2)))  # half width of a row, half height
    slant = rng.normal(0.0, 1.0, n) * np.where(rng.random(n) < 0.4, 30.0, 0.7)
    limit = np.log2(rng.integers(1, 256, n))
    reach_y = radius[:, 1] * np.sqrt(limit)
    reach_x = radius[:, 0] * np.sqrt(limit) + np.abs(slant) * reach_y
    x, y = rng.uniform(-60, width + 60, n), rng.uniform(-60, height + 60, n)
    edge = rng.random((n, 2)) < 0.15
    x, y = np.where(edge[:, 0], rng.choice([0.0, width - 1.0], n), x), np.where(edge[:, 1], rng.choice([0.0, height - 1.0], n), y)
    cut = rng.uniform(0.3, 1.2, (n, 2))  # of the box
    splats = {"x": x * 128, "y": y * 128}
    splats |= {"x0": np.maximum(np.ceil(x - cut[:, 0] * reach_x), 0), "x1": np.minimum(np.floor(x + cut[:, 0] * reach_x), width - 1)}
    splats |= {"y0": np.maximum(np.ceil(y - cut[:, 1] * reach_y), 0), "y1": np.minimum(np.floor(y + cut[:, 1] * reach_y), height - 1)}
    splats["right"] = rng.uniform(-1.0, 1.0, n) * reach_y * 128
    splats = {k: v.astype(np.int64) for k, v in splats.items()}
    for name, value in (("l2", 1.0 / radius[:, 1]), ("i0", radius[:, 0]), ("kappa", slant), ("limit", limit)):
        splats[name] = np.array([ff_round(v, S) for v in value.tolist()])
    splats["empty"] = (splats["x0"] > splats["x1"]) | (splats["y0"] > splats["y1"]) | (rng.random(n) < 0.02)
    return tagged(splats, rng)


def whole(box: bool, size: int = 4096) -> Columns:
    """One splat over all tiles of a picture."""
    splats = {"x": size * 64, "y": size * 64, "x0": 0, "x1": size - 1, "y0": 0, "y1": size - 1, "right": 0}
    splats |= {"l2": 2.0**-14, "i0": 2.0**14, "kappa": 0.0, "limit": 8.0, "empty": False, "seq": 4095, "number": (1 << 24) - 1, "key": 1}
    return {k: np.array([v]) for k, v in splats.items()}


def joined(*parts: Columns) -> Columns:
    return {k: np.concatenate([part[k] for part in parts]) for k in parts[0]}


def boxes(bounds: list[tuple[int, int, int, int]]) -> Columns:
    """For box lists: x0, x1, y0, y1."""
    n = len(bounds)
    splats = {name: np.array(column) for name, column in zip(("x0", "x1", "y0", "y1"), zip(*bounds))}
    splats |= {name: np.zeros(n, np.int64) for name in ("x", "y", "right")} | {name: np.ones(n) for name in NUMBERS}
    return tagged(splats | {"empty": np.zeros(n, np.bool_)}, random(9))


@pytest.mark.parametrize(("idle", "stall"), [("never", "never"), ("half", "half"), ("never", "heavy"), ("heavy", "never"), ("bursts", "bursts")])
@pytest.mark.parametrize("box", [False, True])
def test_made_up(box: bool, idle: str, stall: str) -> None:
    rng = random(1)
    splats = made_up(rng, 500, 4096, 4096, 60.0 if box else 250.0)
    count, _, mask = golden(splats, box)
    assert splats["empty"].any() and (box or (count[~splats["empty"]] == 0).any()) and count.max() > 60
    check(splats, box, idle, stall)


def test_gaps() -> None:
    """Bands of a tile row whose intervals lie apart: tiles between them have no entry."""
    rng = random(2)
    splats = made_up(rng, 400, largest=20.0)
    thin = ~splats["empty"]
    splats["kappa"] = np.array([ff_round(v, S) for v in rng.choice([-60.0, -25.0, 25.0, 60.0], 400).tolist()])
    splats["i0"] = np.full(400, 0.5)
    splats["x0"], splats["x1"] = np.where(thin, 0, splats["x0"]), np.where(thin, 4095, splats["x1"])
    count, tile, _ = golden(splats, box=False)
    of = np.repeat(np.arange(len(count)), count)
    assert ((np.diff(tile) > 1) & (np.diff(tile // COLS) == 0) & (np.diff(of) == 0)).sum() > 100
    check(splats, False, "rare", "rare")


@pytest.mark.parametrize("box", [False, True])
def test_whole_picture(box: bool) -> None:
    """65,536 entries of one splat, one a cycle; others before and behind it."""
    some = made_up(random(3), 40, largest=20.0)
    run = check(joined(some, whole(box), some), box)
    assert run.count > 65536
    run = check(whole(box), box)
    assert run.count == 65536 and run.cycles - run.first == 65536


@pytest.mark.slow
def test_least_queues() -> None:
    check(made_up(random(4), 300, largest=50.0), False, "rare", "half", Splats=2, Rows=1, Interval=2)


@pytest.mark.slow
def test_every_other_cycle() -> None:
    """A band every two cycles in: splats without entries take two each."""
    n = 300
    splats = joined(made_up(random(10), n), whole(False), tagged(made_up(random(11), n) | {"empty": np.ones(n, np.bool_)}, random(12)))
    for idle, stall in (("never", "never"), ("half", "half"), ("bursts", "heavy")):
        check(splats, False, idle, stall, Interval=2)
    run = check(tagged(made_up(random(11), n) | {"empty": np.ones(n, np.bool_)}, random(12)), False, Interval=2)
    assert 2 * n <= run.cycles < 2.08 * n + 40


def test_only_empty() -> None:
    """Splats without entries are finished, one a cycle."""
    n = 300
    splats = made_up(random(5), n) | {"empty": np.ones(n, np.bool_)}
    run = check(tagged(splats, random(6)), False)
    assert run.count == 0 and run.finished == n and run.cycles < 1.08 * n + 40


def test_reset_with_splats_inside() -> None:
    splats = made_up(random(7), 60, largest=40.0)
    for limit in (20, 37, 45, 80, 200):
        Run(splats, False, "rare", "half", limit=limit)
        check(splats, False)


def test_rates() -> None:
    """A band a cycle in, an entry a cycle out. Latency, from a tile row's last band to its first entry: that of the pipeline, and 3."""
    latency = Bench("flk_splat_band").latency
    one = boxes([(8 * (k % 500), 8 * (k % 500) + 7, 16 * (k % 200), 16 * (k % 200) + 15) for k in range(400)])  # two bands, one entry
    run = check(one, True)
    assert run.first == latency + 4 and run.cycles - run.first == 2 * 400 - 1
    four = boxes([(0, 63, 16 * (k % 200), 16 * (k % 200) + 15) for k in range(400)])  # two bands, four entries
    run = check(four, True)
    assert run.cycles - run.first == 4 * 400
    single = boxes([(16, 23, 8 * (k % 500), 8 * (k % 500) + 7) for k in range(1000)])  # one band, one entry
    run = check(single, True)
    assert run.first == latency + 3 and run.cycles - run.first <= max(1.0, (latency + 3) / 33) * 1000  # 33 splats are kept
    missed = boxes([(3000, 4000, 16 * (k % 100), 16 * (k % 100) + 15) for k in range(200)])  # two bands that hold nothing, far from the mean
    run = check(missed, False)
    assert run.count == 0 and run.cycles < 2 * 200 + 40
    mixed = boxes([(0, 16 * (1 + 7 * (k % 2)) - 1, 32, 32 + 16 * (1 + 2 * (k % 2)) - 1) for k in range(300)])  # 2 bands and entry; 6 and 24
    run = check(mixed, True)
    assert run.cycles - run.first <= 150 * 25 + 1


# ---- the demo scene ----------------------------------------------------------------------------------


@cache
def demo() -> tuple[PackedScene, Camera]:
    view = load_view(DEMO, 0)
    return pack(view.scene, PackedFormat.CHUNK).packed, view.camera


@cache
def listed(size: tuple[int, int], lists: frame.ListKind) -> tuple[Columns, frame.FrontFrame]:
    """Splats of a frame, and the frame."""
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    entries = frame._entries

    def watch(start, places, numbers, *more):
        seen.append((places, numbers))
        entries(start, places, numbers, *more)

    packed, camera = demo()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frame, "_entries", watch)
        result = frame.run_front(packed, camera.resized(*size), lists)
    ((places, numbers),) = seen
    splats = {name: places[:, k] for k, name in enumerate(("x", "y", "x0", "x1", "y0", "y1", "right"))}
    splats |= {name: numbers[:, k] for k, name in enumerate(NUMBERS)}
    splats |= {"empty": np.zeros(len(places), np.bool_), "seq": np.arange(len(places)) % 4096, "number": result.number, "key": result.key.astype(np.int64)}
    return splats, result


@pytest.mark.parametrize(("size", "lists"), [((320, 180), frame.ListKind.ELLIPSE), ((320, 180), frame.ListKind.BOX), ((640, 360), frame.ListKind.ELLIPSE),
                                             ((640, 360), frame.ListKind.BOX)])
def test_demo_scene(size: tuple[int, int], lists: frame.ListKind) -> None:
    """Runs of neighbouring splats from all over the scene."""
    splats, whole_frame = listed(size, lists)
    n = len(splats["x"])
    start = random(8).integers(0, n - 400, 8)
    index = np.concatenate([np.arange(s, s + 400) for s in start])
    box = lists is frame.ListKind.BOX
    some = {k: v[index] for k, v in splats.items()}
    count, tile, mask = golden(some, box, -(-size[0] // 16))
    first = np.searchsorted(whole_frame.entry_splat, index)
    of = np.repeat(first - np.cumsum(count) + count, count) + np.arange(len(tile))
    assert np.array_equal(whole_frame.entry_tile[of], tile) and np.array_equal(whole_frame.entry_mask[of], mask)
    run = check(some, box, "rare", "rare")
    assert run.count == len(tile)
    check(some, box)
