"""Cycles of a list that a sorting unit does not hold: runs written back, chains merged in batches (flicker.golden.long_lists, docs/reference/list_sorter.md).

First reading: an entry a cycle, runs leave behind it. Then lines come in the order of the merge, an entry a cycle; of every chain as many are read ahead as its
part of the line memory holds. The chain whose line was used up must have its next one before another line is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..golden.long_lists import LongList
from .sorting import latency

LINES = 128  # of the line memory of the merge
MEMORY = 120  # cycles from a request to its line
RATE = 1.25  # cycles of a line at the memory's peak, 64 bytes of 51.2
CHOOSE = 10  # from a line to its chain's place in the tree
BEGIN = 40  # from the last entry written back to the first request, beside the memory's answer


@dataclass(frozen=True)
class LongCycles:
    """runs: until the last one is written back. given (batches,): when the last line of each batch has been given. total: until the last entry has left.
    slots: lines of each chain in the line memory."""

    runs: int
    given: np.ndarray
    total: int
    slots: int


def chain_slots(chains: int, lines: int = LINES) -> int:
    """Lines of each chain in the line memory."""
    return lines >> (chains - 1).bit_length()


@numba.njit(cache=True)
def _give(chain, entries, whole, chains, slots, memory, rate, choose):
    """Cycle in which each line has been given. chain, entries, whole (lines,): in the order of giving."""
    n = len(chain)
    lines = np.zeros(chains, np.int64)
    for i in range(n):
        lines[chain[i]] += whole[i]
    most = lines.max()
    came = np.zeros((chains, most))
    asked, used = np.zeros(chains, np.int64), np.zeros(chains, np.int64)
    done = np.zeros(n)
    port = now = 0.0
    for _ in range(slots):
        for c in range(chains):
            if asked[c] < lines[c]:
                port += rate
                came[c, asked[c]] = port + memory
                asked[c] += 1
    for c in range(chains):
        now = max(now, came[c, 0]) + choose
    for i in range(n):
        c = chain[i]
        now += entries[i]
        if whole[i]:
            used[c] += 1
            if asked[c] < lines[c]:
                port = max(port + rate, now - entries[i])
                came[c, asked[c]] = port + memory
                asked[c] += 1
            # The next line's key is looked at while this one is given.
            if used[c] < lines[c]:
                now = max(now, came[c, used[c]] + choose)
        done[i] = now
    return done


def merge_cycles(golden: LongList, lines: int = LINES, memory: int = MEMORY) -> LongCycles:
    """Estimate for one list alone. lines: of the line memory."""
    n, capacity = len(golden.order), golden.capacity
    runs = n + len(golden.runs) + max(latency(capacity), latency(len(golden.runs[-1]))) + BEGIN + memory
    owner = {r: c for c, chain in enumerate(golden.chains) for r in chain}
    fed = [f for b in golden.batches for f in b.fed]
    chain = np.array([owner[f.run] for f in fed])
    entries = np.array([golden.starts[f.run][f.line + 1] - golden.starts[f.run][f.line] for f in fed], np.float64)
    slots = chain_slots(len(golden.chains), lines)
    done = _give(chain, entries, np.array([f.whole for f in fed]), len(golden.chains), slots, float(memory), RATE, float(CHOOSE))
    given = runs + done[np.cumsum([len(b.fed) for b in golden.batches]) - 1].astype(np.int64)
    last = len(golden.batches[-1].chunk)
    # A batch leaves behind the one before it.
    out = 0
    for at, batch in zip(given, golden.batches):
        size = len(batch.chunk)
        out = max(out + size + 1, int(at) + latency(size) if size else int(at))
    return LongCycles(int(runs), given, max(out, int(given[-1]) + latency(last)), slots)
