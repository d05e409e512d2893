"""cocotb tests of flk_event_counter (counts) and flk_event_counters (sources) against sums."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

LATENCY = 3
HIGH = (1 << 24) - 1  # the upper bits, all ones


@cocotb.test()
async def counts(dut):
    """Random counts with pauses, through several turns of the lower half; clear in between: the sum of what came three cycles ago and before."""
    rng = random.Random(random.getrandbits(64))
    most = (1 << int(dut.CountBits.value)) - 1
    dut.rst_ni.value = dut.clear_i.value = dut.count_i.value = 0
    Clock(dut.clk_i, 10, unit="ns").start()
    await FallingEdge(dut.clk_i)
    dut.rst_ni.value = 1
    for clears in range(3):
        total, busy = 0, 1.0
        for cycle in range(1500):
            if cycle % 100 == 0:
                busy = rng.choice((0.1, 0.9, 1.0))
            count = rng.randint(1, most) if rng.random() < busy else 0
            dut.count_i.value = count
            await FallingEdge(dut.clk_i)
            total += count
            if cycle % 50 == 49:  # quiet until all has arrived
                dut.count_i.value = 0
                for _ in range(LATENCY - 1):
                    await FallingEdge(dut.clk_i)
                assert int(dut.value_o.value) == total, (clears, cycle)
        assert total > 2 << 8
        dut.clear_i.value = 1
        dut.count_i.value = most
        await FallingEdge(dut.clk_i)
        dut.clear_i.value = dut.count_i.value = 0
        for _ in range(LATENCY):
            await FallingEdge(dut.clk_i)
            assert int(dut.value_o.value) == 0


@cocotb.test()
async def wraps(dut):
    """The upper bits set to their end in between: the count goes from 2^32 - 1 to 0 and on."""
    most = (1 << int(dut.CountBits.value)) - 1
    dut.rst_ni.value = dut.clear_i.value = dut.count_i.value = 0
    Clock(dut.clk_i, 10, unit="ns").start()
    await FallingEdge(dut.clk_i)
    dut.rst_ni.value = 1
    await FallingEdge(dut.clk_i)
    for high in (HIGH - 1, HIGH):
        total = int(dut.value_o.value) & 0xFF | high << 8
        dut.high_q.value = high
        for _ in range(300):
            dut.count_i.value = most
            await FallingEdge(dut.clk_i)
            total += most
        dut.count_i.value = 0
        for _ in range(LATENCY):
            await FallingEdge(dut.clk_i)
        assert int(dut.value_o.value) == total % (1 << 32) and total >> 32 == 1


@cocotb.test()
async def sources(dut):
    """Random bits of each source: each counter has the sum of its own; clear drops those on their way and of its cycle."""
    rng = random.Random(random.getrandbits(64))
    counters, width = int(dut.Counters.value), int(dut.Sources.value)
    every = (1 << counters * width) - 1
    dut.rst_ni.value = dut.clear_i.value = dut.events_i.value = 0
    Clock(dut.clk_i, 10, unit="ns").start()
    await FallingEdge(dut.clk_i)
    dut.rst_ni.value = 1

    async def quiet(cycles: int) -> list[int]:
        dut.events_i.value = 0
        for _ in range(cycles):
            await FallingEdge(dut.clk_i)
        value = int(dut.values_o.value)
        return [value >> 32 * c & 0xFFFFFFFF for c in range(counters)]

    for clears in range(3):
        totals = [0] * counters
        for cycle in range(1200):
            events = rng.getrandbits(counters * width) | (every if cycle > 600 else 0)
            dut.events_i.value = events
            await FallingEdge(dut.clk_i)
            totals = [total + (events >> width * c & (1 << width) - 1).bit_count() for c, total in enumerate(totals)]
            if cycle % 50 == 49:
                assert await quiet(LATENCY) == totals, (clears, cycle)
        assert all(total > 2 << 8 for total in totals)
        dut.events_i.value = every
        await FallingEdge(dut.clk_i)
        dut.clear_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.clear_i.value = 0
        assert await quiet(LATENCY + 1) == [0] * counters
