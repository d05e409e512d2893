"""cocotb test of flk_lzc."""

from __future__ import annotations

import cocotb
from cocotb.triggers import Timer


@cocotb.test()
async def every_input(dut):
    """The count is the width less the bits that the number takes."""
    width = len(dut.value_i)
    for value in range(1 << width):
        dut.value_i.value = value
        await Timer(1, unit="ns")
        assert int(dut.count_o.value) == width - value.bit_length(), f"{value:#x}"
