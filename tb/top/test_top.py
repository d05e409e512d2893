"""The chip's top, flk_top, with stand-ins for its halves: the sequence of frames as a host sees it.

State space: frames back to back, released early and late; a write right behind each start; aborts, time-outs and resets with and without a frame that waits
for its release, in a drain too; interrupts, enables, counters that run on. Not covered: the halves (tb/frames/test_chip_frames.py has the whole chip),
addresses and orders at the memory port (tb/common/test_axi_arbiter.py).
"""

from __future__ import annotations

import standins
from flicker_tb.bench import four_state
from flicker_tb.runner import build_and_test

CAPABILITY = {"stage": 1, "form": 0, "precision": 2, "vrus": 4, "mask_generator": 1, "log2_lists": 10, "log2_beat": 6, "log2_lanes": 4}


def test_top() -> None:
    build_and_test(
        "flk_top", "cocotb_top", sources=standins.sources(), config={"capability": CAPABILITY},
        parameters={"Stage": 1, "Form": 0, "Precision": 2, "VrusPerChannel": 4, "MaskGenerator": 1, "Lists": 1 << 10, "Lanes": 16},
        args=["-Wno-fatal"], tests=["before_the_first_frame"] if four_state() else [],
    )
