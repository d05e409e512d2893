"""Cycles of a sorting unit without stalls (rtl/sort/flk_sorting_unit.sv; held against it by tb/sort/test_sorting_unit.py).

The steps merge while their runs arrive, so lists follow each other at an entry a cycle and one cycle a list; what a list alone takes longer is latency.
Step k waits for its first run, Cells << k entries; the step behind the last one that has two runs of the list waits for its end. A step whose first memory
is full when the next run comes holds it up for up to three cycles, by the order of the entries: never in ascending lists, seldom in others.

`ways`: runs of a list that the last step merges (`flk_sort_select`); the steps that it takes the place of are left out. Its memory, in blocks, holds as much as
with two: a list comes in as the one before it leaves.
"""

from __future__ import annotations

from ..golden.sorting import CELLS, STAGES

PIPELINE = 25  # registers and memories from the line to the output, one after the other, with two ways
STEP = 3  # of these a step's
LEVEL = 1  # and a level's of the last step's tree
AHEAD = 3  # cycles by which reading ahead of the tree moves a list, at most
NEXT = 4  # from a list's last entry to the next one's first
ORDER = 32  # of a list's entries, at most one cycle for so many is lost by their order


def _saved(ways: int) -> int:
    """Steps that the last one takes the place of, beside itself."""
    return ways.bit_length() - 2


def latency(n: int, cells: int = CELLS, stages: int = STAGES, ways: int = 8) -> int:
    """Cycles of a list of n <= cells << stages entries alone beside an entry a cycle, from its first line to its end."""
    pipeline = PIPELINE - (STEP - LEVEL) * _saved(ways)
    if n == 0:
        return 12 - _saved(ways)
    if n < cells:
        return pipeline + 3 + n
    capacity = cells << stages
    last = capacity // ways  # runs of the last step
    if n > last:
        # It needs not wait for the end where all its runs have begun: the unit knows that it is on its way.
        return pipeline + (capacity + 2 if n > capacity - last else last + n)
    runs = cells
    while runs < n:
        runs *= 2
    return pipeline + runs + n


def unit_cycles(n: int, cells: int = CELLS, stages: int = STAGES, ways: int = 8) -> int:
    """Cycles of a list of n <= cells << stages entries alone, first line to end: in ascending order, or up to AHEAD less; else n / ORDER more at most."""
    return n + latency(n, cells, stages, ways)


def list_cycles(n: int) -> int:
    """Cycles from the end of one list to that of the next, of n entries, where latency is hidden."""
    return n + NEXT


def back_to_back(lengths: list[int], cells: int = CELLS, stages: int = STAGES, ways: int = 8) -> int:
    """Cycles from the end of the first list to that of the last, at most, for few lists: a longer latency than the lists' before shows once."""
    delays = [latency(n, cells, stages, ways) for n in lengths]
    return sum(list_cycles(n) for n in lengths[1:]) + sum(lengths) // ORDER + max(delays) - delays[0]


def held_entries(capacity: int, ways: int = 8) -> int:
    """Entries in all steps, those of the last one and of the smaller ones before it."""
    return capacity + 2 * capacity // ways
