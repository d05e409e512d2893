"""cocotb tests of flk_sram (random_traffic) and flk_sram_single (one_port); settings: width, depth."""

from __future__ import annotations

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge
from flicker_tb.bench import config


@cocotb.test()
async def random_traffic(dut):
    """Every cycle against a list of words."""
    rng = random.Random(random.getrandbits(64))
    width, depth = config()["width"], config()["depth"]
    dut.wr_en_i.value = dut.rd_en_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 10, unit="ns").start())
    edge = RisingEdge(dut.clk_i)
    words: list[int | None] = [None] * depth
    due: int | None = None
    known = shown = beside = 0
    for _ in range(3000):
        write, read = rng.random() < 0.5, rng.random() < 0.5
        to, of, word = rng.randrange(depth), rng.randrange(depth), rng.getrandbits(width)
        for name, value in (("wr_en", write), ("wr_addr", to), ("wr_data", word), ("rd_en", read), ("rd_addr", of)):
            getattr(dut, f"{name}_i").value = int(value)
        await edge  # samples what was set after the last edge; the outputs are those of before
        if due is not None:
            assert int(dut.rd_data_o.value) == due, f"read {int(dut.rd_data_o.value):#x}, due {due:#x}"
            known += 1
        if read:
            old = words[of]
            clash = write and to == of
            due = None if old is None else old ^ ((1 << width) - 1 if clash else 0)
            shown += not clash
            beside += clash
        if write:
            words[to] = word
    assert known > 2000 and shown > 300 and beside > 20


@cocotb.test()
async def one_port(dut):
    """Every cycle against a list of words; the port reads, writes or rests."""
    rng = random.Random(random.getrandbits(64))
    width, depth = config()["width"], config()["depth"]
    dut.en_i.value = 0
    cocotb.start_soon(Clock(dut.clk_i, 10, unit="ns").start())
    edge = RisingEdge(dut.clk_i)
    words: list[int | None] = [None] * depth
    due: int | None = None
    known = shown = 0
    for _ in range(3000):
        enable, write = rng.random() < 0.7, rng.random() < 0.5
        at, word = rng.randrange(depth), rng.getrandbits(width)
        for name, value in (("en", enable), ("write", write), ("addr", at), ("wr_data", word)):
            getattr(dut, f"{name}_i").value = int(value)
        await edge
        if due is not None:
            assert int(dut.rd_data_o.value) == due, f"read {int(dut.rd_data_o.value):#x}, due {due:#x}"
            known += 1
        if enable and write:
            words[at] = word
        elif enable:
            due = words[at]
            shown += due is not None
    assert known > 2000 and shown > 300
