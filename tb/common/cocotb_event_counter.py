"""cocotb test of flk_event_counter against a sum."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

LATENCY = 3


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
