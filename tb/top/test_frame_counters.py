"""Counters of frames in two banks: flk_frame_counters.

State space: both halves at any time and together, either bank, halves that have not run, a reader all the while, copies that clear_i ends.
Not covered: words that are read while they are written, which are undefined.
"""

from __future__ import annotations

from flicker_tb.bench import rounds
from flicker_tb.runner import build_and_test


def test_frame_counters() -> None:
    build_and_test("flk_frame_counters", "cocotb_frame_counters", seeds=rounds(1, 2))
