"""cocotb tests of flk_list_reader: elements and beats against flicker.golden.list_reader."""

from __future__ import annotations

from collections import Counter, deque

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort, unpack
from flicker_tb.bench import Bench
from flicker_tb.streams import Monitor, Stream, StreamSink, StreamSource

from flicker.chip.dram import DramConfig
from flicker.golden.list_reader import Line, pointer_line, read_tile
from flicker.golden.lists import COUNT_BITS, HEADER_AT, LINE_ENTRIES, MAX_CHUNKS, TAIL_AT, TAIL_BITS, write_lists, writer_columns
from flicker.sim.memory import Memory, PortConfig

PATTERNS = [("never", "never"), ("half", "half"), ("never", "heavy"), ("heavy", "never"), ("bursts", "bursts")]
LINE = 64
PAGE_LINES = 64
SIZES = (0, 1, 9, 10, 72, 73, 145, 8, 0, 0, 3, 200)


class Frame:
    """Lists in memory. sizes: entries of each tile, row by row. list_base, pointer_base: lines."""

    def __init__(self, rng, cols: int, rows: int, sizes: list[int], list_base: int, pointer_base: int):
        self.cols, self.rows, self.list_base, self.pointer_base = cols, rows, list_base, pointer_base
        tile = np.repeat(np.arange(cols * rows), sizes)
        rng2 = np.random.default_rng(rng.getrandbits(32))
        # Some lists whole, the others mixed, so that lines of fewer than nine entries lie anywhere.
        tile = tile[np.argsort(rng2.random(len(tile)) + np.where(rng2.random(cols * rows) < 0.5, 10 * np.arange(cols * rows), 0)[tile], kind="stable")]
        n = len(tile)
        mask = rng2.integers(1, 16, n)
        key, record = (rng2.integers(0, 1 << 24, n) for _ in range(2))
        # Entries of half of the lists are near each other, so that lines are short ones.
        here = (rng2.random(cols * rows) < 0.5)[tile]
        key[here], record[here] = (tile * 50000 % (1 << 23) + key % (1 << 15))[here], (100 + 3 * np.arange(n))[here]
        image = write_lists(np.arange(n), tile, mask, key, record, cols, rows)
        self.chunks, self.memory, self.pointers = image.chunks, image.memory.copy(), image.pointers.copy()
        self.written = np.concatenate(image.writes)
        self.failing: list[int] = []  # lines of the lists; the bursts that touch them are answered with an error
        self.failing_pointers: list[int] = []

    def put(self, memory: Memory) -> None:
        """Into memory; lines never written hold what is there."""
        for line in self.written:
            memory.write((self.list_base + int(line)) * LINE, self.memory[line].tobytes())
        memory.write(self.pointer_base * LINE, self.pointers.tobytes())

    def spread(self, rng) -> list[int]:
        """Chunks get numbers all over the range that there is, up to the last one, in the same order; `memory` then has the lines that exist, by number.
        Returns the chunks."""
        old = sorted({int(line) // 32 for line in self.written})
        new = dict(zip(old, [*sorted(rng.sample(range(MAX_CHUNKS - 1), len(old) - 1)), MAX_CHUNKS - 1]))
        memory: dict[int, np.ndarray] = {}
        link_at = HEADER_AT + COUNT_BITS
        for line in self.written.tolist():
            word = int.from_bytes(self.memory[line].tobytes(), "little")
            if word >> link_at + 24 & 1:
                link = word >> link_at & MAX_CHUNKS - 1
                word += new[link] - link << link_at
            memory[new[line // 32] * 32 + line % 32] = np.frombuffer(word.to_bytes(LINE, "little"), np.uint64)
        used = self.pointers != 0
        self.pointers[used] = [int(p) + new[int(p) & MAX_CHUNKS - 1] - (int(p) & MAX_CHUNKS - 1) for p in self.pointers[used]]
        self.memory, self.written, self.chunks = memory, np.array(list(memory)), MAX_CHUNKS
        return list(new.values())

    def same_burst(self, line: int, other: int) -> bool:
        return line // 8 == other // 8 and (self.list_base + line) // PAGE_LINES == (self.list_base + other) // PAGE_LINES

    def read(self, x: int, y: int):
        return read_tile(
            self.memory, self.pointers, self.cols, x, y, self.chunks,
            lambda line: any(self.same_burst(line, bad) for bad in self.failing), lambda line: line in self.failing_pointers,
        )

    def walk(self, rng) -> list[tuple[int, int]]:
        """All tiles in some order."""
        tiles = [(x, y) for y in range(self.rows) for x in range(self.cols)]
        rng.shuffle(tiles)
        return tiles


class Reader:
    """The design with its memory."""

    def __init__(self, dut, idle: str = "never", stall: str = "never", latency: int = 5, pauses: float = 0.0, perfect: bool = True):
        self.dut, self.bench = dut, Bench(dut)
        rng = self.rng = self.bench.rng
        self.memory = Memory(DramConfig().timing, perfect)
        self.port = MemoryPort(dut, self.memory, PortConfig(
            latency=latency, max_reads=64, max_beats=8, stall={"AR": pauses, "R": pauses}, run={"AR": 4, "R": 3}, seed=rng.getrandbits(30),
        ), writes=False)
        self.tiles = StreamSource(Stream(dut, "tile", ("x", "y")), self.bench.stall(idle))
        lines = Stream(dut, "out", ("entries", "count", "last"))
        self.sink = StreamSink(lines, self.bench.stall(stall))
        self.output = Monitor(lines, self._line)
        self.due: deque[tuple[Line, int]] = deque()  # element, tile
        self.beats: Counter[int] = Counter()
        for name in ("start", "list_base", "pointer_base", "columns", "chunks"):
            getattr(dut, f"{name}_i").value = 0
        cocotb.start_soon(self._watch())

    def _line(self, item: tuple[int, int, int]) -> None:
        assert self.due, f"element {item} of no list"
        line, tile = self.due.popleft()
        entries, count, last = item
        where = f"tile {tile}"
        assert (count, last) == (line.used, line.last), f"{where}: count {count}, last {last}; due {line.used}, {line.last}"
        assert not count or entries == line.entries, f"{where}: entries {entries:#x}, due {line.entries:#x}"

    async def _watch(self) -> None:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            if dut.ar_valid_o.value == 1 and dut.ar_ready_i.value == 1:
                ar = unpack("ar", int(dut.ar_o.value))
                first = ar["addr"] // LINE
                self.beats.update(range(first, first + ar["len"] + 1))
            if dut.r_valid_i.value == 1:
                assert dut.r_ready_o.value == 1, "the port waits"

    async def start(self, frame: Frame, walk: list[tuple[int, int]], chunks: int | None = None) -> tuple[Counter[int], bool]:
        """Begin a frame. Returns the lines that it has to read, and whether it has a fault."""
        dut = self.dut
        await self.bench.until(lambda: int(dut.idle_o.value) == 1, 3000, "idle")
        for name, value in (("list_base", frame.list_base), ("pointer_base", frame.pointer_base), ("columns", writer_columns(frame.cols)),
                            ("chunks", frame.chunks if chunks is None else chunks), ("start", 1)):
            getattr(dut, f"{name}_i").value = value
        await RisingEdge(dut.clk_i)
        dut.start_i.value = 0
        self.beats.clear()
        lines: Counter[int] = Counter()
        fault = False
        for number, (x, y) in enumerate(walk):
            found = frame.read(x, y)
            fault |= found.fault
            lines[frame.pointer_base + pointer_line(x, y, frame.cols)] += 1
            self.due.extend((line, number) for line in found.lines)
            for first, used in found.requests:
                lines.update(range(frame.list_base + first, frame.list_base + first + used))
        self.tiles.send(walk)
        return lines, fault

    async def run(self, frame: Frame, walk: list[tuple[int, int]]) -> int:
        """A whole frame, and what it must give and read. Returns its cycles."""
        lines, fault = await self.start(frame, walk)
        limit = 3000 + 60 * len(self.due) + 2000 * len(walk)
        cycles = await self.bench.until(lambda: not self.due and not self.tiles.pending, limit, "last line")
        await self.bench.cycles(2)
        if not fault:
            assert self.beats == lines, f"lines read: {self.beats - lines} more than due, {lines - self.beats} missing"
        await self.bench.until(lambda: int(self.dut.idle_o.value) == 1, 300, "idle")
        assert int(self.dut.error_o.value) == fault
        assert self.port.port.idle
        return cycles


def make(reader: Reader, cols: int, rows: int, sizes: list[int], slot: int = 0, aligned: bool = True) -> Frame:
    """A frame in memory of its own; not aligned: chunks lie across 4 KB, in slot 3 across 16 MB too, where both halves of an address change."""
    base = (0x1_0000_0000 if slot % 2 else 0x2_3400_0000) // LINE + slot * 0x10000
    lists = base + (0x40 if aligned else 0x10000 - reader.rng.choice([3, 29, 61]))
    frame = Frame(reader.rng, cols, rows, sizes, lists, base + 0x8000 + reader.rng.randrange(64))
    if len(frame.memory) > 0x7000:
        raise ValueError("frame too large")
    reader.memory.allocate(base * LINE, (0x10000 if aligned else 0x18000) * LINE, reader.rng.getrandbits(30))
    frame.put(reader.memory)
    return frame


def sizes_of(rng, tiles: int) -> list[int]:
    sizes = [*SIZES, *(rng.choice([0, 0, 1, 5, rng.randrange(30), rng.randrange(250)]) for _ in range(tiles))][:tiles]
    rng.shuffle(sizes)
    return sizes


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PATTERNS))
async def lists(dut, idle, stall):
    """Lists of all lengths; frames one after the other."""
    reader = Reader(dut, idle, stall, latency=1 if idle == "half" else 7, pauses=0.3 if stall != "never" else 0.0)
    await reader.bench.reset()
    for slot, (cols, rows) in enumerate(((5, 6), (1, 3), (2, 1), (17, 2), (1, 1))):
        frame = make(reader, cols, rows, sizes_of(reader.rng, cols * rows), slot, aligned=slot != 3)
        await reader.run(frame, frame.walk(reader.rng))


@cocotb.test()
async def wide(dut):
    """A picture of 256x256 tiles: pointers at all places of the table."""
    reader = Reader(dut, latency=20)
    await reader.bench.reset()
    sizes = [0] * 65536
    walk = [(255, 255), (0, 0), (1, 0), (0, 1), (255, 0), (0, 255), *((reader.rng.randrange(256), reader.rng.randrange(256)) for _ in range(40))]
    for x, y in walk:
        sizes[x + 256 * y] = reader.rng.randrange(40)
    await reader.run(make(reader, 256, 256, sizes), walk)


@cocotb.test()
async def largest_region(dut):
    """Chunks all over the largest region of lists, which ends with the address space; then the same with the last chunk outside."""
    reader = Reader(dut, latency=10)
    rng = reader.rng
    await reader.bench.reset()
    base, there = (1 << 34) - 32 * MAX_CHUNKS, set()
    for failing in (False, True):
        frame = Frame(rng, 4, 4, sizes_of(rng, 16), base, 0x1000 + 0x100 * failing)
        chunks = set(frame.spread(rng))
        for chunk in chunks - there:
            reader.memory.allocate((base + 32 * chunk) * LINE, 32 * LINE, rng.getrandbits(30))
        there |= chunks
        reader.memory.allocate(frame.pointer_base * LINE, 0x100 * LINE, rng.getrandbits(30))
        frame.put(reader.memory)
        frame.chunks -= failing
        await reader.run(frame, frame.walk(rng))
        assert int(dut.error_o.value) == failing


@cocotb.test()
@cocotb.parametrize(latency=[3, 100])
async def long(dut, latency):
    """3,000 entries between short lists; latency hidden as far as the chain allows."""
    reader = Reader(dut, latency=latency)
    await reader.bench.reset()
    frame = make(reader, 3, 2, [5, 3000, 0, 90, 2, 30])
    walk = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]
    cycles = await reader.run(frame, walk)
    chunks = len(frame.read(1, 0).requests)
    dut._log.info("latency %d: %d cycles for %d chunks", latency, cycles, chunks)
    assert cycles < chunks * max(9, latency + 9) + 4 * latency + 100


@cocotb.test()
async def dram(dut):
    """DRAM timing."""
    reader = Reader(dut, "rare", "rare", latency=30, perfect=False)
    await reader.bench.reset()
    for slot in range(2):
        frame = make(reader, 6, 6, sizes_of(reader.rng, 36), slot)
        await reader.run(frame, frame.walk(reader.rng))


@cocotb.test()
async def clear(dut):
    """Clear at any time: nothing is asked for after it, what is under way is read, and the next frame is right."""
    reader = Reader(dut, "rare", "rare", latency=40)
    rng = reader.rng
    await reader.bench.reset()
    frames = [make(reader, 5, 5, sizes_of(rng, 25), slot) for slot in range(3)]
    frames[1].failing = [int(rng.choice(frames[1].written))]
    reader.port.port.fail_range((frames[1].list_base + frames[1].failing[0]) * LINE, 1)
    for turn in range(14):
        frame = frames[turn % 3]
        await reader.start(frame, frame.walk(rng))
        await reader.bench.cycles(rng.choice([1, 3, rng.randrange(60), rng.randrange(600)]))
        dut.clear_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        reader.tiles._task.cancel()
        dut.tile_valid_i.value = 0
        await RisingEdge(dut.clk_i)  # what was taken in the cycle of the clear has been seen
        reader.due.clear()
        await RisingEdge(dut.clk_i)
        asked = reader.beats.total()
        await reader.bench.until(lambda: int(dut.idle_o.value) == 1, 400, "idle after clear")
        assert reader.beats.total() <= asked + 3 * 8, "requests after clear"  # two in the splitter
        assert reader.port.port.idle, "idle with answers to come"
        reader.tiles = StreamSource(Stream(dut, "tile", ("x", "y")), reader.bench.stall("rare"))
        if turn % 2:
            await reader.run(frame, frame.walk(rng))


def break_header(frame: Frame, rng, line: int, kind: str) -> None:
    """One fault in a line's header."""
    word = int.from_bytes(frame.memory[line].tobytes(), "little")
    count, first = 15 << HEADER_AT, line % 8 == 0
    if kind == "none":
        word &= ~count
    elif kind == "tail":  # of a line that is none of a short one
        word |= 1 << TAIL_AT + rng.randrange(TAIL_BITS)
        if word >> HEADER_AT & 15 > LINE_ENTRIES:
            word = word & ~count | rng.randrange(1, LINE_ENTRIES + 1) << HEADER_AT
    elif kind == "rest":
        word |= 1 << HEADER_AT + 29 + rng.randrange(11)
    elif first:  # to itself, or a higher chunk
        here = line // 32
        link = rng.choice([here, here, (1 << 24) - 1])
        word = word & ~(((1 << 25) - 1) << HEADER_AT + 4) | (1 << 24 | link) << HEADER_AT + 4
    else:
        word |= 1 << HEADER_AT + 4 + rng.randrange(25)
    frame.memory[line] = np.frombuffer(word.to_bytes(LINE, "little"), np.uint64)


@cocotb.test()
@cocotb.parametrize(stall=["never", "half"])
async def faults(dut, stall):
    """Each fault of a pointer and of a header, and errors of the memory: the list ends, the next ones are whole, the next frame has no error."""
    reader = Reader(dut, stall, stall, latency=9)
    rng = reader.rng
    await reader.bench.reset()
    kinds = ["used none", "used many", "used high", "chunk", "pool", "memory", "pointer memory",
             "none", "tail", "rest", "link", "link", "rest", "none", "first"]
    for slot, kind in enumerate(kinds):
        frame = make(reader, 4, 4, sizes_of(rng, 16), slot, aligned=slot % 2 == 0)
        tiles = [t for t in range(16) if frame.read(t % 4, t // 4).requests]
        tile = max(tiles, key=lambda t: len(frame.read(t % 4, t // 4).lines)) if slot % 3 else rng.choice(tiles)
        x, y = tile % 4, tile // 4
        place = 16 * pointer_line(x, y, 4) + ((y >> 1) * 2 + (x >> 1)) % 16
        lines = [first + k for first, used in frame.read(x, y).requests for k in range(used)]
        if kind == "used none":
            frame.pointers[place] = frame.pointers[place] & 0xFFFFFF | 1
        elif kind == "used many":
            frame.pointers[place] = frame.pointers[place] & 0xFFFFFF | 9 << 24
        elif kind == "used high":
            frame.pointers[place] |= 1 << rng.randrange(28, 32)
        elif kind == "chunk":
            frame.pointers[place] = 8 << 24 | frame.chunks
        elif kind == "pool":
            frame.chunks = int(max(frame.read(t % 4, t // 4).requests[0][0] for t in tiles)) // 32  # the highest chunk in a pointer
        elif kind == "memory":
            frame.failing = [rng.choice(lines)]
            reader.port.port.fail_range((frame.list_base + frame.failing[0]) * LINE, 1)
        elif kind == "pointer memory":
            frame.failing_pointers = [pointer_line(x, y, 4)]
            reader.port.port.fail_range((frame.pointer_base + frame.failing_pointers[0]) * LINE, 1)
        elif kind == "first":
            break_header(frame, rng, lines[0], "link")
        else:
            break_header(frame, rng, rng.choice(lines), kind)
        frame.put(reader.memory)
        await reader.run(frame, frame.walk(rng))
        assert int(dut.error_o.value) == 1, kind
        if slot % 4 == 0:
            good = make(reader, 2, 2, [3, 100, 0, 20], 40 + slot)
            await reader.run(good, good.walk(rng))
            assert int(dut.error_o.value) == 0


@cocotb.test()
async def latency(dut):
    """From a tile to its list."""
    reader = Reader(dut, latency=50)
    await reader.bench.reset()
    frame = make(reader, 3, 1, [0, 5, 100])
    for x in range(3):
        before = reader.output.count
        await reader.start(frame, [(x, 0)])
        await reader.bench.until(lambda: dut.tile_valid_i.value == 1, 20, "tile")
        cycles = await reader.bench.until(lambda: reader.output.count > before, 1000, "line")
        dut._log.info("list of %d: %d cycles", frame.read(x, 0).lines[0].count, cycles)
        await reader.bench.until(lambda: not reader.due, 1000, "list")
        await reader.bench.cycles(10)
