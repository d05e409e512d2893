"""Queue in a memory: order, loss and duplication under idle and back-pressure patterns, capacity, latency and rate, reset in traffic.

Parameter space: a depth that is no power of two, with SLOW=1 also 2 and 32; the memory inverts what is read beside a write of the same word.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("width", "depth"), [(79, 5), *(pytest.param(*size, marks=pytest.mark.slow) for size in ((1, 2), (8, 32)))])
def test_sram_fifo(width: int, depth: int) -> None:
    build_and_test("flk_sram_fifo", "cocotb_sram_fifo", parameters={"Width": width, "Depth": depth}, config={"width": width, "depth": depth}, inner=False)


def test_illegal_parameters() -> None:
    refused("flk_sram_fifo", {"Depth": 1}, "Depth at least 2")
