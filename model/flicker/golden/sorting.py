"""Sorting unit: a tile's list in order, with what the unit holds on the way (rtl/sort/flk_sorting_unit.sv, docs/sorting_unit.md).

Entries are those of flicker.golden.lists: 52 bits, compared by the upper 48 (key, record), which are distinct within a list. The unit gathers up to `capacity`
entries of a reading. An entry more, and it keeps the nearest half; the largest of these is the limit, above which it drops what it reads from then on. What it
has at the end of the reading leaves in order, and where there was a limit the list is read again for what lies above it. The simple statement: `order` is
np.sort of the upper 48 bits.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import FlickerError
from ..params import SORT_CELLS, ChipMemories
from .lists import ENTRY_BITS, MASK_BITS

CELLS = SORT_CELLS
STAGES = ChipMemories().sort_stages  # of merging: runs of 16 become runs of 2048
CAPACITY = CELLS << STAGES


@dataclass(eq=False)
class Reading:
    """One reading of a list.

    bound: upper 48 bits that entries have to be above, or -1. limits: of its cuts, in order: upper 48 bits of the largest entry that was kept. cut_at: entries
    of the list that had been read at each cut. gathered: uint64, what the unit has at the end, in the order in which its merging began with it: after a cut the
    kept ones, in order, then what followed. passed: entries that were neither at or below the bound nor above the limit.
    """

    bound: int
    limits: list[int]
    cut_at: list[int]
    gathered: np.ndarray
    passed: int

    @property
    def chunk(self) -> np.ndarray:
        """uint64, what it delivers."""
        return _ordered(self.gathered)

    @property
    def again(self) -> bool:
        return bool(self.limits)

    def runs(self, length: int) -> list[np.ndarray]:
        """Sorted runs of `length` entries (the last may be shorter) as the merging stages make them of what was gathered."""
        return [_ordered(self.gathered[i : i + length]) for i in range(0, len(self.gathered), length)]


@dataclass(eq=False)
class SortedList:
    """order: uint64 (n,), the entries in order. readings: how they came; an empty list is read once."""

    order: np.ndarray
    readings: list[Reading] = field(default_factory=list)

    @property
    def chunks(self) -> list[int]:
        """Entries that each reading delivers."""
        return [len(r.gathered) for r in self.readings]


def _ordered(entries: np.ndarray) -> np.ndarray:
    return entries[np.argsort(entries >> np.uint64(MASK_BITS), kind="stable")]


def _read(entries: np.ndarray, bound: int, capacity: int) -> Reading:
    key = entries >> np.uint64(MASK_BITS)
    kept = entries[:0]  # what a cut left
    limits: list[int] = []
    cut_at: list[int] = []
    at, passed = 0, 0
    while True:
        low = key[at:] > np.uint64(bound) if bound >= 0 else np.ones(len(entries) - at, bool)
        if limits:
            low &= key[at:] <= np.uint64(limits[-1])
        places = at + np.flatnonzero(low)
        room = capacity - len(kept)
        if len(places) <= room:
            return Reading(bound, limits, cut_at, np.concatenate([kept, entries[places]]), passed + len(places))
        # The entry after these does not fit.
        passed += room
        at = int(places[room])
        kept = _ordered(np.concatenate([kept, entries[places[:room]]]))[: capacity // 2]
        limits.append(int(kept[-1]) >> MASK_BITS)
        cut_at.append(at)


def sort_list(entries: np.ndarray, capacity: int = CAPACITY) -> SortedList:
    """Sort a list (uint64, 52 bits each) as the unit does. capacity: an even number, the unit's `Cells` << `Stages`."""
    entries = np.asarray(entries, np.uint64)
    if capacity < 2 or capacity % 2:
        raise FlickerError(f"sorting unit: capacity {capacity}, not an even number")
    if len(entries) and int(entries.max()) >> ENTRY_BITS:
        raise FlickerError("sorting unit: an entry of more than 52 bits")
    readings = [_read(entries, -1, capacity)]
    while readings[-1].again:
        readings.append(_read(entries, readings[-1].limits[-1], capacity))
    return SortedList(np.concatenate([r.chunk for r in readings]), readings)
