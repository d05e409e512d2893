"""Performance counters: every counter adds its own event, clear works. Not covered: wrapping at 2^32."""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_perf_counters() -> None:
    build_and_test("flk_perf_counters", "cocotb_perf_counters")
