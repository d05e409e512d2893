"""Lists that a sorting unit does not hold, bit for bit: runs, chains, batches (docs/reference/list_sorter.md).

A list of more than `capacity` entries is read once. Each `capacity` entries of it, in the order of reading, are sorted and written back as a run: lines of
nine entries in the layout of `flicker.golden.lists` (count in the header, no link), the runs one after the other, each but the last of the same number of
lines. A run that lies wholly behind or before a chain of runs joins it, the first one that it fits, so that a chain is in order from its first line to its
last one. Then the chains are merged through the sorting unit, in batches of as many lines as it holds, or fewer. Of all chains the line whose last entry is
the least is next; when a batch has all the lines it may have but one for each chain that is left, the last entry of its last line is the batch's limit, and
the next line of every chain gives what is not above it. What a batch delivers is above the limit of the one before: its bound.

The simple statement: `order` is np.sort of the upper 48 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import FlickerError
from .lists import ENTRY_BITS, HEADER_AT, LINE_BYTES, LINE_ENTRIES, MASK_BITS
from .sorting import CAPACITY, ordered

RUNS = 64  # that a list may have
UNITS = 4
SHARES = 3  # batches of few chains are smaller, down to capacity >> SHARES, and leave the unit earlier
FEW = 4  # chains of the smallest batches; twice as many, and they have twice as many lines
WORDS = LINE_BYTES // 8


class Fed(NamedTuple):
    """A line that is given to the unit. run, line: its place. whole: it is used up; else entries above the batch's limit stay."""

    run: int
    line: int
    whole: bool


@dataclass(eq=False)
class Batch:
    """bound: upper 48 bits that entries have to be above, or -1. limit: that they must not be above, or -1: the last batch. fed: lines in order. chunk:
    uint64, what it delivers."""

    bound: int
    limit: int
    fed: list[Fed]
    chunk: np.ndarray


@dataclass(eq=False)
class LongList:
    """order: uint64 (n,), the entries in order. runs: uint64, sorted. chains: numbers of their runs, nearest first. batches: what the unit gathers."""

    order: np.ndarray
    capacity: int
    runs: list[np.ndarray]
    chains: list[list[int]]
    batches: list[Batch]

    @property
    def run_lines(self) -> int:
        """Lines from run to run."""
        return run_lines(self.capacity)

    @property
    def lines(self) -> int:
        """Lines written back."""
        return (len(self.runs) - 1) * self.run_lines + -(-len(self.runs[-1]) // LINE_ENTRIES)

    def memory(self) -> np.ndarray:
        """uint64 (lines, 8): what is written back."""
        return np.concatenate([pack_lines(run) for run in self.runs])


def run_lines(capacity: int = CAPACITY) -> int:
    """Lines of a whole run."""
    return -(-capacity // LINE_ENTRIES)


def region_bytes(capacity: int = CAPACITY, most: int = RUNS) -> int:
    """Bytes of the runs of four units, unit by unit, behind the lists."""
    return UNITS * most * run_lines(capacity) * LINE_BYTES


def batch_lines(chains: int, capacity: int = CAPACITY) -> int:
    """Lines of a batch, at most."""
    doublings = min((-(-chains // FEW) - 1).bit_length(), SHARES)
    return (capacity >> SHARES - doublings) // LINE_ENTRIES


def pack_lines(entries: np.ndarray) -> np.ndarray:
    """uint64 (lines, 8): entries by nine, the last line perhaps with fewer and its last one in the places that are left, so that a line's key is in one
    place."""
    count = -(-len(entries) // LINE_ENTRIES)
    padded = np.zeros(count * LINE_ENTRIES, np.uint64)
    padded[: len(entries)] = entries
    padded[len(entries) :] = entries[-1:]
    lines = np.zeros((count, WORDS), np.uint64)
    for i in range(LINE_ENTRIES):
        at, entry = i * ENTRY_BITS, padded[i::LINE_ENTRIES]
        lines[:, at >> 6] |= entry << np.uint64(at & 63)
        if at & 63 > 64 - ENTRY_BITS:
            lines[:, (at >> 6) + 1] |= entry >> np.uint64(64 - (at & 63))
    used = np.minimum(len(entries) - np.arange(count) * LINE_ENTRIES, LINE_ENTRIES).astype(np.uint64)
    lines[:, -1] |= used << np.uint64(HEADER_AT & 63)
    return lines


def chain_runs(runs: list[np.ndarray]) -> list[list[int]]:
    """Chains in the order in which they were begun: each run goes behind the last or before the first run of the first chain that allows it."""
    chains: list[list[int]] = []
    first, last = ([int(run[at]) >> MASK_BITS for run in runs] for at in (0, -1))
    for r in range(len(runs)):
        for chain in chains:
            if last[chain[-1]] < first[r]:
                chain.append(r)
                break
            if last[r] < first[chain[0]]:
                chain.insert(0, r)
                break
        else:
            chains.append([r])
    return chains


def merge_batches(runs: list[np.ndarray], chains: list[list[int]], capacity: int) -> list[Batch]:
    """Batches in order."""
    room = batch_lines(len(chains), capacity)
    places = [[(r, k) for r in chain for k in range(-(-len(runs[r]) // LINE_ENTRIES))] for chain in chains]
    largest = [[int(runs[r][min(LINE_ENTRIES * (k + 1), len(runs[r])) - 1]) >> MASK_BITS for r, k in chain] for chain in places]
    owner = np.repeat(np.arange(len(chains)), [len(chain) for chain in places])
    order = owner[np.argsort(np.concatenate([np.array(keys, np.int64) for keys in largest]))]
    at = [0] * len(chains)
    live = len(chains)
    batches: list[Batch] = []
    n, bound = 0, -1
    while n < len(order):
        fed: list[Fed] = []
        while n < len(order) and (not fed or len(fed) + live < room):
            c = int(order[n])
            fed.append(Fed(*places[c][at[c]], True))
            limit = largest[c][at[c]]
            at[c] += 1
            live -= at[c] == len(places[c])
            n += 1
        if n == len(order):
            limit = -1
        else:
            fed += [Fed(*places[c][at[c]], False) for c in range(len(chains)) if at[c] < len(places[c])]
        given = np.concatenate([runs[f.run][LINE_ENTRIES * f.line : LINE_ENTRIES * (f.line + 1)] for f in fed])
        key = (given >> np.uint64(MASK_BITS)).astype(np.int64)
        batches.append(Batch(bound, limit, fed, ordered(given[(key > bound) & ((key <= limit) | (limit < 0))])))
        bound = limit
    return batches


def sort_long(entries: np.ndarray, capacity: int = CAPACITY, most: int = RUNS) -> LongList:
    """Sort a list (uint64, 52 bits each) of more than `capacity` entries. most: runs that it may have. Raises FlickerError for
    more, or for chains that a batch has no lines for."""
    entries = np.asarray(entries, np.uint64)
    if len(entries) <= capacity:
        raise FlickerError(f"long lists: {len(entries)} entries, which a unit of {capacity} holds")
    if len(entries) > capacity * most:
        raise FlickerError(f"long lists: {len(entries)} entries, more than {most} runs of {capacity}")
    if int(entries.max()) >> ENTRY_BITS:
        raise FlickerError("long lists: an entry of more than 52 bits")
    runs = [ordered(entries[i : i + capacity]) for i in range(0, len(entries), capacity)]
    chains = chain_runs(runs)
    if len(chains) + 1 > batch_lines(len(chains), capacity):
        raise FlickerError(f"long lists: {len(chains)} chains for a unit of {capacity}")
    batches = merge_batches(runs, chains, capacity)
    return LongList(np.concatenate([b.chunk for b in batches]), capacity, runs, chains, batches)
