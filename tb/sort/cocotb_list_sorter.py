"""cocotb tests of flk_list_sorter: what leaves, what is written back and which of its lines are read, against the golden model."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb import stalls
from flicker_tb.axi import MemoryPort, unpack
from flicker_tb.bench import Bench, config, rounds
from flicker_tb.list_lines import lines_of

from flicker.chip.dram import DramConfig
from flicker.chip.long_lists import ORDERS, make_list
from flicker.golden.lists import HEADER_AT
from flicker.golden.long_lists import LongList, run_lines, sort_long
from flicker.perf import long_lists as perf
from flicker.sim.memory import Memory, PortConfig

CELLS, STAGES, WAYS = config().get("cells", 16), config().get("stages", 7), config().get("ways", 8)
RUNS, MERGE_LINES = config().get("runs", 64), config().get("merge_lines", 128)
CAPACITY = CELLS << STAGES
OUT = (1 << 28) - 1
LINE = 64
BASE = 3 * 4096 // LINE - 5  # of the region, in lines: not at a page's beginning
PATTERNS = (("never", "never", "never", 0.0), ("half", "half", "half", 0.2), ("never", "rare", "heavy", 0.5), ("heavy", "half", "never", 0.0),
            ("bursts", "alternate", "bursts", 0.1))


@dataclass
class Job:
    """A list. finish: delivered entries after which it is finished, or None."""

    entries: np.ndarray
    golden: LongList | None
    order: list[int]
    finish: int | None = None
    out: list[int] = field(default_factory=list)
    finished: bool = False
    first: int = -1
    ended: int = -1


def make_job(rng: np.random.Generator, n: int, order: str, finish: int | None = None) -> Job:
    entries = make_list(rng, n, order) if n else np.zeros(0, np.uint64)
    long = sort_long(entries, CAPACITY, RUNS) if n > CAPACITY else None
    return Job(entries, long, (np.sort(entries) & np.uint64(OUT)).tolist(), finish)


class Sorter:
    """The design with its memory. share: of failing answers."""

    def __init__(self, dut, pauses: float = 0.0, latency: int = 20, perfect: bool = True) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        self.draw = np.random.default_rng(self.rng.getrandbits(32))
        for name in ("start", "in_valid", "in_entries", "in_count", "in_last", "out_ready", "finish", "write_ready", "written"):
            getattr(dut, f"{name}_i").value = 0
        dut.base_i.value = BASE
        self.memory = Memory(DramConfig().timing, perfect)
        self.size = RUNS * run_lines(CAPACITY) * LINE
        self.memory.allocate(BASE * LINE, self.size)
        self.port = MemoryPort(dut, self.memory, PortConfig(
            latency=latency, max_reads=64, max_beats=8, stall={"AR": pauses, "R": pauses}, run={"AR": 4, "R": 3}, seed=self.rng.getrandbits(30),
        ), writes=False)
        self.wrote: list[int] = []  # lines, of the list that is sorted
        self.data: dict[int, int] = {}
        self.read: Counter[int] = Counter()
        self.written_after = (1, 40)

    async def run(self, jobs: list[Job], patterns: tuple[str, str, str] = ("never",) * 3, full: bool = False, pause: int = 0) -> int:
        """The lists one after the other; patterns of lines, writes and output. pause: cycles between what the unit holds of a list and its next line.
        Cycles."""
        dut, rng, edge = self.dut, self.rng, RisingEdge(self.dut.clk_i)
        idle, wait, stall = (stalls.make(p, rng) for p in patterns)
        cut = CAPACITY if pause else 0
        source: deque[tuple[int, int, int, int]] = deque((k, *line) for k, job in enumerate(jobs) for line in lines_of(job.entries, rng, full, cut))
        came, not_before = 0, 0  # entries of the list, cycle
        offered, out, cycle, written_at, held = False, 0, 0, 0, None
        limit = 20_000 + 60 * sum(len(j.entries) for j in jobs)
        pending: deque[tuple[int, int, int]] = deque()
        while out < len(jobs):
            offered = offered or (bool(source) and cycle >= not_before and not next(idle))
            which, word, count, last = source[0] if offered else (0, rng.getrandbits(HEADER_AT), rng.randrange(16), rng.randrange(2))
            job = jobs[out]
            finish = int(job.finish is not None and len(job.out) >= job.finish)
            job.finished = job.finished or bool(finish)
            accept, ready = int(not next(wait)), int(not next(stall))
            while pending and pending[0][0] <= cycle:
                _, beat, data = pending.popleft()
                self.memory.write(beat * LINE, data.to_bytes(LINE, "little"))
            dut.in_valid_i.value, dut.in_entries_i.value, dut.in_count_i.value, dut.in_last_i.value = int(offered), word, count, last
            dut.write_ready_i.value, dut.out_ready_i.value, dut.finish_i.value = accept, ready, finish
            dut.written_i.value = int(not pending)
            await edge
            if offered and int(dut.in_ready_o.value):
                if jobs[which].first < 0:
                    jobs[which].first = cycle
                source.popleft()
                offered = False
                came = 0 if last else came + count
                if pause and came == CAPACITY:
                    not_before = cycle + pause
            if int(dut.ar_valid_o.value) and int(dut.ar_ready_i.value):
                ar = unpack("ar", int(dut.ar_o.value))
                at = ar["addr"] // LINE
                self.read.update(range(at, at + ar["len"] + 1))
            if int(dut.write_valid_o.value) and accept:
                beat, data = int(dut.write_beat_o.value), int(dut.write_data_o.value)
                written_at = max(written_at, cycle + rng.randrange(*self.written_after))
                pending.append((written_at, beat, data))
                self.wrote.append(beat)
                self.data[beat] = data
            if int(dut.out_valid_o.value):
                got = (int(dut.out_end_o.value), int(dut.out_entry_o.value))
                got = (1, 0) if got[0] else got
                assert held in (None, got), "output changed before its transfer"
                held = None if ready else got
                if ready:
                    self.check(out, job, got)
                    if got[0]:
                        job.ended, out = cycle, out + 1
            else:
                assert held is None, "valid fell"
            cycle += 1
            assert cycle < limit, f"stands still: list {out} of {len(jobs)}, {len(job.out)} of {len(job.entries)} entries"
        dut.finish_i.value = dut.in_valid_i.value = 0
        for _ in range(400):
            await edge
            assert int(dut.out_valid_o.value) == 0 and int(dut.write_valid_o.value) == 0
            if int(dut.idle_o.value):
                break
        assert int(dut.idle_o.value) == 1
        return cycle

    def check(self, n: int, job: Job, got: tuple[int, int]) -> None:
        at, place = len(job.out), f"list {n}, element {len(job.out)} of {len(job.entries)}"
        if got[0]:
            assert job.finished or at == len(job.entries), f"{place}: end"
            if job.golden is not None:
                self.check_moved(place, job.golden, job.finished)
            return
        assert at < len(job.entries), f"{place}: an entry after the last"
        assert got[1] == job.order[at], f"{place}: {got[1]:#x}, due {job.order[at]:#x}"
        job.out.append(got[1])

    def check_moved(self, place: str, golden: LongList, finished: bool) -> None:
        """What was written of the list that has left, its lines in order, and read: each once, of a list that was finished none twice. One that was finished
        before it was known to be long is not written at all."""
        if finished and not self.wrote:
            assert not self.read, f"{place}: lines read of a list that was not written"
            return
        lines = [BASE + place for place in golden.places]
        assert self.wrote == lines, f"{place}: lines written"
        memory = b"".join(self.data[line].to_bytes(LINE, "little") for line in lines)
        assert memory == golden.memory().tobytes(), f"{place}: what is written"
        assert self.read == Counter(lines) or (finished and self.read <= Counter(lines)), f"{place}: lines read"
        self.wrote.clear()
        self.read.clear()


def sizes() -> list[int]:
    return [0, 1, CAPACITY, CAPACITY + 1, 2 * CAPACITY, 2 * CAPACITY + 1, 3 * CAPACITY - 1]


@cocotb.test()
@cocotb.parametrize(("which", [0, 1, 3, 4, 2][: rounds(4, 5)]))
async def lists(dut, which):
    """Lists around whole runs, in every order, short ones between them."""
    *patterns, pauses = PATTERNS[which]
    test = Sorter(dut, pauses)
    await test.bench.reset()
    for k, order in enumerate(ORDERS):
        if (k + which) % rounds(8, 2):
            continue
        jobs = [make_job(test.draw, n, order) for n in sizes()]
        jobs += [make_job(test.draw, int(n), "random") for n in test.draw.integers(0, CAPACITY // 4, 4)]
        test.rng.shuffle(jobs)
        await test.run(jobs, tuple(patterns))
    assert int(dut.error_o.value) == 0


@cocotb.test()
async def late(dut):
    """Whether a list fits is known late: nothing of it may have left."""
    test = Sorter(dut)
    await test.bench.reset()
    await test.run([make_job(test.draw, n, "random") for n in (CAPACITY + 1, 3, CAPACITY, CAPACITY + 9)], pause=2 * CAPACITY)


@cocotb.test()
@cocotb.parametrize(("which", [0, 4, 1, 2][: rounds(2, 4)]))
async def longest(dut, which):
    """As many runs as fit."""
    *patterns, pauses = PATTERNS[which]
    test = Sorter(dut, pauses)
    await test.bench.reset()
    d, order = ((0, "random"), (5, "clumps"), (CAPACITY - 1, "walls"), (0, ""), (3, "equal"))[which]
    await test.run([make_job(test.draw, RUNS * CAPACITY - d, order)], tuple(patterns))
    assert int(dut.error_o.value) == 0


@cocotb.test()
@cocotb.parametrize(("which", [0, 1, 2, 3, 4]))
async def finished(dut, which):
    """Lists that are left at once, after some entries, at the last one."""
    *patterns, pauses = PATTERNS[which]
    test = Sorter(dut, pauses)
    await test.bench.reset()
    for _ in range(rounds(1, 4)):
        jobs = []
        for _ in range(8):
            n = int(test.draw.choice([0, 5, CAPACITY // 3, CAPACITY + 7, 2 * CAPACITY + 9, 4 * CAPACITY]))
            after = int(test.draw.choice([0, 1, n // 7, n // 2, max(n - 1, 0), n]))
            jobs.append(make_job(test.draw, n, str(test.draw.choice(ORDERS)), after if test.draw.random() < 0.7 else None))
        await test.run(jobs, tuple(patterns))


@cocotb.test()
async def rate(dut):
    """Cycles of a list alone: within some per cent of the model, and what is read of memory is what it says."""
    test = Sorter(dut, latency=100)
    test.written_after = (100, 101)
    await test.bench.reset()
    for n, order in ((CAPACITY + 1, "random"), (3 * CAPACITY, "walls"), (5 * CAPACITY, "clumps"), (7 * CAPACITY, "backwards"), (12 * CAPACITY, "random")):
        job = make_job(test.draw, n, order)
        await test.run([job], full=True)
        want, got = perf.merge_cycles(job.golden, MERGE_LINES, 110).total, job.ended - job.first
        dut._log.info("%d entries, %s: %d cycles, %d by the model (%+.1f%%), %.2f an entry", n, order, got, want, 100 * (want / got - 1), got / n)
        if CAPACITY == 2048:
            assert got <= 3 * n + 2000 and abs(want - got) <= 0.03 * got, (n, order, got, want)


@cocotb.test()
async def too_long(dut):
    """A list of more runs than fit: an error, an end, and right lists behind it."""
    test = Sorter(dut)
    await test.bench.reset()
    entries = make_list(test.draw, (RUNS + 2) * CAPACITY + 5, "random")
    first = sort_long(entries[: RUNS * CAPACITY], CAPACITY, RUNS)
    job = Job(entries, None, (first.order & np.uint64(OUT)).tolist(), len(entries) + 1)
    job.finished = True
    await test.run([job])
    assert int(dut.error_o.value) == 1 and len(job.out) == RUNS * CAPACITY
    test.wrote.clear()
    test.read.clear()
    dut.start_i.value = 1
    await RisingEdge(dut.clk_i)
    dut.start_i.value = 0
    await test.run([make_job(test.draw, n, "random") for n in (3, 2 * CAPACITY + 1, 0, CAPACITY)])
    assert int(dut.error_o.value) == 0


@cocotb.test()
async def a_long_one(dut):
    """100,000 entries, in the orders of config."""
    test = Sorter(dut, latency=100)
    await test.bench.reset()
    for order in config().get("orders", ["random"]):
        job = make_job(test.draw, config().get("entries", 100_000), order)
        await test.run([job], full=True)
        cycles = job.ended - job.first
        dut._log.info("%s: %d cycles, %.2f an entry", order, cycles, cycles / len(job.entries))
        assert cycles <= 3 * len(job.entries) + 2000, (order, cycles)
