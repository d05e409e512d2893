"""Lists that a sorting unit does not hold, bit for bit: runs, chains, batches (docs/reference/list_sorter.md).

A list of more than `capacity` entries is read once. Each `capacity` entries of it, in the order of reading, are sorted and written back as a run: lines in the
layout of `flicker.golden.lists` (count in the header, no link), with key and record of each entry exchanged, since here the keys rise by little. Runs begin as
many lines from each other as a run of plain lines has. A run that lies wholly behind or before a chain of runs joins it, the first one that it fits, so that a
chain is in order from its first line to its last one. Then the chains are merged through the sorting unit, in batches of as many entries as it holds, or fewer.
Of all chains the line whose last entry is the least is next; when a batch might have no room for another line and one of each chain that is left, the last
entry of its last line is the batch's limit, and the next line of every chain gives what is not above it. What a batch delivers is above the limit of the one
before: its bound.

The simple statement: `order` is np.sort of the upper 48 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import FlickerError
from .lists import ENTRY_BITS, KEY_BITS, LINE_BYTES, LINE_ENTRIES, MASK_BITS, RECORD_BITS, SHORT_ENTRIES, line_starts, pack_line
from .sorting import CAPACITY, ordered

RUNS = 64  # that a list may have
UNITS = 4
SHARES = 2  # batches of few chains are smaller, down to capacity >> SHARES, and leave the unit earlier
FEW = 4  # chains of the smallest batches; twice as many, and they have twice as many entries
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
    """order: uint64 (n,), the entries in order. runs: uint64, sorted; starts: of each where its lines begin, and its length. chains: numbers of their runs,
    nearest first. batches: what the unit gathers."""

    order: np.ndarray
    capacity: int
    runs: list[np.ndarray]
    starts: list[np.ndarray]
    chains: list[list[int]]
    batches: list[Batch]

    @property
    def run_lines(self) -> int:
        """Lines from run to run."""
        return run_lines(self.capacity)

    @property
    def lines(self) -> int:
        """Lines written back."""
        return sum(len(starts) - 1 for starts in self.starts)

    @property
    def places(self) -> list[int]:
        """Where each line lies, in lines from the region's beginning."""
        return [r * self.run_lines + k for r, starts in enumerate(self.starts) for k in range(len(starts) - 1)]

    def memory(self) -> np.ndarray:
        """uint64 (lines, 8): what is written back, without what lies between runs."""
        return np.concatenate([pack_lines(run) for run in self.runs])


def run_lines(capacity: int = CAPACITY) -> int:
    """Lines of a whole run, at most, and from run to run."""
    return -(-capacity // LINE_ENTRIES)


def region_bytes(capacity: int = CAPACITY, most: int = RUNS) -> int:
    """Bytes of the runs of four units, unit by unit, behind the lists."""
    return UNITS * most * run_lines(capacity) * LINE_BYTES


def batch_entries(chains: int, capacity: int = CAPACITY) -> int:
    """Entries of lines in a batch, at most; more only where one line and one of each chain are more."""
    doublings = min((-(-chains // FEW) - 1).bit_length(), SHARES)
    return capacity >> SHARES - doublings


def exchanged(entries: np.ndarray) -> np.ndarray:
    """Entries with key and record in each other's places (of which they have the same number of bits)."""
    mask, record, key = (np.uint64((1 << n) - 1) for n in (MASK_BITS, RECORD_BITS, KEY_BITS))
    tag = entries >> np.uint64(MASK_BITS)
    return ((tag & record) << np.uint64(KEY_BITS) | tag >> np.uint64(RECORD_BITS) & key) << np.uint64(MASK_BITS) | entries & mask


def pack_lines(entries: np.ndarray) -> np.ndarray:
    """uint64 (lines, 8): a sorted run, key and record exchanged; a line's last entry is in its first place."""
    words = exchanged(np.asarray(entries, np.uint64))
    starts = line_starts(words)
    lines = np.zeros((len(starts) - 1, WORDS), np.uint64)
    for k, (a, b) in enumerate(zip(starts[:-1], starts[1:])):
        pack_line(words[a:b], b - a, lines[k])
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


def merge_batches(runs: list[np.ndarray], starts: list[np.ndarray], chains: list[list[int]], capacity: int) -> list[Batch]:
    """Batches in order."""
    room = batch_entries(len(chains), capacity)
    places = [[(r, k) for r in chain for k in range(len(starts[r]) - 1)] for chain in chains]
    largest = [[int(runs[r][starts[r][k + 1] - 1]) >> MASK_BITS for r, k in chain] for chain in places]
    owner = np.repeat(np.arange(len(chains)), [len(chain) for chain in places])
    order = owner[np.argsort(np.concatenate([np.array(keys, np.int64) for keys in largest]))]
    at = [0] * len(chains)
    live = len(chains)
    batches: list[Batch] = []
    n, bound = 0, -1
    while n < len(order):
        fed: list[Fed] = []
        count = 0
        while n < len(order) and (not fed or count + SHORT_ENTRIES * (live + 1) <= room):
            c = int(order[n])
            r, k = places[c][at[c]]
            fed.append(Fed(r, k, True))
            count += int(starts[r][k + 1] - starts[r][k])
            limit = largest[c][at[c]]
            at[c] += 1
            live -= at[c] == len(places[c])
            n += 1
        if n == len(order):
            limit = -1
        else:
            fed += [Fed(*places[c][at[c]], False) for c in range(len(chains)) if at[c] < len(places[c])]
        given = np.concatenate([runs[f.run][starts[f.run][f.line] : starts[f.run][f.line + 1]] for f in fed])
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
    starts = [line_starts(exchanged(run)) for run in runs]
    chains = chain_runs(runs)
    if SHORT_ENTRIES * (len(chains) + 1) > capacity:
        raise FlickerError(f"long lists: {len(chains)} chains for a unit of {capacity}")
    batches = merge_batches(runs, starts, chains, capacity)
    return LongList(np.concatenate([b.chunk for b in batches]), capacity, runs, starts, chains, batches)
