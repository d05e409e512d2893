"""How tile lists may lie in DRAM: writers executed entry by entry, readers with the dependence of a chain on what has arrived.

Four writers, one for each parity of tile column and row, take an entry a cycle each, collect entries in a combiner of 64-byte lines (nine entries of 52 bits
and a header of 44) and write every line once, to a pool of their own. A list is a chain of chunks of `lines` lines; the header of a chunk's first line has
the link, so it is known when that line has arrived. docs/results/lists.md has the results; `flicker.golden.lists` is the layout chosen, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numba
import numpy as np

from ..errors import FlickerError
from ..front.entries import TileEntries, tile_entries
from ..front.projection import NEAR
from . import constants as c
from .cull import cull, planes
from .dram import WRITE, DramConfig, simulate
from .frame import Prepared

LINE = 64
KEY_BITS = 24
WRITERS = 4
DIRECTORY_LINKS = 20  # chunk numbers in a line of a directory: 24 bits each and a link
_REGION = 1 << 22  # lines from pool to pool


class Chain(IntEnum):
    """What leads from chunk to chunk."""

    NEWEST = 0  # a chunk points to the one before; the pointer names the newest
    FORWARD = 1  # a chunk points to the next, which is reserved when the chunk is begun; the pointer names the oldest
    GROWING = 2  # as NEWEST; a list's chunks have 1, 1, 2, 4, ... lines up to `lines`
    DIRECTORY = 3  # lines of 20 chunk numbers and a link; the pointer names the newest of them
    STREAM = 4  # no chain: a list's lines lie together, as if its length had been known (a bound, no design)


class Replace(IntEnum):
    """Line of a full set that has to go."""

    LRU = 0
    ROUND_ROBIN = 1
    FULLEST = 2


@dataclass(frozen=True)
class ListLayout:
    """lines: of a chunk (the largest, where chunks grow). sets_x, sets_y, ways: combiner of one writer. bins: depth bins, a list each.

    mixed: the pools lie chunk by chunk among each other, not one after the other. quantiles: bins hold equal shares of the Gaussians of the kept clusters,
    else equal ranges of the key.
    """

    lines: int = 8
    chain: Chain = Chain.NEWEST
    sets_x: int = 8
    sets_y: int = 8
    ways: int = 4
    replace: Replace = Replace.ROUND_ROBIN
    bins: int = 1
    quantiles: bool = False
    mixed: bool = True

    def __post_init__(self) -> None:
        for name in ("lines", "sets_x", "sets_y", "ways", "bins"):
            if (value := getattr(self, name)) < 1 or value & (value - 1):
                raise FlickerError(f"list layout: {name} must be a power of two, not {value}")

    @property
    def combiner_bytes(self) -> int:
        """The four combiners: a line with tag, count and age, 12 + 4 + 2 bits (a bit more of tag for each doubling of bins)."""
        return WRITERS * self.sets_x * self.sets_y * self.ways * (LINE * 8 + 18 + self.bins.bit_length() - 1) // 8

    def pointer_bytes(self, tiles: int) -> int:
        """28 bits a list: chunk number and lines used in it. A forward chain needs the oldest and the reserved chunk too; of a directory the open line is
        kept."""
        bits = {Chain.FORWARD: 28 + 48, Chain.DIRECTORY: 28 + LINE * 8, Chain.STREAM: 0}.get(self.chain, 28)
        return tiles * self.bins * bits // 8


@dataclass(eq=False)
class Keyed:
    """Entries of a view with what layouts and readers need.

    key: uint32 (S,) of each splat, fixed point of 24 bits between the depths that the kept clusters bound. depth: float64 (S,). needed: int64 (T,), entries
    of each tile's sorted list up to the one that finishes its last pixel. quantiles: int64 (256,), key below which k / 256 of the Gaussians of kept clusters
    lie, each cluster taken to be spread evenly in depth.
    """

    entries: TileEntries
    key: np.ndarray
    depth: np.ndarray
    needed: np.ndarray
    quantiles: np.ndarray


def key_entries(prepared: Prepared) -> Keyed:
    """Entries by the exact test, keys and bounds of a view."""
    camera, projected, lists, clusters = prepared.view.camera, prepared.view.projected, prepared.lists, prepared.clusters
    entries = tile_entries(projected, prepared.splats.projected, camera)
    normal = planes(camera)[0][0]
    keep = cull(clusters, camera)
    low, high = clusters.low[keep].astype(np.float64), clusters.high[keep].astype(np.float64)
    middle, half = ((low + high) / 2 - camera.position) @ normal, (high - low) / 2 @ np.abs(normal)
    near, far = np.maximum(middle - half, NEAR), np.maximum(middle + half, NEAR)
    z0, z1 = (float(near.min()), float(far.max())) if len(near) else (NEAR, 2 * NEAR)
    scale = (1 << KEY_BITS) / max(z1 - z0, 1e-30)
    depth = projected.depth[prepared.splats.projected].astype(np.float64)
    key = np.clip((depth - z0) * scale, 0, (1 << KEY_BITS) - 1).astype(np.uint32)

    # Quantiles by the clusters alone: a histogram of 256 bins, each cluster's members spread over its range.
    edge = z0 + (z1 - z0) * np.arange(257) / 256
    size = np.diff(clusters.start)[keep]
    share = np.array([(np.clip((z - near) / np.maximum(far - near, 1e-30), 0, 1) * size).sum() for z in edge]) / max(size.sum(), 1)
    quantiles = np.interp(np.arange(256) / 256, share, np.arange(257) * (1 << KEY_BITS) / 256).astype(np.int64)

    # `projected` is sorted by depth, so a number in it is a rank.
    count = np.diff(lists.start)
    last = np.full(len(count), -1, np.int64)
    some = count > 0
    last[some] = lists.entry[lists.start[:-1][some] + prepared.needed[some] - 1]
    reach = np.full(entries.cols * entries.rows, -1, np.int64)
    sub = np.arange(len(count))
    np.maximum.at(reach, sub // lists.cols // 2 * entries.cols + sub % lists.cols // 2, last)
    taken = prepared.splats.projected[entries.splat] <= reach[entries.tile]
    return Keyed(entries, key, depth, np.bincount(entries.tile[taken], minlength=len(reach)), quantiles)


def bin_numbers(keyed: Keyed, layout: ListLayout) -> np.ndarray:
    """uint8 (S,): depth bin of each splat, 0 nearest."""
    step = np.arange(1, layout.bins)
    edges = keyed.quantiles[step * 256 // layout.bins] if layout.quantiles else step * (1 << KEY_BITS) // layout.bins
    return np.searchsorted(edges, keyed.key, side="right").astype(np.uint8)


# ---- writing -----------------------------------------------------------------------------------


@numba.njit(cache=True)
def _combine(splat, tile, bin_of, cols, bins, sets_x, sets_y, ways, replace, writer, line_list, line_count, line_time):
    """One writer's entries into lines: list, entries and time (number of the entry) of every line in the order of writing. Returns lines."""
    held = np.full(sets_x * sets_y * ways, -1, np.int64)
    count = np.zeros(len(held), np.int64)
    age = np.zeros(len(held), np.int64)
    turn = np.zeros(sets_x * sets_y, np.int64)
    n = 0
    for e in range(len(tile)):
        x, y = tile[e] % cols, tile[e] // cols
        if (x & 1) | (y & 1) << 1 != writer:
            continue
        b = np.int64(bin_of[splat[e]])
        which = tile[e] * bins + b
        s = ((y >> 1) & (sets_y - 1)) * sets_x + (((x >> 1) * bins + b) & (sets_x - 1))
        w = -1
        free = -1
        for k in range(s * ways, s * ways + ways):
            if held[k] == which:
                w = k
            elif held[k] < 0 and free < 0:
                free = k
        if w < 0:
            w = free
        if w < 0:
            w = s * ways
            if replace == 1:
                w += turn[s]
                turn[s] = (turn[s] + 1) % ways
            for k in range(s * ways, s * ways + ways):
                if (replace == 0 and age[k] < age[w]) or (replace == 2 and (count[k] > count[w] or (count[k] == count[w] and age[k] < age[w]))):
                    w = k
            line_list[n], line_count[n], line_time[n] = held[w], count[w], e
            n += 1
            held[w] = -1
        if held[w] < 0:
            held[w] = which
            count[w] = 0
        count[w] += 1
        age[w] = e
        if count[w] == 9:
            line_list[n], line_count[n], line_time[n] = which, 9, e
            n += 1
            held[w] = -1
    for w in range(len(held)):
        if held[w] >= 0:
            line_list[n], line_count[n], line_time[n] = held[w], count[w], len(tile) + w
            n += 1
    return n


@numba.njit(cache=True)
def _place(line_list, lines, chain, address, newest, before, first, used):
    """Places of the lines in the pool, chunks numbered as they are taken; newest: chunk of each list written last. Returns (lines taken, chunks)."""
    free = 0
    chunks = 0
    spare = np.full(len(newest), -1, np.int64)
    size = np.zeros(len(before), np.int64)
    made = np.zeros(len(newest), np.int64)
    for i in range(len(line_list)):
        t = line_list[i]
        k = newest[t]
        if k < 0 or used[k] == size[k]:
            wanted = min(lines, 1 << max(made[t] - 1, 0)) if chain == 2 else lines
            fresh = spare[t]
            for _ in range((fresh < 0) + (chain == 1)):
                if fresh < 0:
                    fresh = chunks
                else:
                    spare[t] = chunks
                first[chunks] = free
                free += wanted
                chunks += 1
            size[fresh], used[fresh], before[fresh] = wanted, 0, k
            newest[t] = fresh
            made[t] += 1
            k = fresh
        address[i] = first[k] + used[k]
        used[k] += 1
    return free, chunks


@numba.njit(cache=True)
def _follow(newest, before, first, used, forward, links, directory, start, group_first, group_size, group_wait):
    """Groups of lines in the order of reading, of every list; counts them only where `group_first` is empty. directory: its first line, in the pool."""
    filling = len(group_first) > 0
    n = 0
    for t in range(len(newest)):
        start[t] = n
        k = newest[t]
        chunks = 0
        while k >= 0:
            chunks += 1
            k = before[k]
        if not filling:
            n += chunks + ((chunks + links - 1) // links if links else 0)
            continue
        k = newest[t]
        left = chunks
        index = -1
        while k >= 0:
            if links and (left == chunks or left % links == 0):
                group_first[n], group_size[n], group_wait[n] = directory, 1, index
                index = n - start[t]
                directory += 1
                n += 1
            group_first[n], group_size[n] = first[k], used[k]
            group_wait[n] = index if links else n - start[t] - 1
            n += 1
            left -= 1
            k = before[k]
        if forward:
            for i in range((n - start[t]) // 2):
                a, b = start[t] + i, n - 1 - i
                group_first[a], group_first[b] = group_first[b], group_first[a]
                group_size[a], group_size[b] = group_size[b], group_size[a]
    start[len(newest)] = n
    return directory


@dataclass(eq=False)
class Written:
    """What the writers leave. Lists are numbered tile * bins + bin; addresses are in lines.

    address: int64, lines in the order in which they are written. pool: lines taken. start: int64 (L + 1,): list t reads its lines in the groups
    start[t]:start[t + 1] of (group_first, group_size); group_wait: the group of the list whose arrival makes it known, -1: known from the pointer. entries:
    int64 (L,). busiest: entries of the busiest writer.
    """

    address: np.ndarray
    pool: int
    start: np.ndarray
    group_first: np.ndarray
    group_size: np.ndarray
    group_wait: np.ndarray
    entries: np.ndarray
    busiest: int

    @property
    def lines(self) -> np.ndarray:
        """int64 (L,): lines that reading a list moves."""
        total = np.concatenate([[0], np.cumsum(self.group_size)])
        return total[self.start[1:]] - total[self.start[:-1]]


def write(keyed: Keyed, layout: ListLayout) -> Written:
    """Execute the four writers."""
    e, bins = keyed.entries, layout.bins
    lists = e.cols * e.rows * bins
    bin_of = bin_numbers(keyed, layout)
    entries = np.zeros(lists, np.int64)
    addresses, times, owner, groups = [], [], [], []
    pool, busiest = 0, 0
    unit = layout.lines
    for writer in range(WRITERS):
        buffers = np.empty((3, len(e) + 1), np.int64)
        n = _combine(e.splat, e.tile, bin_of, e.cols, bins, layout.sets_x, layout.sets_y, layout.ways, int(layout.replace), writer, *buffers)
        line_list, line_count, line_time = (x[:n] for x in buffers)
        mine = np.bincount(line_list, line_count, minlength=lists).astype(np.int64)
        entries += mine
        busiest = max(busiest, int(mine.sum()))
        address, start = np.empty(n, np.int64), np.empty(lists + 1, np.int64)
        if layout.chain is Chain.STREAM:
            order = np.argsort(line_list, kind="stable")
            address[order] = np.arange(n)
            size = np.bincount(line_list, minlength=lists)
            first, here, free = np.cumsum(size) - size, np.flatnonzero(size), n
            found = np.stack([first[here], size[here], np.full(len(here), -1)])
        else:
            newest = np.full(lists, -1, np.int64)
            before, first, used = np.full((3, 2 * n + 2), -1, np.int64)
            free, _ = _place(line_list, layout.lines, int(layout.chain), address, newest, before, first, used)
            links = DIRECTORY_LINKS if layout.chain is Chain.DIRECTORY else 0
            args = (newest, before, first, used, layout.chain is Chain.FORWARD, links, free, start)
            _follow(*args, *np.empty((3, 0), np.int64))
            found = np.empty((3, start[-1]), np.int64)
            end = _follow(*args, *found)
            if links:  # lines of the directory are written as their last chunk is begun; here after all others
                address = np.concatenate([address, np.arange(free, end)])
                line_time = np.concatenate([line_time, len(e) + np.arange(end - free)])
                free = end
            here = np.repeat(np.arange(lists), np.diff(start))
        if layout.mixed:
            address, found[0] = ((x // unit * WRITERS + writer) * unit + x % unit for x in (address, found[0]))
        else:
            address, found[0] = address + writer * _REGION, found[0] + writer * _REGION
        pool += free
        addresses.append(address)
        times.append(line_time)
        owner.append(here)
        groups.append(found)
    owners, found = np.concatenate(owner), np.concatenate(groups, axis=1)
    place = np.argsort(owners, kind="stable")
    address = np.concatenate(addresses)[np.argsort(np.concatenate(times), kind="stable")]
    start = np.concatenate([[0], np.cumsum(np.bincount(owners, minlength=lists))])
    first, size, wait = found[:, place]
    return Written(address, pool, start, first, size, wait, entries, busiest)


# ---- reading -----------------------------------------------------------------------------------


@numba.njit(cache=True)
def _read(walk, start, group_first, group_size, group_wait, in_flight, room, delay, channels, banks, page_lines, window, timing):
    """Clocks until the last line of the lists `walk` has arrived; see `read_cycles`. The memory's rules are those of sim/dram.hpp, written a second time for
    requests that wait for answers; the engine there takes such requests too and should replace them."""
    (rcd, rp, rp_all, ras, rrd, faw, ccd, _, rtp, _, _, _, refi, rfc, rl, _, half, dq) = timing
    far = np.int64(-1) << 40
    open_row = np.full((channels, banks), -1, np.int64)
    act_ok = np.zeros((channels, banks), np.int64)
    pre_ok = np.zeros((channels, banks), np.int64)
    col_ok = np.zeros((channels, banks), np.int64)
    acts = np.full((channels, 4), far, np.int64)
    last_col = np.full(channels, far, np.int64)
    next_ref = np.full(channels, refi, np.int64)
    over = np.zeros(channels, np.int64)
    # Requests by number: line, slot, group; on their way to a channel or back in a ring by time.
    most = in_flight * room + 1
    line = np.zeros(most, np.int64)
    slot_of = np.zeros(most, np.int64)
    group_of = np.zeros(most, np.int64)
    free = np.arange(most)
    n_free = most
    ring = 1 << 14
    going = np.full(ring, -1, np.int64)
    coming = np.full(ring, -1, np.int64)
    following = np.full(most, -1, np.int64)
    queue = np.zeros((channels, most), np.int64)
    arrived = np.zeros(most, np.int64)
    waiting = np.zeros(channels, np.int64)
    # Lists in flight.
    held = np.full(in_flight, -1, np.int64)
    group = np.zeros(in_flight, np.int64)
    offset = np.zeros(in_flight, np.int64)
    out = np.zeros(in_flight, np.int64)
    serial = np.zeros(in_flight, np.int64)
    known = np.full(len(group_first), -1, np.int64)  # latest visit in which a group has arrived
    taken = 0
    left = 0
    turn = 0
    t = np.int64(0)
    end = np.int64(0)
    while True:
        # Data that arrive.
        r = coming[t % ring]
        coming[t % ring] = -1
        while r >= 0:
            if line[r] == group_first[group_of[r]]:
                known[group_of[r]] = max(known[group_of[r]], serial[slot_of[r]])
            out[slot_of[r]] -= 1
            left -= 1
            end = t
            free[n_free] = r
            n_free += 1
            r = following[r]
        # Requests that reach their channel.
        r = going[t % ring]
        going[t % ring] = -1
        while r >= 0:
            ch = line[r] % channels
            queue[ch, waiting[ch]] = r
            arrived[r] = t
            waiting[ch] += 1
            r = following[r]
        # One request a clock, from the lists in turn.
        for step in range(in_flight):
            s = (turn + step) % in_flight
            if held[s] >= 0 and group[s] == start[held[s] + 1] and out[s] == 0:
                held[s] = -1
            if held[s] < 0 and taken < len(walk):
                held[s] = walk[taken]
                group[s] = start[held[s]]
                offset[s] = 0
                serial[s] = taken
                taken += 1
            if held[s] < 0 or group[s] == start[held[s] + 1] or out[s] >= room:
                continue
            g = group[s]
            if group_wait[g] >= 0 and known[start[held[s]] + group_wait[g]] < serial[s]:
                continue
            n_free -= 1
            r = free[n_free]
            line[r] = group_first[g] + offset[s]
            slot_of[r] = s
            group_of[r] = g
            following[r] = going[(t + delay) % ring]
            going[(t + delay) % ring] = r
            out[s] += 1
            left += 1
            offset[s] += 1
            if offset[s] == group_size[g]:
                group[s] += 1
                offset[s] = 0
            turn = (s + 1) % in_flight
            break
        # Channels.
        for ch in range(channels):
            if waiting[ch] == 0 or t < last_col[ch] + ccd:
                continue
            if refi > 0 and t >= next_ref[ch]:
                begin = t
                for k in range(banks):
                    if open_row[ch, k] >= 0:
                        begin = max(begin, pre_ok[ch, k])
                for k in range(banks):
                    open_row[ch, k] = -1
                    act_ok[ch, k] = begin + rp_all + rfc
                while next_ref[ch] <= t:
                    next_ref[ch] += refi
            best = 0
            best_col = np.int64(1) << 60
            best_act = np.int64(-1)
            for w in range(min(waiting[ch], window)):
                r = queue[ch, w]
                page = line[r] // channels // page_lines
                row = page // banks
                b = (page % banks) ^ (row % banks)
                act = np.int64(-1)
                col = col_ok[ch, b]
                if open_row[ch, b] != row:
                    act = max(arrived[r], act_ok[ch, b])
                    if open_row[ch, b] >= 0:
                        act = max(act, max(arrived[r], pre_ok[ch, b]) + rp)
                    act = max(act, acts[ch, 3] + rrd, acts[ch, 0] + faw)
                    col = act + rcd
                col = max(col, t)
                if col < best_col:
                    best, best_col, best_act = w, col, act
                    if col == t:
                        break
                if over[ch] >= 4 * window:
                    break
            over[ch] = over[ch] + 1 if best > 0 else 0
            r = queue[ch, best]
            page = line[r] // channels // page_lines
            row = page // banks
            b = (page % banks) ^ (row % banks)
            if best_act >= 0:
                for k in range(3):
                    acts[ch, k] = acts[ch, k + 1]
                acts[ch, 3] = best_act
                open_row[ch, b] = row
                col_ok[ch, b] = best_act + rcd
                pre_ok[ch, b] = best_act + ras
            last = best_col + ccd  # a line is two bursts
            pre_ok[ch, b] = max(pre_ok[ch, b], last + rtp)
            last_col[ch] = last
            back = (last + rl + dq + half) % ring
            following[r] = coming[back]
            coming[back] = r
            waiting[ch] -= 1
            for w in range(best, waiting[ch]):
                queue[ch, w] = queue[ch, w + 1]
        if taken == len(walk) and left == 0:
            busy = False
            for s in range(in_flight):
                busy |= held[s] >= 0 and group[s] < start[held[s] + 1]
            if not busy:
                return end
        t += 1


def read_cycles(written: Written, walk: np.ndarray, latency: int, in_flight: int, room: int = 64, config: DramConfig | None = None) -> int:
    """Cycles until the lists `walk` (int64, in this order) are read, nothing else using the memory.

    in_flight lists are open at a time; of each at most `room` lines are on their way. latency: cycles from a request to its data where the memory is idle and
    the row closed. A request a DRAM clock; a group of lines is asked for once the first line of the group it waits for is there.
    """
    config = config or DramConfig()
    if config.interleave_bytes != LINE:
        raise FlickerError(f"list layout: channels must change every {LINE} bytes, not {config.interleave_bytes}")
    clocks_per_cycle = config.rate / 2 / c.CLOCK_HZ
    own = config.trcd + config.rl + config.tdqsck + 2 * config.burst_clocks
    delay = round(latency * clocks_per_cycle) - own
    if delay < 1:
        raise FlickerError(f"list layout: latency {latency} is less than the memory's own")
    t = config.timing
    timing = (t.rcd, t.rp, t.rp_all, t.ras, t.rrd, t.faw, t.ccd, t.ccd_masked, t.rtp, t.write_pre, t.write_read, t.read_write, t.refi, t.rfc, t.rl, t.wl,
              t.half, config.tdqsck)
    walk = walk[np.diff(written.start)[walk] > 0]
    if len(walk) == 0:
        return 0
    clocks = _read(np.ascontiguousarray(walk), written.start, written.group_first, written.group_size, written.group_wait, in_flight, room, delay,
                   config.channels, config.banks, config.page_bytes // LINE, config.window, timing)
    return int(np.ceil(clocks / clocks_per_cycle))


def visits(keyed: Keyed, written: Written, bins: int, early: bool, capacity: int = c.SORT_CAPACITY, ahead: int = c.QUEUE_REFERENCES) -> np.ndarray:
    """int64: lists in the order of reading, tiles row by row, bins near to far; a list longer than the sorter as often as depth chunks are asked for.

    early: with what early termination leaves out (depth chunks of a long list, far bins), `ahead` entries beyond the last one needed. Without it every list is
    read once.
    """
    count = written.entries.reshape(-1, bins)
    if not early:
        return np.flatnonzero(written.entries)
    before = np.cumsum(count, axis=1) - count
    asked = np.clip(np.minimum(keyed.needed + ahead, count.sum(axis=1))[:, None] - before, 0, count)
    asked[:, 0] = np.maximum(asked[:, 0], np.minimum(count[:, 0], 1))
    return np.repeat(np.arange(len(written.entries)), -(-asked.ravel() // capacity))


@dataclass(frozen=True)
class LayoutResult:
    """A layout on a view. Bytes: written (lines, each once), pool (taken), read once (every list once), read (with depth chunks and early termination),
    combiner, pointers.

    write_cycles: of the DRAM alone, efficiency of it. read_cycles: by (latency, lists in flight), of what is read with depth chunks and early termination;
    once_cycles: of every list once. entries, longest: of lists. busiest: entries of the busiest writer. skipped: bytes of lists that are never read. fill:
    entries of a line, on average.
    """

    layout: ListLayout
    entries: int
    longest: int
    busiest: int
    fill: float
    written: int
    pool: int
    write_cycles: int
    efficiency: float
    once: int
    read: int
    skipped: int
    once_cycles: dict[tuple[int, int], int]
    read_cycles: dict[tuple[int, int], int]
    combiner: int
    pointers: int


def evaluate_layout(keyed: Keyed, layout: ListLayout, points: tuple[tuple[int, int], ...] = ((100, 16), (200, 16)), early: bool = True) -> LayoutResult:
    """Execute a layout: writers, DRAM, readers at (latency, lists in flight). early: also the reading with depth chunks and early termination."""
    w = write(keyed, layout)
    burst = LINE // c.LINE_BYTES
    dram = simulate((w.address[:, None] * burst + np.arange(burst)).ravel(), WRITE)
    once, again = visits(keyed, w, layout.bins, False), visits(keyed, w, layout.bins, True)
    lines = w.lines
    unread = np.ones(len(lines), bool)
    unread[again] = False
    return LayoutResult(
        layout, len(keyed.entries), int(w.entries.max(initial=0)), w.busiest, len(keyed.entries) / max(int(lines.sum()), 1),
        len(w.address) * LINE, w.pool * LINE, dram.cycles, dram.efficiency,
        int(lines[once].sum()) * LINE, int(lines[again].sum()) * LINE, int(lines[unread].sum()) * LINE,
        {p: read_cycles(w, once, *p) for p in points}, {p: read_cycles(w, again, *p) for p in points} if early else {},
        layout.combiner_bytes, layout.pointer_bytes(keyed.entries.cols * keyed.entries.rows),
    )
