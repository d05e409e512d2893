"""Frame writer: every byte of the frame buffer as in the golden model, nothing else written; lines, rates, frames one after the other, abort.

State space: pixels of every sub-tile in any order, cores apart by up to two pairs, special FP16 values, idle and back-pressure patterns, both pixel formats,
strides with a gap, odd and even bursts at the start of a row, tiles in any order of pairs, the corners of the largest picture with the least and the longest
stride at the end of the address space. Parameter space: four pairs held and the
order of mini-tiles; two and the order of 32 lanes; with SLOW=1 also two and eight pairs, 64 and 128 lanes, one and two cores, for the bytes of frames and
one late core only.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("pairs", "lanes", "cores"), [
    (4, 0, 4), (2, 32, 4),
    *(pytest.param(*numbers, marks=pytest.mark.slow) for numbers in ((2, 8, 1), (2, 0, 4), (8, 64, 4), (4, 128, 4), (4, 8, 2), (2, 4, 1), (4, 32, 1))),
])
def test_frame_writer(pairs: int, lanes: int, cores: int) -> None:
    tests = [] if pairs == 4 and lanes == 0 else ["bytes_of_frames", "one_core_late"][: 1 if cores == 1 else 2]
    build_and_test("flk_frame_writer", "cocotb_frame_writer", parameters={"Pairs": pairs, "Lanes": lanes, "Cores": cores},
                   config={"pairs": pairs, "lanes": lanes, "cores": cores}, tests=tests, inner=False)


def test_illegal_parameters() -> None:
    for parameters, message in (
        ({"Pairs": 3}, "Pairs must be 2, 4 or 8"), ({"Lanes": 24}, "Lanes must be 4, 8, 16 or 32 times Cores"),
        ({"Cores": 3}, "Cores must be 1, 2 or 4"), ({"Cores": 1}, "or 0 with four cores"),
    ):
        refused("flk_frame_writer", parameters, message)
