"""Frames of the chip: flk_frame_control with host, halves and counters as Python agents.

State space: random and limiting descriptors, every rule broken alone; errors of either half; halves, counters and hosts of every speed; starts while locked;
clear, abort, time-out and reset at random times, with and without a frame that waits for its acknowledgement; acknowledgements of no frame. Parameter space:
16384 lists of a writer, so that the largest picture is legal, with SLOW=1 30 and 2048.
Numbers of frames that wrap at 2^16: set to their last values in between.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [{}, *(pytest.param(p, marks=pytest.mark.slow) for p in ({"Lists": 30}, {"Lists": 2048}))], ids=str)
def test_frame_control(parameters: dict[str, int]) -> None:
    build_and_test("flk_frame_control", "cocotb_frame_control", parameters=parameters, inner=True)
