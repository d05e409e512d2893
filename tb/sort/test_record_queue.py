"""Queue of records and ends: order, loss and duplication under idle and back-pressure patterns, one and two words at either input and output; records
that are dropped at any time, ends that are not, groups that are dropped at once; capacity, latency, rate, clear in traffic.

Parameter space: depths 8 (one group) and 128; with SLOW=1 24, whose groups are no power of two. Not covered: reset in traffic (as clear).
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize(("width", "depth"), [(3, 8), pytest.param(79, 24, marks=pytest.mark.slow), (8, 128)])
def test_record_queue(width: int, depth: int) -> None:
    build_and_test("flk_record_queue", "cocotb_record_queue", parameters={"Width": width, "Depth": depth}, config={"width": width, "depth": depth})


def test_illegal_parameters() -> None:
    refused("flk_record_queue", {"Depth": 12}, "Depth must be a multiple of 8, at least 8")
