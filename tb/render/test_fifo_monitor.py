"""FIFO monitor against its rule: exhaustive over all inputs that the CTU can produce (masks are not empty, tokens have mask 1111)."""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_fifo_monitor() -> None:
    build_and_test("flk_fifo_monitor", "cocotb_fifo_monitor")
