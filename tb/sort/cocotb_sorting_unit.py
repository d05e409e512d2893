"""cocotb tests of flk_sorting_unit, of lists that it holds; what comes out is compared with the golden model. Others: cocotb_list_sorter.py."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import cocotb
import numpy as np
from cocotb.triggers import RisingEdge
from flicker_tb import stalls
from flicker_tb.bench import Bench, config, rounds
from flicker_tb.list_lines import lines_of

from flicker.golden.lists import HEADER_AT
from flicker.golden.sorting import SortedList, sort_list
from flicker.perf import sorting as perf

CELLS, STAGES, WAYS = config().get("cells", 16), config().get("stages", 7), config().get("ways", 8)
CAPACITY = CELLS << STAGES
MERGE = ("valid", "entries", "count", "limited", "limit", "last", "final")  # its lines again
OUT = (1 << 28) - 1
KINDS = ("random", "few", "equal", "ascending", "descending", "extremes", "near", "limits")
STALLS = (("never", "never"), ("half", "half"), ("never", "heavy"), ("heavy", "never"), ("bursts", "bursts"), ("rare", "half"))


def walk(rng, count: int, limits: bool) -> np.ndarray:
    """Entries near the ones before them, so that lines are short, or, now and then, the last that are near and the first that are not."""
    key, record, found = rng.getrandbits(24), (1 << 24) - 1 - rng.randrange(1000), []
    for _ in range(count):
        found.append(key << 28 | record << 4 | rng.randrange(16))
        turn, step = rng.randrange(-(1 << 16), 1 << 16), rng.randrange(1, 512)
        if limits and rng.random() < 0.4:
            turn, step = rng.choice((-(1 << 16) - 1, -(1 << 16), (1 << 16) - 1, 1 << 16, 0)), rng.choice((1, 511, 512))
        key, record = key + turn if 0 <= key + turn < 1 << 24 else key, record - step
    return np.array(found, np.uint64)


def make_list(rng, count: int, kind: str) -> np.ndarray:
    """Entries with distinct (key, record), in the order of their records or, where the kind says so, of their keys."""
    if kind in ("near", "limits"):
        return walk(rng, count, kind == "limits")
    low = [rng.getrandbits(24) for _ in range(count)]
    keys = {
        "random": lambda: low, "few": lambda: [k & 3 for k in low], "equal": lambda: [low[0]] * count, "ascending": lambda: sorted(low),
        "descending": lambda: sorted(low, reverse=True), "extremes": lambda: [(0, (1 << 24) - 1)[k & 1] for k in low],
    }[kind]() if count else []
    records = rng.sample(range(1 << 24), count)
    if kind in ("ascending", "equal"):
        records.sort()
    elif kind == "descending" or (kind == "few" and rng.random() < 0.5):
        records.sort(reverse=True)
    if kind == "extremes" and count > 1:
        records[0], records[-1] = 0, (1 << 24) - 1
        records[1:-1] = [min(max(r, 1), (1 << 24) - 2) for r in records[1:-1]]
    return np.array([key << 28 | record << 4 | rng.randrange(16) for key, record in zip(keys, records)], np.uint64)


@dataclass
class Job:
    """A list. finish: delivered entries after which, and cycles after which, it is finished; or None."""

    entries: np.ndarray
    lines: list[tuple[int, int, int]]
    golden: SortedList
    finish: tuple[int, int] | None = None
    out: list[int] = field(default_factory=list)
    finished: bool = False
    ended: int = -1  # cycle of its end
    first: int = -1  # of its first line
    all_read: int = -1  # of its last line


class Unit:
    def __init__(self, dut) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.rng = self.bench.rng
        for name in ("start", "in_valid", "in_entries", "in_count", "in_last", "out_ready", "finish", "run_ready", *(f"merge_{x}" for x in MERGE)):
            getattr(dut, f"{name}_i").value = 0

    def job(self, count: int, kind: str = "random", finish: tuple[int, int] | None = None, full: bool = False) -> Job:
        entries = make_list(self.rng, count, kind)
        return Job(entries, lines_of(entries, self.rng, full), sort_list(entries, CAPACITY), finish)

    async def run(self, jobs: list[Job], patterns: tuple[str, str] = STALLS[0], stop: int = 0) -> int:
        """The lists one after the other; patterns of lines and output. stop: cycles after which to return. Cycles that it took."""
        dut, rng, edge = self.dut, self.rng, RisingEdge(self.dut.clk_i)
        idle, stall = (stalls.make(p, rng) for p in patterns)
        reading, out = 0, 0  # the list that is read, the one at the output
        lines: deque[tuple[int, int, int]] = deque(jobs[0].lines)
        offered = False
        finish_at = -1
        held: tuple[int, int] | None = None
        limit = 4000 + sum(14 * (len(j.entries) + 60) for j in jobs)
        cycle = 0
        while out < len(jobs):
            offered = offered or (bool(lines) and not next(idle))
            word, count, last = lines[0] if offered else (rng.getrandbits(HEADER_AT), rng.randrange(16), rng.randrange(2))
            job = jobs[out]
            if job.finish is not None and len(job.out) >= job.finish[0] and finish_at < 0:
                finish_at = cycle + job.finish[1]
            finish = int(0 <= finish_at <= cycle)
            job.finished = job.finished or bool(finish)
            ready = int(not next(stall))
            dut.in_valid_i.value, dut.in_entries_i.value, dut.in_count_i.value, dut.in_last_i.value = int(offered), word, count, last
            dut.out_ready_i.value, dut.finish_i.value = ready, finish
            await edge
            if offered and int(dut.in_ready_o.value):
                if jobs[reading].first < 0:
                    jobs[reading].first = cycle
                lines.popleft()
                offered = False
                if last:
                    jobs[reading].all_read = cycle
                    reading += 1
                    lines = deque(jobs[reading].lines if reading < len(jobs) else [])
            assert int(dut.run_valid_o.value) == 0 and int(dut.merging_o.value) == 0
            if int(dut.out_valid_o.value):
                got = (int(dut.out_end_o.value), int(dut.out_entry_o.value))
                if got[0]:
                    got = (1, 0)
                assert held in (None, got), "output changed before its transfer"
                held = None if ready else got
                if ready:
                    self.check(out, job, got)
                    if got[0]:
                        job.ended, finish_at, out = cycle, -1, out + 1
            else:
                assert held is None, "valid fell"
            cycle += 1
            assert cycle < limit, f"stands still: list {out} of {len(jobs)}, {len(job.out)} of {len(job.entries)} entries, reading {reading}"
            if stop and cycle >= stop:
                return cycle
        dut.finish_i.value = 0
        dut.in_valid_i.value = 0
        for _ in range(16):
            await edge
            assert int(dut.out_valid_o.value) == 0
        assert int(dut.idle_o.value) == 1 and reading == len(jobs)
        return cycle

    def check(self, n: int, job: Job, got: tuple[int, int]) -> None:
        at, place = len(job.out), f"list {n}, element {len(job.out)}"
        if got[0]:
            assert job.finished or at == len(job.entries), f"{place}: end of {len(job.entries)} entries"
            return
        assert at < len(job.entries), f"{place}: an entry after the last"
        want = int(job.golden.order[at]) & OUT
        assert got[1] == want, f"{place}: {got[1]:#x}, due {want:#x}"
        job.out.append(got[1])

    async def start(self) -> None:
        """Counters to zero."""
        assert int(self.dut.idle_o.value) == 1
        self.dut.start_i.value = 1
        await RisingEdge(self.dut.clk_i)
        self.dut.start_i.value = 0
        for _ in range(10):
            await RisingEdge(self.dut.clk_i)
        assert [int(getattr(self.dut, f"{name}_o").value) for name in ("entries", "readings", "dropped")] == [0, 0, 0]

    def counted(self, jobs: list[Job]) -> None:
        """The counters are those of these lists."""
        entries, readings, dropped = (int(getattr(self.dut, f"{name}_o").value) for name in ("entries", "readings", "dropped"))
        assert entries == sum(len(j.out) for j in jobs)
        assert readings == len(jobs)
        assert dropped == sum(len(j.entries) - len(j.out) for j in jobs)


def sizes() -> list[int]:
    around = [n + d for n in (CELLS, CELLS << STAGES // 2, CAPACITY) for d in (-1, 0, 1)]
    return sorted(n for n in {0, 1, 8, 9, *around} if n <= CAPACITY)


@cocotb.test()
@cocotb.parametrize(("which", [0, 1, 2, 3, 4, 5]))
async def lists(dut, which):
    """All lengths and kinds of keys, back to back."""
    test = Unit(dut)
    await test.bench.reset()
    few = CAPACITY > 256
    for k, kind in enumerate(KINDS):
        if few and (k + which) % rounds(6, 3):
            continue
        jobs = [test.job(n, kind) for n in sizes()]
        test.rng.shuffle(jobs)
        await test.bench.cycles(16)
        await test.start()
        await test.run(jobs, STALLS[which])
        test.counted(jobs)


@cocotb.test()
@cocotb.parametrize(("which", [0, 1, 2, 3, 4, 5]))
async def many(dut, which):
    """Short lists, many of them; lengths in turn near to each other and far apart."""
    test = Unit(dut)
    await test.bench.reset()
    rng = test.rng
    jobs = []
    for _ in range(60):
        n = rng.choice((0, 0, 1, rng.randrange(2 * CELLS), rng.randrange(4 * CELLS), rng.randrange(CELLS << 3)))
        jobs.append(test.job(min(n, CAPACITY), rng.choice(KINDS)))
    await test.run(jobs, STALLS[which])
    test.counted(jobs)


@cocotb.test()
@cocotb.parametrize(("which", [0, 1, 2, 3, 4, 5]))
async def finished(dut, which):
    """finish_i before the first entry, at some entry, some cycles later, at the last one, for lists of all lengths."""
    test = Unit(dut)
    await test.bench.reset()
    rng = test.rng
    for _ in range(2 if CAPACITY > 256 else rounds(3, 8)):
        jobs = []
        for _ in range(14 if CAPACITY > 256 else 40):
            n = rng.choice((0, 1, rng.randrange(2 * CELLS), rng.randrange(CAPACITY >> 2), CAPACITY // 2 + rng.randrange(CAPACITY // 2 + 1),
                            CAPACITY) if rng.random() < 0.4 else (rng.randrange(CELLS << 2), rng.randrange(CAPACITY >> 2)))
            n = min(n, CAPACITY)
            after = rng.choice((0, n, max(n - 1, 0), rng.randrange(n + 1), rng.randrange(n + 1)))
            finish = (after, rng.choice((0, 1, 2, rng.randrange(60)))) if rng.random() < 0.7 else None
            jobs.append(test.job(n, rng.choice(KINDS), finish))
        await test.bench.cycles(16)
        await test.start()
        await test.run(jobs, STALLS[which])
        test.counted(jobs)


@cocotb.test()
async def finish_is_quick(dut):
    """After finish_i the end comes soon where the list was read."""
    test = Unit(dut)
    await test.bench.reset()
    for n in (CAPACITY, CAPACITY // 2 + 1, CAPACITY // 4, CAPACITY // 8 + 3):
        for delivered in (1, n // 3):
            jobs = [test.job(n, "random", (delivered, 0), True), test.job(CELLS)]
            await test.run(jobs)
            # Of the list no more than what is under way in the first step may be to come.
            seen = jobs[0].all_read
            assert jobs[0].ended - seen < n + 2 * CAPACITY, (n, jobs[0])
            jobs = [test.job(n, "ascending", (delivered, 0), True), test.job(0)]
            base = [test.job(n, "ascending", None, True), test.job(0)]
            cycles, whole = await test.run(jobs), await test.run(base)
            saved = whole - cycles
            assert saved >= n - delivered - CELLS - 2 * (n - n // 2) // 2 - 60, (n, delivered, saved)


@cocotb.test()
@cocotb.parametrize(("which", [0, 1, 4]))
async def clear_in_the_middle(dut, which):
    """After clear_i nothing is left of the lists before."""
    test = Unit(dut)
    await test.bench.reset()
    rng = test.rng
    for _ in range(4 if CAPACITY > 256 else rounds(12, 30)):
        jobs = []
        for _ in range(6):
            n = min(rng.choice((rng.randrange(CELLS << 2), CAPACITY // 2 + 3, CAPACITY)), CAPACITY)
            jobs.append(test.job(n, finish=rng.choice((None, (3, 2)))))
        await test.run(jobs, STALLS[which], stop=rng.randrange(1, 4 * CAPACITY))
        for name in ("in_valid", "finish"):
            getattr(dut, f"{name}_i").value = 0
        await test.bench.clear()
        await test.bench.cycles(12)
        await test.start()
        jobs = [test.job(min(n, CAPACITY)) for n in (rng.randrange(CELLS << 1), 0, CAPACITY // 2 + 1 + rng.randrange(CELLS))]
        await test.run(jobs, STALLS[which])
        test.counted(jobs)


@cocotb.test()
async def rate(dut):
    """Cycles without stalls: of a list alone as the model says, back to back one an entry and some a list."""
    test = Unit(dut)
    await test.bench.reset()
    for n in (*sizes(), CELLS * 2, CELLS * 3 + 1, CAPACITY // 4 + 5, CAPACITY // 2 + 1):
        for kind in ("ascending", "random", "descending"):
            if n > CAPACITY:
                continue
            jobs = [test.job(n, kind, None, True)]
            await test.run(jobs)
            want, got = perf.unit_cycles(n, CELLS, STAGES, WAYS), jobs[0].ended - jobs[0].first
            most = want if kind == "ascending" else want + n // perf.ORDER
            assert want - perf.AHEAD <= got <= most, f"{n} entries, {kind}: {got} cycles, {want} by the model"
    for lengths in ([CAPACITY // 8 + 5] * 12, [CAPACITY] * 3, [CAPACITY // 2] * 5, [CAPACITY * 3 // 4] * 4, [CELLS] * 40, [CELLS + 1] * 40, [CELLS // 4] * 40,
                    [CAPACITY // 8 + 5, CELLS + 3, CAPACITY // 4 + 1, 1, CAPACITY // 16] * 4):
        jobs = [test.job(n, "random", None, True) for n in lengths]
        await test.run(jobs)
        got, most = jobs[-1].ended - jobs[0].ended, perf.back_to_back(lengths, CELLS, STAGES, WAYS)
        assert got <= most, f"{lengths}: {got} cycles, {most} by the model"
    # Lengths of a geometric distribution, with the mean of a real frame.
    jobs = [test.job(1024), *(test.job(min(int(test.rng.expovariate(1 / 261)), CAPACITY), "random", None, True) for _ in range(rounds(60, 150)))]
    await test.run(jobs)
    got, least = jobs[-1].ended - jobs[0].ended, sum(perf.list_cycles(len(j.entries)) for j in jobs[1:])
    dut._log.info(f"{len(jobs) - 1} lists: {got} cycles, {got / least:.3f} of one an entry and {perf.NEXT} a list")
    assert got <= 1.05 * least, (got, least)
