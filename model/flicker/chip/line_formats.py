"""Formats of the lines of tile lists: how many entries of real lists fit a line (docs/decisions/040-short-lines.md).

A line has up to nine entries whatever they are, and up to `entries` where each differs from the one before it, or from the line's first one, by little: its
record by less than 2^record more, its key by less than 2^(key - 1) either way. Otherwise writers are those of `flicker.golden.lists`. Runs, which are sorted,
have key and record exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..golden.front.frame import FrontFrame
from ..golden.lists import COMBINER_SETS, COMBINER_WAYS, ENTRY_BITS, LINE_BYTES, LINE_ENTRIES, MASK_BITS, WRITERS
from ..golden.sorting import CAPACITY
from ..params import TILE

HEADER_BITS = 4 + 24 + 1


@dataclass(frozen=True)
class LineFormat:
    """entries: of a short line; the number of plain ones: none are short. record, key: bits kept of both. first: differences are to the line's first entry."""

    entries: int
    record: int = 0
    key: int = 0
    first: bool = False

    @property
    def kept(self) -> int:
        """Bits of all entries but the one that is whole."""
        return MASK_BITS + self.record + self.key

    @property
    def bits(self) -> int:
        """Of a line, without count and link: at most 483."""
        return max(ENTRY_BITS + (self.entries - 1) * self.kept, LINE_ENTRIES * ENTRY_BITS)

    @property
    def name(self) -> str:
        if self.entries == LINE_ENTRIES:
            return f"{LINE_ENTRIES} of {ENTRY_BITS} bits"
        return f"{self.entries} of {self.kept} bits, record {self.record}, key {self.key}, to the {'first' if self.first else 'one before'}"


PLAIN = LineFormat(LINE_ENTRIES)
CHOSEN = LineFormat(15, 9, 17)
FORMATS = (
    PLAIN, LineFormat(12, 14, 20), LineFormat(13, 14, 17), LineFormat(14, 10, 18), LineFormat(14, 12, 16), LineFormat(15, 8, 18), CHOSEN,
    LineFormat(15, 10, 16), LineFormat(15, 9, 17, True), LineFormat(16, 8, 16), LineFormat(16, 7, 17),
)


@numba.njit(cache=True)
def _lines(u, v, key, record, columns, entries, record_bits, key_bits, first):
    """Lines of a writer."""
    held = np.full(COMBINER_SETS * COMBINER_WAYS, -1, np.int64)
    count, last_key, last_record = np.zeros_like(held), np.zeros_like(held), np.zeros_like(held)
    close = np.ones(len(held), np.bool_)
    turn = np.zeros(COMBINER_SETS, np.int64)
    lines = 0
    for e in range(len(u)):
        which = v[e] * columns + u[e]
        s = ((v[e] & 7) << 3 | (u[e] & 7)) * COMBINER_WAYS
        slot = -1
        for w in range(s + COMBINER_WAYS - 1, s - 1, -1):
            if count[w] == 0:
                slot = w
        for w in range(s, s + COMBINER_WAYS):
            if count[w] > 0 and held[w] == which:
                slot = w
        if slot < 0:
            slot = s + turn[s // COMBINER_WAYS]
            turn[s // COMBINER_WAYS] = (turn[s // COMBINER_WAYS] + 1) % COMBINER_WAYS
            lines += 1
            count[slot] = 0
        if count[slot] > 0:
            half = 1 << key_bits - 1 if key_bits else 0
            fits = close[slot] and 0 <= record[e] - last_record[slot] < 1 << record_bits and -half <= last_key[slot] - key[e] < half
            if count[slot] < LINE_ENTRIES or fits:
                close[slot] = fits
                count[slot] += 1
                if not first:
                    last_key[slot], last_record[slot] = key[e], record[e]
                if count[slot] == entries or (count[slot] >= LINE_ENTRIES and not fits):
                    lines += 1
                    count[slot] = 0
                continue
            lines += 1
            if turn[s // COMBINER_WAYS] == slot - s:
                turn[s // COMBINER_WAYS] = (turn[s // COMBINER_WAYS] + 1) % COMBINER_WAYS
        held[slot] = which
        count[slot] = 1
        close[slot] = True
        last_key[slot], last_record[slot] = key[e], record[e]
    return lines + np.count_nonzero(count)


@numba.njit(cache=True)
def _run_lines(key, record, entries, record_bits, key_bits):
    """Lines of a sorted run, differences to the one before."""
    lines = count = 0
    close = True
    half = 1 << key_bits - 1 if key_bits else 0
    for e in range(len(key)):
        if count > 0:
            close = close and 0 <= key[e] - key[e - 1] < 1 << record_bits and -half <= record[e - 1] - record[e] < half
        if count == 0 or count == entries or (count >= LINE_ENTRIES and not close):
            lines += 1
            count = 0
            close = True
        count += 1
    return lines


@dataclass(frozen=True)
class Fill:
    """entries: of all lists; lines: that they take. long_entries, run_lines: of lists that a sorting unit does not hold, and of their runs in this format."""

    entries: int
    lines: int
    long_entries: int
    run_lines: int

    @property
    def written(self) -> int:
        """Bytes of one writing of the lists."""
        return self.lines * LINE_BYTES


def fill(frame: FrontFrame, format_: LineFormat) -> Fill:
    """Lists of a frame, and the runs of long ones, in a format."""
    columns = -(-frame.camera.width // TILE)
    tile = frame.entry_tile.astype(np.int64)
    key, record = frame.key.astype(np.int64)[frame.entry_splat], frame.number.astype(np.int64)[frame.entry_splat]
    x, y = tile % columns, tile // columns
    lines = long_entries = run_lines = 0
    for b in range(WRITERS):
        here = np.flatnonzero(x & 1 | (y & 1) << 1 == b)
        values = x[here] >> 1, y[here] >> 1, key[here], record[here]
        lines += _lines(*values, -(-columns // 2), format_.entries, format_.record, format_.key, format_.first)
    order = np.argsort(tile, kind="stable")
    ends = np.cumsum(np.bincount(tile))
    for a, b in zip(np.r_[0, ends[:-1]], ends):
        if b - a <= CAPACITY:
            continue
        long_entries += int(b - a)
        newest_first = order[a:b][::-1]
        for at in range(0, len(newest_first), CAPACITY):
            part = newest_first[at : at + CAPACITY]
            part = part[np.lexsort((record[part], key[part]))]
            run_lines += _run_lines(key[part], record[part], format_.entries, format_.record, format_.key)
    return Fill(len(tile), lines, long_entries, run_lines)
