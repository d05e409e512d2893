"""Tile lists in DRAM, bit for bit: what the four list writers leave in memory, and how it is read back (docs/reference/list_layout.md).

Writer b serves the tiles with (column & 1) | (row & 1) << 1 == b; its tile (u, v) is column 2 u + (b & 1), row 2 v + (b >> 1) of the picture. It takes entries
in the order of the scene and collects them in a combiner of 64 sets (3 low bits of u and v) and 4 ways of one line each. A line is written when it has nine
entries, when another tile needs its place (ways in turn), and at the end (by set and way). Every line is written once, whole. All depends on the writer's own
entries alone, so memory is the same in every run.

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
LINE_ENTRIES = 9
CHUNK_LINES = 8
COMBINER_SETS = 64  # 8 x 8 tiles
COMBINER_WAYS = 4
# An entry, least significant bit first, so that entries compare by key, then record.
MASK_BITS, RECORD_BITS, KEY_BITS = 4, 24, 24
ENTRY_BITS = MASK_BITS + RECORD_BITS + KEY_BITS
# The header of a line, behind its entries: count; in the first line of a chunk the chunk before it and whether there is one; zeros.
HEADER_AT = LINE_ENTRIES * ENTRY_BITS
COUNT_BITS, LINK_BITS = 4, 24
# A pointer.
POINTER_BITS, USED_BITS = 32, 4
POINTER_BYTES = POINTER_BITS // 8
POINTERS_PER_LINE = LINE_BYTES * 8 // POINTER_BITS
MAX_TILES = 256  # along a side: pictures up to 4096 pixels
MAX_CHUNKS = 1 << LINK_BITS  # of a writer
HELD_POINTERS = 2048  # of a writer, on the chip: all of a picture up to 1080p

_HEADER_SHIFT = HEADER_AT % 64
assert HEADER_AT // 64 == 7 and ENTRY_BITS <= 64 and COUNT_BITS + LINK_BITS + 1 <= 64 - _HEADER_SHIFT


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
    """Chunks of each list writer that hold so many entries in all wherever they fall, were lines full; 64 more for lines that are not."""
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
    turn = np.zeros(COMBINER_SETS, np.int64)
    buffer = np.zeros((len(held), LINE_ENTRIES), np.uint64)
    words = np.zeros(8, np.uint64)
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
                        for i in range(count[full]):
                            at = i * ENTRY_BITS
                            words[at >> 6] |= buffer[full, i] << np.uint64(at & 63)
                            if at & 63 > 64 - ENTRY_BITS:
                                words[(at >> 6) + 1] |= buffer[full, i] >> np.uint64(64 - (at & 63))
                        header = np.uint64(count[full])
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
                buffer[slot, count[slot]] = entry_word[e]
                count[slot] += 1
                if count[slot] == LINE_ENTRIES:
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
    chunk first, its lines in order."""

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
                if not 1 <= count <= LINE_ENTRIES:
                    return 3, t, k, count
                if (np.int64(header >> np.uint64(COUNT_BITS)) if k else link >> LINK_BITS + 1) != 0:
                    return 4, t, chunk, 0
                if filling:
                    for i in range(count):
                        at = i * ENTRY_BITS
                        value = memory[first + k, at >> 6] >> np.uint64(at & 63)
                        if at & 63 > 64 - ENTRY_BITS:
                            value |= memory[first + k, (at >> 6) + 1] << np.uint64(64 - (at & 63))
                        word[n + i] = value & np.uint64((1 << ENTRY_BITS) - 1)
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
