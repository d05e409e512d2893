"""Counters of a core of the lanes: each adds its own events, in the order of params.LANE_COUNTERS; hold and clear. Not covered: wrapping at 2^32."""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_lane_counters() -> None:
    build_and_test("flk_lane_counters", "cocotb_lane_counters")
