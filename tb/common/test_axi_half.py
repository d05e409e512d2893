"""Narrow reads on a wider port: the half of each beat is that of its address.

State space: one read under way, few, all that have room; beats in the cycle of another address. Parameter space: halves of 256 bits;
with SLOW=1 also of 32 and 64, 1 and 8 reads.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {}, *(pytest.param(case, marks=pytest.mark.slow) for case in ({"Width": 32, "AddrBits": 32, "Bursts": 8}, {"Width": 64, "Bursts": 1})),
], ids=str)
def test_axi_half(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_half", "cocotb_axi_half", parameters=parameters)
