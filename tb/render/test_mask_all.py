"""Generator of full masks: every element comes out once, in order, with all bits set; acceptance stops at stall_i; counters, idle, clear.

State space: random elements and tokens under idle input, blocked output and blocked acceptance; clear in mid-traffic. Parameter space: masks of
mini-tiles, with SLOW=1 of pixels. Not covered: reset in mid-traffic (its register slice: tb/common/test_stream_cells.py).
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

from flicker.params import CHANNELS, SUBTILE_PIXELS


@pytest.mark.parametrize("bits", [CHANNELS, pytest.param(SUBTILE_PIXELS, marks=pytest.mark.slow)])
def test_mask_all(bits: int) -> None:
    settings = {"MaskBits": bits}
    build_and_test("flk_mask_all", "cocotb_mask_all", parameters=settings, config=settings)


def test_illegal_mask() -> None:
    refused("flk_mask_all", {"MaskBits": 5}, "MaskBits must be 4 (mini-tiles) or 64")
