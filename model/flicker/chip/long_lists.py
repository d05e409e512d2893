"""Lists longer than a sorting unit holds: ways to sort them, by cycles, bytes and what they need on the chip (docs/decisions/050-long-lists.md).

Every way is executed on the list as far as its bytes and cycles depend on it, one list alone, memory at 51.2 GB/s that answers after `MEMORY` cycles. Bytes are
of the list alone and in multiples of its one writing by the front end, which counts: a list that is written and read once has 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..golden.lists import CHUNK_LINES, ENTRY_BITS, KEY_BITS, LINE_ENTRIES, MASK_BITS, RECORD_BITS
from ..golden.long_lists import RUNS, sort_long
from ..golden.sorting import CAPACITY
from ..perf.long_lists import BEGIN, LINES, MEMORY, merge_cycles
from ..perf.sorting import latency, unit_cycles

CLUMP = 300  # entries of a clump that follow each other
LINE_BITS = LINE_ENTRIES * ENTRY_BITS + 4
# Gates of what is in registers and comparators, from the units that were synthesised (docs/reference/synthesis.md).
FLOP, COMPARE, CONTROL = 5.2, 260.0, 1500.0
BINS = 1024  # of a histogram, ten bits of the key
PARTS = 64  # of a partition, with an open line each

# Orders of lists: keys against the order of reading. Clumps: entries that follow each other lie near each other in depth too, as those of a cluster do.
ORDERS = ("random", "sorted", "backwards", "equal", "equal, in order", "walls", "clumps", "clumps of runs")


def code(depth: np.ndarray) -> np.ndarray:
    """int64: 24-bit depth keys, the code of a float of 5 bits of exponent from 1/8 on and 19 of mantissa."""
    depth = np.maximum(depth, 0.125)
    exponent = np.floor(np.log2(depth)).astype(np.int64)
    mantissa = np.floor((depth / 2.0**exponent - 1) * (1 << 19)).astype(np.int64)
    return np.minimum((exponent + 3 << 19) + mantissa, (1 << KEY_BITS) - 1)


def reading_order(n: int) -> np.ndarray:
    """Places in the order of the scene, in the order of reading: the newest chunk first."""
    chunk = CHUNK_LINES * LINE_ENTRIES
    at = np.arange(n)
    return np.lexsort((at, -(at // chunk)))


def make_list(rng: np.random.Generator, n: int, order: str) -> np.ndarray:
    """uint64 (n,): a list in the order of reading. walls: six tenths within two per cent of a depth, the others spread over four
    octaves. All but those in order are read as writers leave them, chunks of the scene's order from the newest back."""
    record = np.sort(rng.choice(1 << min(RECORD_BITS, max(n.bit_length() + 2, 12)), n, replace=False))
    spread = 2.0 * 2.0 ** (4 * rng.random(n))
    if order in ("equal", "equal, in order"):
        key = np.full(n, code(np.array([5.0]))[0])
    elif order == "walls":
        key = code(np.where(rng.random(n) < 0.6, 5 * (1 + 0.01 * rng.standard_normal(n)), spread))
    elif order.startswith("clumps"):
        size = CLUMP if order == "clumps" else 3 * CAPACITY // 2
        key = code(np.repeat(spread[: n // size + 1], size)[:n] * (1 + 0.02 * rng.standard_normal(n)))
    else:
        key = code(spread)
    tag = key << RECORD_BITS | record
    tag = np.sort(tag) if order in ("sorted", "equal, in order") else np.sort(tag)[::-1] if order == "backwards" else tag[reading_order(n)]
    return tag.astype(np.uint64) << np.uint64(MASK_BITS) | rng.integers(1, 16, n).astype(np.uint64)


def lines_of(n: int | np.ndarray) -> np.ndarray:
    return -(-np.asarray(n) // LINE_ENTRIES)


@dataclass(frozen=True)
class Cost:
    """cycles: from the first line to the last entry that is wanted. moved: lines, with the one writing."""

    cycles: int
    moved: int


@dataclass(frozen=True)
class Way:
    """cost: of a list (entries in the order of reading, entries wanted of it). bits: SRAM of a unit more than today's. gates: GE of a unit more than today's,
    estimated. chip_bits: SRAM in the front end more than today's."""

    name: str
    cost: Callable[[np.ndarray, int], Cost]
    bits: int = 0
    gates: float = 0.0
    chip_bits: int = 0


# ---- ways ---------------------------------------------------------------------------------------


def _fits(n: int) -> Cost:
    return Cost(unit_cycles(n), 2 * int(lines_of(n)))


def _readings(key: np.ndarray, capacity: int) -> list[tuple[int, int]]:
    """Entries that each reading of a list delivers, and its cuts: when an entry more passes than fits, the nearer half stays and is the limit."""
    found, bound = [], -1
    while True:
        at, cuts, kept, limit = 0, 0, np.zeros(0, np.int64), np.int64(1) << 60
        while True:
            places = at + np.flatnonzero((key[at:] > bound) & (key[at:] <= limit))
            room = capacity - len(kept)
            if len(places) <= room:
                found.append((len(kept) + len(places), cuts))
                break
            at = int(places[room])
            kept = np.sort(np.concatenate([kept, key[places[:room]]]))[: capacity // 2]
            limit, cuts = kept[-1], cuts + 1
        if not cuts:
            return found
        bound = int(limit)


def read_again(entries: np.ndarray, wanted: int, capacity: int = CAPACITY) -> Cost:
    """As it was: the whole list for each part that the unit holds."""
    n = len(entries)
    if n <= CAPACITY:
        return _fits(n)
    if n <= capacity:
        return Cost(unit_cycles(n, stages=(capacity // 16).bit_length() - 1), 2 * int(lines_of(n)))
    readings, given = 0, 0
    found = _readings((entries >> np.uint64(MASK_BITS)).astype(np.int64), capacity)
    while given < wanted:
        given += found[readings][0]
        readings += 1
    # A cut stops the reading until what is in the unit has been counted and moved.
    cycles = readings * n + sum(cuts for _, cuts in found[:readings]) * (3 * capacity // 2 + 38) + min(capacity, capacity // 2 + n // readings)
    # A reading that has begun runs out, but nobody waits for what it has found.
    return Cost(cycles, int(lines_of(n)) * (1 + min(readings + 1, len(found))))


def merge_lines(entries: np.ndarray, wanted: int, lines: int = LINES) -> Cost:
    """Runs written back; their lines in order of their last entries through the unit again."""
    n = len(entries)
    if n <= CAPACITY:
        return _fits(n)
    golden = sort_long(entries)
    cost = merge_cycles(golden, lines)
    given, batches = 0, 0
    while given < wanted:
        given += len(golden.batches[batches].chunk)
        batches += 1
    fed = sum(f.whole for b in golden.batches[:batches] for f in b.fed)
    ahead = min(lines, int(golden.lines) - fed)
    end = cost.total if batches == len(golden.batches) else int(cost.given[batches - 1]) + latency(len(golden.batches[batches - 1].chunk))
    return Cost(end, 2 * int(lines_of(n)) + golden.lines + fed + ahead)


def merge_entries(entries: np.ndarray, wanted: int) -> Cost:
    """Runs written back; a tree of 64 leaves takes an entry a cycle of them. As if a run's next line were always there."""
    n = len(entries)
    if n <= CAPACITY:
        return _fits(n)
    runs = -(-n // CAPACITY)
    last = n - (runs - 1) * CAPACITY
    back = (runs - 1) * int(lines_of(CAPACITY)) + int(lines_of(last))
    ahead = min(back, int(lines_of(wanted)) + 2 * runs)
    return Cost(n + runs + latency(CAPACITY) + BEGIN + 2 * MEMORY + wanted, 2 * int(lines_of(n)) + back + ahead)


def _partition(tag: np.ndarray, wanted: int, low: int) -> tuple[int, int, int]:
    """Cycles, lines moved, entries given of a list of random access, `low` bits of the tag not yet used; parts near first."""
    n = len(tag)
    if n <= CAPACITY:
        return n + 1, int(lines_of(n)), n
    shift = max(low - BINS.bit_length() + 1, 0)
    number = (tag >> np.uint64(shift)).astype(np.int64) & BINS - 1
    count = np.bincount(number, minlength=BINS)
    # Bins side by side in a part, as many as fit; one that does not is a part alone.
    part, size, which = 0, 0, np.zeros(BINS, np.int64)
    for b in np.flatnonzero(count):
        if size and size + count[b] > CAPACITY:
            part, size = part + 1, 0
        which[b] = part
        size += int(count[b])
    rounds = -(-(part + 1) // PARTS)  # with more parts than open lines the far ones wait together for a partition of their own
    place = which[number]
    sizes = np.bincount(place)
    cycles = 2 * n * rounds + 2 * (MEMORY + BEGIN) * rounds
    moved = int(lines_of(n)) * (1 + rounds) + int(lines_of(sizes).sum())
    given = 0
    for p in range(part + 1):
        if given >= wanted:
            break
        c, m, g = _partition(tag[place == p], wanted - given, shift)
        cycles, moved, given = cycles + c, moved + m, given + g
    return cycles, moved, given


def partition(entries: np.ndarray, wanted: int) -> Cost:
    """A reading counts keys by their upper ten bits, another one writes parts of neighbouring bins; what is larger than a unit is parted again."""
    n = len(entries)
    if n <= CAPACITY:
        return _fits(n)
    cycles, moved, _ = _partition(entries >> np.uint64(MASK_BITS), wanted, KEY_BITS + RECORD_BITS)
    return Cost(cycles + latency(CAPACITY), int(lines_of(n)) + moved)


def binned(entries: np.ndarray, wanted: int, bins: int = 4) -> Cost:
    """Four lists for each tile, by quarters of an octave's doubling: bins of the key's range over all of a scene. Each is sorted by reading again."""
    tag = entries >> np.uint64(MASK_BITS)
    edges = code(2.0 * 2.0 ** (4 * np.arange(1, bins) / bins))
    which = np.searchsorted(edges, (tag >> np.uint64(RECORD_BITS)).astype(np.int64), side="right")
    cycles, moved = 0, 0
    for b in range(bins):
        own = entries[which == b]
        moved += int(lines_of(len(own)))
        if wanted > 0 and len(own):
            cost = read_again(own, min(wanted, len(own)))
            cycles += cost.cycles
            moved += cost.moved - int(lines_of(len(own)))
            wanted -= len(own)
    return Cost(cycles, moved)


def _many(entries: np.ndarray, wanted: int) -> Cost:
    return read_again(entries, wanted, 4 * CAPACITY)


_PACKER = 8 * ENTRY_BITS * FLOP + CONTROL
_NODE = 48 + 6

WAYS = (
    Way("read again", read_again),
    Way("read again, a unit of 8,192", _many, 3 * 216_320, 2 * 3_200.0),
    Way("four bins at writing", binned, 0, CONTROL, 3 * (4 * 2048 * 28 + 36 * 256 * 52)),
    Way("parted by a histogram", partition, BINS * 17 + PARTS * (LINE_BITS + 24), LINE_BITS * FLOP + 2 * CONTROL),
    Way("runs merged by entries", merge_entries, 2 * RUNS * (LINE_BITS + 3 * ENTRY_BITS), _PACKER + 6 * (COMPARE + 2 * ENTRY_BITS * FLOP) + CONTROL),
    Way("runs merged by lines", merge_lines, LINES * LINE_BITS + RUNS * (_NODE + 2 * 48 + 40), _PACKER + COMPARE + 4 * _NODE * FLOP + CONTROL),
)
