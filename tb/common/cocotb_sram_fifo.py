"""cocotb tests of flk_sram_fifo; settings: width, depth."""

from __future__ import annotations

import cocotb
from flicker_tb.bench import StreamTest, combinations, config
from flicker_tb.stalls import PATTERNS

PAIRS = combinations(["never", "half", "bursts"], PATTERNS)


def items(test: StreamTest, count: int) -> list[int]:
    return [test.bench.rng.getrandbits(config()["width"]) for _ in range(count)]


@cocotb.test()
@cocotb.parametrize((("idle", "stall"), PAIRS))
async def order(dut, idle, stall):
    """What enters leaves, in order; empty_o afterwards."""
    test = StreamTest(dut, lambda item: [item], idle=idle, stall=stall)
    await test.run(items(test, 250))
    assert int(dut.empty_o.value) == 1


@cocotb.test()
async def capacity(dut):
    """A blocked output: Depth and one more enter. Then one a cycle."""
    test = StreamTest(dut, lambda item: [item])
    depth = config()["depth"]
    stall = [True] * (3 * depth + 20)
    test.sink.stall = iter(stall + [False] * 10000)
    await test.bench.reset()
    test.source.send(items(test, 4 * depth))
    await test.bench.cycles(2 * depth + 10)
    assert test.input.count == depth + 1 and int(dut.empty_o.value) == 0
    await test.bench.until(lambda: not test.checker.outstanding and not test.source.pending, 1000, "last")
    assert test.output.last - test.output.first == 4 * depth - 1


@cocotb.test()
async def latency(dut):
    """Two cycles, one a cycle."""
    test = StreamTest(dut, lambda item: [item])
    await test.run(items(test, 100))
    assert test.output.first - test.input.first == 2
    assert test.output.last - test.input.last == 2


@cocotb.test()
async def reset_in_traffic(dut):
    """What was inside is gone."""
    test = StreamTest(dut, lambda item: [item], stall="heavy")
    await test.bench.reset()
    test.source.send(items(test, 60))
    await test.bench.cycles(30)
    dut.rst_ni.value = 0
    await test.bench.cycles(2)
    test.source.drop()
    test.checker.drop()
    test.checker.checked = test.input.count = 0
    await test.run(items(test, 50))


@cocotb.test()
async def clear(dut):
    """What was inside is gone in the next cycle; then as after a reset."""
    test = StreamTest(dut, lambda item: [item])
    test.sink.stall = iter([True] * 40 + [False] * 10000)
    await test.bench.reset()
    for count in (1, 2):
        test.source.send(items(test, count))
        await test.bench.until(lambda: not test.source.pending, 20, "in")
        await test.bench.cycles(3)
        assert int(dut.out_valid_o.value) == 1
        await test.bench.clear()
        await test.bench.cycles(1)
        assert int(dut.out_valid_o.value) == 0 and int(dut.empty_o.value) == 1
        test.checker.drop()
    test.source.send(items(test, 60))
    await test.bench.until(lambda: test.checker.checked == 60, 500, "all")
