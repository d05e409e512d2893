"""Narrow reads on a wider port: the half of each beat is that of its address.

State space: one read under way, few, all that have room; beats in the cycle of another address. Parameter space: halves of 32 to 256 bits, 1 to 128 reads.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [{}, {"Width": 32, "AddrBits": 32, "Bursts": 8}, {"Width": 64, "Bursts": 1}], ids=str)
def test_axi_half(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_half", "cocotb_axi_half", parameters=parameters)
