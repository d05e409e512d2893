"""Lines of tile lists as sorting units take them: without their headers, plain ones and short ones (docs/reference/list_layout.md)."""

from __future__ import annotations

import random

import numpy as np

from flicker.golden.lists import ENTRY_BITS, HEADER_AT, LINE_ENTRIES, SHORT_ENTRIES, line_of, near


def lines_of(entries: np.ndarray, rng: random.Random, full: bool, cut: int = 0) -> list[tuple[int, int, int]]:
    """Lines (entries, count, last) of entries in the order of reading. As many in each as fit, or fewer (not `full`); cut: one ends with so many entries. What
    lies above the count of a plain line is random."""
    lines, at, values = [], 0, [int(e) for e in entries]
    close = [bool(near(np.uint64(b), np.uint64(a))) for a, b in zip(values, values[1:])]
    while True:
        run = 1
        while run < SHORT_ENTRIES and at + run < len(values) and close[at + run - 1]:
            run += 1
        most = max(run, LINE_ENTRIES)
        count = min(most if full or rng.random() < 0.7 else rng.randrange(1, most + 1), len(values) - at)
        if at < cut:
            count = min(count, cut - at)
        word = line_of(values[at : at + count][::-1]) & (1 << HEADER_AT) - 1 if count else 0
        if count <= LINE_ENTRIES:
            word |= rng.getrandbits(HEADER_AT) >> count * ENTRY_BITS << count * ENTRY_BITS
        at += count
        lines.append((word, count, int(at == len(values))))
        if at == len(values):
            return lines
