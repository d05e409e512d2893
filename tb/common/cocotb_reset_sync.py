"""cocotb tests of flk_reset_sync: its output after every change of an input."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import Timer
from flicker_tb.bench import config

STAGES = config()["stages"]


class Cell:
    """The cell, and how many edges of the clock it has seen out of reset."""

    def __init__(self, dut):
        self.dut, self.rng, self.edges = dut, random.Random(random.getrandbits(64)), 0

    async def begin(self):
        """In reset, the clock low."""
        for value in (1, 0):  # an edge, from whatever it is
            self.dut.clk_i.value, self.dut.rst_ni.value, self.dut.test_en_i.value = 0, value, 0
            await Timer(1, unit="ns")
        return self

    async def change(self, pin, value):
        before = int(pin.value)
        pin.value = value
        await Timer(1, unit="ns")
        if not int(self.dut.rst_ni.value):
            self.edges = 0
        elif pin._name == "clk_i" and value and not before:
            self.edges += 1
        released = int(self.dut.rst_ni.value) if int(self.dut.test_en_i.value) else self.edges >= STAGES
        assert int(self.dut.rst_no.value) == released, f"{self.edges} edges"


@cocotb.test()
async def falls_at_once_rises_with_the_clock(dut):
    cell = await Cell(dut).begin()
    rises = 0
    for _ in range(600):
        await cell.change(dut.clk_i, 1 - int(dut.clk_i.value))
        if cell.rng.random() < (0.1 if int(dut.rst_ni.value) else 0.5):
            await cell.change(dut.rst_ni, 1 - int(dut.rst_ni.value))
        rises += cell.edges == STAGES
    assert rises > 20


@cocotb.test()
async def scan_test_puts_it_through(dut):
    cell = await Cell(dut).begin()
    await cell.change(dut.test_en_i, 1)
    for _ in range(200):
        await cell.change(cell.rng.choice([dut.clk_i, dut.rst_ni, dut.rst_ni, dut.clk_i]), cell.rng.getrandbits(1))
    await cell.change(dut.rst_ni, 0)
    await cell.change(dut.test_en_i, 0)
    for edge in range(2 * STAGES):  # and back: behind a reset it is as it was
        await cell.change(dut.clk_i, edge & 1)
    await cell.change(dut.rst_ni, 1)
    for _ in range(2 * STAGES + 2):
        await cell.change(dut.clk_i, 1 - int(dut.clk_i.value))
    assert int(dut.rst_no.value)
