"""cocotb tests of flk_axi_fetch: its bursts are the pieces of the requests, none without a place, its beats what the memory holds."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench
from flicker_tb.streams import Stream, StreamSource

from flicker.chip.dram import DramConfig
from flicker.sim.memory import Memory, PortConfig

BASE, SIZE = 0x8000, 0x10000


class FetchTest:
    """Requests in, beats out into a buffer that is emptied with a share of the cycles."""

    def __init__(self, dut, idle="never", share=1.0, stall=0.0, latency=10, fail=()):
        self.dut, self.bench, self.share = dut, Bench(dut), share
        self.rng = self.bench.rng
        self.bytes = len(dut.r_data_i) // 8
        self.longest, self.places = int(dut.MaxBeats.value), int(dut.Places.value)
        memory = Memory(DramConfig().timing, perfect=True)
        memory.allocate(BASE, SIZE, noise=self.rng.getrandbits(30))
        self.memory = memory
        self.port = MemoryPort(dut, memory, PortConfig(
            data_bits=8 * self.bytes, id_bits=len(dut.ar_id_o), latency=latency, max_reads=64, max_beats=self.longest, stall={"AR": stall, "R": stall},
            run={"AR": 5, "R": 3}, seed=self.rng.getrandbits(30),
        ), writes=False)
        for address in fail:
            self.port.port.fail_range(address, 1)
        self.fail = fail
        self.source = StreamSource(Stream(dut, "in", ("beat", "beats", "tag", "placed")), self.bench.stall(idle))
        self.pieces, self.beats = deque(), deque()  # to be asked for, to come
        self.held = self.under_way = 0  # beats with places: in the buffer, asked for or in the buffer
        self.asked = self.come = 0
        dut.stop_i.value = dut.freed_i.value = 0
        cocotb.start_soon(self.watch())

    def requests(self, count):
        lines = SIZE // self.bytes
        longest = min(100, (1 << len(self.dut.in_beats_i)) - 1)
        made = []
        for _ in range(count):
            beats = self.rng.choice([1, 2, self.rng.randint(1, longest), self.rng.randint(1, longest)])
            made.append((BASE // self.bytes + self.rng.randrange(lines - beats), beats, self.rng.getrandbits(len(self.dut.in_tag_i)), self.rng.random() < 0.3))
        return [(beat, beats, tag, int(placed)) for beat, beats, tag, placed in made]

    def expect(self, beat, beats, tag, placed):
        while beats:
            count = min(beats, self.longest - beat % self.longest)
            self.pieces.append((beat, count, tag, placed))
            beat, beats = beat + count, beats - count

    async def watch(self):
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            if dut.freed_i.value == 1:
                self.under_way -= 1
            if dut.ar_valid_o.value == 1 and dut.ar_ready_i.value == 1:
                beat, count, tag, placed = self.pieces.popleft()
                assert (int(dut.ar_addr_o.value), int(dut.ar_len_o.value)) == (beat * self.bytes, count - 1)
                wrong = any(beat * self.bytes <= a < (beat + count) * self.bytes for a in self.fail)
                self.beats.extend((beat + k, tag, placed, wrong) for k in range(count))
                self.under_way += 0 if placed else count
                assert self.under_way <= self.places
                self.asked += 1
            if dut.r_valid_i.value == 1:
                assert dut.r_ready_o.value == 1, "the port waits"
            if dut.out_valid_o.value == 1:
                beat, tag, placed, wrong = self.beats.popleft()
                assert (int(dut.out_tag_o.value), int(dut.out_error_o.value)) == (tag, wrong)
                if not wrong:
                    assert int(dut.out_data_o.value) == int.from_bytes(self.memory.read(beat * self.bytes, self.bytes), "little")
                self.held += not placed
                self.come += 1
            if dut.in_valid_i.value == 1 and dut.in_ready_o.value == 1:
                self.expect(*(int(getattr(dut, f"in_{name}_i").value) for name in ("beat", "beats", "tag", "placed")))
            free = self.held > 0 and self.rng.random() < self.share and dut.stop_i.value == 0
            self.held -= free
            dut.freed_i.value = int(free)

    @property
    def over(self):
        return not self.source.pending and not self.pieces and not self.beats


@cocotb.test()
@cocotb.parametrize((("idle", "share", "stall"), [("never", 1.0, 0.0), ("half", 0.5, 0.4), ("never", 0.3, 0.2)]))
async def fetch(dut, idle, share, stall):
    """Pieces, places, beats, tags, errors."""
    test = FetchTest(dut, idle, share, stall, fail=(BASE + 0x1234, BASE + 0x8000))
    await test.bench.reset()
    assert dut.idle_o.value == 1
    test.source.send(test.requests(20))
    await test.bench.until(lambda: test.over, 20_000, "last beat")
    await test.bench.cycles(5)
    assert dut.idle_o.value == 1 and test.come > 20 and test.port.port.idle


@cocotb.test()
async def rate(dut):
    """The places, full in each round trip: a long request with a latency of 100."""
    test = FetchTest(dut, latency=100)
    await test.bench.reset()
    start = BASE // test.bytes // test.longest * test.longest
    beats = min(64 * test.longest, (1 << len(dut.in_beats_i)) - 1) // test.longest * test.longest
    test.source.send([(start, beats, 0, 0)])
    cycles = await test.bench.until(lambda: test.come == beats, 20_000, "last beat")
    pieces = min(test.places // test.longest, int(dut.Bursts.value))
    trips = -(-beats // (pieces * test.longest))
    assert cycles <= trips * (100 + 8 + 2 * test.longest)


@cocotb.test()
@cocotb.parametrize(stall=[0.0, 0.6])
async def stop(dut, stall):
    """After a stop no piece is asked for but one on offer, what was asked for comes, and then all places are free again."""
    test = FetchTest(dut, "never", 0.3, stall)
    await test.bench.reset()
    for _ in range(10):
        test.source.send(test.requests(3))
        await test.bench.cycles(test.rng.randint(5, 60))
        dut.stop_i.value = 1
        await RisingEdge(dut.clk_i)
        await RisingEdge(dut.clk_i)
        asked = test.asked
        await test.bench.until(lambda: dut.idle_o.value == 1, 2000, "idle")
        assert test.asked <= asked + 3, "pieces after the stop"  # one on offer, two in the splitter
        assert not test.beats
        # The user forgets its buffer too.
        test.held = test.under_way = 0
        test.pieces.clear()
        dut.stop_i.value = 0
        await test.bench.cycles(1)
    test.share = 1.0
    await test.bench.until(lambda: test.over and not test.held, 20_000, "the rest")
    await test.bench.cycles(3)
    assert test.under_way == 0
    test.share = 0.0
    test.source.send([(BASE // test.bytes, test.places, 0, 0)])
    await test.bench.until(lambda: test.over, 5000, "as many beats as there are places")
