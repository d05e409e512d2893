"""cocotb test of flk_clock_gate: both halves of every cycle, sampled around each change of its inputs."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.handle import Immediate
from cocotb.triggers import FallingEdge, RisingEdge, Timer


@cocotb.test()
@cocotb.parametrize(driven=["en", "test_en"])
async def whole_pulses_or_none(dut, driven):
    """One of the enables changes while the clock is high, as behind a register, or low: a cycle that began with it high has its whole pulse, any other none."""
    rng = random.Random(random.getrandbits(64))
    enable = getattr(dut, f"{driven}_i")
    dut.clk_i.value, dut.en_i.value, dut.test_en_i.value = Immediate(0), Immediate(0), Immediate(0)
    await Timer(1, unit="ns")
    assert dut.clk_o.value == 0
    Clock(dut.clk_i, 10, unit="ns").start()
    pulses = 0
    for _ in range(400):
        enabled = int(enable.value)
        await RisingEdge(dut.clk_i)
        await Timer(1, unit="ns")
        assert dut.clk_o.value == enabled
        enable.value = rng.getrandbits(1)
        await Timer(2, unit="ns")
        assert dut.clk_o.value == enabled, "the enable reaches a clock that is high"
        pulses += enabled
        await FallingEdge(dut.clk_i)
        await Timer(1, unit="ns")
        assert dut.clk_o.value == 0
        if rng.random() < 0.3:
            enable.value = rng.getrandbits(1)
            await Timer(1, unit="ns")
            assert dut.clk_o.value == 0, "the enable makes a pulse by itself"
    assert 100 < pulses < 300


@cocotb.test()
async def test_enable_wins(dut):
    """In a scan test every cycle has its pulse, whatever the enable does."""
    rng = random.Random(random.getrandbits(64))
    dut.clk_i.value, dut.en_i.value, dut.test_en_i.value = Immediate(0), Immediate(0), Immediate(1)
    Clock(dut.clk_i, 10, unit="ns").start()
    for _ in range(50):
        await RisingEdge(dut.clk_i)
        await Timer(1, unit="ns")
        assert dut.clk_o.value == 1
        dut.en_i.value = rng.getrandbits(1)
        await FallingEdge(dut.clk_i)
        await Timer(1, unit="ns")
        assert dut.clk_o.value == 0
