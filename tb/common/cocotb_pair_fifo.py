"""cocotb tests of flk_pair_fifo; settings: width, depth."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, combinations, config
from flicker_tb.stalls import PATTERNS

PAIRS = combinations(["never", "half", "bursts"], PATTERNS)


class Queue:
    """The design between a giver of `todo`, one or two words a cycle at either input, and a taker of one or two; what is inside beside it."""

    def __init__(self, dut, idle: str = "never", stall: str = "never", alone: float = 0.3) -> None:
        self.dut, self.bench, self.alone = dut, Bench(dut), alone
        self.width, self.depth = config()["width"], config()["depth"]
        self.idle, self.stall = self.bench.stall(idle), self.bench.stall(stall)
        self.todo: deque[int] = deque()
        self.inside: deque[int] = deque()
        self.old: int = 0  # words that have been inside for two cycles while none left
        self.taken: list[int] = []
        self.first_in: int | None = None
        self.first_out: int | None = None
        self.most = self.pairs_in = self.pairs_out = 0
        dut.in_valid_i.value = dut.out_ready_i.value = 0
        cocotb.start_soon(self._run())

    def words(self, count: int) -> None:
        self.todo.extend(self.bench.rng.getrandbits(self.width) for _ in range(count))

    async def _run(self) -> None:
        dut, edge, rng, mask = self.dut, RisingEdge(self.dut.clk_i), self.bench.rng, (1 << self.width) - 1
        offered: dict[int, int] = {}  # input: word
        ready, cycle = 0, 0
        while True:
            await edge
            cycle += 1
            if dut.rst_ni.value != 1:
                offered, ready, self.old = {}, 0, 0
                continue
            cleared = dut.clear_i.value == 1
            before, gone = len(self.inside), 0
            valid = int(dut.out_valid_o.value)
            words = int(dut.out_data_o.value) if valid else 0
            shown = [words >> self.width * k & mask for k in range(valid.bit_count())]
            assert valid in (0, 1, 3), "the second word alone"
            assert shown == list(self.inside)[: len(shown)], f"{shown}, due {list(self.inside)[:2]}"
            assert len(shown) >= min(self.old, 2), "what has been inside for two cycles is not shown"
            assert int(dut.empty_o.value) == (not self.inside)
            room = int(dut.in_ready_o.value)
            assert room & 1 or before >= self.depth, "no room for one"
            assert room & 2 or before >= self.depth - 1, "no room for two"
            assert room != 2
            if ready & 1 and shown:
                gone = 2 if ready == 3 and len(shown) == 2 else 1
                self.taken.extend(self.inside.popleft() for _ in range(gone))
                self.pairs_out += gone == 2
                self.first_out = self.first_out or cycle
            if offered and room >> (len(offered) - 1) & 1:
                self.inside.extend(offered[k] for k in sorted(offered))
                self.pairs_in += len(offered) == 2
                self.first_in = self.first_in or cycle
                offered = {}
            if cleared:
                self.inside.clear()
            self.most = max(self.most, len(self.inside))
            self.old = 0 if cleared or gone else before
            if not offered and self.todo and not next(self.idle):
                pair = len(self.todo) > 1 and rng.random() >= self.alone
                offered = {k: self.todo.popleft() for k in ((0, 1) if pair else (rng.getrandbits(1),))}
            ready = 0 if next(self.stall) else 2 | (rng.random() >= self.alone) if self.alone else 3
            if ready == 2 and rng.getrandbits(1):
                ready = 1
            dut.in_valid_i.value = sum(1 << k for k in offered)
            dut.in_data_i.value = sum(offered.get(k, rng.getrandbits(self.width)) << self.width * k for k in range(2))
            dut.out_ready_i.value = ready

    async def through(self, count: int) -> None:
        await self.bench.until(lambda: len(self.taken) == count, 200 + 12 * count, "last word")


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PAIRS))
async def order(dut, idle, stall):
    """What enters leaves, in order, one or two a cycle, at either input; out_ready_i[1] alone takes nothing."""
    test = Queue(dut, idle, stall)
    await test.bench.reset()
    test.words(300)
    await test.through(300)
    assert test.pairs_in > 30 and test.pairs_out > 10


@cocotb.test()
@cocotb.parametrize(alone=[0.0, 1.0])
async def capacity(dut, alone):
    """A blocked output: Depth and two more enter, in pairs or one by one. Then pairs go through without a gap."""
    test = Queue(dut, alone=alone)
    depth = test.depth
    test.stall = iter([True] * (3 * depth + 20) + [False] * 10_000)
    await test.bench.reset()
    test.words(8 * depth)
    await test.bench.cycles(2 * depth + 15)
    assert test.most == depth + 2
    if alone:
        return
    await test.bench.until(lambda: len(test.taken) > 0, 3 * depth + 20, "first word")
    cycles = await test.bench.until(lambda: len(test.taken) == 8 * depth, 10 * depth, "all")
    assert cycles <= 4 * depth


@cocotb.test()
async def latency(dut):
    """Two cycles."""
    test = Queue(dut, alone=0.0)
    await test.bench.reset()
    test.words(2)
    await test.through(2)
    assert test.first_out - test.first_in == 2


@cocotb.test()
async def clear(dut):
    """What was inside is gone, in the next cycle; then as after a reset."""
    test = Queue(dut, stall="heavy")
    await test.bench.reset()
    for turn in range(12):
        test.words(3 * test.depth)
        await test.bench.cycles(5 * turn + test.bench.rng.randrange(20))
        await test.bench.clear()
    await test.bench.until(lambda: not test.todo and not test.inside, 2000 + 100 * test.depth, "last word")
