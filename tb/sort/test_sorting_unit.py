"""Sorting unit: every list that it holds in order, whatever the timing; lists finished early; clear; counters; cycles.

State space: lists empty, of one entry, around the lengths of runs, up to the capacity; keys random, few, equal, ascending, descending, extreme;
idle and back-pressure patterns on lines and output; finish_i at every place; clear_i at random times.
Parameter space: a small unit with last steps of eight runs, with SLOW=1 also of two and four; the unit as it is (16 cells, 7 doublings, eight runs) with
lists of all lengths, with SLOW=1 in everything, with cycles, and with two runs. Longer lists: test_list_sorter.py. Not covered: counters of more than 2**16.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SMALL = ["lists", "many", "finished", "clear_in_the_middle"]


@pytest.mark.parametrize(("cells", "stages", "ways", "block"), [
    *(pytest.param(*sizes, marks=pytest.mark.slow) for sizes in ((4, 3, 2, 4), (2, 1, 2, 2), (4, 3, 4, 2))), (2, 3, 8, 2),
])
def test_small(cells: int, stages: int, ways: int, block: int) -> None:
    build_and_test("flk_sorting_unit", "cocotb_sorting_unit",
                   parameters={"Cells": cells, "Stages": stages, "Ways": ways, "Block": block, "Lists": 2 if stages == 1 else 4},
                   config={"cells": cells, "stages": stages, "ways": ways}, tests=SMALL, opt="-O1")


@pytest.mark.parametrize("ways", [8, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("tests", [["lists", "finish_is_quick"], pytest.param([*SMALL[1:], "rate"], marks=pytest.mark.slow)], ids=["lists", "more"])
def test_sorting_unit(tests: list[str], ways: int) -> None:
    build_and_test("flk_sorting_unit", "cocotb_sorting_unit", parameters={"Ways": ways}, config={"ways": ways}, tests=tests, opt="-O1")


def test_illegal_parameters() -> None:
    refused("flk_sorting_unit", {"Cells": 12}, "Cells must be a power of two")
    refused("flk_sorting_unit", {"Stages": 1, "Ways": 4}, "Ways must be a power of two")
