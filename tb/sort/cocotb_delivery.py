"""cocotb tests of flk_delivery: what each core gets against flicker.golden.delivery."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.axi import MemoryPort
from flicker_tb.bench import Bench, config, rounds

from flicker.chip.dram import DramConfig
from flicker.golden.delivery import END, LINE_BYTES, SUBTILES, core_records
from flicker.sim.memory import Memory, PortConfig

BASE, RECORDS = 0x7_6543_2100 // LINE_BYTES * LINE_BYTES, 1 << 12
Tile = list[tuple[int, int]]
CORES = config().get("Cores", SUBTILES)


class Unit:
    """What stands for a sorting unit and its buffer: its tiles' entries, an end behind each; the rest of a list is dropped when finish_o says so."""

    def __init__(self) -> None:
        self.lists: deque[tuple[int, deque[tuple[int, int]]]] = deque()  # number of the tile, entries left
        self.offered = 0

    @property
    def most(self) -> int:
        """Elements that may be offered: a pair does not go beyond the end of a list."""
        return min(2, len(self.lists[0][1]) + 1) if self.lists else 0

    def item(self, k: int) -> tuple[int, int, int]:
        """End, record, mask."""
        entries = self.lists[0][1]
        return (0, *entries[k]) if k < len(entries) else (1, 0, 0)

    def move(self) -> None:
        for _ in range(self.offered):
            if self.lists[0][1]:
                self.lists[0][1].popleft()
            else:
                self.lists.popleft()
        self.offered = 0


class Delivery:
    """The design with its memory, units and cores. finish: share of the tiles of which a sub-tile finishes early; pace: of each core, cycles from record to
    record.
    deaf: units give all, as their buffers do with what they hold of a finished list."""

    def __init__(self, dut, idle="never", stall="never", latency=5, pauses=0.0, finish=0.0, pace=(1, 1, 1, 1), perfect=True, deaf=False):
        self.dut, self.bench, self.finish, self.pace, self.deaf = dut, Bench(dut), finish, pace, deaf
        rng = self.rng = self.bench.rng
        self.count = int(dut.Units.value)  # sorting units
        self.width = len(dut.out_valid_o) // CORES  # elements that a core takes in a cycle
        self.bytes = len(dut.out_record_o) // (8 * CORES * self.width)
        memory = Memory(DramConfig().timing, perfect)
        memory.allocate(BASE, RECORDS * self.bytes, rng.getrandbits(30))
        data = memory.read(BASE, RECORDS * self.bytes)
        self.data = [int.from_bytes(data[k : k + self.bytes], "little") for k in range(0, len(data), self.bytes)]
        self.port = MemoryPort(dut, memory, PortConfig(
            data_bits=256, latency=latency, max_reads=256, max_beats=1, stall={"AR": pauses, "R": pauses}, seed=rng.getrandbits(30),
        ), writes=False)
        self.idle = [self.bench.stall(idle) for _ in range(self.count)]
        self.stall = [self.bench.stall(stall) for _ in range(CORES)]
        for name in ("start", "in_valid", "in_end", "in_entry", "out_ready", "finished"):
            getattr(dut, f"{name}_i").value = 0
        dut.record_base_i.value = BASE // LINE_BYTES
        self.reset()
        cocotb.start_soon(self._run())

    def reset(self) -> None:
        self.tiles: list[Tile] = []
        self.units = [Unit() for _ in range(self.count)]
        self.due: list[deque[tuple[int, int] | None]] = [deque() for _ in range(CORES)]
        self.tile = [0] * CORES  # that the core is taking
        self.rest = [0] * CORES  # cycles until it takes the next one
        # Of each sub-tile of the tile that its core is taking:
        self.got = [0] * SUBTILES  # records
        self.finished = [False] * SUBTILES
        self.dropped = [False] * SUBTILES  # a record did not come
        self.finishes: list[list[int | None]] = [[] for _ in range(SUBTILES)]  # by tile: records after which it is finished
        self.after = [0] * SUBTILES  # records since
        self.over = [0] * CORES  # records since all of a core's are
        self.finish_seen = 0
        self.records = 0
        self.late = 0
        self.together = 0  # pairs that a core took
        self.waits = [0] * 4

    def give(self, tiles: list[Tile]) -> None:
        """Tiles of a frame, in the order of the walk."""
        first = len(self.tiles)
        assert first % self.count == 0
        self.tiles += tiles
        for k, entries in enumerate(tiles):
            self.units[k % self.count].lists.append((first + k, deque(entries)))
        for k in range(CORES):
            self.due[k].extend(core_records(tiles, k, CORES))
        for s in range(SUBTILES):
            self.finishes[s] += [self.rng.choice([0, 0, 1, self.rng.randrange(1, 60)]) if self.rng.random() < self.finish else None for _ in tiles]

    async def _run(self) -> None:
        dut, edge = self.dut, RisingEdge(self.dut.clk_i)
        bits, number = 8 * self.bytes, len(dut.in_entry_i) // (2 * self.count)
        ready = 0
        turn, due = 0, 0  # unit that is taken from; waits_o of it in the next cycle
        step = 0  # of the walk
        dut.border_i.value = 0
        told: list[set[int]] = [set() for _ in range(SUBTILES)]
        while True:
            await edge
            if dut.rst_ni.value != 1:
                continue
            if dut.r_valid_i.value == 1:
                assert dut.r_ready_o.value == 1, "the port waits"
            if not self.tiles:
                told = [set() for _ in range(SUBTILES)]
            if dut.clear_i.value == 1:
                ready = turn = due = 0
                continue
            # Waits
            offered, taken, waits = self.units[turn].offered, int(dut.in_ready_o.value) >> turn & 1, int(dut.waits_o.value)
            assert waits & 3 == due, f"waits_o {waits:#x}, due {due}, unit {turn}"
            due = (not offered and taken) + 2 * (offered > 0 and not taken)
            assert waits >> 2 != 3, "the head waits for two things"
            self.waits = [n + (waits >> k & 1) for k, n in enumerate(self.waits)]
            if offered and taken and any(self.units[turn].item(k)[0] for k in range(offered)):
                turn = (turn + 1) % self.count
                assert dut.taken_o.value == 1
                step += 1
                dut.border_i.value = 91 * step % 256
            else:
                assert dut.taken_o.value == 0
            # Units
            moved, finish = int(dut.in_ready_o.value), int(dut.finish_o.value)
            for u, unit in enumerate(self.units):
                if finish >> u & 1:
                    assert unit.lists, f"finish_o of unit {u}, which has no list"
                    tile = unit.lists[0][0]
                    assert all(tile in told[s] for s in range(SUBTILES)), f"finish_o of unit {u} for tile {tile}"
                    self.finish_seen += 1
                if unit.offered and moved >> u & 1:
                    unit.move()
                elif finish >> u & 1 and unit.lists and not self.deaf:  # the rest of the list is dropped but for what is offered
                    entries = unit.lists[0][1]
                    while len(entries) > unit.offered:
                        entries.pop()
                while unit.offered < unit.most and not next(self.idle[u]):  # one, or two; a second may join
                    unit.offered += 1
            # Cores
            valid, ends = int(dut.out_valid_o.value), int(dut.out_end_o.value)
            record, subtile = (int(port.value) if valid and ready else 0 for port in (dut.out_record_o, dut.out_subtile_o))
            for s in range(CORES):
                if self.rest[s]:
                    self.rest[s] -= 1
                given = valid >> self.width * s & (1 << self.width) - 1
                if not ready >> s & 1 or not given:
                    continue
                assert given & 1, f"core {s}: the younger element alone"
                self.together += given == 3
                for at in range(self.width * s, self.width * s + given.bit_length()):
                    tile = self.tile[s]
                    self._element(s, bool(ends >> at & 1), record >> bits * at & (1 << bits) - 1, subtile >> 2 * at & 3)
                assert given == 1 or tile == self.tile[s] or ends >> at & 1, f"core {s}: elements of two lists together"
                for m in range(s, SUBTILES, CORES):
                    if not self.finished[m] and self.tile[s] < len(self.tiles):
                        limit = self.finishes[m][self.tile[s]]
                        self.finished[m] = limit is not None and self.got[m] >= limit
                    if self.finished[m]:
                        told[m].add(self.tile[s])
            ready = sum((not self.rest[s] and not next(self.stall[s])) << s for s in range(CORES))
            dut.out_ready_i.value = ready
            dut.finished_i.value = sum(f << s for s, f in enumerate(self.finished))
            junk = (self.rng.getrandbits(1), self.rng.getrandbits(number - 4), 15)
            items = [unit.item(k) if k < unit.offered else junk for unit in self.units for k in range(2)]
            dut.in_valid_i.value = sum(((1 << unit.offered) - 1) << 2 * u for u, unit in enumerate(self.units))
            dut.in_end_i.value = sum(item[0] << k for k, item in enumerate(items))
            dut.in_entry_i.value = sum((item[1] << 4 | item[2]) << number * k for k, item in enumerate(items))

    def _element(self, k: int, end: bool, record: int, subtile: int) -> None:
        due = self.due[k]
        where = f"core {k}, tile {self.tile[k]}, records {self.got}"
        assert due, f"core {k}: an element too many"
        while due[0] is not END and (end or due[0][1] != subtile) and self.finished[due[0][1]]:
            self.dropped[due.popleft()[1]] = True
        if end:
            assert due.popleft() is END, f"{where}: end"
            self.tile[k] += 1
            for s in range(k, SUBTILES, CORES):
                self.got[s], self.finished[s], self.dropped[s], self.after[s] = 0, False, False, 0
            self.over[k] = 0
            return
        assert due[0] is not END, f"{where}: no end"
        number, s = due.popleft()
        assert s == subtile and not self.dropped[s], f"{where}: for sub-tile {subtile}, due is {s}"
        assert record == self.data[number], f"{where}: {record:#x}, due {number}: {self.data[number]:#x}"
        self.got[s] += 1
        self.records += 1
        self.after[s] += self.finished[s]
        self.late += self.finished[s]
        assert self.after[s] <= int(self.dut.Queue.value) + 2, f"{where}: {self.after[s]} records since sub-tile {s} is finished"
        self.over[k] += all(self.finished[m] for m in range(k, SUBTILES, CORES))
        assert self.over[k] <= self.width, f"{where}: {self.over[k]} records since the core is finished"
        self.rest[k] = self.pace[k] - 1

    async def ready(self) -> None:
        await self.bench.until(lambda: int(self.dut.idle_o.value) == 1, 2000, "idle")

    async def run(self, tiles: list[Tile]) -> int:
        self.give(tiles)
        limit = 4000 + 60 * sum(len(t) + 1 for t in tiles)
        cycles = await self.bench.until(lambda: not any(self.due) and not any(unit.lists for unit in self.units), limit, "last end")
        await self.bench.cycles(3)
        await self.ready()
        return cycles


def make(rng, count: int, longest: int = 60) -> list[Tile]:
    """Lists of tiles that share records with the ones before."""
    tiles: list[Tile] = []
    recent = [rng.randrange(RECORDS) for _ in range(100)]
    for _ in range(count):
        n = rng.choice([0, 1, rng.randrange(longest), rng.randrange(longest), longest])
        kind = rng.randrange(4)
        masks = [15, 1 << rng.randrange(4), 0, 0][kind]
        tile = [(rng.choice(recent) if rng.random() < 0.7 else rng.randrange(RECORDS), masks or rng.randrange(1, 16)) for _ in range(n)]
        recent = (recent + [r for r, _ in tile])[-300:]
        tiles.append(tile)
    return tiles


PATTERNS = [("never", "never", 3, 0.0), ("half", "half", 10, 0.3), ("never", "heavy", 1, 0.0), ("bursts", "never", 80, 0.0), ("rare", "bursts", 20, 0.2)]


@cocotb.test()
@cocotb.parametrize((("idle", "stall", "latency", "pauses"), PATTERNS))
async def tiles(dut, idle, stall, latency, pauses):
    """Every core gets all its records."""
    test = Delivery(dut, idle, stall, latency, pauses)
    await test.bench.reset()
    await test.ready()
    await test.run(make(test.rng, rounds(25, 40)))
    assert test.records > 500 and dut.error_o.value == 0
    assert test.width == 1 or test.together > 50


FINISHING = [("never", "never", 5, 0.3), ("never", "half", 40, 0.9), ("half", "never", 10, 0.97), ("rare", "bursts", 1, 0.6)]


@cocotb.test()
@cocotb.parametrize((("idle", "stall", "latency", "share"), FINISHING))
async def finishing(dut, idle, stall, latency, share):
    """Cores finish early: what they get is the beginning of their list."""
    test = Delivery(dut, idle, stall, latency, finish=share)
    await test.bench.reset()
    await test.ready()
    await test.run(make(test.rng, rounds(15, 60), 200) + make(test.rng, rounds(1, 4), 1000))
    assert test.records > 200 and (share < 0.9 or test.finish_seen)


@cocotb.test()
@cocotb.parametrize(slow=[0, 3])
async def pace(dut, slow):
    """One core takes a record every eight cycles: the others go on until its queue is full."""
    test = Delivery(dut, pace=tuple(8 if s == slow else 1 for s in range(CORES)), finish=0.1)
    await test.bench.reset()
    await test.ready()
    await test.run(make(test.rng, 12, 120))
    assert test.waits[2] > 200, f"waits {test.waits}"


@cocotb.test()
async def ends_alone(dut):
    """Empty lists, and a core that takes nothing until all stands still: as many ends as there may be are between the units and it."""
    test = Delivery(dut)
    room = int(dut.Queue.value) + int(dut.Depth.value)
    await test.bench.reset()
    await test.ready()
    test.rest[0] = 3 * room
    test.give([[] for _ in range(room + room % 4 + 40)])
    await test.bench.until(lambda: test.rest[0] < room, 3 * room, "a core that takes again")
    assert test.tile[0] == 0 and len(test.tiles) > len(test.tiles) - sum(len(unit.lists) for unit in test.units) >= room, "ends that are under way"
    await test.run(make(test.rng, 8))


@cocotb.test()
@cocotb.parametrize(deaf=[False, True])
async def all_finished(dut, deaf):
    """All cores finished with their tiles at once: of long lists no more is looked up than before they are there, whether the unit drops the rest or not."""
    test = Delivery(dut, latency=30, deaf=deaf)
    await test.bench.reset()
    await test.ready()
    lists = [[(test.rng.randrange(RECORDS), 15) for _ in range(300)] for _ in range(8)]
    test.finish = 1.0
    test.rng.choice = lambda _: 0
    await test.run(lists)
    assert int(dut.lines_o.value) < 8 * 68, f"{int(dut.lines_o.value)} lines"
    assert test.finish_seen >= 8


@cocotb.test()
async def dropped(dut):
    """Slow cores that finish with full queues: what these hold makes room for the next tile."""
    test = Delivery(dut, pace=(4, 4, 4, 4), finish=1.0)
    await test.bench.reset()
    await test.ready()
    test.rng.choice = lambda _: 40
    cycles = await test.run([[(test.rng.randrange(RECORDS), 15) for _ in range(400)] for _ in range(12)])
    assert test.finish_seen and cycles < 12 * (4 * SUBTILES // CORES * 42 + 150), f"{cycles} cycles"


@cocotb.test()
async def rate(dut):
    """Two entries a cycle, nearly, for cores that take all; records in the cache."""
    test = Delivery(dut)
    await test.bench.reset()
    await test.ready()
    # Entries of one core each, in turn, and lines of different banks.
    lists = [[((2 * k + t % 2) % 64 * 2, 1 << k % 4) for k in range(400)] for t in range(8)]
    await test.run(lists[:4])
    cycles = await test.run(lists)
    assert cycles < 8 * 400 * 0.55 + 100, f"{cycles} cycles"


@cocotb.test()
async def rate_of_one(dut):
    """All entries of one core: it takes as many a cycle as it may."""
    test = Delivery(dut)
    await test.bench.reset()
    await test.ready()
    lists = [[((2 * k + t % 2) % 64 * 2, 1) for k in range(400)] for t in range(8)]
    await test.run(lists[:4])
    cycles = await test.run(lists)
    assert 8 * 400 / test.width <= cycles < 8 * 400 / test.width * 1.1 + 100, f"{cycles} cycles"


@cocotb.test()
async def waits(dut):
    """Records that come late are waited for at the cache's head, and there alone, by cores that take all."""
    test = Delivery(dut, latency=200)
    await test.bench.reset()
    await test.ready()
    await test.run([[(2 * (100 * t + k), 1 << k % 4) for k in range(100)] for t in range(8)])
    assert test.waits[2] == 0 and test.waits[3] > 200, f"waits {test.waits}"
    before = test.waits[3]
    await test.run([[(2 * k % 64, 1 << k % 4) for k in range(100)] for _ in range(8)])
    assert test.waits[3] - before < 300, f"waits {test.waits}, {before} before: lines are in the cache"


@cocotb.test()
async def latency(dut):
    """Seven cycles from the transfer of an entry, whose record is in the cache, to its record."""
    test = Delivery(dut)
    await test.bench.reset()
    await test.ready()
    await test.run([[(5, 15)], [], [], []])
    test.give([[(5, 15)], [], [], []])
    edge = RisingEdge(dut.clk_i)
    while not (int(dut.in_valid_i.value) & 1 and int(dut.in_ready_o.value) & 1):
        await edge
    cycle = 0
    while not int(dut.out_valid_o.value):
        await edge
        cycle += 1
    assert cycle == 7, f"{cycle} cycles"
    first = sum(1 << test.width * s for s in range(CORES))  # of each core
    assert int(dut.out_valid_o.value) & first == first and int(dut.out_end_o.value) & first == 0
    await test.bench.until(lambda: not any(test.due), 100, "last end")


@cocotb.test()
async def clear(dut):
    """Clear at any time; the next frame is right."""
    test = Delivery(dut, "rare", "rare", 30, 0.1, finish=0.3)
    await test.bench.reset()
    await test.ready()
    for turn in range(10):
        test.give(make(test.rng, 16))
        await test.bench.cycles(test.rng.randrange(20, 400))
        dut.clear_i.value = 1
        await RisingEdge(dut.clk_i)
        dut.clear_i.value = 0
        for name in ("in_valid", "out_ready", "finished"):
            getattr(dut, f"{name}_i").value = 0
        test.reset()
        await RisingEdge(dut.clk_i)
        test.stall, stall = [iter(lambda: True, None)] * CORES, test.stall
        await test.ready()
        assert test.port.port.idle
        test.stall = stall
        if turn % 3 == 0:
            await test.run(make(test.rng, 16))
