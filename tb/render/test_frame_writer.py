"""Frame writer: every byte of the frame buffer as in the golden model, nothing else written; lines, rates, frames one after the other, abort.

State space: pixels of every sub-tile in any order, cores apart by up to two pairs, special FP16 values, idle and back-pressure patterns, both pixel formats,
strides with a gap, odd and even bursts at the start of a row, tiles in any order of pairs. Parameter space: the defaults.
"""

from __future__ import annotations

from flicker_tb.runner import build_and_test


def test_frame_writer() -> None:
    build_and_test("flk_frame_writer", "cocotb_frame_writer", inner=False)
