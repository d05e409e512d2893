"""Frame writer: every byte of the frame buffer as in the golden model, nothing else written; lines, rates, frames one after the other, abort.

State space: pixels of every sub-tile in any order, cores apart by up to two pairs, special FP16 values, idle and back-pressure patterns, both pixel formats,
strides with a gap, odd and even bursts at the start of a row, tiles in any order of pairs. Parameter space: four pairs held; two, and
with SLOW=1 eight, for the bytes of frames and one late core only.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test, refused


@pytest.mark.parametrize("pairs", [4, 2, pytest.param(8, marks=pytest.mark.slow)])
def test_frame_writer(pairs: int) -> None:
    tests = [] if pairs == 4 else ["bytes_of_frames", "one_core_late"]
    build_and_test("flk_frame_writer", "cocotb_frame_writer", parameters={"Pairs": pairs}, config={"pairs": pairs}, tests=tests, inner=False)


def test_illegal_parameters() -> None:
    with refused("Pairs must be 2, 4 or 8"):
        build_and_test("flk_frame_writer", "cocotb_frame_writer", parameters={"Pairs": 3}, inner=False)
