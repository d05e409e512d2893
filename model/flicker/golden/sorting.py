"""Sorting unit: a list that it holds in order, with the runs that it makes on the way (rtl/sort/flk_sorting_unit.sv, docs/reference/sorting_unit.md).

Entries are those of flicker.golden.lists: 52 bits, compared by the upper 48 (key, record), which are distinct within a list. Longer lists:
flicker.golden.long_lists. The simple statement: `order` is np.sort of the upper 48 bits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import FlickerError
from ..params import SORT_CELLS, ChipMemories
from .lists import ENTRY_BITS, MASK_BITS

CELLS = SORT_CELLS
STAGES = ChipMemories().sort_stages  # of merging: runs of 16 become runs of 2048
CAPACITY = CELLS << STAGES


@dataclass(eq=False)
class SortedList:
    """entries, order: uint64 (n,), as they come and in order."""

    entries: np.ndarray
    order: np.ndarray

    def runs(self, length: int) -> list[np.ndarray]:
        """Sorted runs of `length` entries (the last may be shorter) as the merging stages make them."""
        return [ordered(self.entries[i : i + length]) for i in range(0, len(self.entries), length)]


def ordered(entries: np.ndarray) -> np.ndarray:
    """Entries by their upper 48 bits."""
    return entries[np.argsort(entries >> np.uint64(MASK_BITS), kind="stable")]


def sort_list(entries: np.ndarray, capacity: int = CAPACITY) -> SortedList:
    """Sort a list (uint64, 52 bits each) of up to `capacity` entries, the unit's `Cells` << `Stages`."""
    entries = np.asarray(entries, np.uint64)
    if len(entries) > capacity:
        raise FlickerError(f"sorting unit: {len(entries)} entries, more than {capacity}")
    if len(entries) and int(entries.max()) >> ENTRY_BITS:
        raise FlickerError("sorting unit: an entry of more than 52 bits")
    return SortedList(entries, ordered(entries))
