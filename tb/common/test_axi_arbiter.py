"""Managers of both kinds at one memory port: flk_axi_arbiter.

A model of choice, order, drain and watch is compared in every cycle. State space: random requests of every manager with several identifiers, bursts of 1 to
16 beats, narrow reads; memory perfect, LPDDR4 and of another project (cocotbext-axi), every order of answers, of addresses and data, pauses of every channel;
drains at random times; each channel that stops. Parameter space: 2 to 6 readers, 2 and 3 writers, 64 to 512 bits, little patience, few orders
(numbers other than the defaults and the chip's with SLOW=1). Not covered: 4095 bursts under way.
"""

from __future__ import annotations

import pytest
from flicker_tb.bench import four_state
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {"Width": 64}, pytest.param({"Readers": 2, "Writers": 3, "Width": 128, "IdBits": 2, "AddrBits": 32, "Patience": 2, "Orders": 2}, marks=pytest.mark.slow),
], ids=str)
def test_axi_arbiter(parameters: dict[str, int]) -> None:
    build_and_test("flk_axi_arbiter", "cocotb_axi_arbiter", parameters=parameters, tests=["rate"] if four_state() else [])


def test_of_the_chip() -> None:
    """The parameters of the chip."""
    build_and_test("flk_axi_arbiter", "cocotb_axi_arbiter", tests=["traffic", "other_memory"])


def test_illegal_parameters() -> None:
    refused("flk_axi_arbiter", {"Readers": 17, "Patience": 20}, "at most 16")
