"""FIFO monitor against its rule: exhaustive over all inputs that a mask generator can produce (masks are not empty, tokens go to all), with
masks of mini-tiles; with SLOW=1 also with masks of pixels over all sets of mini-tiles, by random pixels of each."""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.params import CHANNELS, SUBTILE_PIXELS


@pytest.mark.parametrize("bits", [CHANNELS, pytest.param(SUBTILE_PIXELS, marks=pytest.mark.slow)])
def test_fifo_monitor(bits: int) -> None:
    settings = {"MaskBits": bits}
    build_and_test("flk_fifo_monitor", "cocotb_fifo_monitor", parameters=settings, config=settings)


def test_illegal_mask() -> None:
    refused("flk_fifo_monitor", {"MaskBits": 8}, "MaskBits must be 4 (mini-tiles) or 64")
