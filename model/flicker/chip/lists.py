"""Building the lists of a scheme (`schemes`), and what that writes to DRAM."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..front.binning import pixel_boxes
from ..params import ALPHA_MIN, SUBTILE
from . import constants as c
from .dram import MASKED_WRITE, WRITE, Stream
from .schemes import Method, Scheme


@dataclass(eq=False)
class Splats:
    """Visible Gaussians that meet a sub-tile, in the order of memory (R of them).

    key: uint32 (R,). box: int32 (R, 4), first and one-past-last sub-tile column, then row. projected: int64 (R,), their numbers in
    `Projected` (near to far). cols, rows: sub-tile grid.
    """

    key: np.ndarray
    box: np.ndarray
    projected: np.ndarray
    cols: int
    rows: int

    def __len__(self) -> int:
        return len(self.key)


def collect(projected, camera, tight: bool = False) -> Splats:
    """The splats of a projection in the order of memory, that is, of the scene.

    tight: boxes no larger than the ellipse alpha = 1/255 (fewer entries, the same picture; `build_lists` does not do it).
    """
    cols, rows = -(-camera.width // SUBTILE), -(-camera.height // SUBTILE)
    radii = projected.radii
    if tight:
        reach = np.sqrt(2.0 * np.log(np.maximum(projected.opacity / ALPHA_MIN, 1.0)))
        radii = np.minimum(radii, reach[:, None] * np.sqrt(projected.cov2d[:, ::2]) * (1.0 + 1e-9))
    box = pixel_boxes(projected.mean, radii, SUBTILE, cols, rows, camera.width, camera.height)
    here = np.flatnonzero((box[:, 1] > box[:, 0]) & (box[:, 3] > box[:, 2]))
    here = here[np.argsort(projected.index[here], kind="stable")]
    return Splats(projected.depth[here].view(np.uint32), np.ascontiguousarray(box[here]), here, cols, rows)


# ---- building lists ----------------------------------------------------------------------------


@numba.njit(cache=True)
def count_entries(order, box, block, cols, rows):
    """Entries of every list."""
    bcols = (cols + block - 1) // block
    count = np.zeros(bcols * ((rows + block - 1) // block), np.int64)
    for r in order:
        for y in range(box[r, 2] // block, (box[r, 3] - 1) // block + 1):
            for x in range(box[r, 0] // block, (box[r, 1] - 1) // block + 1):
                count[y * bcols + x] += 1
    return count


@numba.njit(cache=True)
def way_of(held, age, first, ways, which):
    """Place of list `which` in a set, else a free one, else the least recently used."""
    best = first
    for w in range(first, first + ways):
        if held[w] == which:
            return w
        if held[best] >= 0 and (held[w] < 0 or age[w] < age[best]):
            best = w
    return best


@numba.njit(cache=True)
def _build_counting(order, box, block, cols, rows, start, line_start, per_line, sets_x, sets_y, ways, entry, line, kind):
    """Second pass: entries to their places. line, kind: bursts written. Returns their number."""
    bcols = (cols + block - 1) // block
    fill = np.zeros(len(start) - 1, np.int64)
    held = np.full(sets_x * sets_y * ways, -1, np.int64)
    age = np.zeros(len(held), np.int64)
    inside = np.zeros(len(held), np.int64)
    now = 0
    writes = 0
    for r in order:
        for y in range(box[r, 2] // block, (box[r, 3] - 1) // block + 1):
            for x in range(box[r, 0] // block, (box[r, 1] - 1) // block + 1):
                t = y * bcols + x
                w = way_of(held, age, ((y % sets_y) * sets_x + x % sets_x) * ways, ways, t)
                if held[w] != t:
                    if held[w] >= 0:
                        old = held[w]
                        line[writes] = line_start[old] + (fill[old] - 1) // per_line
                        kind[writes] = WRITE if inside[w] == (fill[old] - 1) % per_line + 1 else MASKED_WRITE
                        writes += 1
                    held[w] = t
                    inside[w] = 0
                entry[start[t] + fill[t]] = r
                fill[t] += 1
                inside[w] += 1
                age[w] = now
                now += 1
                if fill[t] % per_line == 0:
                    line[writes] = line_start[t] + fill[t] // per_line - 1
                    kind[writes] = WRITE if inside[w] == per_line else MASKED_WRITE
                    writes += 1
                    held[w] = -1
    for w in range(len(held)):
        if held[w] >= 0:
            old = held[w]
            line[writes] = line_start[old] + (fill[old] - 1) // per_line
            kind[writes] = WRITE if inside[w] == (fill[old] - 1) % per_line + 1 else MASKED_WRITE
            writes += 1
    return writes


@numba.njit(cache=True)
def _build_linked(order, box, block, cols, rows, cap, sets_x, sets_y, ways, newest, before, held_count, chunk):
    """One pass into chunks. newest: chunk of each list written last; before, held_count, chunk: link, count and entries of a chunk."""
    bcols = (cols + block - 1) // block
    held = np.full(sets_x * sets_y * ways, -1, np.int64)
    age = np.zeros(len(held), np.int64)
    inside = np.zeros(len(held), np.int64)
    buffer = np.empty((len(held), cap), np.int32)
    now = 0
    used = 0
    for r in order:
        for y in range(box[r, 2] // block, (box[r, 3] - 1) // block + 1):
            for x in range(box[r, 0] // block, (box[r, 1] - 1) // block + 1):
                t = y * bcols + x
                w = way_of(held, age, ((y % sets_y) * sets_x + x % sets_x) * ways, ways, t)
                if held[w] != t:
                    if held[w] >= 0:
                        chunk[used] = buffer[w]
                        held_count[used] = inside[w]
                        before[used] = newest[held[w]]
                        newest[held[w]] = used
                        used += 1
                    held[w] = t
                    inside[w] = 0
                buffer[w, inside[w]] = r
                inside[w] += 1
                age[w] = now
                now += 1
                if inside[w] == cap:
                    chunk[used] = buffer[w]
                    held_count[used] = cap
                    before[used] = newest[t]
                    newest[t] = used
                    used += 1
                    held[w] = -1
    for w in range(len(held)):
        if held[w] >= 0:
            chunk[used] = buffer[w]
            held_count[used] = inside[w]
            before[used] = newest[held[w]]
            newest[held[w]] = used
            used += 1
    return used


@numba.njit(cache=True)
def _follow(walk, newest, before, held_count, chunk, start, entry, visited, chain):
    """Read the chains of the lists `walk`: entries from the newest chunk back, each chunk backwards; chain: chunks of each list."""
    n = 0
    for t in walk:
        e = start[t]
        k = newest[t]
        while k >= 0:
            visited[n] = k
            n += 1
            chain[t] += 1
            for i in range(held_count[k] - 1, -1, -1):
                entry[e] = chunk[k, i]
                e += 1
            k = before[k]
    return n


@dataclass(eq=False)
class Lists:
    """Unsorted lists of one grain. start: int64 (L + 1,); record: int64 (E,); walk: lists in the order of rendering.

    writes: what building them moves. chunks: int64, chunk numbers in the order of reading, chain: int64 (L,) chunks of each list
    (linked and global). line_start: int64 (L + 1,), first burst of each list (counting).
    """

    start: np.ndarray
    record: np.ndarray
    walk: np.ndarray
    writes: list[Stream]
    chunks: np.ndarray
    chain: np.ndarray
    line_start: np.ndarray


def walk_order(splats: Splats, block: int) -> np.ndarray:
    """Lists in the order of rendering: tiles (or groups) row by row, the sub-tiles of a tile together."""
    bcols, brows = -(-splats.cols // block), -(-splats.rows // block)
    number = np.arange(bcols * brows)
    if block > 1:
        return number
    x, y = number % bcols, number // bcols
    return np.lexsort([x % 2, y % 2, x // 2, y // 2])


def build(splats: Splats, scheme: Scheme, order: np.ndarray, base: int) -> Lists:
    """Build the lists, taking the records in the given order. base: byte address of the lists in DRAM."""
    block = int(scheme.grain)
    args = (order, splats.box, block, splats.cols, splats.rows)
    count = count_entries(*args)
    start = np.concatenate([[0], np.cumsum(count)])
    sets_x = 1 << ((scheme.combiner_sets.bit_length() - 1 + 1) // 2)
    sets_y = max(scheme.combiner_sets // sets_x, 1)
    entry = np.empty(start[-1], np.int32)
    walk = walk_order(splats, block)
    none = np.zeros(0, np.int64)
    if scheme.method is Method.COUNTING:
        line_start = np.concatenate([[0], np.cumsum(-(-count // scheme.per_line))])
        line, kind = np.empty(len(entry) + len(count), np.int64), np.empty(len(entry) + len(count), np.int8)
        n = _build_counting(*args, start, line_start, scheme.per_line, sets_x, sets_y, scheme.combiner_ways, entry, line, kind)
        used = len(entry) * scheme.entry_bits // 8
        stream = Stream("list write", base // c.LINE_BYTES + line[:n], kind[:n].copy(), used)
        return Lists(start, entry.astype(np.int64), walk, [stream], none, np.zeros(len(count), np.int64), line_start)
    cap = scheme.per_chunk
    newest = np.full(len(count), -1, np.int64)
    most = len(entry) + scheme.combiner_sets * scheme.combiner_ways
    before, held_count, chunk = np.empty(most, np.int64), np.empty(most, np.int64), np.empty((most, cap), np.int32)
    used = _build_linked(*args, cap, sets_x, sets_y, scheme.combiner_ways, newest, before, held_count, chunk)
    chain, visited = np.zeros(len(count), np.int64), np.empty(used, np.int64)
    _follow(walk, newest, before, held_count, chunk, start, entry, visited, chain)
    stream = Stream.span("list write", base, used * c.CHUNK_BYTES, WRITE)
    stream.used_bytes = len(entry) * scheme.entry_bits // 8
    return Lists(start, entry.astype(np.int64), walk, [stream], visited, chain, none)
