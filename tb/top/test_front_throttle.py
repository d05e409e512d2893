"""When the front end has few bursts under way: while the rendering half runs and is no further in its frame.

State space: clusters, one by one and many at once, and pairs of tiles at any pace, together and alone, to the last of both; frames of one cluster, of one
pair and of the most of both; a front end that begins with or behind the rendering half, and ends before it; reset under way. Parameter space: the chip's
widths, and so few bits that frames are as large as they allow.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [{}, {"ClusterBits": 5, "PairBits": 4}], ids=str)
def test_front_throttle(parameters: dict[str, int]) -> None:
    build_and_test("flk_front_throttle", "cocotb_front_throttle", parameters=parameters)
