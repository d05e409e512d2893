"""State of a VRU's pixels: what each operation reads, what it leaves, tokens and clear_i, against a list of sub-tiles in program order.

State space: random operations, pixels as close behind each other as they may come, tokens in any distance, clear_i at random times,
registers beginning with random values. Parameter space: 8 pixels, with SLOW=1 4 and 16. Not covered: operations on a pixel that return too early, which
an assertion refuses.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("pixels", [8, *(pytest.param(pixels, marks=pytest.mark.slow) for pixels in (4, 16))])
def test_pixel_state(pixels: int) -> None:
    build_and_test("flk_pixel_state", "cocotb_pixel_state", parameters={"Pixels": pixels}, config={"Pixels": pixels})


def test_too_few_pixels() -> None:
    refused("flk_pixel_state", {"Pixels": 2}, "return before their state is written")
