"""Addresses kept from a memory port, and what is under way behind it.

State space: holds of reads, of writes and of both at any time, while nothing, something and all that can be counted is under way; ends in the cycle of another
address; clear. Parameter space: the front end's and the rendering half's managers, few bursts.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [{}, {"Readers": 2, "Writers": 1, "CountBits": 2}], ids=str)
def test_axi_hold(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_hold", "cocotb_axi_hold", parameters=parameters)
