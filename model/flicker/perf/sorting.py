"""Cycles of a sorting unit without stalls (rtl/sort/flk_sorting_unit.sv; held against it by tb/sort/test_sorting_unit.py).

The steps merge while their runs arrive, so lists follow each other at an entry a cycle and one cycle a list; what a list alone takes longer is latency.
Step k waits for its first run, Cells << k entries; the step behind the last one that has two runs of the list waits for its end. A step whose first memory
is full when the next run comes holds it up for up to three cycles, by the order of the entries: never in ascending lists, seldom in others.
"""

from __future__ import annotations

from ..golden.sorting import CELLS, STAGES, SortedList

PIPELINE = 22  # registers and memories from the line to the output, one after the other
ORDER = 32  # of a list's entries, at most one cycle for so many is lost by their order


def latency(n: int, cells: int = CELLS, stages: int = STAGES) -> int:
    """Cycles of a list of n <= cells << stages entries alone beside an entry a cycle, from its first line to its end."""
    if n == 0:
        return 11
    if n < cells:
        return PIPELINE + 3 + n
    runs = cells
    while runs < n:
        runs *= 2
    # The last step needs not wait for the end: the unit knows that it is on its way.
    return PIPELINE + runs + (2 if runs == cells << stages else n)


def unit_cycles(n: int, cells: int = CELLS, stages: int = STAGES) -> int:
    """Cycles of a list of n <= cells << stages entries alone, first line to end: exactly in ascending order; else n / ORDER more at most."""
    return n + latency(n, cells, stages)


def list_cycles(n: int) -> int:
    """Cycles from the end of one list to that of the next, of n entries, where latency is hidden."""
    return n + 1


def back_to_back(lengths: list[int], cells: int = CELLS, stages: int = STAGES) -> int:
    """Cycles from the end of the first list to that of the last, at most, for few lists: a longer latency than the lists' before shows once."""
    delays = [latency(n, cells, stages) for n in lengths]
    return sum(list_cycles(n) for n in lengths[1:]) + sum(lengths) // ORDER + max(delays) - delays[0]


def long_cycles(golden: SortedList, cells: int = CELLS, stages: int = STAGES) -> int:
    """Estimate for a list that does not fit, within some per cent: each reading takes an entry a cycle, each cut stops it until the cut is made."""
    return reading_cycles(len(golden.order), len(golden.readings), sum(len(r.limits) for r in golden.readings), cells << stages)


def reading_cycles(n: int, readings: int, cuts: int, capacity: int) -> int:
    """The same by the numbers of its readings and cuts."""
    return readings * n + cuts * (3 * capacity // 2 + 38) + capacity
