"""Queue of two words a cycle: order, loss and duplication under idle and back-pressure patterns, one and two words at either input and output,
room, capacity, latency, rate, clear in traffic.

Parameter space: a depth whose half is no power of two; with SLOW=1 also 4 and 32. Not covered: reset in traffic (as clear, and flk_sram_fifo's).
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("width", "depth"), [(79, 10), *(pytest.param(*size, marks=pytest.mark.slow) for size in ((3, 4), (8, 32)))])
def test_pair_fifo(width: int, depth: int) -> None:
    build_and_test("flk_pair_fifo", "cocotb_pair_fifo", parameters={"Width": width, "Depth": depth}, config={"width": width, "depth": depth})


def test_illegal_parameters() -> None:
    refused("flk_pair_fifo", {"Depth": 5}, "Depth must be even, at least 4")
