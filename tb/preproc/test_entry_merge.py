"""Merge of the lanes' entries: every bank's entries in the order of the scene, whatever the timing; the end, once; frames one after the other.

State space: splats with and without entries, of any lane; sequence numbers that run around, half of their range apart; progress seen at once and late; idle
and back-pressure patterns, different ones for each lane and bank; reset in a frame. Parameter space: queues of 2 and 4.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("depth", [2, 4])
def test_entry_merge(depth: int) -> None:
    tests = [] if depth == 4 else ["frames", "one_lane_late", "overtaken_by_progress"]
    build_and_test("flk_entry_merge", "cocotb_entry_merge", parameters={"Depth": depth}, inner=False, tests=tests)


def test_illegal_parameters() -> None:
    refused("flk_entry_merge", {"Depth": 1}, "Depth must be at least 2")
