"""Frames of the chip: flk_frame_control with host, halves and counters as Python agents.

State space: random and limiting descriptors, every rule broken alone; errors of either half; halves, counters and hosts of every speed; starts while locked;
clear, abort, time-out and reset at random times. Parameter space: 30 lists of a writer, with SLOW=1 2048 and 16384. Not covered: numbers of frames
that wrap at 2^16.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [*(pytest.param(p, marks=pytest.mark.slow) for p in ({}, {"Lists": 2048})), {"Lists": 30}], ids=str)
def test_frame_control(parameters: dict[str, int]) -> None:
    build_and_test("flk_frame_control", "cocotb_frame_control", parameters=parameters)
