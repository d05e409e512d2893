"""cocotb tests of flk_record_writer: records of beats dealt out to the lanes; the lines must be the beats in order, whole."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb import stalls
from flicker_tb.bench import Bench, rounds

LANES = 4


@dataclass
class Beat:
    """records: by place in the beat, those that come."""

    address: int
    records: dict[int, int]


class Writer:
    """The design between lanes and memory, one cycle at a time."""

    def __init__(self, dut) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.lanes = int(dut.Lanes.value)
        self.place_bits = len(dut.in_place_i) // self.lanes
        self.ring = 1 << self.place_bits - 2
        self.record_bits = len(dut.in_record_i) // self.lanes
        self.records = len(dut.out_data_o) // self.record_bits  # of a beat
        self.quarters = 4 // self.records  # of a record
        for name in ("in_valid", "in_place", "in_record", "beat_valid", "beat_data", "out_ready"):
            getattr(dut, f"{name}_i").value = 0

    async def reset(self) -> None:
        self.head = 0
        await self.bench.reset()

    def beats(self, count: int, full: bool = False) -> list[Beat]:
        beats = []
        for _ in range(count):
            every = range(self.records)
            come = every if full or self.rng.random() < 0.5 else self.rng.sample(every, self.rng.randrange(1, self.records + 1))
            beats.append(Beat(self.rng.getrandbits(34), {r: self.record() for r in come}))
        return beats

    def record(self) -> int:
        return self.rng.getrandbits(self.record_bits)

    def marked(self, records: Iterable[int]) -> int:
        """Quarters of records."""
        return sum(((1 << self.quarters) - 1) << self.quarters * r for r in records)

    async def run(self, beats: list[Beat], idle: list[str], stall: str, beat_idle: str = "never", shuffle: bool = True, lane_of=None, stop: int = 0) -> int:
        """All beats; cycles from the first record's transfer to the last line's. idle: of the lanes. lane_of: (beat, record) to lane."""
        dut, rng, edge = self.dut, self.rng, RisingEdge(self.dut.clk_i)
        lanes: list[list[tuple[int, int, int]]] = [[] for _ in range(self.lanes)]  # place, record
        idles, stop_line, stop_beat = [stalls.make(p, rng) for p in idle], stalls.make(stall, rng), stalls.make(beat_idle, rng)
        offered: list[tuple[int, int, int] | None] = [None] * self.lanes
        items: deque[int] = deque()
        assigned = freed = lines = cycle = inside = 0
        item_offered, held, first = False, None, -1
        dut.out_ready_i.value = 0
        while lines < len(beats):
            while assigned < len(beats) and assigned - freed < self.ring:
                beat, at = beats[assigned], (self.head + assigned) % self.ring
                for r, record in beat.records.items():
                    lanes[rng.randrange(self.lanes) if lane_of is None else lane_of(assigned, r)].append((at, self.quarters * r, record))
                items.append(beat.address << 4 | self.marked(beat.records))
                assigned += 1
            valid = places = records = 0
            for k in range(self.lanes):
                if offered[k] is None and lanes[k] and not next(idles[k]):
                    offered[k] = lanes[k].pop(rng.randrange(len(lanes[k])) if shuffle else 0)
                shown = offered[k]
                at, q, record = (rng.randrange(self.ring), rng.getrandbits(2), self.record()) if shown is None else shown
                valid |= (shown is not None) << k
                places |= (at << 2 | q) << self.place_bits * k
                records |= record << self.record_bits * k
            item_offered = item_offered or bool(items and not next(stop_beat))
            ready = not next(stop_line)
            dut.in_valid_i.value, dut.in_place_i.value, dut.in_record_i.value = valid, places, records
            dut.beat_valid_i.value, dut.beat_data_i.value = int(item_offered), items[0] if item_offered else rng.getrandbits(38)
            dut.out_ready_i.value = int(ready)
            await edge
            cycle += 1
            assert not (inside and int(dut.idle_o.value)), "idle with records inside"
            taken = valid & int(dut.in_ready_o.value)
            for k in range(self.lanes):
                if taken >> k & 1:
                    offered[k] = None
                    inside += 1
                    first = cycle if first < 0 else first
            if item_offered:
                assert int(dut.beat_ready_o.value) == 1, "a beat refused"
                items.popleft()
                item_offered = False
            freed += int(dut.freed_o.value)
            if int(dut.out_valid_o.value):
                beat = beats[lines]
                strobe, data = int(dut.out_strobe_o.value), dut.out_data_o.value
                shown_records = {r: int(data[self.record_bits * (r + 1) - 1 : self.record_bits * r]) for r in beat.records}  # the others hold anything
                got = (int(dut.out_beat_o.value), strobe, shown_records)
                assert held in (None, got), "line changed before its transfer"
                held = None if ready else got
                if ready:
                    assert (got[0], strobe, shown_records) == (beat.address, self.marked(beat.records), beat.records), f"line {lines}"
                    lines += 1
                    inside -= len(shown_records)
            else:
                assert held is None, "valid fell"
            assert cycle < 2000 + 100 * len(beats), f"stands still at line {lines} of {len(beats)}"
            if stop and cycle >= stop:
                return cycle
        dut.in_valid_i.value = dut.beat_valid_i.value = 0
        await edge
        await edge
        assert int(dut.idle_o.value) == 1 and int(dut.out_valid_o.value) == 0
        assert freed == len(beats) or freed + int(dut.freed_o.value) == len(beats)
        self.head = (self.head + len(beats)) % self.ring
        return cycle - first


@cocotb.test()
@cocotb.parametrize(
    ("kind", ["never never never", "half half half", "never heavy never", "heavy never never", "bursts bursts never", "never never heavy", "mixed"])
)
async def records(dut, kind):
    """Full and partial beats, records before and after their beat is known, in any order within the ring."""
    test = Writer(dut)
    await test.reset()
    for count in (1, 2, 45, rounds(150, 300)):
        pick = lambda: test.rng.choice(stalls.PATTERNS)  # noqa: E731
        idle, stall, beat = ([pick() for _ in range(LANES)], pick(), pick()) if kind == "mixed" else ([kind.split()[0]] * LANES, *kind.split()[1:])
        await test.run(test.beats(count), idle, stall, beat, shuffle=test.rng.random() < 0.7)


@cocotb.test()
async def one_place(dut):
    """All lanes want the same place of a beat in every cycle: a record a cycle, the lanes in turn."""
    test = Writer(dut)
    await test.reset()
    for r in range(test.records):
        beats = [Beat(n, {r: test.record()}) for n in range(120)]
        cycles = await test.run(beats, ["never"] * 4, "never", shuffle=False, lane_of=lambda beat, _: beat % 4)
        assert cycles <= 120 + 4, cycles


@cocotb.test()
async def rate(dut):
    """All records of a beat and a line a cycle; a line three cycles after its beat, two after its last record."""
    test = Writer(dut)
    await test.reset()
    cycles = await test.run(test.beats(1, full=True), ["never"] * 4, "never", lane_of=lambda beat, r: r)
    assert cycles == 3
    beats = test.beats(2, full=True)
    cycles = await test.run(beats, ["never"] * 4, "never", shuffle=False, lane_of=lambda beat, r: 0)  # a record a cycle
    assert cycles == 2 * test.records - 1 + 2
    cycles = await test.run(test.beats(200, full=True), ["never"] * 4, "never", shuffle=False, lane_of=lambda beat, r: r)
    assert cycles <= 200 + 3, cycles


@cocotb.test()
async def reset_inside(dut):
    """What a reset found inside is gone."""
    test = Writer(dut)
    await test.reset()
    for _ in range(4):
        await test.run(test.beats(80), ["rare"] * 4, "heavy", "half", stop=test.rng.randrange(20, 80))
        dut.in_valid_i.value = dut.beat_valid_i.value = 0
        await test.reset()
        await test.run(test.beats(40), ["rare"] * 4, "half")
