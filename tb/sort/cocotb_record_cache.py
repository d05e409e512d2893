"""cocotb tests of flk_record_cache: records against the bytes in memory, requests against flicker.golden.delivery."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench, rounds

from flicker.chip.dram import DramConfig
from flicker.golden.delivery import LINE_BYTES, RecordCache
from flicker.sim.memory import Memory, PortConfig

RECORDS = 1 << 13
LAST = (1 << 24) - 64  # the last numbers that there are
BASE = (1 << 40) - (1 << 29) - 0xABC0  # the sum of an address carries far up, behind a sixth or a third of the records
Element = tuple[int, int, int, int, int]  # skip, record, tag, tile, tiles after it for which the line is wanted


class Cache:
    """The design with its memory; `queue`: elements to come."""

    def __init__(self, dut, idle: str = "never", latency: int = 5, pauses: float = 0.0, perfect: bool = True, fail: int | None = None, stall: str = "never"):
        self.dut, self.bench = dut, Bench(dut)
        self.bytes = len(dut.out_record_o) // 16
        rng = self.rng = self.bench.rng
        self.base = BASE // LINE_BYTES * LINE_BYTES
        memory = Memory(DramConfig().timing, perfect)
        memory.allocate(self.base, RECORDS * self.bytes, rng.getrandbits(30))
        memory.allocate(self.base + LAST * self.bytes, 64 * self.bytes, rng.getrandbits(30))
        self.data = memory.read(self.base, RECORDS * self.bytes)
        self.last = memory.read(self.base + LAST * self.bytes, 64 * self.bytes)
        self.port = MemoryPort(dut, memory, PortConfig(
            data_bits=256, latency=latency, max_reads=256, max_beats=1, stall={"AR": pauses, "R": pauses}, run={"AR": 4, "R": 3}, seed=rng.getrandbits(30),
        ), writes=False)
        if fail is not None:
            self.port.port.fail_range(self.base + fail * LINE_BYTES, 1)
        size = {name: int(getattr(dut, name).value) for name in ("Banks", "Sets", "Ways")}
        self.model = lambda: RecordCache(size["Banks"], size["Sets"], size["Ways"], self.bytes)
        self.golden = self.model()
        self.idle, self.stall = self.bench.stall(idle), self.bench.stall(stall)
        self.queue: deque[Element] = deque()
        self.due: deque[Element] = deque()
        self.lines: deque[int] = deque()  # to be asked for
        self.asked = self.taken = self.hits = 0
        dut.start_i.value = dut.in_valid_i.value = dut.out_ready_i.value = 0
        dut.record_base_i.value = self.base // LINE_BYTES
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        tag_bits, number_bits = len(dut.in_tag_i) // 2, len(dut.in_record_i) // 2
        offered, ready = [None, None], 0  # elements at the inputs
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            self._requests()
            self._outputs(tag_bits, ready)
            ready = int(dut.out_ready_i.value)
            taken = int(dut.in_ready_o.value)
            assert taken != 2, "input 1 before input 0"
            stopped = int(dut.start_i.value) | int(dut.clear_i.value)
            for c in range(2):
                if offered[c] is not None and taken >> c & 1:
                    skip, record, _, tile, until = element = offered[c]
                    offered[c] = None
                    self.queue.popleft()
                    if stopped:
                        continue
                    self.taken += 1
                    self.due.append(element)
                    if not skip:
                        line, miss = self.golden.lookup(record, tile, until)
                        self.hits += not miss
                        if miss:
                            self.lines.append(line)
            if stopped:
                self.forget()
            left = [element for element in offered if element is not None]
            if len(self.queue) < len(left):
                left = []  # a clear took them
            if len(left) == 1 and self.rng.random() < 0.5:
                offered = [None, *left]  # what waited stays where it was, or moves up
            else:
                while len(left) < min(2, len(self.queue)) and self.queue[len(left)][3] == self.queue[0][3] and not next(self.idle):
                    left.append(self.queue[len(left)])
                offered = [*left, None, None][:2]
            heads = [element or (self.rng.getrandbits(1), self.rng.getrandbits(number_bits), 0, 0, self.rng.getrandbits(6)) for element in offered]
            tiles = {element[3] for element in offered if element} or {self.rng.getrandbits(6)}
            assert len(tiles) == 1
            dut.in_valid_i.value = sum((element is not None) << c for c, element in enumerate(offered))
            dut.in_skip_i.value = sum(heads[c][0] << c for c in range(2))
            dut.in_record_i.value = sum(heads[c][1] << number_bits * c for c in range(2))
            dut.in_tag_i.value = sum(heads[c][2] << tag_bits * c for c in range(2))
            dut.in_tile_i.value = (tile := tiles.pop()) % 64
            dut.in_until_i.value = sum((tile + heads[c][4]) % 64 << 6 * c for c in range(2))
            dut.out_ready_i.value = not next(self.stall)

    def forget(self) -> None:
        self.golden = self.model()
        self.due.clear()
        self.lines.clear()
        self.asked = 0

    def _requests(self) -> None:
        dut = self.dut
        if dut.ar_valid_o.value == 1 and dut.ar_ready_i.value == 1:
            assert int(dut.ar_len_o.value) == 0
            if self.watching:
                assert self.lines, "a line that nobody needs"
                line = self.lines.popleft()
                assert int(dut.ar_addr_o.value) == self.base + line * LINE_BYTES, f"line {(int(dut.ar_addr_o.value) - self.base) // LINE_BYTES}, due {line}"
                self.asked += 1
        if dut.r_valid_i.value == 1:
            assert dut.r_ready_o.value == 1, "the port waits"

    watching = True
    wrong = False  # data may be: errors

    def _outputs(self, tag_bits: int, ready: int) -> None:
        """ready: whether out_ready_i was high in the cycle before."""
        dut = self.dut
        valid = int(dut.out_valid_o.value)
        assert ready or not valid, "an element that had no place"
        for c in range(2):
            if valid >> c & 1:
                assert self.due, f"output {c}: an element too many"
                skip, record, tag, _, _ = self.due.popleft()
                got = int(dut.out_tag_o.value) >> tag_bits * c & (1 << tag_bits) - 1
                assert got == tag, f"output {c}: tag {got}, due {tag}"
                if not skip and not self.wrong:
                    data = int(dut.out_record_o.value) >> 8 * self.bytes * c & (1 << 8 * self.bytes) - 1
                    data_of, at = (self.last, record - LAST) if record >= LAST else (self.data, record)
                    want = int.from_bytes(data_of[at * self.bytes : (at + 1) * self.bytes], "little")
                    assert data == want, f"output {c}: record {record}: {data:#x}, due {want:#x}"

    async def ready(self) -> None:
        await self.bench.until(lambda: int(self.dut.idle_o.value) == 1, 2000, "idle")

    async def through(self, limit: int = 60_000) -> int:
        cycles = await self.bench.until(lambda: not self.queue and not self.due, limit, "last record")
        await self.bench.cycles(4)
        await self.ready()
        assert not self.lines and int(self.dut.lines_o.value) == self.asked
        return cycles


def elements(rng, count: int, tag_bits: int) -> list[Element]:
    """Runs of records: one line, one set, neighbours, anywhere; some again soon. Tiles of 1 to 60 of them, lines that are wanted for none to two more."""
    out: list[int] = []
    tile = rng.randrange(100)
    while len(out) < count:
        first, n = rng.randrange(RECORDS), rng.randrange(1, 20)
        kind = rng.randrange(6)
        if kind == 0:
            out += [first ^ rng.getrandbits(1) for _ in range(n)]
        elif kind == 1:
            out += [(first + 512 * rng.randrange(16)) % RECORDS for _ in range(n)]
        elif kind == 2:
            out += [(first + k) % RECORDS for k in range(n)]
        elif kind == 3 and out:
            out += [rng.choice(out[-100:]) for _ in range(2 * n)]
        elif kind == 4:  # the last ones, and the same with one bit less
            out += [LAST + rng.choice((63, rng.randrange(64))) if rng.random() < 0.7 else first for _ in range(n)]
        else:
            out += [rng.randrange(RECORDS) for _ in range(n)]
    made: list[Element] = []
    share = rng.choice((0.03, 0.2, 0.8))
    for record in out[:count]:
        tile += rng.random() < share
        made.append((int(rng.random() < 0.05), record, rng.getrandbits(tag_bits), tile, rng.choice((-1, 1, 2))))
    return made


def fill(cache: Cache, count: int) -> None:
    cache.queue.extend(elements(cache.rng, count, len(cache.dut.in_tag_i) // 2))


PATTERNS = [("never", 0.0, 1, "never"), ("half", 0.4, 10, "rare"), ("never", 0.0, 100, "bursts"), ("bursts", 0.2, 30, "half"), ("heavy", 0.0, 3, "never"),
            ("never", 0.0, 10, "heavy")]


@cocotb.test()
@cocotb.parametrize((("idle", "pauses", "latency", "stall"), PATTERNS))
async def records(dut, idle, pauses, latency, stall):
    cache = Cache(dut, idle, latency, pauses, stall=stall)
    await cache.bench.reset()
    await cache.ready()
    fill(cache, rounds(600, 2200))
    await cache.through()
    assert cache.hits > 100


@cocotb.test()
async def rate(dut):
    """Lookups that hit: two a cycle, but for those of one bank."""
    cache = Cache(dut)
    await cache.bench.reset()
    await cache.ready()
    step = 32 // cache.bytes
    banks = int(dut.Banks.value)
    warm = [(0, step * k, 0, 0, -1) for k in range(banks)]
    cache.queue.extend(warm)
    await cache.through()
    for shift, limit in ((1, 0.55), (0, 1.05)):
        cache.queue.extend((0, step * (shift * k % banks), k % 4, 0, -1) for k in range(800))
        cycles = await cache.through()
        assert cycles < 800 * limit + 20, f"{cycles} cycles"


@cocotb.test()
async def latency(dut):
    """Four cycles from a lookup that hits to its record."""
    cache = Cache(dut)
    await cache.bench.reset()
    await cache.ready()
    cache.queue.append((0, 7, 1, 0, -1))
    await cache.through()
    cache.queue.append((0, 7, 2, 0, -1))
    edge = RisingEdge(dut.clk_i)
    while not int(dut.in_valid_i.value):
        await edge
    assert int(dut.in_ready_o.value) & 1
    cycles = 0
    while not int(dut.out_valid_o.value):
        await edge
        cycles += 1
    assert cycles == 4, f"{cycles} cycles"
    await cache.through()


@cocotb.test()
async def wanted(dut):
    """A wanted line outlives as many others of its set as there are ways; one that is not goes in its turn; wanted lines alone do not stop others."""
    cache = Cache(dut)
    await cache.bench.reset()
    await cache.ready()
    ways, step = int(dut.Ways.value), 32 // cache.bytes * int(dut.Banks.value) * int(dut.Sets.value)
    limit = RECORDS // step
    for until, lines, again in ((2, ways + 1, False), (-1, ways + 1, True), (2, 2 * ways, False)):
        if lines >= limit:
            continue
        dut.start_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.start_i.value = 0
        cache.forget()
        await RisingEdge(dut.clk_i)
        await cache.ready()
        others = [(0, step * k, 0, 1, -1) for k in range(1, lines)]
        cache.queue.extend([(0, 0, 0, 0, until), *others])
        await cache.through()
        asked = cache.asked
        cache.queue.append((0, 0, 0, 2, -1))
        await cache.through()
        assert (cache.asked > asked) == again, f"wanted for {until} tiles, {lines} lines"
    cache.queue.extend((0, step * (k % limit), 0, 2, 2) for k in range(3 * limit))
    await cache.through()


@cocotb.test()
async def dram(dut):
    """DRAM timing."""
    cache = Cache(dut, "rare", 30, perfect=False)
    await cache.bench.reset()
    await cache.ready()
    fill(cache, 800)
    await cache.through()


@cocotb.test()
async def stops(dut):
    """start_i when idle, clear_i at any time: nothing is in the cache afterwards, nothing of before comes."""
    cache = Cache(dut, "rare", 40, 0.1)
    rng = cache.rng
    await cache.bench.reset()
    await cache.ready()
    for turn in range(12):
        fill(cache, rng.choice([10, 100, 300]))
        if turn % 3 == 0:
            await cache.through()
            dut.start_i.value = 1
        else:
            await cache.bench.cycles(rng.randrange(250))
            dut.clear_i.value = 1
            while len(cache.queue) > 2:
                cache.queue.pop()
        cache.watching = False
        await RisingEdge(dut.clk_i)
        dut.start_i.value = dut.clear_i.value = 0
        await RisingEdge(dut.clk_i)
        assert dut.idle_o.value == 0
        cache.queue.clear()
        await cache.bench.until(lambda: int(dut.idle_o.value) == 1, 3000, "idle")
        assert cache.port.port.idle
        cache.forget()
        cache.watching = True
    fill(cache, 200)
    await cache.through()


@cocotb.test()
async def errors(dut):
    """An error of the memory is told until the next start, and nothing hangs."""
    cache = Cache(dut, latency=10, fail=5)
    cache.wrong = True
    await cache.bench.reset()
    await cache.ready()
    per = 32 // cache.bytes
    cache.queue.extend((0, per * k, 0, 0, -1) for k in range(5))
    await cache.through()
    assert dut.error_o.value == 0
    cache.queue.extend((0, per * k, 0, 0, -1) for k in range(8))
    await cache.through()
    assert dut.error_o.value == 1
    dut.start_i.value = 1
    await RisingEdge(dut.clk_i)
    dut.start_i.value = 0
    await cache.bench.cycles(2)
    assert dut.error_o.value == 0
