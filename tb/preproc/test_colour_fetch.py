"""Colour fetch: parts of survivors' colours against memory, in both formats and all degrees, under pauses of memory and lanes.

State space: clusters of one to 256 Gaussians, without survivors, with gaps; more clusters than numbers of them; frames one after the other; the
highest beats that a header can name. Parameter space: the default; with SLOW=1 one and two lanes. Not covered: errors of the memory
(tb/preproc/test_preprocessing.py).
"""

from __future__ import annotations

import pytest
from flicker_tb.bench import four_state
from flicker_tb.runner import build_and_test


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [1, 2])
def test_fewer_lanes(lanes: int) -> None:
    build_and_test("flk_colour_fetch", "cocotb_colour_fetch", parameters={"Lanes": lanes},
                   tests=["parts", "last_colours", "a_lane_that_waits", "clusters_without_survivors"])


def test_colour_fetch() -> None:
    build_and_test("flk_colour_fetch", "cocotb_colour_fetch", tests=["a_lane_that_waits"] if four_state() else [])
