"""Delivery: every core gets the records of the entries with its bit, in order, tile by tile; none twice, none more after it is finished than were on their way.

State space: lists of 0 to 300 entries, masks of all kinds, cores of different pace, idle and back-pressure patterns, memory with and without pauses; cores that
finish with their tiles at random, none or all of them; latency; clear at any time. Parameter space: short queues and a small cache; with SLOW=1 the default,
records of 32 bytes.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test, refused

SMALL = {"Queue": 8, "Banks": 2, "Sets": 2, "Ways": 2, "Depth": 8, "Places": 4}


@pytest.mark.parametrize("parameters", [*(pytest.param(p, marks=pytest.mark.slow) for p in ({}, {"RecordBits": 256})), SMALL])
def test_delivery(parameters: dict[str, int]) -> None:
    tests = [] if not parameters else ["tiles", "finishing", "all_finished", "latency", "clear"]
    build_and_test("flk_delivery", "cocotb_delivery", parameters=parameters, tests=tests)


def test_illegal_parameters() -> None:
    with refused("Queue must be even, at least 8"):
        build_and_test("flk_delivery", "cocotb_delivery", parameters={"Queue": 6})
