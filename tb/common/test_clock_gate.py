"""Clock gate: enables that change in either half of a cycle. Not covered: what it becomes in synthesis, where a technology's cell takes its place."""

from __future__ import annotations

import pytest
from flicker_tb.bench import four_state, netlist
from flicker_tb.runner import build_and_test


@pytest.mark.skipif(netlist() or four_state(), reason="in synthesis without a cell the clock passes")
def test_clock_gate() -> None:
    build_and_test("flk_clock_gate", "cocotb_clock_gate")
