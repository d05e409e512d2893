"""List reader: lines of every list in the order of the tiles against the golden model, and exactly the lines of memory that it says; faults; clear.

State space: lists of 0 to 3,000 entries, chunks begun and full, chunks across 4 KB, lists given again, idle and back-pressure patterns on tiles, lines and
answers, memory with and without pauses, latency 1 to 100 and DRAM timing; faults of the memory and of each field of pointer and header; clear at any time.
Parameter space: four contexts of 16 lines, two of 16, eight of 32. Not covered: chunk numbers of more than 12 bits, several managers at one port.
"""

from __future__ import annotations

import pytest
from flicker_tb.runner import build_and_test, refused


@pytest.mark.parametrize("parameters", [{}, {"Contexts": 2, "Places": 16, "Ahead": 1}, {"Contexts": 8, "Places": 32, "Ahead": 3, "Bursts": 3}])
def test_list_reader(parameters: dict[str, int]) -> None:
    tests = [] if not parameters else ["lists", "again", "faults"]
    build_and_test("flk_list_reader", "cocotb_list_reader", parameters=parameters, tests=tests)


@pytest.mark.parametrize(("parameters", "message"), [
    ({"Contexts": 3}, "Contexts must be a power of two"), ({"Places": 8}, "Places must be a power of two"),
    ({"ChunkLines": 6}, "ChunkLines must be a power of two"), ({"EntryBits": 54}, "must fit a line"),
])
def test_illegal_parameters(parameters: dict[str, int], message: str) -> None:
    with refused(message):
        build_and_test("flk_list_reader", "cocotb_list_reader", parameters=parameters)
