"""Schemes that make the sorted sub-tile lists, executed step by step with what each step moves.

Input are the visible Gaussians in the order of memory (`collect`): depth key, box of sub-tiles, record number. Every
scheme ends with the same lists as `golden.records.build_lists` (equal depths in the order of memory); what differs is
on the way there.

Grain, what one list stands for: a sub-tile; a tile, whose records are broadcast to the four cores with a 4-bit mask;
a group of 2x2 or 4x4 tiles, whose list is sorted once and filtered per tile by a bit mask (GS-TG). Method, how a list
comes to lie in DRAM:

- counting: a first pass counts the entries of each list, a second writes them where they belong. Entries of a list
  lie together, writes scatter.
- linked: one pass; a full chunk of 64 bytes goes to the next free place and carries the number of the chunk before
  it. Writes are one stream, reads follow the chain from the newest chunk back.
- global: all records are sorted by depth first, far to near, then linked: chains are read near to far and need no
  further sort.

A small write-combining buffer (sets x ways lines, least recently used) collects entries before they are written.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

import numba
import numpy as np

from ..errors import FlickerError
from ..golden.records import _span
from ..params import ALPHA_MAX, ALPHA_MIN, CORES, SUBTILE, TRANSMITTANCE_MIN
from . import constants as c
from .dram import MASKED_WRITE, READ, WRITE, Stream
from .sorting import merge_passes, quantised_key, sort_lists


class Grain(IntEnum):
    """Sub-tiles along a side of the square that a list stands for."""

    SUBTILE = 1
    TILE = 2
    GROUP32 = 4
    GROUP64 = 8


class Method(str, Enum):
    """How lists are built."""

    COUNTING = "counting"
    LINKED = "linked"
    GLOBAL = "global"


@dataclass(frozen=True)
class Scheme:
    """A way to build and sort the lists. record_cache_bytes: 0 for none.

    key_bits: 32, the depth as it is, or fewer for fixed point between the nearest and the farthest depth of the frame; then the lists
    may differ in the order of entries that such keys cannot tell apart.
    """

    method: Method
    grain: Grain
    record_cache_bytes: int = c.RECORD_CACHE_BYTES
    combiner_sets: int = c.COMBINER_SETS
    combiner_ways: int = c.COMBINER_WAYS
    sort_capacity: int = c.SORT_CAPACITY
    key_bits: int = c.KEY_BITS

    def __post_init__(self) -> None:
        for name in ("combiner_sets", "combiner_ways"):
            if getattr(self, name) < 1:
                raise FlickerError(f"lists: {name} must be at least 1, not {getattr(self, name)}")
        if not 1 <= self.key_bits <= c.KEY_BITS:
            raise FlickerError(f"lists: key_bits must be 1 to {c.KEY_BITS}, not {self.key_bits}")
        if self.record_cache_bytes and self.record_cache_bytes < c.RECORD_BYTES * c.RECORD_CACHE_WAYS:
            raise FlickerError(f"lists: record_cache_bytes must be 0 or at least {c.RECORD_BYTES * c.RECORD_CACHE_WAYS}")

    @property
    def name(self) -> str:
        return f"{self.method.value}-{self.grain.name.lower()}"

    @property
    def mask_bits(self) -> int:
        return 0 if self.grain == Grain.SUBTILE else int(self.grain) ** 2

    @property
    def entry_bits(self) -> int:
        key = 0 if self.method is Method.GLOBAL else self.key_bits
        return key + c.ID_BITS + self.mask_bits

    @property
    def per_line(self) -> int:
        """Entries of a burst in the lists of the counting method."""
        return c.LINE_BYTES * 8 // self.entry_bits

    @property
    def per_chunk(self) -> int:
        """Entries of a linked chunk."""
        return (c.CHUNK_BYTES * 8 - c.CHUNK_LINK_BITS) // self.entry_bits


SCHEMES = {s.name: s for s in (
    Scheme(Method.COUNTING, Grain.SUBTILE),
    Scheme(Method.LINKED, Grain.SUBTILE),
    Scheme(Method.COUNTING, Grain.TILE),
    Scheme(Method.LINKED, Grain.TILE),
    Scheme(Method.GLOBAL, Grain.TILE),
    Scheme(Method.LINKED, Grain.GROUP32),
    Scheme(Method.LINKED, Grain.GROUP64),
)}
RECOMMENDED = "linked-tile"


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


@numba.njit(cache=True)
def _boxes(mean, radii, cols, rows, width, height):
    box = np.empty((len(mean), 4), np.int32)
    for i in range(len(mean)):
        x0, x1 = _span(mean[i, 0] - radii[i, 0], min(mean[i, 0] + radii[i, 0], width - 1.0), SUBTILE, cols)
        y0, y1 = _span(mean[i, 1] - radii[i, 1], min(mean[i, 1] + radii[i, 1], height - 1.0), SUBTILE, rows)
        box[i] = x0, x1, y0, y1
    return box


def collect(projected, camera, tight: bool = False) -> Splats:
    """The splats of a projection in the order of memory, that is, of the scene.

    tight: boxes no larger than the ellipse alpha = 1/255 (fewer entries, the same picture; `build_lists` does not do it).
    """
    cols, rows = -(-camera.width // SUBTILE), -(-camera.height // SUBTILE)
    radii = projected.radii
    if tight:
        reach = np.sqrt(2.0 * np.log(np.maximum(projected.opacity / ALPHA_MIN, 1.0)))
        radii = np.minimum(radii, reach[:, None] * np.sqrt(projected.cov2d[:, ::2]) * (1.0 + 1e-9))
    box = _boxes(projected.mean, radii, cols, rows, camera.width, camera.height)
    here = np.flatnonzero((box[:, 1] > box[:, 0]) & (box[:, 3] > box[:, 2]))
    here = here[np.argsort(projected.index[here], kind="stable")]
    return Splats(projected.depth[here].view(np.uint32), np.ascontiguousarray(box[here]), here, cols, rows)


# ---- building lists ----------------------------------------------------------------------------


@numba.njit(cache=True)
def _count(order, box, block, cols, rows):
    """Entries of every list."""
    bcols = (cols + block - 1) // block
    count = np.zeros(bcols * ((rows + block - 1) // block), np.int64)
    for r in order:
        for y in range(box[r, 2] // block, (box[r, 3] - 1) // block + 1):
            for x in range(box[r, 0] // block, (box[r, 1] - 1) // block + 1):
                count[y * bcols + x] += 1
    return count


@numba.njit(cache=True)
def _way(held, age, first, ways, which):
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
                w = _way(held, age, ((y % sets_y) * sets_x + x % sets_x) * ways, ways, t)
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
                w = _way(held, age, ((y % sets_y) * sets_x + x % sets_x) * ways, ways, t)
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
    count = _count(*args)
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


# ---- from sorted lists to the records that the cores take ---------------------------------------


@numba.njit(cache=True)
def _split(start, record, box, block, cols, rows, sub_start, sub_record):
    """Sub-tile lists out of sorted lists of a grain, by mask."""
    bcols = (cols + block - 1) // block
    fill = sub_start[:-1].copy()
    for t in range(len(start) - 1):
        x0 = t % bcols * block
        y0 = t // bcols * block
        for e in range(start[t], start[t + 1]):
            r = record[e]
            for y in range(max(y0, box[r, 2]), min(y0 + block, box[r, 3])):
                for x in range(max(x0, box[r, 0]), min(x0 + block, box[r, 1])):
                    s = y * cols + x
                    sub_record[fill[s]] = r
                    fill[s] += 1


@numba.njit(cache=True)
def _fetches(walk, start, record, box, block, cols, rows, limit, out, deepest):
    """Records in the order in which they are fetched. deepest: entries of each list up to the last one needed.

    limit: entries of each sub-tile that are fetched. Within a tile every record once (block >= 2), else once a sub-tile, the
    four lists entry by entry in turn.
    """
    bcols = (cols + block - 1) // block
    n = 0
    if block == 1:
        for first in range(0, len(walk)):
            t = walk[first]
            deepest[t] = min(limit[t], start[t + 1] - start[t])
        first = 0
        while first < len(walk):
            tile = (walk[first] // cols // 2, walk[first] % cols // 2)
            last = first
            most = 0
            while last < len(walk) and (walk[last] // cols // 2, walk[last] % cols // 2) == tile:
                most = max(most, deepest[walk[last]])
                last += 1
            for e in range(most):
                for k in range(first, last):
                    t = walk[k]
                    if e < deepest[t]:
                        out[n] = record[start[t] + e]
                        n += 1
            first = last
        return n
    seen = np.zeros(4, np.int64)
    for t in walk:
        x0 = t % bcols * block
        y0 = t // bcols * block
        for ty in range(y0, min(y0 + block, rows), 2):
            for tx in range(x0, min(x0 + block, cols), 2):
                seen[:] = 0
                for e in range(start[t], start[t + 1]):
                    r = record[e]
                    wanted = False
                    for y in range(max(ty, box[r, 2]), min(ty + 2, box[r, 3], rows)):
                        for x in range(max(tx, box[r, 0]), min(tx + 2, box[r, 1], cols)):
                            k = (y - ty) * 2 + x - tx
                            if seen[k] < limit[y * cols + x]:
                                wanted = True
                            seen[k] += 1
                    if wanted:
                        out[n] = r
                        n += 1
                        deepest[t] = max(deepest[t], e - start[t] + 1)
    return n


@numba.njit(cache=True)
def _misses(sequence, sets, ways, out):
    """Accesses that miss a set-associative cache with least-recently-used replacement."""
    held = np.full(sets * ways, -1, np.int64)
    age = np.zeros(sets * ways, np.int64)
    n = 0
    for i in range(len(sequence)):
        r = sequence[i]
        w = _way(held, age, (r % sets) * ways, ways, r)
        if held[w] != r:
            held[w] = r
            out[n] = r
            n += 1
        age[w] = i
    return n


@numba.njit(parallel=True, cache=True)
def _consumed(mean, conic, cov, opacity, reach, start, entry, cols, width, height, out):
    for s in numba.prange(len(start) - 1):
        left = s % cols * SUBTILE
        top = s // cols * SUBTILE
        right = min(left + SUBTILE, width)
        bottom = min(top + SUBTILE, height)
        live = (right - left) * (bottom - top)
        t = np.ones((SUBTILE, SUBTILE))
        out[s] = start[s + 1] - start[s]
        for e in range(start[s], start[s + 1]):
            i = entry[e]
            for y in range(top, bottom):
                dy = y - mean[i, 1]
                if dy * dy > 2.0 * reach[i] * cov[i, 2] * (1.0 + 1e-9):
                    continue
                for x in range(left, right):
                    if t[y - top, x - left] < 0.0:
                        continue
                    dx = x - mean[i, 0]
                    weight = 0.5 * (conic[i, 0] * dx * dx + conic[i, 2] * dy * dy) + conic[i, 1] * dx * dy
                    if weight < 0.0 or weight > reach[i]:
                        continue
                    alpha = min(ALPHA_MAX, opacity[i] * np.exp(-weight))
                    if alpha < ALPHA_MIN:
                        continue
                    after = t[y - top, x - left] * (1.0 - alpha)
                    if after < TRANSMITTANCE_MIN:
                        t[y - top, x - left] = -1.0
                        live -= 1
                    else:
                        t[y - top, x - left] = after
            if live == 0:
                out[s] = e - start[s] + 1
                break


def consumed(projected, lists) -> np.ndarray:
    """int64 (S,): entries of each sub-tile list up to the one that finishes its last pixel (all, where pixels stay open), in float64."""
    out = np.empty(len(lists.start) - 1, np.int64)
    reach = np.log(projected.opacity / ALPHA_MIN) + 1e-9
    _consumed(projected.mean, projected.conic, projected.cov2d, projected.opacity, reach, lists.start, lists.entry,
              lists.cols, lists.width, lists.height, out)
    return out


@numba.njit(cache=True)
def _broadcast(start, record, box, block, cols, rows, needed, service, depth):
    """Cycles until the last core is done; see `broadcast_cycles`. start, record: lists of whole tiles or groups, sorted."""
    bcols = (cols + block - 1) // block
    finish = np.zeros((4, depth))  # when the records last handed to a core are done, a ring
    given = np.zeros(4, np.int64)
    free = np.zeros(4)
    seen = np.zeros(4, np.int64)
    sent = 0.0
    for t in range(len(start) - 1):
        x0 = t % bcols * block
        y0 = t // bcols * block
        for ty in range(y0, min(y0 + block, rows), 2):
            for tx in range(x0, min(x0 + block, cols), 2):
                seen[:] = 0
                for e in range(start[t], start[t + 1]):
                    r = record[e]
                    at = sent + 1.0
                    taken = False
                    for step in range(2):  # when there is room everywhere; then hand out
                        for y in range(max(ty, box[r, 2]), min(ty + 2, box[r, 3], rows)):
                            for x in range(max(tx, box[r, 0]), min(tx + 2, box[r, 1], cols)):
                                k = (y - ty) * 2 + x - tx
                                s = y * cols + x
                                if seen[k] < needed[s]:
                                    slot = given[k] % depth
                                    if step == 0:
                                        taken = True
                                        at = max(at, finish[k, slot])
                                    else:
                                        free[k] = max(free[k], at) + service[s]
                                        finish[k, slot] = free[k]
                                        given[k] += 1
                                if step == 1:
                                    seen[k] += 1
                    if taken:
                        sent = at
    return max(free.max(), sent)


def broadcast_cycles(splats: Splats, needed: np.ndarray, subtile_cycles: np.ndarray, depth: int, grain: Grain = Grain.TILE) -> int:
    """Cycles of the rendering stage when the records of a tile are broadcast and every core queues `depth` of them.

    A record is sent, one a cycle, once every core that takes it has room; a core works on it for the average of its sub-tile,
    subtile_cycles (S,) / needed. With a deep queue the cores are independent, with a shallow one the slowest sub-tile of a tile holds up the
    others, as a barrier would.
    """
    if depth < 1:
        raise FlickerError(f"broadcast: depth must be at least 1, not {depth}")
    block = int(grain)
    count = _count(np.arange(len(splats)), splats.box, block, splats.cols, splats.rows)
    start = np.concatenate([[0], np.cumsum(count)])
    record = np.empty(start[-1], np.int64)
    number = np.empty(int(splats.projected.max(initial=-1)) + 1, np.int64)
    number[splats.projected] = np.arange(len(splats))
    near_to_far = number[np.sort(splats.projected)]
    _fill_lists(near_to_far, splats.box, block, splats.cols, start, record)
    service = subtile_cycles / np.maximum(needed, 1)
    return int(np.ceil(_broadcast(start, record, splats.box, block, splats.cols, splats.rows, needed, service, depth)))


@numba.njit(cache=True)
def _fill_lists(order, box, block, cols, start, record):
    bcols = (cols + block - 1) // block
    fill = start[:-1].copy()
    for r in order:
        for y in range(box[r, 2] // block, (box[r, 3] - 1) // block + 1):
            for x in range(box[r, 0] // block, (box[r, 1] - 1) // block + 1):
                record[fill[y * bcols + x]] = r
                fill[y * bcols + x] += 1


@dataclass(eq=False)
class SchemeResult:
    """What a scheme did.

    start, record: the sub-tile lists it ends with, sorted; record numbers of `Splats`. entries: entries of its own lists. longest: its longest list.
    streams: DRAM traffic, back: names of the streams of the rendering phase (the others belong to preprocessing).
    cycles: of each step. build_cycles, sort_cycles: what its steps take in the two phases. on_chip: bytes by purpose. fetched: records
    handed to the cores; missed: those read from DRAM. early_stop: entries of the sub-tile lists never asked for.
    """

    scheme: Scheme
    start: np.ndarray
    record: np.ndarray
    entries: int
    longest: int
    streams: list[Stream]
    back: tuple[str, ...]
    cycles: dict[str, int]
    build_cycles: int
    sort_cycles: int
    on_chip: dict[str, int]
    fetched: int
    missed: int
    early_stop: int

    def bytes(self) -> int:
        """Bytes moved."""
        return sum(s.moved_bytes for s in self.streams)


@dataclass(frozen=True)
class Addresses:
    """Byte addresses of the arrays in DRAM that the schemes touch."""

    records: int = 1 << 30
    boxes: int = (1 << 30) + (1 << 28)
    runs: int = (1 << 30) + (2 << 28)
    lists: int = (1 << 30) + (3 << 28)


def run_scheme(
    splats: Splats, scheme: Scheme, needed: np.ndarray | None = None, addresses: Addresses = Addresses(), ahead: int = c.QUEUE_REFERENCES
) -> SchemeResult:
    """Execute a scheme. needed: entries of each sub-tile list that rendering takes (`consumed`), None for all.

    ahead: entries fetched beyond the one that finishes a sub-tile, in the worst case a full queue.
    """
    block, cols, rows = int(scheme.grain), splats.cols, splats.rows
    total = len(splats)
    streams: list[Stream] = []
    cycles: dict[str, int] = {}
    units = c.SORTING_UNITS
    cores = c.PREPROCESSING_CORES * c.ENTRIES_PER_CYCLE
    order = np.arange(total)
    key = splats.key
    if scheme.key_bits < c.KEY_BITS:
        key = quantised_key(key.view(np.float32), scheme.key_bits, "linear")
    if scheme.method is Method.GLOBAL:
        one = sort_lists(np.array([0, total]), key, order, capacity=max(total, c.SORT_LANES))
        order = one.record[::-1].copy()
        size = scheme.key_bits + c.ID_BITS
        runs = -(-total // scheme.sort_capacity)
        passes = int(merge_passes(runs, 1, c.MERGE_WAYS))
        inner = max(int(merge_passes(min(total, scheme.sort_capacity), c.SORT_LANES, c.MERGE_WAYS)), 1)
        streams.append(Stream.span("run write", addresses.runs, total * size // 8 * (passes + 1), WRITE))
        streams.append(Stream.span("run read", addresses.runs, total * size // 8 * (passes + 1), READ))
        # Runs by all units, so the passes but the last, which one merge tree does alone.
        cycles["global sort"] = total * inner // units + total * max(passes - 1, 0) // units + (total if passes else 0)
    lists = build(splats, scheme, order, addresses.lists)
    entries = len(lists.record)
    count = np.diff(lists.start)
    cycles["emit entries"] = -(-entries // cores)
    if scheme.method is Method.COUNTING:
        cycles["count entries"] = -(-entries // cores)
        streams += [Stream.span("box write", addresses.boxes, total * c.BOX_BYTES, WRITE),
                    Stream.span("box read", addresses.boxes, total * c.BOX_BYTES, READ)]
    streams += lists.writes

    full = np.zeros(cols * rows, np.int64)
    sub_count = _count(np.arange(total), splats.box, 1, cols, rows)
    sub_start = np.concatenate([[0], np.cumsum(sub_count)])
    limit = sub_count if needed is None else np.minimum(sub_count, needed + ahead)
    if needed is not None and needed.shape != full.shape:
        raise FlickerError(f"lists: needed has shape {needed.shape}, not {full.shape}")

    if scheme.method is Method.GLOBAL:
        tag_record, busy, reads = lists.record, np.zeros(len(count), np.int64), (count > 0).astype(np.int64)
    else:
        done = sort_lists(lists.start, key[lists.record], lists.record, capacity=scheme.sort_capacity)
        tag_record, busy, reads = done.record, done.busy, done.reads
    sub_record = np.empty(sub_start[-1], np.int64)
    _split(lists.start, tag_record, splats.box, block, cols, rows, sub_start, sub_record)
    out, deepest = np.empty(sub_start[-1], np.int64), np.zeros(len(count), np.int64)
    fetched = out[: _fetches(lists.walk, lists.start, tag_record, splats.box, block, cols, rows, limit, out, deepest)]
    if scheme.method is not Method.GLOBAL and (count > scheme.sort_capacity).any():
        done = sort_lists(lists.start, key[lists.record], lists.record, deepest, capacity=scheme.sort_capacity)
        busy, reads = done.busy, done.reads

    # Reading the lists. Sorted chains stop where rendering stops; others are read whole, long ones once a depth chunk.
    if scheme.method is Method.COUNTING:
        lines = np.diff(lists.line_start)[lists.walk]
        first = addresses.lists + lists.line_start[:-1][lists.walk] * c.LINE_BYTES
        times = reads[lists.walk]
        read = Stream.ranges("list read", np.repeat(first, times), np.repeat(lines * c.LINE_BYTES, times), READ)
        read.used_bytes = int((count * reads).sum()) * scheme.entry_bits // 8
    else:
        chain = lists.chain[lists.walk]
        begin = np.concatenate([[0], np.cumsum(chain)])[:-1]
        if scheme.method is Method.GLOBAL:
            share = deepest / np.maximum(count, 1)  # chunks are filled unevenly; a list's are taken to be alike
            taken = np.ceil(share[lists.walk] * chain).astype(np.int64)
            times = np.ones(len(chain), np.int64)
        else:
            taken, times = chain, reads[lists.walk]
        begin, taken = np.repeat(begin, times), np.repeat(taken, times)
        place = np.repeat(begin - np.cumsum(taken) + taken, taken) + np.arange(taken.sum())
        read = Stream.items("list read", addresses.lists, c.CHUNK_BYTES, lists.chunks[place], READ)
        used = deepest if scheme.method is Method.GLOBAL else count * reads
        read.used_bytes = int(used.sum()) * scheme.entry_bits // 8
        cycles["chain latency"] = int(taken.sum()) * c.DRAM_LATENCY_CYCLES // c.LISTS_IN_FLIGHT
    streams.append(read)
    missed = fetched
    if scheme.record_cache_bytes:
        sets = scheme.record_cache_bytes // c.RECORD_BYTES // c.RECORD_CACHE_WAYS
        keep = np.empty(len(fetched), np.int64)
        missed = keep[: _misses(fetched, sets, c.RECORD_CACHE_WAYS, keep)]
    burst = addresses.records // c.LINE_BYTES + missed * (c.RECORD_BYTES // c.LINE_BYTES)
    streams.append(Stream("record read", burst, np.full(len(burst), READ, np.int8), len(burst) * c.RECORD_BYTES))

    if scheme.method is not Method.GLOBAL:
        place = np.arange(len(count)) if block > 1 else (np.arange(len(count)) // cols % 2) * 2 + np.arange(len(count)) % cols % 2
        cycles["sort"] = int(np.bincount(place % units, busy, units).max())
    if block > 2:
        tiles = (block // 2) ** 2
        cycles["filter by mask"] = int((deepest * tiles).sum()) // c.FILTER_ENTRIES_PER_CYCLE
    cycles["hand out records"] = len(fetched) if block > 1 else -(-len(fetched) // 4)

    line = c.LINE_BYTES if scheme.method is Method.COUNTING else c.CHUNK_BYTES
    on_chip = {
        "list pointers": len(count) * c.POINTER_BYTES,
        "write combining": scheme.combiner_sets * scheme.combiner_ways * (line + c.POINTER_BYTES),
        "sort buffers": units * 2 * scheme.sort_capacity * max(scheme.entry_bits, scheme.key_bits + c.ID_BITS) // 8,
        "record cache": scheme.record_cache_bytes + scheme.record_cache_bytes // c.RECORD_BYTES * 3,
        "record queues": CORES * c.QUEUE_REFERENCES * c.REFERENCE_BYTES,
        "parameter buffers": c.GEOMETRY_BUFFER_BYTES,
    }
    front = cycles["emit entries"] + cycles.get("count entries", 0) + cycles.get("global sort", 0)
    back = max(cycles.get(k, 0) for k in ("sort", "chain latency", "filter by mask", "hand out records"))
    return SchemeResult(
        scheme, sub_start, sub_record, entries, int(count.max(initial=0)), streams, ("list read", "record read"), cycles, front, back,
        on_chip, len(fetched), len(missed), int((sub_count - limit).sum()),
    )
