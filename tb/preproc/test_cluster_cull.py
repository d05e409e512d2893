"""Cluster cull against the golden model: which clusters are kept and in what order, and counts, under pauses on all sides.

Covered: the demo scene, tables of numbers from all over their range (subnormal ones too) and of every length up to 40, none and all kept, one
cluster, frames one after the other and after a reset in a frame, errors of the memory at each beat, numbers that are not finite, rates.
A table of more than 2**16 clusters. Not covered: of more than 2**17.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from itertools import product

import numpy as np
import pytest
from fetch_bench import BEAT, PAUSES, FetchBench, Outcome, codes, packed_bits
from flicker_tb.runner import seed

from flicker.front.view import DEMO, load_view
from flicker.golden.front import cull
from flicker.golden.front.setup import CLUSTER_M, FrameSetup
from flicker.scene.demo import demo_cameras
from flicker.scene.packed import CHUNK_HEADER, TABLE_ENTRY, PackedFormat, PackedScene
from flicker.scene.packing import pack

BASE = 0x1_2345_6000
PORT = {"stall": {"AR": 0.3, "R": 0.3}, "run": {"R": 5}}


@cache
def bench() -> FetchBench:
    return FetchBench("cluster_cull_bench", 3, 960)


@cache
def demo() -> tuple[PackedScene, FrameSetup]:
    view = load_view(DEMO, 0, (640, 360))
    return pack(view.scene, PackedFormat.CHUNK).packed, FrameSetup.of(view.camera)


def scene(table: np.ndarray) -> PackedScene:
    """A scene of which the cull sees but the table."""
    return PackedScene(PackedFormat.CHUNK, table, np.zeros(len(table), CHUNK_HEADER), np.zeros((16, 3), np.uint32), np.zeros(BEAT, np.uint8))


def wild_table(rng: np.random.Generator, n: int, low: int = 0, high: int = 254) -> np.ndarray:
    """Floats with exponent codes low to high; some zeros."""
    def floats(shape: tuple[int, ...], signed: bool = True) -> np.ndarray:
        bits = rng.integers(0, 1 + signed, shape) << 31 | rng.integers(low, high + 1, shape) << 23 | rng.integers(0, 1 << 23, shape)
        bits[rng.random(shape) < 0.05] &= 1 << 31
        return bits.astype(np.uint32)

    table = np.zeros(n, TABLE_ENTRY)
    table["low"], table["high"] = floats((n, 3)).view(np.float32), floats((n, 3)).view(np.float32)
    table["sigma"] = floats((n,), False) >> 16
    table["last"], table["flags"], table["first"] = rng.integers(0, 256, n), rng.integers(0, 4, n), rng.integers(0, 1 << 20, n)
    return table


def near_table(rng: np.random.Generator, n: int, setup: FrameSetup) -> np.ndarray:
    """Boxes in front of a camera at the origin, at depths of all sizes."""
    table = wild_table(rng, n)
    depth = 2.0 ** rng.uniform(-4, rng.choice([-1, 2, 20, 100]), n)
    middle = depth[:, None] * (setup.normal[0] + rng.normal(scale=0.2, size=(n, 3)))
    size = (depth * rng.choice([1e-7, 0.01, 0.3], n))[:, None] * rng.random((n, 3))
    table["low"], table["high"] = middle - size, middle + size
    table["sigma"] = (depth * 0.01).astype(np.float32).view(np.uint32) >> 16
    return table


def registers(setup: FrameSetup, beat: int, clusters: int) -> int:
    """As cluster_cull_bench has them; of a packed struct the last field lies lowest."""
    fields = codes(setup.reach, CLUSTER_M) + codes(setup.offset, CLUSTER_M) + codes(setup.normal, CLUSTER_M) + codes(setup.position, CLUSTER_M)
    return packed_bits(*fields, (beat, 34), (clusters, 24))


def contents(table: np.ndarray) -> bytes:
    data = table.tobytes()
    return data + bytes(-len(data) % BEAT)


def check(outcome: Outcome, packed: PackedScene, setup: FrameSetup) -> np.ndarray:
    """Returns which clusters are kept."""
    want = cull.cull(packed, setup)
    table, kept = packed.table, np.flatnonzero(want)
    assert outcome.done
    ends = outcome.field(54, 1)
    assert ends.tolist() == [0] * len(kept) + [1]
    for name, got, expected in (
        ("degree", outcome.field(0, 2), table["flags"] & 3), ("last", outcome.field(2, 8), table["last"]),
        ("first", outcome.field(10, 20), table["first"]), ("index", outcome.field(30, 24), np.arange(len(table))),
    ):
        assert np.array_equal(got[:-1], expected[kept].astype(np.int64)), name
    assert outcome.status[:3] == [0, int((~want).sum()), int(packed.counts[~want].sum())]
    return want


def test_numbers() -> None:
    """Tables of all lengths, numbers of all sizes, one frame after the other."""
    rng = np.random.default_rng([seed(), 31])
    setup = FrameSetup.of(demo_cameras()[0])
    tiny = lambda n: np.where(rng.random(n) < 0.5, 0.0, 2.0**-126 * (1.0 + rng.integers(0, 8, n) / 8) * rng.choice([-1, 1], n))  # noqa: E731
    cases = []
    for n in [*range(41), 300]:
        near = dataclasses.replace(setup, position=np.zeros(3), offset=np.array([-0.19998779296875, 0.0, 0.0, 0.0, 0.0]))
        cases.append((wild_table(rng, n), setup))
        cases.append((near_table(rng, n, setup), near))
        turned = near_table(rng, n, setup)  # boxes whose farthest corner is nearer than the nearest
        turned["low"], turned["high"] = turned["high"].copy(), turned["low"].copy()
        cases.append((turned, near))
        for _ in range(8 if n == 300 else 0):
            # Where a subnormal number would matter: boxes and camera next to nothing, normals that make much of it, mostly no sigma that makes more.
            small = dataclasses.replace(near, position=tiny(3), normal=near.normal * 2.0**60, reach=np.full(5, 2.0**127), offset=tiny(5) * 2.0**60)
            table = wild_table(rng, 1000, 0, 1)
            table["sigma"][rng.random(1000) < 0.9] = 0
            cases.append((table, small))
    data, base, places = {}, BASE, []
    for table, _ in cases:
        places.append(base)
        if len(table):
            data[base] = contents(table)
        base += len(table) * 32 // BEAT * BEAT + BEAT
    unit = bench()
    unit.open(data, stall={"R": 0.2}, latency=7)
    kinds = set()
    for (table, registers_of), place in zip(cases, places):
        packed = scene(table)
        outcome = unit.frame(registers(registers_of, place // BEAT, len(table)), stall=str(rng.choice(list(PAUSES))))
        want = check(outcome, packed, registers_of)
        kinds |= {(len(table) > 0, bool(want.any()), bool(want.all()))}
    assert kinds >= {(False, False, True), (True, True, True), (True, True, False), (True, False, False)}


def test_a_long_table() -> None:
    """More clusters than 16 bits number, most of them culled; the last ones are kept."""
    rng = np.random.default_rng([seed(), 33])
    setup = FrameSetup.of(demo_cameras()[0])
    near = dataclasses.replace(setup, position=np.zeros(3), offset=np.array([-0.19998779296875, 0.0, 0.0, 0.0, 0.0]))
    n = (1 << 16) + 37
    table = near_table(rng, n, setup)
    table["low"][:-5] *= -1
    table["high"][:-5] *= -1
    unit = bench()
    unit.open({BASE: contents(table)}, latency=7)
    want = check(unit.frame(registers(near, BASE // BEAT, n), limit=16 * n + 2000), scene(table), near)
    assert want[-5:].any() and want[: 1 << 16].mean() < 0.5


def test_errors() -> None:
    """An answer with an error at any beat: the frame ends, what was kept before it is right, and the next frame is whole."""
    packed, setup = demo()
    n = 37
    table = packed.table[:n].copy()
    small = scene(table)
    want = np.flatnonzero(cull.cull(small, setup))
    assert len(want)
    unit, other = bench(), BASE + 0x10000
    for beat in range(19):
        unit.open({BASE: contents(table), other: contents(table)}, latency=1 + 20 * (beat % 4), **PORT)
        unit.fail(BASE + BEAT * beat)
        for stall in ("never", "bursts"):
            outcome = unit.frame(registers(setup, BASE // BEAT, n), stall=stall)
            assert outcome.done and outcome.status[0] & 1
            assert outcome.field(54, 1).tolist() == [0] * (len(outcome.when) - 1) + [1]
            got = outcome.field(30, 24)[:-1]
            assert np.array_equal(got, want[: len(got)]) and (not len(got) or got[-1] < 2 * beat)
            check(unit.frame(registers(setup, other // BEAT, n), stall=stall), small, setup)


def test_damaged_tables() -> None:
    """A bound or a sigma that is not finite, in any entry: the frame ends and says so, what was kept before it is right, the next one is whole."""
    rng = np.random.default_rng([seed(), 33])
    packed, setup = demo()
    n = 37
    table = packed.table[:n].copy()
    small = scene(table)
    kept = np.flatnonzero(cull.cull(small, setup))
    assert len(kept)
    unit, other = bench(), BASE + 0x10000
    for turn, (name, k) in enumerate([*product(("low", "high"), range(3)), ("sigma", 0)]):
        for entry in (0, n - 1, int(rng.integers(n))):
            bad = table.copy()
            if name == "sigma":
                bad[name][entry] = rng.choice([0x7F80, 0x7FC0, 0xFFFF])
            else:
                bad[name].view(np.uint32)[entry, k] = rng.choice([0x7F800000, 0xFF800000, 0x7FC00001, 0xFFFFFFFF])
            unit.open({BASE: contents(bad), other: contents(table)}, latency=1 + 20 * (turn % 4), **PORT)
            for stall in ("never", "bursts"):
                outcome = unit.frame(registers(setup, BASE // BEAT, n), stall=stall)
                assert outcome.done and outcome.status[0] == 2, (name, k, entry)
                assert outcome.field(54, 1).tolist() == [0] * (len(outcome.when) - 1) + [1]
                got = outcome.field(30, 24)[:-1]
                assert np.array_equal(got, kept[: len(got)]) and (not len(got) or got[-1] < entry)
                check(unit.frame(registers(setup, other // BEAT, n), stall=stall), small, setup)


def test_reset_in_a_frame() -> None:
    packed, setup = demo()
    unit = bench()
    unit.open({BASE: packed.sections()["table"]}, latency=30)
    what = registers(setup, BASE // BEAT, len(packed.table))
    for cycle in (1, 5, 33, 200, 700, 1400):
        assert not unit.frame(what, reset_at=cycle).done
        unit.open({BASE: packed.sections()["table"]}, latency=30)
    check(unit.frame(what), packed, setup)


@pytest.mark.parametrize(("latency", "perfect"), [(1, True), (100, True), (200, True), (100, False)])
def test_rate(latency: int, perfect: bool) -> None:
    """A cluster every sixteen cycles, whatever the latency. perfect: a memory without DRAM."""
    packed, setup = demo()
    n = len(packed.table)
    unit = bench()
    unit.open({BASE: packed.sections()["table"]}, perfect, latency=latency)
    dram = 0 if perfect else 50  # an access to a closed row
    outcome = unit.frame(registers(setup, BASE // BEAT, n))
    want = check(outcome, packed, setup)
    print(f"latency {latency}: {n} clusters in {outcome.cycles} cycles, first kept cluster in cycle {outcome.when[0]}, last element in {outcome.when[-1]}")
    assert 16 * n < outcome.cycles <= 16 * n + latency + dram + 100
    assert outcome.when[0] - 16 * int(np.flatnonzero(want)[0]) <= latency + dram + 70


@pytest.mark.parametrize("perfect", [True, False])
def test_demo(perfect: bool) -> None:
    packed, setup = demo()
    part = packed.sections()["table"]
    unit = bench()
    unit.open({BASE: part}, perfect, **PORT)
    for stall in PAUSES:
        outcome = unit.frame(registers(setup, BASE // BEAT, len(packed.table)), stall=stall)
        want = check(outcome, packed, setup)
        assert want.any() and not want.all()
    assert unit.waits == 0
