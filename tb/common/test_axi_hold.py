"""Addresses kept from a memory port, and what is under way behind it.

State space: holds of reads, of writes and of both at any time, while nothing, something and all that can be counted is under way; few bursts of a manager,
from any number on; ends in the cycle of another address; clear. Parameter space: the front end's and the rendering half's managers, few bursts.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [{}, {"Readers": 2, "Writers": 1, "CountBits": 2, "Few": 1}], ids=str)
def test_axi_hold(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_hold", "cocotb_axi_hold", parameters=parameters)


@pytest.mark.parametrize("few", [0, 4096])
def test_illegal_parameters(few: int) -> None:
    refused("flk_axi_hold", {"Few": few}, "Few must be 1 to 2^CountBits - 1")
