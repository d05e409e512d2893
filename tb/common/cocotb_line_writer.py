"""cocotb tests of flk_line_writer: what is in memory afterwards, addresses in order, when lines leave."""

from __future__ import annotations

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort, ram_write
from flicker_tb.bench import Bench
from flicker_tb.streams import Monitor, Stream, StreamSource

from flicker.chip.dram import DramConfig
from flicker.sim.memory import Memory, PortConfig

BASE, LINES, BEAT = 0x40_0000, 256, 64
WAIT = 127  # cycles without a line, after which those that wait leave


class Writer:
    """The design with a golden copy of the memory."""

    def __init__(self, dut, idle: str = "never", base: int = BASE) -> None:
        self.dut, self.bench, self.base = dut, Bench(dut), base
        self.gather = int(dut.Gather.value)
        lines = Stream(dut, "in", ("beat", "strobe", "data"))
        self.source = StreamSource(lines, self.bench.stall(idle))
        self.input = Monitor(lines, self._taken)
        self.golden = bytearray(LINES * BEAT)
        self.failing = range(0)  # lines
        self.beats: list[int] = []  # taken, in order
        self.left = self.failed = self.data = self.answers = 0  # addresses, errors, beats, answers
        self.flush = self.bench.stall("never")
        dut.flush_i.value = 0
        cocotb.start_soon(self._watch())

    def perfect(self, share: float = 0.0, timing: bool = False) -> None:
        """This project's memory."""
        dut, rng = self.dut, self.bench.rng
        memory = Memory(DramConfig().timing, not timing)
        memory.allocate(self.base, LINES * BEAT, noise=rng.getrandbits(30))
        self.golden[:] = memory.read(self.base, LINES * BEAT)
        self.memory = memory
        self.port = MemoryPort(dut, memory, PortConfig(
            max_beats=1, max_writes=64, latency=10, stall=dict.fromkeys(("AW", "W", "B"), share), run={"B": 3}, seed=rng.getrandbits(30),
        ), reads=False)

    def make(self, count: int, lines: int = LINES) -> list[tuple[int, int, int]]:
        rng = self.bench.rng
        return [(self.base // BEAT + rng.randrange(lines), rng.choice([15, 15, rng.getrandbits(4), 1 << rng.randrange(4)]), rng.getrandbits(8 * BEAT))
                for _ in range(count)]

    def _taken(self, item: tuple[int, int, int]) -> None:
        beat, strobe, data = item
        at = beat - self.base // BEAT
        self.beats.append(beat)
        if at not in self.failing:
            for q in range(4):
                if strobe >> q & 1:
                    where = at * BEAT + 16 * q
                    self.golden[where : where + 16] = (data >> 128 * q & (1 << 128) - 1).to_bytes(16, "little")

    async def _watch(self) -> None:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        before = 0
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            if dut.idle_o.value == 1:
                assert dut.empty_o.value == 1 and self.left == self.data == self.answers == before, "idle_o, but lines are inside"
            if dut.empty_o.value == 1:  # one address and two beats may be in registers behind the queues
                assert self.left >= before - 1 and self.data >= before - 2, "empty_o, but lines wait"
            before = len(self.beats)
            self.answers += dut.b_valid_i.value == 1 and dut.b_ready_o.value == 1
            if dut.aw_valid_o.value == 1 and dut.aw_ready_i.value == 1:
                want = self.beats[self.left] * BEAT
                assert int(dut.aw_addr_o.value) == want, f"line {self.left}: address {int(dut.aw_addr_o.value):#x}, due {want:#x}"
                assert (int(dut.aw_len_o.value), int(dut.aw_size_o.value), int(dut.aw_id_o.value)) == (0, 6, int(dut.Id.value))
                self.left += 1
            if dut.w_valid_o.value == 1 and dut.w_ready_i.value == 1:
                assert dut.w_last_o.value == 1
                self.data += 1
            self.failed += int(dut.failed_o.value)
            dut.flush_i.value = int(not next(self.flush)) if self.flushing else 0

    flushing = False

    async def run(self, items: list[tuple[int, int, int]]) -> None:
        done = len(self.beats) + len(items)
        self.source.send(items)
        await self.bench.until(lambda: len(self.beats) == done and self.dut.idle_o.value == 1, 100_000, "idle")
        await self.bench.cycles(3)

    def compare(self) -> None:
        assert bytes(self.memory.read(self.base, LINES * BEAT)) == bytes(self.golden)


PATTERNS = [("never", 0.0, False), ("half", 0.3, False), ("never", 0.6, False), ("bursts", 0.2, True), ("heavy", 0.0, True)]


@cocotb.test()
@cocotb.parametrize((("idle", "share", "timing"), PATTERNS))
async def lines(dut, idle, share, timing):
    """Everything that goes in is in memory."""
    test = Writer(dut, idle)
    test.perfect(share, timing)
    await test.bench.reset()
    await test.run(test.make(300))
    test.compare()
    assert test.failed == 0 and test.left == 300


@cocotb.test()
async def other_memory(dut):
    """The memory of cocotbext-axi."""
    test = Writer(dut, "half", 0)
    ram = ram_write(dut, LINES * BEAT)
    ram.write(0, bytes(test.golden))
    ram.b_channel.set_pause_generator(test.bench.stall("half"))
    ram.w_channel.set_pause_generator(test.bench.stall("half"))
    await test.bench.reset()
    await test.run(test.make(200))
    assert ram.read(0, LINES * BEAT) == bytes(test.golden)


@cocotb.test()
async def gathering(dut):
    """Nothing leaves before Gather - 2 lines are there or none has come for a while; a flush lets what waits go at once."""
    test = Writer(dut)
    test.perfect()
    await test.bench.reset()
    few = test.gather - 3
    test.source.send(test.make(few))
    await test.bench.until(lambda: len(test.beats) == few, 1000, "lines")
    await test.bench.cycles(WAIT - 10)
    assert test.left == 0 and dut.empty_o.value == 0 and dut.idle_o.value == 0, "lines left early"
    waited = await test.bench.until(lambda: dut.idle_o.value == 1, 400, "idle")
    assert test.left == few and waited > 5
    test.source.send(test.make(test.gather - 2))
    cycles = await test.bench.until(lambda: test.left > few, 400, "first line")
    assert cycles < test.gather + 12, f"first line after {cycles} cycles"
    await test.bench.until(lambda: dut.idle_o.value == 1, 400, "idle")
    test.source.send(test.make(2))
    await test.bench.cycles(20)
    before = test.left
    assert before == len(test.beats) - 2
    test.flushing = True
    await test.bench.until(lambda: dut.idle_o.value == 1, 60, "idle after a flush")
    assert test.left == before + 2
    test.compare()


@cocotb.test()
async def gathering_again(dut):
    """After a memory that made lines wait in front of the writer: few lines are gathered as before."""
    test = Writer(dut)
    test.perfect(0.2)
    await test.bench.reset()
    await test.run(test.make(8 * test.gather))
    assert test.input.last - test.input.first > 8.5 * test.gather, "the writer was always ready"
    assert test.input.cycles - test.input.last < WAIT, "too late: lines may leave at once after a pause"
    left = test.left
    test.source.send(test.make(test.gather - 4))
    await test.bench.cycles(WAIT - 10)
    assert test.left == left and dut.empty_o.value == 0, "lines left early"
    await test.bench.until(lambda: dut.idle_o.value == 1, 2000, "idle")
    test.compare()


@cocotb.test()
async def rate(dut):
    """A line a cycle once they leave, as far as bursts under way allow."""
    test = Writer(dut)
    test.perfect()
    test.flushing = True
    await test.bench.reset()
    await test.run(test.make(400))
    trip = 10 + 8
    least = 400 if int(dut.Bursts.value) > trip else 400 * trip // int(dut.Bursts.value)
    assert test.input.last - test.input.first < 1.1 * least + 20
    test.compare()


@cocotb.test()
async def errors(dut):
    """failed_o for a cycle for each line that the memory refuses; the others are written."""
    test = Writer(dut, "half")
    test.perfect(0.3)
    test.failing = range(10, 14)
    test.port.port.fail_range(test.base + 10 * BEAT, 4 * BEAT)
    await test.bench.reset()
    await test.run(test.make(200, 40))
    assert test.failed == sum(beat - test.base // BEAT in test.failing for beat in test.beats) > 0
    test.compare()


@cocotb.test()
async def flushes(dut):
    """Flush at any time: order and contents stay."""
    test = Writer(dut, "rare")
    test.perfect(0.1)
    test.flush, test.flushing = test.bench.stall("bursts"), True
    await test.bench.reset()
    await test.run(test.make(400))
    test.compare()
