"""FIFO in a memory: flk_sram_fifo.

As test_stream_cells.py: every pair of idle and back-pressure patterns, random payloads and initial values, blocked output, reset and clear in mid-traffic.
Parameter space: widths of one bit and of more than a machine word, depths that are powers of two and others. Not covered: other depths and widths.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test, refused


@pytest.mark.parametrize(("width", "depth"), [(1, 2), (146, 5)])
def test_sram_fifo(width: int, depth: int) -> None:
    build_and_test(
        "flk_sram_fifo", "cocotb_stream_cells", parameters={"Width": width, "Depth": depth},
        config={"capacity": depth + 1, "period": 1, "latency": 2, "paths": []}, inner=False,
    )


@pytest.mark.parametrize("parameters", [{"Width": 0}, {"Depth": 1}])
def test_illegal_parameters(parameters: dict[str, int]) -> None:
    with refused("Width must be at least 1, Depth at least 2"):
        build_and_test("flk_sram_fifo", "cocotb_stream_cells", parameters=parameters)
