"""Buffer of a sorting unit's entries: order, pairs, ends, finish_o in every cycle, capacity and rate, clear.

State space: lists of no entry to three times the depth; every idle and stall pattern; finish_i at random; clear in traffic. Parameter space: depths 4,
with SLOW=1 10, and 512, of which clear in traffic with SLOW=1. Not covered: reset in traffic (as clear, and flk_sram_fifo's).
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("depth", "tests"), [
    (4, []), pytest.param(10, [], marks=pytest.mark.slow), (512, ["capacity"]), pytest.param(512, ["clear"], marks=pytest.mark.slow),
])
def test_entry_buffer(depth: int, tests: list[str]) -> None:
    build_and_test("flk_entry_buffer", "cocotb_entry_buffer", parameters={"Depth": depth}, config={"depth": depth}, tests=tests)


def test_illegal_parameters() -> None:
    refused("flk_entry_buffer", {"Depth": 5}, "Depth must be even, at least 4")
