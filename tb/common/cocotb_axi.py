"""cocotb tests of flk_axi_split, flk_axi_read and flk_axi_write.

Memories: that of flicker.sim.memory, which checks the rules of AXI and pauses at random, perfect or LPDDR4, and that of cocotbext-axi.
Settings: ``top``.
"""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort, ram_read, ram_write
from flicker_tb.bench import Bench, StreamTest, combinations, config
from flicker_tb.streams import Checker, Monitor, Stream, StreamSink, StreamSource

from flicker.chip.dram import DramConfig, port_config
from flicker.sim.memory import Memory, PortConfig, WriteOrder

TOP = config()["top"]
BASE, SIZE = 0x8000, 0x10000
REQUEST = ("addr", "beats", "tag")
WRITES = combinations(["never", "half", "bursts"], WriteOrder, [0.0, 0.5])


class Anything:
    """Equal to all values."""

    def __eq__(self, other):
        return True


def requests(dut, rng, count, base=BASE, longest=40, apart=False):
    """Random requests inside of the memory; apart: none overlaps another."""
    width = int(dut.Width.value) // 8 if hasattr(dut, "Width") else int(dut.Bytes.value)
    tags = len(dut.in_tag_i) if not hasattr(dut, "Listed") or int(dut.Listed.value) else 0
    lines = SIZE // width
    made, at = [], 0
    for _ in range(count):
        beats = min(rng.choice([1, 1, 2, rng.randint(1, longest), rng.randint(1, longest)]), 2 ** len(dut.in_beats_i) - 1)
        across = 4096 // width * rng.randint(1, SIZE // 4096 - 4) - rng.randint(1, min(beats, lines // 20))  # a page
        first = at if apart else rng.choice([rng.randrange(lines - beats), across])
        at = first + beats + rng.randint(0, 3)
        if at > lines:
            break
        made.append((base + first * width, beats, rng.getrandbits(tags)))
    return made


def bursts(request, width, longest):
    """The bursts of a request, as (address, AXI's length, last, tag)."""
    addr, beats, tag = request
    while beats:
        count = min(beats, longest, (4096 - addr % 4096) // width)
        beats -= count
        yield addr, count - 1, int(beats == 0), tag
        addr += count * width


# ---- split -------------------------------------------------------------------------------------


@cocotb.test(skip=TOP != "flk_axi_split")
@cocotb.parametrize(idle=["never", "half"], stall=["never", "half", "bursts"])
async def split(dut, idle, stall):
    """The bursts are those of the model, one a cycle."""
    width, longest = int(dut.Bytes.value), int(dut.MaxBeats.value)
    test = StreamTest(
        dut, lambda item: bursts(item, width, longest), source=Stream(dut, "in", REQUEST), sink=Stream(dut, "out", ("addr", "len", "last", "tag")),
        idle=idle, stall=stall,
    )
    items = requests(dut, test.bench.rng, 200, longest=min(300, (1 << len(dut.in_beats_i)) - 1))
    await test.run(items, limit=200_000)
    assert dut.idle_o.value == 1
    if idle == stall == "never":
        assert test.output.last - test.output.first == test.output.count - 1 and test.output.first - test.input.first == 2


# ---- read --------------------------------------------------------------------------------------


class ReadTest:
    """Requests in, beats out, against the contents of a memory."""

    def __init__(self, dut, idle="never", stall="never"):
        self.dut, self.bench = dut, Bench(dut)
        self.width = int(dut.Width.value) // 8
        source, sink = Stream(dut, "in", REQUEST), Stream(dut, "out", ("data", "tag", "last", "error"))
        self.checker = Checker(self.beats, sink.show)
        self.source, self.sink = StreamSource(source, self.bench.stall(idle)), StreamSink(sink, self.bench.stall(stall))
        self.output, self.input = Monitor(sink, self.checker.check), Monitor(source, self.checker.expect)
        self.failing = range(0)
        self.asked = 0

    def read(self, address, size):
        raise NotImplementedError

    def beats(self, request):
        for addr, length, last, tag in bursts(request, self.width, int(self.dut.MaxBeats.value)):
            wrong = any(a in self.failing for a in (addr, addr + (length + 1) * self.width - 1))
            for k in range(length + 1):
                at = addr + k * self.width
                data = Anything() if wrong else int.from_bytes(self.read(at, self.width), "little")
                yield data, tag, int(last and k == length), int(wrong)

    async def run(self, items):
        await self.bench.reset()
        assert self.dut.idle_o.value == 1
        self.source.send(items)
        await self.bench.until(lambda: not self.source.pending and not self.checker.outstanding, 200_000, "last beat")
        await self.bench.cycles(20)
        assert self.dut.idle_o.value == 1
        self.checker.finish(len(items))


@cocotb.test(skip=TOP != "flk_axi_read")
@cocotb.parametrize(idle=["never", "half"], stall=["never", "heavy", "bursts"], perfect=[False, True])
async def read(dut, idle, stall, perfect):
    """Beats, tags, marks, errors, under pauses of both sides."""
    test = ReadTest(dut, idle, stall)
    memory = Memory(DramConfig().timing, perfect)
    memory.allocate(BASE, SIZE, noise=test.bench.rng.getrandbits(30))
    test.read = memory.read
    share = 0.0 if stall == "never" else 0.4
    port = MemoryPort(dut, memory, port_config(
        data_bits=8 * test.width, id_bits=len(dut.ar_id_o), max_beats=int(dut.MaxBeats.value), stall={"AR": share, "R": share}, run={"R": 4},
        seed=test.bench.rng.getrandbits(30),
    ), writes=False)
    test.failing = range(BASE + 0x400, BASE + 0x1400)  # whole pages: no burst is in one with its middle alone
    port.port.fail_range(BASE + 0x400, 0x1000)
    await test.run(requests(dut, test.bench.rng, 40))
    assert port.port.idle


@cocotb.test(skip=TOP != "flk_axi_read")
@cocotb.parametrize(beats=[100, 1])
async def read_rate(dut, beats):
    """A memory that answers after 20 cycles gives a beat a cycle to long requests, and Bursts beats in a round trip to short ones."""
    test = ReadTest(dut)
    memory = Memory(DramConfig().timing, perfect=True)
    memory.allocate(BASE, SIZE, noise=1)
    test.read = memory.read
    MemoryPort(dut, memory, PortConfig(data_bits=8 * test.width, id_bits=len(dut.ar_id_o), latency=20, max_reads=64), writes=False)
    count = 10 if beats > 1 else 200
    await test.run([(BASE + test.width * k, beats, 0) for k in range(count)])
    trip = 20 + 1  # the list of bursts under way takes one in the cycle after another has left
    taken = test.output.last - test.output.first + 1
    assert taken == (beats * count if beats > 1 else (count - 1) // int(dut.Bursts.value) * trip + (count - 1) % int(dut.Bursts.value) + 1)


@cocotb.test(skip=TOP != "flk_axi_read")
async def read_other_memory(dut):
    """The memory of cocotbext-axi, which knows nothing of this project."""
    test = ReadTest(dut, "half", "half")
    ram = ram_read(dut, SIZE)
    ram.write(0, random.Random(test.bench.rng.getrandbits(30)).randbytes(SIZE))
    test.read = ram.read
    pause = test.bench.stall("half")
    ram.r_channel.set_pause_generator(pause)
    await test.run(requests(dut, test.bench.rng, 60, base=0))


# ---- write -------------------------------------------------------------------------------------


class WriteTest:
    """Requests and beats in, a golden copy of the memory, answers."""

    def __init__(self, dut, idle="never"):
        self.dut, self.bench = dut, Bench(dut)
        self.width = int(dut.Width.value) // 8
        self.source = StreamSource(Stream(dut, "in", REQUEST), self.bench.stall(idle))
        self.beats = StreamSource(Stream(dut, "data", ("data", "strb")), self.bench.stall(idle))
        self.done = []
        cocotb.start_soon(self.watch())

    async def watch(self):
        edge = RisingEdge(self.dut.clk_i)
        while True:
            await edge
            if self.dut.rst_ni.value == 1 and self.dut.done_valid_o.value == 1:
                self.done.append((int(self.dut.done_tag_o.value), int(self.dut.done_error_o.value)))

    async def run(self, items, golden, base, failing=range(0)):
        """golden: bytearray of the memory from `base` on; it gets what the items write. Bursts that touch `failing` write nothing."""
        rng, expected, beats = self.bench.rng, [], []
        for item in items:
            error = 0
            for addr, length, last, tag in bursts(item, self.width, int(self.dut.MaxBeats.value)):
                wrong = addr in failing or addr + (length + 1) * self.width - 1 in failing
                error |= wrong
                for k in range(length + 1):
                    data = rng.randbytes(self.width)
                    strobes = rng.choice([(1 << self.width) - 1, rng.getrandbits(self.width), 0])
                    beats.append((int.from_bytes(data, "little"), strobes))
                    for j in range(self.width):
                        if strobes >> j & 1 and not wrong:
                            golden[addr + k * self.width + j - base] = data[j]
                if last:
                    expected.append((tag if int(self.dut.Tagged.value) else 0, error))
        await self.bench.reset()
        assert self.dut.idle_o.value == 1
        self.source.send(items)
        self.beats.send(beats)
        start = self.source.sent
        taken = await self.bench.until(lambda: len(self.done) >= len(items), 200_000, "last answer")
        await self.bench.cycles(20)
        assert self.done == expected and self.dut.idle_o.value == 1 and not self.beats.pending and start == 0
        return taken


@cocotb.test(skip=TOP != "flk_axi_write")
@cocotb.parametrize((("idle", "order", "share"), WRITES))
async def write(dut, idle, order, share):
    """Contents, answers in order with their errors, whatever the memory wants first."""
    test = WriteTest(dut, idle)
    memory = Memory(DramConfig().timing, perfect=share > 0)
    memory.allocate(BASE, SIZE, noise=3)
    port = MemoryPort(dut, memory, port_config(
        data_bits=8 * test.width, id_bits=len(dut.aw_id_o), max_beats=int(dut.MaxBeats.value), write_order=order, stall={"AW": share, "W": share, "B": share},
        seed=test.bench.rng.getrandbits(30),
    ), reads=False)
    failing = range(BASE + 0x400, BASE + 0x1400)
    port.port.fail_range(BASE + 0x400, 0x1000)
    golden = bytearray(memory.read(BASE, SIZE))
    await test.run(requests(dut, test.bench.rng, 80, apart=True), golden, BASE, failing)
    assert memory.read(BASE, SIZE) == golden and port.port.idle
    assert {error for _, error in test.done} == {0, 1}


@cocotb.test(skip=TOP != "flk_axi_write")
async def write_rate(dut):
    """A beat a cycle to a memory that answers after 20 cycles."""
    test = WriteTest(dut)
    memory = Memory(DramConfig().timing, perfect=True)
    memory.allocate(BASE, SIZE)
    MemoryPort(dut, memory, PortConfig(data_bits=8 * test.width, id_bits=len(dut.aw_id_o), latency=20), reads=False)
    count, beats = 10, 4096 // test.width
    taken = await test.run([(BASE + 4096 * k, beats, 0) for k in range(count)], bytearray(SIZE), BASE)
    assert taken <= count * beats + 30


@cocotb.test(skip=TOP != "flk_axi_write")
async def write_other_memory(dut):
    """The memory of cocotbext-axi."""
    test = WriteTest(dut, "half")
    ram = ram_write(dut, SIZE)
    ram.w_channel.set_pause_generator(test.bench.stall("half"))
    golden = bytearray(SIZE)
    await test.run(requests(dut, test.bench.rng, 60, base=0, apart=True), golden, 0)
    assert ram.read(0, SIZE) == golden


# ---- bad ports ---------------------------------------------------------------------------------


@cocotb.test(skip=TOP == "flk_axi_split")
async def no_answer(dut):
    """A memory that never answers holds the unit; idle_o says so."""
    bench = Bench(dut)
    reads = TOP == "flk_axi_read"
    source = StreamSource(Stream(dut, "in", REQUEST))
    if reads:
        StreamSink(Stream(dut, "out", ("data", "tag", "last", "error")))
    else:
        StreamSource(Stream(dut, "data", ("data", "strb"))).send([(1, 1)] * 100)
    memory = Memory(DramConfig().timing, perfect=True)
    memory.allocate(BASE, SIZE)
    width = int(dut.Width.value)
    port = MemoryPort(dut, memory, PortConfig(data_bits=width, id_bits=len(dut.ar_id_o if reads else dut.aw_id_o), max_reads=100, max_writes=100,
                                              stop_after={"R" if reads else "B": 0}), reads=reads, writes=not reads)
    await bench.reset()
    for count in (int(dut.Bursts.value), 50):  # all addresses are out; one waits
        source.send([(BASE + width // 8 * k, 1, 0) for k in range(count)])
        await bench.cycles(200)
        assert port.port.channels()["AR" if reads else "AW"][0] == int(dut.Bursts.value)
        assert dut.idle_o.value == 0
    assert source.pending > 0
