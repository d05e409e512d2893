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
TILES = 64  # numbers of tiles that the record cache tells apart


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


def wanted_until(mask: int, borders: Sequence[int]) -> int:
    """Tiles for which the cache keeps the line of an entry after its own tile: 2 or 1 where its mask touches a tile that comes so soon
    (`walk.borders`), so that the splat is probably in that one's list too; -1: not even for the own tile."""
    return 2 if mask & borders[1] else 1 if mask & borders[0] else -1


class RecordCache:
    """Lines held. banks, sets (of a bank), ways: powers of two.

    Each line held is wanted until a tile of the walk, as its last lookup says (`wanted_until`). A line that is not there takes the first way, from the one
    behind the way taken last in its set, that is empty or whose line is wanted no more; the first of all where there is none. Tiles are compared modulo
    TILES, by the difference to the present one: 0 to 2 is wanted.
    """

    def __init__(self, banks: int = 4, sets: int = 64, ways: int = 4, record_bytes: int = 16) -> None:
        self.banks, self.sets, self.ways, self.per_line = banks, sets, ways, LINE_BYTES // record_bytes
        self._held: list[list[int | None]] = [[None] * ways for _ in range(banks * sets)]
        self._until = [[0] * ways for _ in range(banks * sets)]
        self._turn = [0] * (banks * sets)

    def bank(self, record: int) -> int:
        return record // self.per_line % self.banks

    def lookup(self, record: int, tile: int = 0, until: int = -1) -> tuple[int, bool]:
        """The line of a record, and whether it has to be read. tile: number in the walk; until: tiles after it for which the line is wanted."""
        line = record // self.per_line
        at = line % (self.banks * self.sets)
        held, marks = self._held[at], self._until[at]
        missed = line not in held
        if missed:
            order = [(self._turn[at] + w) % self.ways for w in range(self.ways)]
            free = [w for w in order if held[w] is None or (marks[w] - tile) % TILES > 2]
            way = (free or order)[0]
            held[way] = line
            self._turn[at] = (way + 1) % self.ways
        marks[held.index(line)] = (tile + until) % TILES
        return line, missed
