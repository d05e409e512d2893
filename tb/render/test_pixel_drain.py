"""Output buffer of a VRU: the stream of each sub-tile, when the buffer is free, back-pressure, clear_i.

State space: random states and distances between token, T and C, every back-pressure of probability, clear_i at random times, registers
beginning with random values. Parameter space: 8 pixels, with SLOW=1 4 and 16. Not covered: a token while the buffer is in use, which an assertion refuses.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("pixels", [8, *(pytest.param(pixels, marks=pytest.mark.slow) for pixels in (4, 16))])
def test_pixel_drain(pixels: int) -> None:
    build_and_test("flk_pixel_drain", "cocotb_pixel_drain", parameters={"Pixels": pixels}, config={"Pixels": pixels})
