"""cocotb test of flk_clock_gate: both halves of every cycle, sampled around each change of its inputs."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.handle import Immediate
from cocotb.triggers import FallingEdge, RisingEdge, Timer


@cocotb.test()
async def whole_pulses_or_none(dut):
    """The enable changes while the clock is high, as behind a register, or low: a cycle that began with it high has its whole pulse, any other none."""
    rng = random.Random(random.getrandbits(64))
    dut.clk_i.value, dut.en_i.value = Immediate(0), Immediate(0)
    await Timer(1, unit="ns")
    assert dut.clk_o.value == 0
    Clock(dut.clk_i, 10, unit="ns").start()
    pulses = 0
    for _ in range(400):
        enabled = int(dut.en_i.value)
        await RisingEdge(dut.clk_i)
        await Timer(1, unit="ns")
        assert dut.clk_o.value == enabled
        dut.en_i.value = rng.getrandbits(1)
        await Timer(2, unit="ns")
        assert dut.clk_o.value == enabled, "the enable reaches a clock that is high"
        pulses += enabled
        await FallingEdge(dut.clk_i)
        await Timer(1, unit="ns")
        assert dut.clk_o.value == 0
        if rng.random() < 0.3:
            dut.en_i.value = rng.getrandbits(1)
            await Timer(1, unit="ns")
            assert dut.clk_o.value == 0, "the enable makes a pulse by itself"
    assert 100 < pulses < 300
