"""Pointer port: lines of pointers of four writers to their table in memory and back, against a table in Python.

State space: requests of all writers at once and of one alone, lines that go, come, or both; memories that pause on every channel, perfect and LPDDR4; answers
with errors, after which zeros come until the next start; reset in a request. Parameter space: 28 of 32 bits; with SLOW=1 20, with one and two writers.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test


@pytest.mark.parametrize("parameters", [
    {}, *(pytest.param({"Writers": few, "NumberBits": 5, "MoveBits": 20}, marks=pytest.mark.slow) for few in (1, 2)),
], ids=str)
def test_pointer_port(parameters: dict[str, int]) -> None:
    build_and_test("flk_pointer_port", "cocotb_pointer_port", parameters=parameters)


def test_illegal_parameters() -> None:
    refused("flk_pointer_port", {"Writers": 3}, "Writers must be a power of two")
