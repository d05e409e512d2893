"""Delivery of records, bit for bit: what each core gets of the tiles' sorted entries, and which lines of memory the record cache reads
(docs/reference/delivery.md).

An entry of a sorted list is a record number and a mask of four bits, one for each sub-tile of the tile. Sub-tile s is of core s mod cores. A core gets the
records of the entries with a bit of its sub-tiles, once for each of them, the lowest first, in the order of the list, tile by tile, and behind them the end
of the list. Of a finished sub-tile, whose pixels take no more, records may be missing at the end of its list: which, depends on timing, `may_be_given` is
what holds for all of them. The cache holds lines of 32 bytes; its contents depend on the order of the
lookups alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

SUBTILES, UNITS = 4, 4
LINE_BYTES = 32
END = None  # of a list


def core_records(tiles: Iterable[Sequence[tuple[int, int]]], core: int, cores: int = SUBTILES) -> list[tuple[int, int] | None]:
    """Record numbers that a core gets, with the sub-tile that each is for, `END` behind each tile's. tiles: sorted entries (record, mask) of each tile of the
    walk."""
    out: list[tuple[int, int] | None] = []
    for entries in tiles:
        out += [(record, s) for record, mask in entries for s in range(core, SUBTILES, cores) if mask >> s & 1]
        out.append(END)
    return out


def may_be_given(records: np.ndarray, lengths: np.ndarray, needed: np.ndarray, whole: bool) -> np.ndarray:
    """bool (S,): whether sub-tiles whose cores got the first `records` of their lists have their pixels right.

    lengths: of the lists. needed: of `golden.render.Frame`. whole: every list must come to its end, since all its records count in the decisions of the
    automatic mode.
    """
    return (records <= lengths) & (records >= (lengths if whole else needed))


class RecordCache:
    """Lines held. banks, sets (of a bank), ways: powers of two. A line that is not there takes the way whose turn it is in its set: the oldest one goes."""

    def __init__(self, banks: int = 4, sets: int = 64, ways: int = 4, record_bytes: int = 16) -> None:
        self.banks, self.sets, self.ways, self.per_line = banks, sets, ways, LINE_BYTES // record_bytes
        self._held: list[list[int | None]] = [[None] * ways for _ in range(banks * sets)]
        self._turn = [0] * (banks * sets)

    def bank(self, record: int) -> int:
        return record // self.per_line % self.banks

    def lookup(self, record: int) -> tuple[int, bool]:
        """The line of a record, and whether it has to be read."""
        line = record // self.per_line
        at = line % (self.banks * self.sets)
        if line in self._held[at]:
            return line, False
        self._held[at][self._turn[at]] = line
        self._turn[at] = (self._turn[at] + 1) % self.ways
        return line, True
