"""Lists of any length in order: entries, lines written back, against the golden model, whatever the timing; lists left early; too long ones; cycles.

State space: lists empty, short, around whole runs, of as many runs as fit; keys random, sorted, backwards, equal, in walls and clumps; idle and back-pressure
patterns on lines, writes, reads and output; answers of writes early and late; lists finished at any place. Parameter space: a small unit with 16 runs, last
steps of eight runs, as it is, of two and four; the unit as it is with SLOW=1, with 100,000 entries in the worst orders.
"""

from __future__ import annotations

import pytest
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test

SMALL = {"Cells": 16, "Stages": 5, "Runs": 16, "MergeLines": 32}
SETTINGS = {"cells": 16, "stages": 5, "runs": 16, "merge_lines": 32}


@pytest.mark.parametrize("ways", [8, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 4))])
def test_small(ways: int) -> None:
    build_and_test("flk_list_sorter", "cocotb_list_sorter", parameters={**SMALL, "Ways": ways}, config={**SETTINGS, "ways": ways},
                   tests=["lists", "late", "longest", "finished", "too_long"], opt="-O1")


@pytest.mark.slow
@pytest.mark.parametrize("ways", [2, 4, 8])
def test_list_sorter(ways: int) -> None:
    build_and_test("flk_list_sorter", "cocotb_list_sorter", parameters={"Ways": ways}, config={"ways": ways}, tests=["lists", "finished", "rate"], opt="-O1")


@pytest.mark.slow
@pytest.mark.parametrize("ways", [2, 4, 8])
def test_100000(ways: int) -> None:
    build_and_test("flk_list_sorter", "cocotb_list_sorter", parameters={"Ways": ways}, config={"ways": ways, "orders": ["random", "backwards", "equal"]},
                   tests=["a_long_one"], opt="-O1")


def test_illegal_parameters() -> None:
    refused("flk_list_sorter", {"MergeLines": 64}, "Lines at least twice Runs")
    refused("flk_list_sorter", {"Stages": 3}, "Capacity must hold")
