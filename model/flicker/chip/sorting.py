"""Sorting unit and depth keys.

A unit sorts one list: runs of `SORT_LANES` through the bitonic network of `rtl/sort` (one vector a cycle), then
passes of a merge tree with `MERGE_WAYS` inputs (one entry a cycle). It holds `SORT_CAPACITY` entries. A longer list
is sorted in depth chunks, nearest first: every pass reads the list, drops what earlier passes delivered and keeps the
nearest `SORT_CAPACITY` of the rest, so a list that ends early never pays for its far chunks and no list is too long.
Equal keys come out in the order of the records, because the record number follows the key in the comparison.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..errors import FlickerError
from . import constants as c


def network_stages(lanes: int) -> int:
    """Compare-exchange stages of the bitonic network (docs/reference/bitonic_sorter.md)."""
    n = lanes.bit_length() - 1
    return n * (n + 1) // 2


def network_latency(lanes: int = c.SORT_LANES, stages_per_reg: int = c.SORT_STAGES_PER_REG) -> int:
    """Cycles from a vector in to the sorted vector out."""
    return -(-network_stages(lanes) // stages_per_reg)


@numba.njit(cache=True)
def merge_passes(n, lanes, ways):
    """Passes of the merge tree over n entries."""
    runs = (n + lanes - 1) // lanes
    passes = 0
    while runs > 1:
        runs = (runs + ways - 1) // ways
        passes += 1
    return passes


@numba.njit(cache=True)
def unit_cycles(n, lanes, ways):
    """Cycles a unit is busy with a list of n <= SORT_CAPACITY entries.

    The network forms the runs of the next list meanwhile. Every pass moves n entries and drains a tree of log2(ways) levels.
    """
    if n == 0:
        return 0
    levels = 0
    while 1 << levels < ways:
        levels += 1
    return max(merge_passes(n, lanes, ways), 1) * (n + levels)


@numba.njit(cache=True)
def _network(x, first, lanes):
    """The bitonic network on x[first:first + lanes], stages as in flk_bitonic_sorter."""
    merge = 0
    while 2 << merge <= lanes:
        run = 2 << merge
        for step in range(merge + 1):
            distance = 1 << (merge - step)
            for i in range(lanes):
                if i & distance:
                    continue
                a = x[first + i]
                b = x[first + i + distance]
                down = (i & run) != 0 and run < lanes
                if (a > b) != down:
                    x[first + i] = b
                    x[first + i + distance] = a
        merge += 1


@numba.njit(cache=True)
def _sort(x, y, n, lanes, ways):
    """Sort x[:n] as the unit does; x and y have room for n rounded up to lanes. The result is in x."""
    padded = (n + lanes - 1) // lanes * lanes
    for i in range(n, padded):
        x[i] = np.uint64(0xFFFFFFFFFFFFFFFF)
    for first in range(0, padded, lanes):
        _network(x, first, lanes)
    run = lanes
    head = np.empty(ways, np.int64)
    while run < n:
        for first in range(0, n, run * ways):
            last = min(first + run * ways, n)
            parts = (last - first + run - 1) // run
            for w in range(parts):
                head[w] = first + w * run
            for i in range(first, last):
                best = -1
                for w in range(parts):
                    if head[w] < min(first + (w + 1) * run, last) and (best < 0 or x[head[w]] < x[head[best]]):
                        best = w
                y[i] = x[head[best]]
                head[best] += 1
        for i in range(n):
            x[i] = y[i]
        run *= ways


@numba.njit(cache=True)
def _sort_lists(start, tag, needed, lanes, ways, capacity, busy, reads):
    """Sort every list of tags in place, as far as needed; busy, reads: cycles and times the list was read."""
    room = (capacity + lanes - 1) // lanes * lanes
    x = np.empty(room, np.uint64)
    y = np.empty(room, np.uint64)
    kept = np.empty(capacity, np.uint64)
    merged = np.empty(capacity, np.uint64)
    for s in range(len(start) - 1):
        low = start[s]
        n = start[s + 1] - low
        if n <= capacity:
            for i in range(n):
                x[i] = tag[low + i]
            _sort(x, y, n, lanes, ways)
            for i in range(n):
                tag[low + i] = x[i]
            busy[s] = unit_cycles(n, lanes, ways)
            reads[s] = 1 if n > 0 else 0
            continue
        source = tag[low : low + n].copy()
        done = 0
        while done < n and (done == 0 or done < needed[s]):
            count = 0
            fresh = 0
            for i in range(n + 1):
                if i < n and (done == 0 or source[i] > tag[low + done - 1]):
                    x[fresh] = source[i]
                    fresh += 1
                if fresh == capacity or (i == n and fresh > 0):
                    _sort(x, y, fresh, lanes, ways)
                    busy[s] += unit_cycles(fresh, lanes, ways)
                    a = b = 0
                    total = min(count + fresh, capacity)
                    for k in range(total):
                        if b >= fresh or (a < count and kept[a] < x[b]):
                            merged[k] = kept[a]
                            a += 1
                        else:
                            merged[k] = x[b]
                            b += 1
                    for k in range(total):
                        kept[k] = merged[k]
                    busy[s] += total if count else 0
                    count = total
                    fresh = 0
            reads[s] += 1
            if count == 0:
                break  # only when entries are equal, which records of one list never are
            for k in range(count):
                tag[low + done + k] = kept[k]
            done += count
        if done < n:  # what nobody asked for: the rest, in no order
            limit = tag[low + done - 1]
            for i in range(n):
                if source[i] > limit:
                    tag[low + done] = source[i]
                    done += 1


@dataclass
class Sorted:
    """tag: uint64 (E,), key << 32 | record, in order within each list. busy: int64 (L,) cycles; reads: int64 (L,) times read."""

    tag: np.ndarray
    busy: np.ndarray
    reads: np.ndarray

    @property
    def record(self) -> np.ndarray:
        """int64 (E,): record numbers in order."""
        return (self.tag & np.uint64(0xFFFFFFFF)).astype(np.int64)


def sort_lists(
    start: np.ndarray, key: np.ndarray, record: np.ndarray, needed: np.ndarray | None = None,
    lanes: int = c.SORT_LANES, ways: int = c.MERGE_WAYS, capacity: int = c.SORT_CAPACITY,
) -> Sorted:
    """Sort lists (entries start[s]:start[s + 1] of key, uint32, and record) by (key, record).

    needed: int64 (L,), entries that will be asked for; depth chunks beyond them stay unsorted. All by default.
    """
    if lanes < 2 or lanes & (lanes - 1) or ways < 2 or capacity < lanes:
        raise FlickerError(f"sorting unit: lanes {lanes}, ways {ways}, capacity {capacity}")
    tag = key.astype(np.uint64) << np.uint64(32) | record.astype(np.uint64)
    busy, reads = np.zeros((2, len(start) - 1), np.int64)
    needed = np.diff(start) if needed is None else needed
    _sort_lists(start.astype(np.int64), tag, needed.astype(np.int64), lanes, ways, capacity, busy, reads)
    return Sorted(tag, busy, reads)


# ---- depth keys --------------------------------------------------------------------------------

KEY_KINDS = ("float32", "linear", "log", "fp16")


def quantised_key(depth: np.ndarray, bits: int, kind: str = "float32") -> np.ndarray:
    """uint32 keys of `bits` bits, in the order of the depths (float32, > 0), equal where the format cannot tell them apart.

    float32: the upper bits of the float32 pattern without its sign. linear: fixed point between the nearest and the farthest
    depth of the frame. log: the same for the logarithm. fp16: the depth rounded to FP16 (bits is ignored).
    """
    depth = np.asarray(depth, np.float32)
    if kind == "fp16":
        with np.errstate(over="ignore"):  # beyond 65504: infinity, the largest key
            return depth.astype(np.float16).view(np.uint16).astype(np.uint32)
    if not 1 <= bits <= 31:
        raise FlickerError(f"depth key: {bits} bits, not 1 to 31")
    if kind == "float32":
        return depth.view(np.uint32) >> np.uint32(31 - bits)
    if kind not in KEY_KINDS:
        raise FlickerError(f"depth key: kind must be one of {', '.join(KEY_KINDS)}, not {kind}")
    value = depth.astype(np.float64)
    if len(value) == 0:
        return value.astype(np.uint32)
    value = np.log(value) if kind == "log" else value
    extent = max(value.max() - value.min(), np.finfo(np.float64).tiny)
    return np.minimum((value - value.min()) / extent * 2.0**bits, 2.0**bits - 1).astype(np.uint32)
