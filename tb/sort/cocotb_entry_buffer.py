"""cocotb tests of flk_entry_buffer; setting: depth."""

from __future__ import annotations

from collections import deque

import cocotb
from cocotb.triggers import RisingEdge
from flicker_tb.bench import Bench, config
from flicker_tb.stalls import PATTERNS

Item = tuple[int, int]  # end, entry


class Buffer:
    """The design between a unit that gives `todo` and a taker; what is inside beside it. finish: how often the list at the output is said to be finished."""

    def __init__(self, dut, idle: str = "never", stall: str = "never", finish: float = 0.0) -> None:
        self.dut, self.bench, self.finish = dut, Bench(dut), finish
        self.bits = len(dut.in_entry_i)
        self.idle, self.stall = self.bench.stall(idle), self.bench.stall(stall)
        self.todo: deque[Item] = deque()
        self.inside: deque[Item] = deque()
        self.taken: list[Item] = []
        self.pairs = self.finished = self.most = 0
        dut.in_valid_i.value = dut.out_ready_i.value = dut.finish_i.value = 0
        cocotb.start_soon(self._run())

    def lists(self, count: int, longest: int) -> None:
        rng = self.bench.rng
        for _ in range(count):
            self.todo.extend((0, rng.getrandbits(self.bits)) for _ in range(rng.choice([0, 1, rng.randrange(longest), longest])))
            self.todo.append((1, rng.getrandbits(self.bits)))

    async def _run(self) -> None:
        dut, edge, rng = self.dut, RisingEdge(self.dut.clk_i), self.bench.rng
        offered = ready = finish = False
        while True:
            await edge
            if dut.rst_ni.value != 1:
                offered = ready = finish = False
                continue
            cleared = dut.clear_i.value == 1
            valid, ends = int(dut.out_valid_o.value), int(dut.out_end_o.value)
            entries = int(dut.out_entry_o.value) if valid else 0
            assert valid in (0, 1, 3), "the second entry alone"
            shown = [(ends >> k & 1, entries >> self.bits * k & (1 << self.bits) - 1) for k in range(valid.bit_count())]
            assert shown == list(self.inside)[: len(shown)], f"{shown}, due {list(self.inside)[:2]}"
            assert not (valid == 3 and shown[0][0]), "beyond the end of a list"
            assert int(dut.empty_o.value) == (not self.inside)
            ended = any(end for end, _ in self.inside)
            assert int(dut.finish_o.value) == (finish and not ended)
            self.finished += int(dut.finish_o.value)
            if ready:
                for _ in shown:
                    self.taken.append(self.inside.popleft())
                self.pairs += len(shown) == 2
            if offered and dut.in_ready_o.value == 1:
                self.inside.append(self.todo.popleft())
                offered = False
            if cleared:
                self.inside.clear()
            self.most = max(self.most, len(self.inside))
            offered = offered or bool(self.todo) and not next(self.idle)
            ready = not next(self.stall)
            finish = rng.random() < self.finish
            dut.in_valid_i.value = int(offered)
            dut.in_end_i.value, dut.in_entry_i.value = self.todo[0] if offered else (rng.getrandbits(1), rng.getrandbits(self.bits))
            dut.out_ready_i.value, dut.finish_i.value = int(ready), int(finish)

    async def through(self) -> None:
        await self.bench.until(lambda: not self.todo and not self.inside, 2000 + 12 * len(self.todo), "last entry")


@cocotb.test()
@cocotb.parametrize(("idle", ["never", "half", "bursts"]), ("stall", list(PATTERNS)))
async def order(dut, idle, stall):
    """What enters leaves, in order, in pairs that never go beyond an end; finish_o while no end is inside."""
    test = Buffer(dut, idle, stall, finish=0.5)
    await test.bench.reset()
    test.lists(60, 3 * config()["depth"])
    await test.through()
    assert test.finished > 10 and (test.pairs > 10 or stall in ("never", "rare"))


@cocotb.test()
async def capacity(dut):
    """A blocked output: Depth and two more enter. Then two a cycle."""
    test = Buffer(dut)
    depth = config()["depth"]
    test.stall = iter([True] * (3 * depth + 20) + [False] * 10_000)
    await test.bench.reset()
    test.todo.extend((0, test.bench.rng.getrandbits(test.bits)) for _ in range(4 * depth))
    await test.bench.cycles(2 * depth + 10)
    assert test.most == depth + 2
    await test.bench.until(lambda: bool(test.taken), 2 * depth + 20, "first entry")
    cycles = await test.bench.until(lambda: len(test.taken) >= depth, 2 * depth, "Depth entries")
    assert cycles <= depth // 2 + 1


@cocotb.test()
async def clear(dut):
    """What was inside is gone, ends too; then as after a reset."""
    test = Buffer(dut, stall="heavy", finish=0.5)
    await test.bench.reset()
    for turn in range(12):
        test.lists(4, config()["depth"])
        await test.bench.cycles(7 * turn + test.bench.rng.randrange(20))
        await test.bench.clear()
    await test.through()
