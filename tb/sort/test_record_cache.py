"""Record cache: records in order, two a cycle, and exactly the lines read that the golden model says for the order of the lookups.

State space: records of one line, of one set, near each other and anywhere; ends between them; pairs in one bank; idle patterns, outputs that wait,
memory with and without pauses, latency 1 to 100; latency of a hit; errors; start and clear at any time. Parameter space: the default; with SLOW=1
also a small cache with short queues, the one of the memories `records` and `large`, records of 32 bytes.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SMALL = {"Banks": 2, "Sets": 4, "Ways": 2, "Depth": 8, "Places": 4}


LARGE = {"Sets": 128}  # of the memories `records` and `large`


@pytest.mark.parametrize("parameters", [
    {}, *(pytest.param(p, marks=pytest.mark.slow) for p in (SMALL, LARGE, {"RecordBits": 256, "Sets": 16})),
])
def test_record_cache(parameters: dict[str, int]) -> None:
    tests = [] if parameters in ({}, SMALL) else ["wanted"] if parameters == LARGE else ["records"]
    build_and_test("flk_record_cache", "cocotb_record_cache", parameters=parameters, tests=tests)


@pytest.mark.parametrize(("parameters", "message"), [({"RecordBits": 96}, "RecordBits must be 128 or 256"), ({"Ways": 3}, "must be powers of two")])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    refused("flk_record_cache", parameters, message)
