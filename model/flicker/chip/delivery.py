"""From sorted lists to the records that the cores take: masks, order and number of fetches, broadcast to four cores."""

from __future__ import annotations

import numba
import numpy as np

from ..errors import FlickerError
from ..params import ALPHA_MAX, ALPHA_MIN, SUBTILE, TRANSMITTANCE_MIN
from .lists import Splats, count_entries, way_of
from .schemes import Grain


@numba.njit(cache=True)
def split_by_boxes(start, record, box, block, cols, rows, sub_start, sub_record):
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
def fetches(walk, start, record, box, block, cols, rows, limit, out, deepest):
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
def misses(sequence, sets, ways, out):
    """Accesses that miss a set-associative cache with least-recently-used replacement."""
    held = np.full(sets * ways, -1, np.int64)
    age = np.zeros(sets * ways, np.int64)
    n = 0
    for i in range(len(sequence)):
        r = sequence[i]
        w = way_of(held, age, (r % sets) * ways, ways, r)
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
    count = count_entries(np.arange(len(splats)), splats.box, block, splats.cols, splats.rows)
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
