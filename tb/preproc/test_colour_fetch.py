"""Colour fetch: parts of survivors' colours against memory, in both formats and all degrees, under pauses of memory and lanes.

State space: clusters of one to 256 Gaussians, without survivors, with gaps; more clusters than numbers of them; frames one after the other; the
highest beats that a header can name. Parameter space: the default. Not covered: errors of the memory (tb/preproc/test_preprocessing.py).
"""

from __future__ import annotations

from flicker_tb.bench import four_state
from flicker_tb.runner import build_and_test


def test_colour_fetch() -> None:
    build_and_test("flk_colour_fetch", "cocotb_colour_fetch", tests=["a_lane_that_waits"] if four_state() else [])
