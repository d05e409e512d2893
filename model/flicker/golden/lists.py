"""Tile lists in DRAM, bit for bit: what the four list writers leave in memory, and how it is read back (docs/reference/list_layout.md).

Writer b serves the tiles with (column & 1) | (row & 1) << 1 == b; its tile (u, v) is column 2 u + (b & 1), row 2 v + (b >> 1) of the picture. It takes entries
in the order of the scene and collects them in a combiner of 64 sets (3 low bits of u and v) and 4 ways of one line each. Every line is written once, whole. All
depends on the writer's own entries alone, so memory is the same in every run.

A line is plain, up to nine entries, or short, ten to fifteen of which each but the newest is near the one behind it (`near`): of these only the low bits are
kept, and the reader has the others from the entry before. Up to nine entries are taken whatever they are; a line is written when it has nine that are not all
near, when it has fifteen, when a tenth or later one is not near (it begins the next line), when another tile needs its place (ways in turn, but not a line that
has just begun so), and at the end (by set and way).

Pointers lie on the chip by lines of 16, line n in place n mod (held / 16). Where a writer has more than it holds, a line that is wanted takes the place of the
one there, which goes to its place in the pointer table (it is spilled) and comes back when it is wanted again (it is fetched).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numba
import numpy as np

from ..errors import FlickerError
from ..params import TILE

WRITERS = 4
LINE_BYTES = 64
LINE_ENTRIES = 9  # of a plain line
SHORT_ENTRIES = 15  # of a short one
CHUNK_LINES = 8
COMBINER_SETS = 64  # 8 x 8 tiles
COMBINER_WAYS = 4
# An entry, least significant bit first, so that entries compare by key, then record.
MASK_BITS, RECORD_BITS, KEY_BITS = 4, 24, 24
ENTRY_BITS = MASK_BITS + RECORD_BITS + KEY_BITS
RECORD_AT, KEY_AT = MASK_BITS, MASK_BITS + RECORD_BITS
# Of an entry of a short line, but the newest: its mask and the low bits of record and key. What it leaves free of 52 bits, above these of both, is a gap.
RECORD_KEPT, KEY_KEPT = 9, 17
KEPT_BITS = MASK_BITS + RECORD_KEPT + KEY_KEPT
GAP_BITS = ENTRY_BITS - KEPT_BITS
# Entries 9 to 14 of a short line: the low bits of what they keep in the gaps of entries 1 to 6, the others in those of 7 and 8 and behind entry 8.
OVER_BITS = KEPT_BITS - GAP_BITS
OVER_ENTRIES = SHORT_ENTRIES - LINE_ENTRIES
TAIL_BITS = max(OVER_ENTRIES * KEPT_BITS - (LINE_ENTRIES - 1) * GAP_BITS, 0)
# The header of a line, behind its entries: count; in the first line of a chunk the chunk before it and whether there is one; zeros.
TAIL_AT = LINE_ENTRIES * ENTRY_BITS
HEADER_AT = TAIL_AT + TAIL_BITS
COUNT_BITS, LINK_BITS = 4, 24
# A pointer.
POINTER_BITS, USED_BITS = 32, 4
POINTER_BYTES = POINTER_BITS // 8
POINTERS_PER_LINE = LINE_BYTES * 8 // POINTER_BITS
MAX_TILES = 256  # along a side: pictures up to 4096 pixels
MAX_CHUNKS = 1 << LINK_BITS  # of a writer
HELD_POINTERS = 2048  # of a writer, on the chip: all of a picture up to 1080p

_HEADER_SHIFT = HEADER_AT % 64
_WORDS = LINE_BYTES // 8
assert HEADER_AT // 64 == 7 and ENTRY_BITS <= 64 and COUNT_BITS + LINK_BITS + 1 <= 64 - _HEADER_SHIFT
assert OVER_ENTRIES < LINE_ENTRIES and SHORT_ENTRIES < 1 << COUNT_BITS


# ---- a line -------------------------------------------------------------------------------------


@numba.njit(cache=True)
def _put(words, at, bits, value):
    """Set bits from `at` on of a line that is zero there."""
    word, shift = at >> 6, np.uint64(at & 63)
    words[word] |= value << shift
    if at & 63 > 64 - bits:
        words[word + 1] |= value >> (np.uint64(64) - shift)


@numba.njit(cache=True)
def _get(words, at, bits):
    """uint64: bits from `at` on."""
    word, shift = at >> 6, np.uint64(at & 63)
    value = words[word] >> shift
    if at & 63 > 64 - bits:
        value |= words[word + 1] << (np.uint64(64) - shift)
    return value & ((np.uint64(1) << np.uint64(bits)) - np.uint64(1))


@numba.njit(cache=True)
def _cut(word, at, bits):
    return (word >> np.uint64(at)) & ((np.uint64(1) << np.uint64(bits)) - np.uint64(1))


@numba.njit(cache=True)
def near(older, newer):
    """Whether an entry (uint64) can be told from the one that came behind it by its low bits: record at most 2^9 - 1 lower, key less than 2^16 lower or higher
    (or 2^16 lower)."""
    record = np.int64(_cut(newer, RECORD_AT, RECORD_BITS)) - np.int64(_cut(older, RECORD_AT, RECORD_BITS))
    key = np.int64(_cut(older, KEY_AT, KEY_BITS)) - np.int64(_cut(newer, KEY_AT, KEY_BITS))
    return 0 <= record < 1 << RECORD_KEPT and -(1 << KEY_KEPT - 1) <= key < 1 << KEY_KEPT - 1


@numba.njit(cache=True)
def _restored(kept, newer):
    """uint64: the entry that keeps `kept` before `newer`."""
    last = np.int64(_cut(newer, RECORD_AT, RECORD_BITS))
    low = np.int64(_cut(kept, MASK_BITS, RECORD_KEPT))
    record = last - ((last - low) & ((1 << RECORD_KEPT) - 1))
    last = np.int64(_cut(newer, KEY_AT, KEY_BITS))
    low = np.int64(_cut(kept, MASK_BITS + RECORD_KEPT, KEY_KEPT))
    key = last + ((low - last + (1 << KEY_KEPT - 1)) & ((1 << KEY_KEPT) - 1)) - (1 << KEY_KEPT - 1)
    tag = np.uint64(key & ((1 << KEY_BITS) - 1)) << np.uint64(RECORD_BITS) | np.uint64(record & ((1 << RECORD_BITS) - 1))
    return tag << np.uint64(MASK_BITS) | _cut(kept, 0, MASK_BITS)


@numba.njit(cache=True)
def _over(words, over, value, filling):
    """What entry 9 + `over` of a short line keeps, uint64: put into the gaps, or taken from them."""
    record_gap = RECORD_BITS - RECORD_KEPT
    at = ENTRY_BITS * (over + 1)
    low = np.uint64(0)
    # The gap of entry `over` + 1: above its record's low bits, above its key's.
    for first, begin, bits in ((0, at + RECORD_AT + RECORD_KEPT, record_gap), (record_gap, at + KEY_AT + KEY_KEPT, GAP_BITS - record_gap)):
        if filling:
            _put(words, begin, bits, _cut(value, first, bits))
        else:
            low |= _get(words, begin, bits) << np.uint64(first)
    # The others, bit by bit, in the gaps behind those.
    for k in range(OVER_BITS):
        place = over * OVER_BITS + k
        gap, bit = OVER_ENTRIES + place // GAP_BITS, place % GAP_BITS
        if gap >= LINE_ENTRIES - 1:
            begin = TAIL_AT + place - (LINE_ENTRIES - 1 - OVER_ENTRIES) * GAP_BITS
        else:
            begin = ENTRY_BITS * (gap + 1) + (RECORD_AT + RECORD_KEPT + bit if bit < record_gap else KEY_AT + KEY_KEPT + bit - record_gap)
        if filling:
            _put(words, begin, 1, _cut(value, GAP_BITS + k, 1))
        else:
            low |= _get(words, begin, 1) << np.uint64(GAP_BITS + k)
    return low


@numba.njit(cache=True)
def _kept(entry):
    return (_cut(entry, KEY_AT, KEY_KEPT) << np.uint64(RECORD_KEPT) | _cut(entry, RECORD_AT, RECORD_KEPT)) << np.uint64(MASK_BITS) | _cut(entry, 0, MASK_BITS)


@numba.njit(cache=True)
def pack_line(entries, count, words):
    """Put `count` entries (uint64, in the order of coming; ten or more are near each other) and their number into a line `words` (uint64 (8,)) of zeros."""
    _put(words, 0, ENTRY_BITS, entries[count - 1])
    gaps = ((np.uint64(1) << np.uint64(RECORD_KEPT)) - np.uint64(1)) << np.uint64(RECORD_AT)
    gaps |= ((np.uint64(1) << np.uint64(KEY_KEPT)) - np.uint64(1)) << np.uint64(KEY_AT)
    gaps |= (np.uint64(1) << np.uint64(MASK_BITS)) - np.uint64(1)
    for i in range(1, count):
        if i < LINE_ENTRIES:
            _put(words, ENTRY_BITS * i, ENTRY_BITS, entries[i - 1] & gaps if count > LINE_ENTRIES else entries[i - 1])
        else:
            _over(words, i - LINE_ENTRIES, _kept(entries[i - 1]), True)
    _put(words, HEADER_AT, COUNT_BITS, np.uint64(count))


@numba.njit(cache=True)
def unpack_line(words, count, entries):
    """The entries of a line, the newest first: the order of reading."""
    entries[0] = _get(words, 0, ENTRY_BITS)
    for k in range(1, count):
        i = count - k
        if count <= LINE_ENTRIES:
            entries[k] = _get(words, ENTRY_BITS * i, ENTRY_BITS)
        elif i < LINE_ENTRIES:
            entries[k] = _restored(_kept(_get(words, ENTRY_BITS * i, ENTRY_BITS)), entries[k - 1])
        else:
            entries[k] = _restored(_over(words, i - LINE_ENTRIES, np.uint64(0), False), entries[k - 1])


@numba.njit(cache=True)
def line_starts(entries):
    """int64: where lines begin that take entries (uint64, in the order of coming) as a writer's do, and the number of entries."""
    starts = np.zeros(len(entries) + 1, np.int64)
    lines = count = 0
    tight = True
    for i in range(len(entries)):
        joins = 0 < count < SHORT_ENTRIES
        if count > 0:
            close = tight and near(entries[i - 1], entries[i])
            joins = joins and (count < LINE_ENTRIES or close)
            tight = close
        if joins:
            count += 1
        else:
            starts[lines] = i
            lines += 1
            count = 1
            tight = True
    starts[lines] = len(entries)
    return starts[: lines + 1]


def line_entries(line: int, count: int) -> list[int]:
    """Entries of a line, of which the lowest 472 bits matter, in the order of reading."""
    entries = np.zeros(SHORT_ENTRIES, np.uint64)
    unpack_line(np.frombuffer(bytearray(line.to_bytes(LINE_BYTES, "little")), np.uint64), count, entries)
    return [int(entry) for entry in entries[:count]]


def line_of(entries: list[int]) -> int:
    """A line's bits without a link, of entries in the order of coming. Raises FlickerError for more than fit."""
    word = np.array(entries, np.uint64)
    if not 1 <= len(word) <= SHORT_ENTRIES or int(word.max()) >> ENTRY_BITS:
        raise FlickerError(f"lists: a line of {len(word)} entries, not 1 to {SHORT_ENTRIES} of {ENTRY_BITS} bits")
    if len(word) > LINE_ENTRIES and not all(near(a, b) for a, b in zip(word[:-1], word[1:])):
        raise FlickerError(f"lists: {len(word)} entries that are not near each other in a line")
    words = np.zeros(_WORDS, np.uint64)
    pack_line(word, len(word), words)
    return int.from_bytes(words.tobytes(), "little")


# ---- writing ------------------------------------------------------------------------------------


class ListError(IntEnum):
    """How a frame's lists ended."""

    NONE = 0
    OUT_OF_MEMORY = 1  # a writer needed a chunk more than it has


def writer_columns(cols: int) -> int:
    """Columns of tiles of a writer; the writers of odd columns may have one less, whose pointers stay zero."""
    return -(-cols // 2)


def pointer_lines(cols: int, rows: int) -> int:
    """Lines of 64 bytes of the pointer table: of 16 pointers of one writer each, the writers' lines in turn."""
    return -(-writer_columns(cols) * (-(-rows // 2)) // POINTERS_PER_LINE) * WRITERS


def pointer_place(tile: np.ndarray | int, cols: int) -> np.ndarray | int:
    """Where the pointer of a tile lies in the table, in units of 4 bytes. tile: column + cols * row."""
    x, y = tile % cols, tile // cols
    number = (y >> 1) * writer_columns(cols) + (x >> 1)
    return (number // POINTERS_PER_LINE * WRITERS + (x & 1 | (y & 1) << 1)) * POINTERS_PER_LINE + number % POINTERS_PER_LINE


def list_chunks(width: int, height: int, entries: int) -> int:
    """Chunks of each list writer that hold so many entries in all wherever they fall, were lines plain and full; 64 more for lines that are not."""
    pair = 2 * TILE
    return min(-(-width // pair) * -(-height // pair) + entries // (CHUNK_LINES * LINE_ENTRIES) + 64, MAX_CHUNKS)


@dataclass(eq=False)
class ListImage:
    """What the writers leave.

    cols, rows: grid of tiles. chunks: that each writer may take; chunk c of writer b is bytes (4 c + b) * 512 to + 511 of the memory. memory: uint64 (32
    chunks, 8), lines of little-endian words; lines never written are zero. pointers: uint32 (16 * pointer_lines,). error: of the frame. Of each writer, int64
    (4,): entries taken, lines written, evicted (lines written because another tile needed their place), taken (chunks), failed (0 or 1: it ran out of chunks;
    it wrote nothing more then, no pointers but those spilled before), spilled and fetched (lines of pointers). Of each writer, int64, in order: writes: the
    lines of the memory that it wrote; moves (n, 3): lines that it had written by then, line of its pointers that was spilled and that was fetched, -1: none;
    closed: lines of its pointers written at the end, all but those in memory and not held.
    """

    cols: int
    rows: int
    chunks: int
    memory: np.ndarray
    pointers: np.ndarray
    error: ListError
    entries: np.ndarray
    lines: np.ndarray
    evicted: np.ndarray
    taken: np.ndarray
    failed: np.ndarray
    spilled: np.ndarray
    fetched: np.ndarray
    writes: list[np.ndarray]
    moves: list[np.ndarray]
    closed: list[np.ndarray]


@numba.njit(cache=True)
def _write(entry_word, tile, cols, writer, chunks, memory, writes, moves, newest, link, used, place, table, spilled, counters):
    """One writer. entry_word: uint64 (E,), the entries' 52 bits. memory: uint64 (lines, 8), or empty to count only, moves too.

    newest, link, used: of each list. place: line of pointers in each place, -1: none. table: uint32 (lines, 16), what was spilled; spilled: bool (lines,).
    """
    held = np.full(COMBINER_SETS * COMBINER_WAYS, -1, np.int64)
    count = np.zeros(len(held), np.int64)
    close = np.ones(len(held), np.bool_)  # its entries are near each other
    turn = np.zeros(COMBINER_SETS, np.int64)
    buffer = np.zeros((len(held), SHORT_ENTRIES), np.uint64)
    words = np.zeros(_WORDS, np.uint64)
    n = 0
    m = 0
    free = 0
    failed = False
    last = len(tile) + len(held)
    ucols = (cols + 1) // 2
    for e in range(last):
        slot = -1
        full = -1
        if e < len(tile):
            x, y = tile[e] % cols, tile[e] // cols
            if (x & 1) | (y & 1) << 1 != writer:
                continue
            counters[0] += 1
            u, v = x >> 1, y >> 1
            which = v * ucols + u
            s = ((v & 7) << 3 | (u & 7)) * COMBINER_WAYS
            for w in range(s + COMBINER_WAYS - 1, s - 1, -1):
                if count[w] == 0:
                    slot = w
            for w in range(s, s + COMBINER_WAYS):
                if count[w] > 0 and held[w] == which:
                    slot = w
            if slot < 0:  # another line has to go
                slot = s + turn[s // COMBINER_WAYS]
                turn[s // COMBINER_WAYS] = (turn[s // COMBINER_WAYS] + 1) % COMBINER_WAYS
                full = slot
                counters[2] += 1
            elif count[slot] >= LINE_ENTRIES and not near(buffer[slot, count[slot] - 1], entry_word[e]):
                full = slot
                if turn[s // COMBINER_WAYS] == slot - s:
                    turn[s // COMBINER_WAYS] = (turn[s // COMBINER_WAYS] + 1) % COMBINER_WAYS
        else:
            slot = e - len(tile)
            if count[slot] > 0:
                full = slot
        for step in range(2):
            if full >= 0:
                t = held[full]
                line = t // POINTERS_PER_LINE
                room = line % len(place)
                if not failed and len(spilled) > len(place) and place[room] != line:
                    old = place[room]
                    if old >= 0:
                        for i in range(old * POINTERS_PER_LINE, min((old + 1) * POINTERS_PER_LINE, len(used))):
                            table[old, i % POINTERS_PER_LINE] = newest[i] | used[i] << LINK_BITS
                        spilled[old] = True
                        counters[5] += 1
                    back = spilled[line]
                    counters[6] += back
                    if old >= 0 or back:
                        if len(moves):
                            moves[m] = n, old, line if back else -1
                        m += 1
                    place[room] = line
                if not failed and (used[t] == 0 or used[t] == CHUNK_LINES):
                    if free == chunks:
                        failed = True
                    else:
                        link[t] = newest[t] if used[t] > 0 else -1
                        newest[t] = free
                        used[t] = 0
                        free += 1
                if not failed:
                    if len(memory):
                        words[:] = 0
                        pack_line(buffer[full], count[full], words)
                        header = np.uint64(0)
                        if used[t] == 0 and link[t] >= 0:
                            header |= np.uint64(link[t]) << np.uint64(COUNT_BITS) | np.uint64(1) << np.uint64(COUNT_BITS + LINK_BITS)
                        words[7] |= header << np.uint64(_HEADER_SHIFT)
                        address = (newest[t] * WRITERS + writer) * CHUNK_LINES + used[t]
                        memory[address] = words
                        writes[n] = address
                    n += 1
                    used[t] += 1
                count[full] = 0
            full = -1
            if step == 0 and e < len(tile):
                held[slot] = which
                close[slot] = count[slot] == 0 or (close[slot] and near(buffer[slot, count[slot] - 1], entry_word[e]))
                buffer[slot, count[slot]] = entry_word[e]
                count[slot] += 1
                if count[slot] == SHORT_ENTRIES or (count[slot] == LINE_ENTRIES and not close[slot]):
                    full = slot
    counters[1] = n
    counters[3] = free
    counters[4] = failed
    counters[7] = m


def entry_words(splat: np.ndarray, mask: np.ndarray, key: np.ndarray, record: np.ndarray) -> np.ndarray:
    """uint64 (E,): the 52 bits of each entry."""
    for name, value, bits in (("mask", mask, MASK_BITS), ("record", record, RECORD_BITS), ("key", key, KEY_BITS)):
        if len(value) and not 0 <= int(value.min()) <= int(value.max()) < 1 << bits:
            raise FlickerError(f"lists: {name} must fit {bits} bits, found {int(value.min())} to {int(value.max())}")
    tag = key.astype(np.uint64) << np.uint64(RECORD_BITS) | record.astype(np.uint64)
    return tag[splat] << np.uint64(MASK_BITS) | mask.astype(np.uint64)


def write_lists(
    splat: np.ndarray, tile: np.ndarray, mask: np.ndarray, key: np.ndarray, record: np.ndarray, cols: int, rows: int, chunks: int | None = None,
    held: int = HELD_POINTERS,
) -> ListImage:
    """Execute the four writers.

    splat, tile, mask: (E,), entries in the order of the scene: number of the splat (into key and record), tile column + cols * row, 4-bit mask. key, record:
    (S,), 24 bits each. cols, rows: grid of tiles, at most 256 each. chunks: of each writer; None: as many as the busiest one takes. held: pointers of a
    writer on the chip, a multiple of 16. Raises FlickerError for what does not fit the formats.
    """
    if not (1 <= cols <= MAX_TILES and 1 <= rows <= MAX_TILES):
        raise FlickerError(f"lists: {cols}x{rows} tiles, not 1x1 to {MAX_TILES}x{MAX_TILES} (pictures up to {MAX_TILES * TILE} pixels)")
    if chunks is not None and not 0 <= chunks <= MAX_CHUNKS:
        raise FlickerError(f"lists: chunks must be 0 to {MAX_CHUNKS}, not {chunks}")
    tile = np.ascontiguousarray(tile, np.int64)
    if len(tile) and not 0 <= tile.min() <= tile.max() < cols * rows:
        raise FlickerError(f"lists: tile must be 0 to {cols * rows - 1}, found {tile.min()} to {tile.max()}")
    word = entry_words(splat, mask, key, record)
    own = writer_columns(cols) * (-(-rows // 2))
    lines = pointer_lines(cols, rows) // WRITERS
    limit = MAX_CHUNKS if chunks is None else chunks
    none, nowhere = np.zeros((0, 8), np.uint64), np.zeros(0, np.int64)
    counters = np.zeros((WRITERS, 8), np.int64)
    pointers = np.zeros((lines, WRITERS, POINTERS_PER_LINE), np.uint32)

    def run(b: int, memory: np.ndarray, writes: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Writer b; its pointers. Returns the lines of them that it wrote at the end."""
        states, place = np.zeros((3, own), np.int64), np.full(held // POINTERS_PER_LINE, -1, np.int64)
        table, spilled = np.zeros((lines, POINTERS_PER_LINE), np.uint32), np.zeros(lines, np.bool_)
        counters[b] = 0
        _write(word, tile, cols, b, limit, memory, writes, moves, *states, place, table, spilled, counters[b])
        if counters[b, 4]:
            closed = nowhere
        else:
            value = np.zeros((lines, POINTERS_PER_LINE), np.uint32)
            value.ravel()[:own] = states[0] | states[2] << LINK_BITS
            number = np.arange(lines)
            closed = number[~spilled | (place[number % len(place)] == number)]
            table[closed] = value[closed]
        pointers[:, b] = table
        return closed

    for b in range(WRITERS):
        run(b, none, nowhere, nowhere.reshape(0, 3))
    if chunks is None:
        chunks = int(counters[:, 3].max())
    memory = np.zeros((chunks * WRITERS * CHUNK_LINES, 8), np.uint64)
    writes = [np.zeros(n, np.int64) for n in counters[:, 1]]
    moves = [np.zeros((n, 3), np.int64) for n in counters[:, 7]]
    closed = [run(b, memory, writes[b], moves[b]) for b in range(WRITERS)]
    error = ListError.OUT_OF_MEMORY if counters[:, 4].any() else ListError.NONE
    return ListImage(cols, rows, chunks, memory, pointers.ravel(), error, *counters.T[:7].copy(), writes, moves, closed)  # type: ignore[call-arg]


# ---- reading -----------------------------------------------------------------------------------


@dataclass(eq=False)
class ReadLists:
    """Lists of tiles row by row: entries of tile t are start[t]:start[t + 1] of key, record (uint32) and mask (uint8), in the order of reading: the newest
    chunk first, its lines in order, of a line the newest entry first."""

    start: np.ndarray
    key: np.ndarray
    record: np.ndarray
    mask: np.ndarray


_FAULTS = ("", "pointer with {0} lines used", "chunk {0}, but there are {1}", "line {0} of its chunk holds {1} entries",
           "chunk {0} has a header with wrong bits", "chunk {0} belongs to another list too")


@numba.njit(cache=True)
def _walk(memory, pointers, place, cols, tiles, chunks, owner, start, word):
    """Follow all chains; counts only where `word` is empty. Returns (fault, tile, two numbers)."""
    n = 0
    filling = len(word) > 0
    for t in range(tiles):
        start[t] = n
        pointer = np.int64(pointers[place[t]])
        used = pointer >> LINK_BITS
        if used == 0 and pointer == 0:
            continue
        if not 1 <= used <= CHUNK_LINES:
            return 1, t, used, 0
        x, y = t % cols, t // cols
        writer = (x & 1) | (y & 1) << 1
        chunk = pointer & (MAX_CHUNKS - 1)
        while chunk >= 0:
            if chunk >= chunks:
                return 2, t, chunk, chunks
            if not filling:
                if owner[chunk * WRITERS + writer] >= 0:
                    return 5, t, chunk, 0
                owner[chunk * WRITERS + writer] = t
            first = (chunk * WRITERS + writer) * CHUNK_LINES
            link = np.int64(memory[first, 7] >> np.uint64(_HEADER_SHIFT + COUNT_BITS))
            for k in range(used):
                header = memory[first + k, 7] >> np.uint64(_HEADER_SHIFT)
                count = np.int64(header & np.uint64((1 << COUNT_BITS) - 1))
                if not 1 <= count <= SHORT_ENTRIES:
                    return 3, t, k, count
                if (np.int64(header >> np.uint64(COUNT_BITS)) if k else link >> LINK_BITS + 1) != 0:
                    return 4, t, chunk, 0
                if count <= LINE_ENTRIES and _get(memory[first + k], TAIL_AT, TAIL_BITS) != 0:
                    return 4, t, chunk, 0
                if filling:
                    unpack_line(memory[first + k], count, word[n : n + count])
                n += count
            chunk = link & (MAX_CHUNKS - 1) if link >> LINK_BITS else -1
            used = CHUNK_LINES
    start[tiles] = n
    return 0, 0, 0, 0


def read_lists(memory: np.ndarray, pointers: np.ndarray, cols: int, rows: int) -> ReadLists:
    """Read the lists back: memory uint64 (32 chunks, 8), pointers uint32, as in `ListImage`. Raises FlickerError where they are not lists, naming tile and
    chunk."""
    if memory.ndim != 2 or memory.shape[1] != 8 or len(memory) % (WRITERS * CHUNK_LINES):
        raise FlickerError(f"lists: memory of shape {memory.shape}, not (32 chunks, 8)")
    if len(pointers) != pointer_lines(cols, rows) * POINTERS_PER_LINE:
        raise FlickerError(f"lists: {len(pointers)} pointers for {cols}x{rows} tiles, not {pointer_lines(cols, rows) * POINTERS_PER_LINE}")
    tiles = cols * rows
    place = np.asarray(pointer_place(np.arange(tiles), cols))
    chunks = len(memory) // (WRITERS * CHUNK_LINES)
    start, owner = np.zeros(tiles + 1, np.int64), np.full(chunks * WRITERS, -1, np.int64)
    args = (memory, pointers, place, cols, tiles, chunks, owner, start)
    fault, tile, *about = _walk(*args, np.zeros(0, np.uint64))
    if fault:
        raise FlickerError(f"lists: tile {tile % cols}, {tile // cols}: {_FAULTS[fault].format(*about)}")
    word = np.zeros(start[-1], np.uint64)
    if len(word):
        _walk(*args, word)
    tag = word >> np.uint64(MASK_BITS)
    return ReadLists(
        start, (tag >> np.uint64(RECORD_BITS)).astype(np.uint32), (tag & np.uint64((1 << RECORD_BITS) - 1)).astype(np.uint32),
        (word & np.uint64((1 << MASK_BITS) - 1)).astype(np.uint8),
    )
