"""cocotb test of flk_delay against a list."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer


@cocotb.test()
async def follows_its_enable(dut):
    """Random data and enable: the output is the input of Depth enabled cycles ago, and holds while the enable is low."""
    rng = random.Random(random.getrandbits(64))
    depth, width = int(dut.Depth.value), len(dut.d_i)
    dut.en_i.value = 0
    dut.d_i.value = 0
    if depth:
        Clock(dut.clk_i, 10, unit="ns").start()
    held: list[int] = []
    compared = 0
    for _ in range(600):
        if depth:
            await FallingEdge(dut.clk_i)
        data, enable = rng.getrandbits(width), rng.random() < 0.6
        dut.d_i.value, dut.en_i.value = data, enable
        await Timer(1, unit="ns")
        if depth == 0:
            assert int(dut.q_o.value) == data
            compared += 1
        elif len(held) >= depth:
            assert int(dut.q_o.value) == held[-depth]
            compared += 1
        if enable:
            held.append(data)
    assert compared > 500
