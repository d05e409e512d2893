"""cocotb tests of the mask merge unit."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge
from flicker_tb.bench import PERIOD_NS


def dense_mask(rects) -> int:
    """Mask of a dense splat: rectangle m holds the leaders of mini-tile m."""
    return sum((rect != 0) << m for m, rect in enumerate(rects))


def sparse_mask(rects) -> int:
    """Mask of a sparse splat: both rectangles hold one leader of each mini-tile."""
    top_left, bottom_right = rects
    return sum((top_left >> m & 1 or bottom_right >> m & 1) << m for m in range(4))


class Driver:
    """Drives one batch per cycle and looks at the answer of the same cycle."""

    def __init__(self, dut) -> None:
        self.dut = dut
        self.edge = RisingEdge(dut.clk_i)
        self.checked = 0
        cocotb.start_soon(Clock(dut.clk_i, PERIOD_NS, unit="ns").start())

    def set(self, valid: int, dense: int, batch: int, override: int) -> None:
        """Control inputs of the next cycles."""
        dut = self.dut
        dut.valid_i.value, dut.dense_i.value = valid, dense
        dut.batch_i.value, dut.all_i.value = batch, override

    async def cycle(self, pass_a: int, pass_b: int) -> None:
        """One cycle with these results of the two rectangles; returns at its end."""
        self.dut.pass_a_i.value = pass_a
        self.dut.pass_b_i.value = pass_b
        await self.edge

    def expect(self, mask: int | None) -> None:
        """Compare the answer in the cycle that ends; None: no answer."""
        dut = self.dut
        assert dut.valid_o.value == (mask is not None)
        if mask is not None:
            self.checked += 1
            got = int(dut.mask_o.value)
            assert got == mask, f"a={int(dut.pass_a_i.value):04b} b={int(dut.pass_b_i.value):04b}: {got:04b}, not {mask:04b}"


@cocotb.test()
async def sparse(dut):
    """All results in one batch, with and without the override."""
    driver = Driver(dut)
    for override in (0, 1):
        driver.set(1, 0, 0, override)
        for bits in range(1 << 8):
            rects = bits & 15, bits >> 4
            await driver.cycle(*rects)
            driver.expect(15 if override else sparse_mask(rects))
    assert driver.checked == 2 << 8


@cocotb.test()
async def dense(dut):
    """All results of two batches; what batch 0 left holds for every batch 1, and yields to the override."""
    driver = Driver(dut)
    for first in range(1 << 8):
        driver.set(1, 1, 0, 0)
        await driver.cycle(first & 15, first >> 4)
        driver.expect(None)
        driver.set(1, 1, 1, 0)
        for second in range(1 << 8):
            rects = first & 15, first >> 4, second & 15, second >> 4
            await driver.cycle(*rects[2:])
            driver.expect(dense_mask(rects))
        driver.set(1, 1, 1, 1)
        await driver.cycle(0, first & 15)
        driver.expect(15)
    assert driver.checked == (1 << 16) + (1 << 8)


@cocotb.test()
async def sequences(dut):
    """Sparse and dense splats and tokens in random order, with bubbles and garbage in them."""
    driver = Driver(dut)
    rng = random.Random(random.getrandbits(64))
    bits = rng.getrandbits

    async def bubbles() -> None:
        while rng.random() < 0.3:
            driver.set(0, bits(1), bits(1), bits(1))
            await driver.cycle(bits(4), bits(4))
            driver.expect(None)

    for _ in range(2000):
        await bubbles()
        rects = [rng.choice((0, 0, 1, 2, 4, 8, bits(4))) for _ in range(4)]
        kind = rng.choice(("sparse", "dense", "override"))
        if kind == "dense":
            driver.set(1, 1, 0, 0)
            await driver.cycle(*rects[:2])
            driver.expect(None)
            await bubbles()
            driver.set(1, 1, 1, 0)
            await driver.cycle(*rects[2:])
            driver.expect(dense_mask(rects))
        else:
            driver.set(1, 0, 0, int(kind == "override"))
            await driver.cycle(*rects[:2])
            driver.expect(15 if kind == "override" else sparse_mask(rects[:2]))
    assert driver.checked == 2000
