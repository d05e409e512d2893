"""cocotb tests of flk_record_queue; settings: width, depth."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config, rounds
from flicker_tb.stalls import PATTERNS

Word = tuple[int, int]  # whether it is an end, data


class Queue:
    """The design between a giver of `todo`, which counts what is inside, and a taker of one or two; what is inside beside it. drop: drop_i, cycle by cycle."""

    def __init__(self, dut, idle: str = "never", stall: str = "never", drop: str = "never", alone: float = 0.3) -> None:
        self.dut, self.bench, self.alone = dut, Bench(dut), alone
        self.width, self.depth = config()["width"], config()["depth"]
        self.idle, self.stall = self.bench.stall(idle), self.bench.stall(stall)
        # A level: it rises and falls at random, and stays for some cycles.
        self.drop = self.bench.stall(drop)
        self.todo: deque[Word] = deque()
        self.offered: dict[int, Word] = {}  # by input
        self.inside: deque[Word] = deque()
        self.old = 0  # words that have been inside for two cycles while none left
        self.taken: list[Word] = []
        self.dropped: list[Word] = []
        self.skips = 0
        self.first_in: int | None = None
        self.first_out: int | None = None
        self.most = 0
        for name in ("in_valid", "out_ready", "drop", "in_last", "in_data"):
            getattr(dut, f"{name}_i").value = 0
        cocotb.start_soon(self._run())

    def words(self, count: int, ends: float = 0.1) -> None:
        rng = self.bench.rng
        self.todo.extend((int(rng.random() < ends), rng.getrandbits(self.width)) for _ in range(count))

    async def _run(self) -> None:
        dut, edge, rng, mask = self.dut, RisingEdge(self.dut.clk_i), self.bench.rng, (1 << self.width) - 1
        ready = drop = cycle = 0
        while True:
            await edge
            cycle += 1
            if dut.rst_ni.value != 1:
                self.offered, ready, drop, self.old = {}, 0, 0, 0
                continue
            cleared = dut.clear_i.value == 1
            before = len(self.inside)
            valid, left = int(dut.out_valid_o.value), int(dut.left_o.value)
            # An output that is not valid may be undefined.
            count = valid.bit_count()
            words, lasts = (int(port.value[bits * count - 1 : 0]) if valid else 0 for port, bits in ((dut.out_data_o, self.width), (dut.out_last_o, 1)))
            shown = [(lasts >> k & 1, words >> self.width * k & mask) for k in range(count)]
            assert valid in (0, 1, 3), "the second word alone"
            assert shown == list(self.inside)[: len(shown)], f"{shown}, due {list(self.inside)[:2]}"
            assert int(dut.empty_o.value) == (not self.inside)
            if drop:
                assert valid != 3 and (not valid or shown[0][0]), "a record is valid while records are dropped"
                assert len(shown) or self.old == 0 or not self.inside[0][0], "an end that has been inside for two cycles is not shown"
            else:
                assert len(shown) >= min(self.old, 2), "what has been inside for two cycles is not shown"
            gone = (2 if ready == 3 and len(shown) == 2 else 1) if ready & 1 and shown else 0
            self.taken.extend(list(self.inside)[:gone])
            if gone:
                self.first_out = self.first_out or cycle
                assert left == gone, f"{left} leave, {gone} were taken"
            elif left:
                assert drop and left <= before and not any(last for last, _ in list(self.inside)[:left]), f"{left} leave, drop_i {drop}"
                self.dropped.extend(list(self.inside)[:left])
                self.skips += left >= 8
            for _ in range(left):
                self.inside.popleft()
            assert left or not drop or not self.old or self.inside[0][0], "nothing is dropped"
            self.inside.extend(self.offered[k] for k in sorted(self.offered))
            if self.offered:
                self.first_in = self.first_in or cycle
            if cleared:
                self.inside.clear()
            self.most = max(self.most, len(self.inside))
            self.old = 0 if cleared or left else before
            self.offered = {}
            if self.todo and not cleared and not next(self.idle):
                pair = len(self.todo) > 1 and rng.random() >= self.alone
                if len(self.inside) + 1 + pair <= self.depth:
                    self.offered = {k: self.todo.popleft() for k in ((0, 1) if pair else (rng.getrandbits(1),))}
            ready = 0 if next(self.stall) else 2 | (rng.random() >= self.alone) if self.alone else 3
            if ready == 2 and rng.getrandbits(1):
                ready = 1
            drop = int(next(self.drop))
            dut.drop_i.value = drop
            dut.in_valid_i.value = sum(1 << k for k in self.offered)
            dut.in_last_i.value = sum(self.offered.get(k, (rng.getrandbits(1), 0))[0] << k for k in range(2))
            dut.in_data_i.value = sum(self.offered.get(k, (0, rng.getrandbits(self.width)))[1] << self.width * k for k in range(2))
            dut.out_ready_i.value = ready

    async def empty(self) -> None:
        await self.bench.until(lambda: not self.todo and not self.offered and not self.inside, 500 + 40 * (len(self.todo) + self.depth), "last word")


@cocotb.test()
@cocotb.parametrize(("idle", ["never", "half", "bursts"]), ("stall", list(PATTERNS)))
async def order(dut, idle, stall):
    """What enters leaves, in order, one or two a cycle, at either input; out_ready_i[1] alone takes nothing."""
    test = Queue(dut, idle, stall)
    await test.bench.reset()
    test.words(300)
    due = list(test.todo)
    await test.empty()
    assert test.taken == due


@cocotb.test()
@cocotb.parametrize(("idle", ["never", "half", "bursts"]), ("stall", ["never", "half", "bursts"]), ("drop", ["half", "bursts", "heavy"]))
async def dropping(dut, idle, stall, drop):
    """Records are dropped at any time, ends never; lists of all lengths. Whole groups leave at once."""
    test = Queue(dut, idle, stall, drop)
    await test.bench.reset()
    for ends in (0.4, 0.03, 0.0, 0.1):
        test.words(rounds(4, 20) * test.depth, ends)
    test.words(1, 1.0)
    due = list(test.todo)
    await test.empty()
    assert sorted(test.taken + test.dropped) == sorted(due)
    assert [word for word in test.taken if word[0]] == [word for word in due if word[0]]
    assert test.dropped and (test.skips or idle != "never" or stall != "bursts" or test.depth < 24)


@cocotb.test()
@cocotb.parametrize(odd=[0, 1, 5])
async def rate(dut, odd):
    """A full queue of one list is dropped eight a cycle, but for what lies before its first group and behind its last."""
    test = Queue(dut, alone=0.0)
    depth = test.depth
    test.stall = iter([False] * 40 + [True] * 10_000)
    await test.bench.reset()
    test.words(odd, 0.0)
    await test.bench.cycles(45)
    assert len(test.taken) == odd
    test.words(depth - 2, 0.0)
    test.words(1, 1.0)
    await test.bench.cycles(depth)
    assert test.most == depth - 1
    test.drop = iter([True] * 10_000)
    cycles = await test.bench.until(lambda: len(test.dropped) == depth - 2, 2 * depth + 20, "last record")
    assert cycles <= depth // 8 + 12, f"{cycles} cycles"
    assert test.skips >= depth // 8 - 2
    await test.bench.cycles(4)
    assert len(test.inside) == 1 and int(dut.out_valid_o.value) == 1


@cocotb.test()
async def capacity(dut):
    """Depth words are inside; pairs then go through without a gap."""
    test = Queue(dut, alone=0.0)
    depth = test.depth
    test.stall = iter([True] * (2 * depth + 20) + [False] * 10_000)
    await test.bench.reset()
    test.words(8 * depth)
    await test.bench.cycles(depth + 15)
    assert test.most == depth
    await test.bench.until(lambda: len(test.taken) > 0, 3 * depth + 20, "first word")
    await test.bench.until(lambda: len(test.taken) == 8 * depth, 10 * depth, "all")


@cocotb.test()
async def latency(dut):
    """Two cycles."""
    test = Queue(dut, alone=0.0)
    await test.bench.reset()
    test.words(2)
    await test.empty()
    assert test.first_out - test.first_in == 2


@cocotb.test()
async def clear(dut):
    """What was inside is gone, in the next cycle; then as after a reset, ends of groups too."""
    test = Queue(dut, stall="heavy", drop="half")
    await test.bench.reset()
    for turn in range(12):
        test.words(3 * test.depth)
        await test.bench.cycles(5 * turn + test.bench.rng.randrange(20))
        await test.bench.clear()
    await test.empty()
