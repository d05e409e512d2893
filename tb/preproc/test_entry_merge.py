"""Merge of the lanes' entries: every bank's entries in the order of the scene, whatever the timing; the end, once; frames one after the other.

State space: splats with and without entries, of any lane; sequence numbers that run around, half of their range apart; progress seen at once and late; idle
and back-pressure patterns, different ones for each lane and bank; reset in a frame. Parameter space: queues of 4; with SLOW=1 of 2, and one
and two lanes and writers.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("depth", [pytest.param(2, marks=pytest.mark.slow), 4])
def test_entry_merge(depth: int) -> None:
    tests = [] if depth == 4 else ["frames", "one_lane_late", "overtaken_by_progress"]
    build_and_test("flk_entry_merge", "cocotb_entry_merge", parameters={"Depth": depth}, inner=False, tests=tests)


@pytest.mark.slow
@pytest.mark.parametrize(("lanes", "writers"), [(2, 2), (1, 1), (4, 1), (1, 4)])
def test_fewer_lanes_and_writers(lanes: int, writers: int) -> None:
    """Outputs that have two banks, or all."""
    build_and_test("flk_entry_merge", "cocotb_entry_merge", parameters={"Depth": 2, "Lanes": lanes, "Writers": writers}, inner=False,
                   tests=["frames", "one_bank_stands", "reset_in_a_frame"])


def test_illegal_parameters() -> None:
    refused("flk_entry_merge", {"Depth": 1}, "Depth must be at least 2")
    refused("flk_entry_merge", {"Writers": 3}, "Writers must be 1, 2 or 4")
