"""Counters of events: one and several a cycle, carries into the upper bits, clear with events on their way; several counters of several
sources each; counts about 2^32, where the upper bits are set to their end. With SLOW=1 also one bit a cycle, other numbers of counters and sources."""

from __future__ import annotations

import pytest
from flicker_tb.bench import four_state, netlist
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SLOW = pytest.mark.slow  # the same with other numbers


@pytest.mark.parametrize("bits", [pytest.param(1, marks=SLOW), 3])
def test_event_counter(bits: int) -> None:
    build_and_test("flk_event_counter", "cocotb_event_counter", parameters={"CountBits": bits}, tests=["counts"])


@pytest.mark.skipif(netlist() or four_state(), reason="sets a register")
def test_end_of_the_count() -> None:
    build_and_test("flk_event_counter", "cocotb_event_counter", parameters={"CountBits": 3}, tests=["wraps"], inner=True)


@pytest.mark.parametrize(("counters", "sources"), [pytest.param(1, 1, marks=SLOW), (3, 4), pytest.param(2, 5, marks=SLOW)])
def test_event_counters(counters: int, sources: int) -> None:
    build_and_test("flk_event_counters", "cocotb_event_counter", parameters={"Counters": counters, "Sources": sources}, tests=["sources"])


def test_illegal_parameters() -> None:
    refused("flk_event_counter", {"CountBits": 9}, "CountBits must be 1 to 8")
