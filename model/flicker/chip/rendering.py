"""Rendering as the RTL does it (`flk_rendering`): what it moves, and an estimate of its cycles, from lists in memory to the frame buffer.

One pass over the records in the order in which delivery looks them up, each with the times at which it goes on: sorted by its unit, looked up, found (two a
cycle each, when all queues have places), taken by a core, tested, dispatched, blended. A time is the latest of what it waits for. Places, queues and latencies
are those of the RTL; masks and finishing records those of the golden model, and from them follows when a core is finished with a sub-tile and its records are
left out. Pointers and frame buffer are moved to the byte as in the RTL, lists too unless one of more than 2,048 entries is left before its end; lines
of records depend on the order of lookups, in the RTL's timing or in the one that is estimated here. docs/results/rendering.md has the estimate beside
the RTL.

Lanes have as many cycles for a sub-tile as in the stage alone, shared out evenly to the elements that it takes. Where a core has several sub-tiles, each of
them goes through the pass as if it had a core, but for its elements: those of a core are blended one after the other, and share the cycles of the tile.

Left out: conflicts of banks in the cache; in the memory, when records wait for anything but each other (their lines go to channels and banks, what else moves
takes its share of the rate and makes lists and records wait, and all together the peak rate); the order of entries within a merge, arbitration between
list readers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np

from ..explore.generators.contribution import cat_masks
from ..golden.chip import chip_walk, whole_pairs
from ..golden.delivery import TILES
from ..golden.frame_buffer import PAIR, PixelFormat, least_stride
from ..golden.lanes.lists import front_lists
from ..golden.masked import render_masked
from ..golden.render import stream_order
from ..golden.walk import borders
from ..params import CORES, LANE_ROW_MASK_STAGES, LANE_SETUP_STAGES, LINE_BITS, TILE, CatMode, RenderConfig, vru_stages
from ..perf.lanes import COLOUR, STATE, lane_work, simulate_lanes
from ..perf.long_lists import BEGIN
from ..perf.render_stage import finish_events
from ..perf.sorting import NEXT, held_entries, latency
from .constants import CLOCK_HZ, LINE_BYTES
from .dram import DramConfig, Refresh, Stream
from .tile_lists import BEAT, RECORD_LINE, TileLists

# Of the RTL, times in cycles.
CLEAR = 68  # of the record cache, at the beginning of a frame
READ = 4  # registers from a request to the port and behind it
CHAIN = 12  # from a line with a link to the request of its chunk, and to the lines that come (docs/reference/list_reader.md)
FIRST = 17  # a tile's first line beside two accesses
CONTEXTS = 4  # lists under way in a list reader
SORTED_LISTS = 8  # that a sorting unit holds, as far as its memories reach
OUTPUTS = 2  # of a buffer behind a sorting unit, places beside its memories
BUFFERED = 3  # from the sorting unit through the buffer to a lookup
MARGIN = 6  # places that have to be free in all queues for a record to come
ROOM = 4  # from a record's leaving a queue to the next one that comes
CACHE_WAYS = 4  # of the record cache
DEPTH, PLACES = 512, 256  # elements that wait in the cache, lines on their way
FOUND = 6  # from a lookup to its record without a miss, into the queue
QUEUED = 3  # through a queue
ELASTIC = 4  # registers between a queue and the stage: latency and places
TOLD = 4  # from a sub-tile's last finished pixel to delivery
TAKEN = 1  # from there to what is dropped from the core's queue,
DROP = 8  # so many records a cycle
DROPPED = 8  # from there to the end of a list that all cores have finished
PAIR_CYCLES, PAIR_GAP = 128, 4  # of tiles in the frame writer
ROUNDS = 12  # of a frame, at most: each with the share of the memory's time that what is not records has by those before, until it is the same
SETTLED = 0.005
EFFICIENCY = 0.8  # of the memory's peak rate, for that
MOST_BUSY = 0.9
# Cycles by which a line of records or lists comes later at the chip's port where what else moves takes half of the memory's time: fitted to its frames with
# 32 lanes (`make docs PART=scale_hardware`).
LOADED = 170
BESIDE = 0.8  # of the front end's bytes, which go last, count for that: fitted to frames on paths (`make docs PART=path_hardware`)
END = 60  # from the last line of a picture to its answer, beside the memory's latency

NEVER = np.int64(1) << 60


@numba.njit(cache=True)
def cache_lookup(line, tile, until, held, marks, turn, ways):
    """Whether the cache has to read a line; it has it then (`golden.delivery.RecordCache`). held, marks: int64 (sets, ways), lines (-1: none) and the tiles
    until which they are wanted; turn: int64 (sets,)."""
    at = line % held.shape[0]
    for w in range(ways):
        if held[at, w] == line:
            marks[at, w] = tile + until
            return False
    way = turn[at]
    for k in range(ways):
        w = (turn[at] + k) % ways
        if held[at, w] < 0 or (marks[at, w] - tile) % TILES > 2:
            way = w
            break
    held[at, way] = line
    marks[at, way] = tile + until
    turn[at] = (way + 1) % ways
    return True


@numba.njit(cache=True)
def _moves(line, ask, channels, interleave, page, banks, rcd, rp, ras, rrd, burst, row, activated, last, bus):
    """The cycle in which a line of records moves on its channel of the DRAM, asked for in cycle `ask`. Requests of a channel go one after the other and leave
    rows open; addresses and times are those of sim/dram.hpp, without its window and without what else moves. row, activated: by channel and bank; last
    (activation), bus: by channel; times are cycles of the chip, float64."""
    place = line * RECORD_LINE // interleave
    channel = place % channels
    number = (place // channels * interleave + line * RECORD_LINE % interleave) // page
    own = number // banks
    bank = (number ^ own) % banks
    at = ask
    if row[channel, bank] != own:
        at = max(at, last[channel] + rrd)
        if row[channel, bank] >= 0:
            at = max(at, activated[channel, bank] + ras) + rp
        row[channel, bank] = own
        activated[channel, bank] = last[channel] = at
    at = max(at, activated[channel, bank] + rcd)
    bus[channel] = max(at, bus[channel] + burst)
    return bus[channel]


@numba.njit(cache=True)
def _issue(t, k, depth, recent, arrived, left, count, written, popped, entries):
    """The first cycle from t on in which core k's mask generator may take a batch: its pipeline moves, and no feature FIFO is full."""
    ring, fifo = arrived.shape[1], written.shape[2]
    moved = True
    while moved:
        moved = False
        for i in range(max(count - recent, 0), count):
            if arrived[k, i % ring] <= t < left[k, i % ring]:
                t = left[k, i % ring]
                moved = True
        for c in range(4):
            q = entries[k, c] - 1
            while q >= 0 and q > entries[k, c] - recent and written[k, c, q % fifo] >= t:
                q -= 1
            if q >= depth - 1:
                free = popped[k, c, (q - depth + 1) % fifo]
                if free >= t:
                    t = free + 1
                    moved = True
    return t


@numba.njit(cache=True)
def _frame(
    tile_start, record, mask, border, lines_start, chunk_entries, sort_delay, batch_start, batch_size, batch_given, batch_delay, element_start, element_mask,
    element_cycles, finish, finish_op, listed, per_line, sets, ways, read_latency, line_latency, refresh, reads, early, ctu_latency, ctu_fifo, one_token,
    depth, blend, out_delay, served, needed, base, memory, gap, sizes, cores, missed,
):
    """Cycles of a frame; lines of records; batches of each list that are given (T,); records given to each core of each tile (T, 4). missed: takes the lines
    of records in the order in which they are read.

    Arrays over tiles in the order of the walk (T; `border` (T, 2), of `walk.borders`), their entries, the chunks of their lists (`lines_start`, entries of
    each), batches of their lists, and the elements of the cores' streams (`element_start` (T, 4)). served, needed (T, 4): cycles that a core has for so many
    elements of a tile. refresh: (period, length) of the memory's, cycles, or zeros. base: line of the first record; memory: of `_moves`, channels 0 for one
    without banks. gap: cycles from line to line of records at the port. sizes: entries in a
    sorting unit's steps, cycles from the end of a list that it does not hold to the first request for its runs, chunks in a list reader, entries that wait
    behind a sorting unit, records in a core's queue, pairs of tiles in the frame writer, sorting units. cores: that share the four sub-tiles of a tile.
    """
    tiles = len(tile_start) - 1
    ring = 256
    sorted_held, back, slots, buffer, queue, held_pairs, units = sizes
    # Sorting units: by tile, since unit i takes tiles i, i + units, ...
    gate_end = np.zeros(tiles, np.int64)
    out_begin, out_end = np.zeros((2, tiles), np.int64)
    chunk_free = np.zeros((4, 64), np.int64)
    chunk_count = np.zeros(4, np.int64)
    batches = np.zeros(tiles, np.int64)
    given = np.zeros((tiles, 4), np.int64)
    # Delivery
    tile, at = 0, np.int64(0)  # at: entry
    looked, looked_before = np.int64(0), np.int64(0)  # the last lookup, and the one before
    begun = False
    ready = np.int64(0)  # what is left of the list's present chunk is sorted from here on
    part = 0  # batch of a list that comes in several
    part_end = np.int64(0)  # its last entry
    part_gate = np.int64(0)  # when all of the batch has been given
    gave = np.zeros((tile_start[1:] - tile_start[:-1]).max() + 1, np.int64)  # of a list with batches: when so many entries have left the unit
    # Buffers: when the unit gave its last entry, and when entries were taken
    emitted = np.zeros(4, np.int64)
    removed, removals = np.zeros((4, buffer), np.int64), np.zeros(4, np.int64)
    # Queues: when found; element in its list, or -1, the end; when taken
    found = np.zeros((4, queue), np.int64)
    which = np.zeros((4, queue), np.int64)
    freed = np.zeros((4, queue), np.int64)
    put, got = np.zeros(4, np.int64), np.zeros(4, np.int64)
    dropped = np.zeros(4, np.int64)  # of the core's sub-tile, from its queue
    # Cache
    held = np.full((sets, ways), -1, np.int64)
    turn = np.zeros(sets, np.int64)
    marks = np.zeros((sets, ways), np.int64)
    channels, banks = memory[0], memory[3]
    open_row, activated = np.full((channels, banks), -1, np.int64), np.full((channels, banks), -1e9)
    last_activated, bus = np.full(channels, -1e9), np.full(channels, -1e9)
    lookups, misses = 0, 0
    last_found, found_before, last_line, last_ask = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    found_at = np.zeros(DEPTH, np.int64)
    line_at = np.zeros(PLACES, np.int64)
    line_used = np.zeros(PLACES, np.int64)
    # Cores
    core_tile = np.zeros(4, np.int64)
    finished = np.full(4, NEVER, np.int64)  # time from which delivery knows, of the core's tile
    taken = np.zeros(4, np.int64)
    accepted = np.zeros((4, ring), np.int64)
    count = np.zeros(4, np.int64)  # elements that the generator has issued
    arrived, left = np.zeros((4, ring), np.int64), np.zeros((4, ring), np.int64)
    last_issue, last_left = np.full(4, -1, np.int64), np.full(4, -1, np.int64)
    token_free = np.zeros(4, np.int64)
    recent = ctu_latency + 1
    fifo = depth + ring
    written, popped = np.zeros((4, 4, fifo), np.int64), np.zeros((4, 4, fifo), np.int64)
    entries = np.zeros((4, 4), np.int64)
    vru = np.zeros((4, 4), np.int64)  # cycle after the last element has left the FIFO
    done = np.full((4, 4), NEVER, np.int64)  # mini-tiles, of the sub-tile whose elements come
    token_gone = np.full((4, 4), -NEVER, np.int64)
    drained = np.zeros((4, 4), np.int64)
    port = np.zeros(4, np.int64)
    # Frame writer
    pair_done = np.zeros(tiles // 2, np.int64)
    pair_cores = np.zeros(tiles // 2, np.int64)
    pair_free = np.full(tiles // 2, NEVER, np.int64)
    pairs_left = 0
    writer = np.int64(0)
    while True:
        # ---- cores take what has been found
        for k in range(4):
            while core_tile[k] < tiles:
                t_now = core_tile[k]
                if got[k] == put[k]:
                    break
                if t_now // 2 >= held_pairs and pair_free[t_now // 2 - held_pairs] == NEVER:
                    break
                q = got[k] % queue
                n = count[k]
                element = which[k, q]
                is_end = element < 0
                leave = max(found[k, q] + QUEUED, taken[k] + 1)
                # What a core that is finished with its sub-tiles has in its queue is dropped, in groups.
                over = np.int64(0)
                for i in range(k % cores, 4, cores):
                    if core_tile[i] <= t_now:
                        over = max(over, finished[i] if core_tile[i] == t_now else NEVER)
                if not is_end and leave >= over + TAKEN:
                    if dropped[k] == 0:
                        taken[k] = max(taken[k], over + TAKEN - 1)
                    leave = max(found[k, q] + QUEUED, taken[k] + (dropped[k] % DROP == 0))
                    freed[k, q] = taken[k] = leave
                    dropped[k] += 1
                    got[k] += 1
                    continue
                dropped[k] = 0
                if n >= ELASTIC:
                    leave = max(leave, accepted[k, (n - ELASTIC) % ring])
                go = leave + ELASTIC
                if t_now // 2 >= held_pairs:
                    go = max(go, pair_free[t_now // 2 - held_pairs] + ELASTIC)
                taken[k] = leave
                freed[k, q] = leave
                got[k] += 1
                place = element_start[t_now, k] + element
                # The mask generator takes it.
                t = max(go, last_issue[k] + 1)
                if is_end and one_token:
                    t = max(t, token_free[k])
                if ctu_fifo > 0 and n >= ctu_fifo:
                    t = max(t, left[k, (n - ctu_fifo) % ring] + 1)
                t = _issue(t, k, depth, recent, arrived, left, n, written, popped, entries)
                if not is_end and element_cycles[place] == 2:
                    t = _issue(t + 1, k, depth, recent, arrived, left, n, written, popped, entries)
                last_issue[k] = t
                accepted[k, n % ring] = t
                # Its pipeline stands while the element at its end waits.
                out = t + ctu_latency
                for i in range(max(n - recent, 0), n):
                    if arrived[k, i % ring] >= t:
                        out += left[k, i % ring] - arrived[k, i % ring]
                sent = 15 if is_end else element_mask[place]
                x = max(out, last_left[k] + 1) if ctu_fifo > 0 else out
                for c2 in range(4):
                    if sent >> c2 & 1:
                        # Mini-tiles that are known to be finished are left out.
                        if not is_end and done[k, c2] <= x and token_gone[k, c2] + blend < x:
                            sent &= ~(1 << c2)
                        elif entries[k, c2] >= depth:
                            x = max(x, popped[k, c2, (entries[k, c2] - depth) % fifo] + 1)
                arrived[k, n % ring], left[k, n % ring] = (x, x) if ctu_fifo > 0 else (out, x)
                if sent:
                    last_left[k] = x
                count[k] += 1
                # Channels
                cost = np.int64(1)
                if not is_end and element < needed[t_now, k]:
                    cost = (element + 1) * served[t_now, k] // needed[t_now, k] - element * served[t_now, k] // needed[t_now, k]
                for c2 in range(4):
                    if not sent >> c2 & 1:
                        continue
                    start = max(x + 1, vru[k % cores, c2])
                    if is_end:
                        pop = max(start, drained[k, c2])
                        token_gone[k, c2] = pop
                        port[k % cores] = max(port[k % cores], pop + out_delay) + 16
                        drained[k, c2] = port[k % cores]
                    elif done[k, c2] <= start:
                        pop = start
                    else:
                        pop = min(start + cost - 1, done[k, c2])
                        if element == finish[t_now, k, c2]:
                            done[k, c2] = start + finish_op[t_now, k, c2] + blend + 1
                    vru[k % cores, c2] = pop + 1
                    e = entries[k, c2] % fifo
                    written[k, c2, e], popped[k, c2, e] = x, pop
                    entries[k, c2] += 1
                if is_end:
                    token_free[k] = x + 2
                    pair = t_now // 2
                    pair_cores[pair] += 1
                    for c2 in range(4):
                        pair_done[pair] = max(pair_done[pair], drained[k, c2])
                        done[k, c2] = NEVER
                    finished[k] = NEVER
                    core_tile[k] += 1
                    while pairs_left < len(pair_free) and pair_cores[pairs_left] == 8:
                        writer = max(writer + PAIR_GAP, pair_done[pairs_left]) + PAIR_CYCLES
                        pair_free[pairs_left] = writer
                        pairs_left += 1
                elif early:
                    over = max(max(done[k, 0], done[k, 1]), max(done[k, 2], done[k, 3]))
                    finished[k] = NEVER if over == NEVER else over + TOLD
        if tile >= tiles:
            break
        # ---- the next lookup
        t_c, u = tile, tile % units
        if not begun:
            begun = True
            at = tile_start[t_c]
            n = tile_start[t_c + 1] - tile_start[t_c]
            # Chunks of its list: asked for one after the other, in the order of the lists.
            came = np.int64(CLEAR)
            if t_c >= units * CONTEXTS:
                came = max(came, gate_end[t_c - units * CONTEXTS])
            if t_c < units:
                came += FIRST - CHAIN + read_latency
            gate = gate_end[t_c - units] if t_c >= units else np.int64(CLEAR)
            if t_c >= units * SORTED_LISTS:
                gate = max(gate, out_end[t_c - units * SORTED_LISTS])
            for j in range(lines_start[t_c], lines_start[t_c + 1]):
                came = max(came, chunk_free[u, chunk_count[u] % slots]) + CHAIN + read_latency
                gate = max(gate, came) + chunk_entries[j]
                chunk_free[u, chunk_count[u] % slots] = gate
                chunk_count[u] += 1
            # What lies as many entries before as it holds has left, of the list there as many as make room for this one.
            total = n
            before = t_c - units
            while before >= 0 and total <= sorted_held:
                total += tile_start[before + 1] - tile_start[before]
                before -= units
            b = before + units
            if b < t_c and total > sorted_held:
                gate = max(gate, out_begin[b] + (out_end[b] - out_begin[b]) * (total - sorted_held) // (tile_start[b + 1] - tile_start[b]))
            gate += 1
            gate_end[t_c] = gate
            batches[t_c] = 1
            part = 0
            r = batch_start[t_c]
            parts = batch_start[t_c + 1] - r
            part_end = at + n
            ready = gate - n + sort_delay[t_c] - 1
            if parts > 1:
                gate_end[t_c] = NEVER  # until it has been given
                part_gate = gate + back + batch_given[r]
                part_end = at + batch_size[r]
                ready = part_gate + batch_delay[r]
            if t_c >= units:
                ready = max(ready, out_end[t_c - units] + NEXT)
            out_begin[t_c] = ready
        is_end = at == tile_start[t_c + 1]
        # The unit gives an entry a cycle, while its buffer has a place; two a cycle are looked up.
        give = max(emitted[u] + 1, ready)
        if removals[u] >= buffer:
            give = max(give, removed[u, removals[u] % buffer] + 1)
        t = max(give + BUFFERED, max(looked, looked_before + 1))
        if lookups >= DEPTH:
            t = max(t, found_at[lookups % DEPTH])
        kept = 15 if is_end else mask[at]
        over = np.int64(0)
        for k in range(4):
            if core_tile[k] == t_c and finished[k] <= t:
                over |= 1 << k
        if not is_end:
            kept &= ~over
            parts = batch_start[t_c + 1] - batch_start[t_c]
            if over == 15:
                # The list is dropped: what is in the buffer is taken, two a cycle. A batch that has begun is not given to its end.
                rest = tile_start[t_c + 1] - at
                inside = min(rest, max(t - give, 0))
                if parts > 1:
                    r, inside_end = part + 1, part_end - tile_start[t_c]
                    while r < parts:
                        inside_end += batch_size[batch_start[t_c] + r]
                        if inside_end - sorted_held > at - tile_start[t_c]:
                            break
                        part_gate = max(part_gate, gave[max(inside_end - sorted_held, 0)])
                        if part_gate >= t + DROPPED - TOLD:
                            break
                        part_gate += batch_given[batch_start[t_c] + r] - batch_given[batch_start[t_c] + r - 1]
                        r += 1
                    batches[t_c] = r
                    gate_end[t_c] = t + DROPPED
                at = tile_start[t_c + 1]
                part_end = at + 1
                emitted[u] = max(give, t) + (DROPPED if inside < rest else 0)
                ready = emitted[u]
                looked = looked_before = t + inside // 2
                continue
        emitted[u] = give
        removed[u, removals[u] % buffer] = t
        removals[u] += 1
        looked_before, looked = looked, t
        if kept:
            come = t + FOUND
            if not is_end:
                line = record[at] // per_line
                until = 2 if mask[at] & border[t_c, 1] else 1 if mask[at] & border[t_c, 0] else -1  # `golden.delivery.wanted_until`
                if cache_lookup(line, t_c, until, held, marks, turn, ways):
                    ask = max(t + 2, last_ask + 1)
                    if misses >= PLACES:
                        ask = max(ask, line_used[misses % PLACES])
                    if reads < PLACES and misses >= reads:
                        ask = max(ask, line_at[(misses - reads) % PLACES])
                    last_ask = ask
                    if refresh[0] and ask >= refresh[0] and ask % refresh[0] < refresh[1]:
                        ask += refresh[1] - ask % refresh[0]
                    if channels:
                        ask = np.int64(np.ceil(_moves(base + line, float(ask), *memory, open_row, activated, last_activated, bus)))
                    last_line = max(ask + READ + line_latency, last_line + gap)
                    line_at[misses % PLACES] = last_line
                    come = max(come, last_line + 3)
                    line_used[misses % PLACES] = max(come, last_found)
                    missed[misses] = line
                    misses += 1
            come = max(come, max(last_found, found_before + 1))
            # All queues have places.
            for k in range(4):
                first = put[k] - (queue - MARGIN) - 1
                if first >= 0:
                    if first >= got[k]:
                        raise RuntimeError("rendering: nothing can go on")
                    come = max(come, freed[k, first % queue] + ROOM)
            found_before, last_found = last_found, come
            found_at[lookups % DEPTH] = come
            lookups += 1
            for k in range(4):
                if not kept >> k & 1:
                    continue
                if not is_end and core_tile[k] == t_c and finished[k] <= come:
                    continue  # its element is never taken; those behind it are not either
                q = put[k] % queue
                found[k, q] = come
                which[k, q] = -1 if is_end else given[t_c, k]
                put[k] += 1
                if not is_end:
                    given[t_c, k] += 1
        if is_end:
            out_end[t_c] = give
            if not listed[t_c]:
                batches[t_c] = 0
            tile += 1
            begun = False
            continue
        at += 1
        if parts > 1:
            gave[at - tile_start[t_c]] = give
        if at == part_end and at < tile_start[t_c + 1]:
            # The next batch: its lines are given when all of it has room in the unit.
            part += 1
            r = batch_start[t_c] + part
            part_end += batch_size[r]
            part_gate = max(part_gate, gave[max(part_end - tile_start[t_c] - sorted_held, 0)]) + batch_given[r] - batch_given[r - 1]
            ready = max(ready, part_gate + batch_delay[r])
            batches[t_c] = part + 1
            if part + 1 == parts:
                gate_end[t_c] = part_gate
    return writer, misses, batches, given


@dataclass(frozen=True, eq=False)
class Rendering:
    """A frame of the rendering half. bytes: by purpose. given: int64 (S,), records that a core gets of each sub-tile, in the order of `whole_pairs`.
    traffic: bursts of the DRAM by purpose, each in its order; empty of a perfect memory. beside_cycles: while the front end works on the next frame."""

    cycles: int
    bytes: dict[str, int]
    given: np.ndarray
    traffic: list[Stream]
    beside_cycles: int


def frame_beats(width: int, height: int, format_: PixelFormat, stride: int) -> int:
    """Beats of the frame buffer that are written: whole rows of whole tiles, pair by pair."""
    pairs, rows = -(-width // PAIR), -(-height // TILE) * TILE
    if format_ is PixelFormat.RGB8:
        return 2 * pairs * rows
    return int(pairs * (4 + np.arange(rows) * (stride // 32) % 2).sum())


@dataclass(frozen=True, eq=False)
class _Cores:
    """What `_frame` needs of a rendering stage. mask, cycles: int64 (E,), mini-tiles of an element's channels, cycles of its test; finish: int (S, 64) position
    of the element that finishes a pixel. pace: cycles that a channel takes for an element. served, needed: int64 (S,), cycles that a core has for a sub-tile
    and the elements that it takes of its list in them: of lanes those of the stage alone, which gets a record in every cycle it wants one."""

    mask: np.ndarray
    cycles: np.ndarray
    finish: np.ndarray
    pace: int
    generator_latency: int
    generator_fifo: int
    one_token: bool
    finished_after: int
    leaves_after: int
    depth: int
    served: np.ndarray
    needed: np.ndarray

    @staticmethod
    def of(tables: TileLists, config: RenderConfig) -> _Cores:
        if config.by_lanes:
            work = lane_work(whole_pairs(front_lists(tables.frame)))
            ones = np.ones(int(work.start[-1]), np.int64)
            end = simulate_lanes(work, config.with_(in_width=config.delivered), leave=True).subtile_end
            order, core_start = stream_order(work, True)
            served, needed = np.zeros_like(end), np.minimum(np.diff(work.start), work.finish.max(axis=1) + 1)
            for k in range(config.cores):
                own = np.stack([order[core_start[s] : core_start[s + 1]] for s in range(k, CORES, config.cores)])  # a row for each of its sub-tiles
                cycles, share = np.maximum(np.diff(end[own].max(axis=0), prepend=0), 0), needed[own]
                served[own] = cycles * share // np.maximum(share.sum(axis=0), 1) if len(own) > 1 else cycles
            late = config.cores < CORES
            return _Cores(
                15 * ones, ones, work.finish, 1, LANE_SETUP_STAGES + LANE_ROW_MASK_STAGES, 0, False, STATE + late, COLOUR + late, config.slots, served, needed,
            )
        lists = tables.lists
        order, core_start = stream_order(lists, walk=chip_walk(lists))
        mask, cycles, _ = cat_masks(lists, config, order, core_start)
        if config.mask_generator == "all":
            mask, cycles = np.full_like(mask, 15), np.ones_like(cycles)
        _, _, finish = render_masked(lists, order, mask, None)
        blend, last = vru_stages(config.form)
        return _Cores(
            mask.astype(np.int64), cycles.astype(np.int64), finish, config.pixels_per_vru, config.generator.latency(config), config.ctu_fifo_depth,
            config.generator.one_token, blend, last + 1, config.fifo_depth, config.pixels_per_vru * np.diff(lists.start), np.diff(lists.start),
        )


def estimate(
    tables: TileLists, config: RenderConfig, dram: DramConfig | None, latency_cycles: int = 20, reads: int = 256, format_: PixelFormat = PixelFormat.RGB8,
    stride: int | None = None, beside: int = 0,
) -> Rendering:
    """Cycles and bytes of a frame. dram: None: a perfect memory. latency_cycles, reads: of the memory's ports, `PortConfig.latency` and `max_reads`, by default
    those of `sim.chip.PORT`. stride: bytes from row to row; None: as few as a row needs. beside: bytes that the front end moves for the next frame.

    Lists of an ideal sorting unit (`TileLists.capacity`) are sorted in no time once their last line is there, any number of entries at once.

    Lanes take a record a cycle each core here, whatever `config.delivered`.
    """
    lists = tables.lists
    cores = _Cores.of(tables, config)
    subtiles = lists.cols * lists.rows
    finish, finish_op = np.empty((2, subtiles, 4), np.int64)
    finish_events(cores.finish, lists.start, cores.pace, finish, finish_op)
    listed = (tables.x < -(-lists.width // TILE)).astype(np.bool_)
    sizes = config.chip_memories
    lengths, chunk_entries, held = np.diff(tables.start), tables.chunk_entries, held_entries(sizes.sorted_entries, sizes.sort_ways)
    ways = dict(stages=sizes.sort_stages, ways=sizes.sort_ways)
    batch_delay = np.array([latency(int(n), **ways) - n if n <= sizes.sorted_entries else 0 for n in tables.batch_size])
    if tables.capacity is None:  # a list is sorted when its last line is there
        delay, chunk_entries, held = lengths + 1, np.zeros_like(chunk_entries), int(NEVER)
    elif (tables.capacity, tables.merge_lines) == (sizes.sorted_entries, sizes.merge_lines):
        delay = np.array([latency(min(int(n), sizes.sorted_entries), **ways) for n in lengths])
    else:
        raise ValueError(f"lists are read for sizes {tables.capacity}, {tables.merge_lines}, not {sizes.sorted_entries}, {sizes.merge_lines}")
    # Rows stay open: a line of a list finds another one than its own.
    each = CLOCK_HZ / (dram.rate // 2) if dram else 0.0
    list_latency = latency_cycles + (dram.idle_cycles(BEAT) + math.ceil(dram.trp * each) if dram else 0)
    line_latency = latency_cycles + (math.ceil((dram.rl + dram.burst_clocks) * each) if dram else 0)
    memory = (
        (dram.channels, dram.interleave_bytes, dram.page_bytes, dram.banks, *(each * t for t in (dram.trcd, dram.trp, dram.tras, dram.trrd, dram.tccd)))
        if dram else (0, 1, 1, 1, 0.0, 0.0, 0.0, 0.0, 0.0)
    )
    refresh = (0, 0)  # one bank at a time delays few lines
    if dram and dram.refresh == Refresh.ALL_BANKS:
        refresh = (dram.trefi * CLOCK_HZ // (dram.rate // 2), dram.trfc * CLOCK_HZ // (dram.rate // 2))
    early = config.by_lanes or config.cat != CatMode.AUTO or config.mask_generator != "ctu"
    missed = np.empty(len(tables.record), np.int64)
    stride = stride or least_stride(lists.width, format_)
    others = {"pointers": LINE_BYTES * len(tables.lines), "frame": BEAT * frame_beats(lists.width, lists.height, format_, stride)}
    if dram and dram.port_bits != config.port_bits:
        raise ValueError(f"the memory's port has {dram.port_bits} bits, the chip's {config.port_bits}")
    gap = max(1, 8 * RECORD_LINE // config.port_bits)  # lists, asked for ahead, stand back while lines of records come

    def settle(beside: int) -> tuple[int, int, np.ndarray, np.ndarray]:
        """Cycles, lines of records (`missed` says which), batches, records given: with the shares of the memory's time that they make."""
        busy = np.zeros(2)  # of what is not the records', and of that and what the front end moves
        for _ in range(ROUNDS if dram else 1):
            # What else moves goes on all the time: a line of records has the rest of the memory's rate, and waits. The front end takes nothing of the rate:
            # it goes last.
            paced, later = (*memory[:-1], memory[-1] / (1.0 - busy[0])), round(LOADED * busy[1] / (1.0 - busy[1]))
            clock, misses, batches, given = _frame(
                tables.start, tables.record, tables.mask, borders(tables.cols // 2, tables.rows), tables.chunk_start, chunk_entries, delay,
                tables.batch_start, tables.batch_size, tables.batch_given, batch_delay, tables.by_tile(lists.start[:-1]), cores.mask, cores.cycles,
                tables.by_tile(finish), tables.by_tile(finish_op), listed, RECORD_LINE // tables.frame.kind.bytes, sizes.record_lines // CACHE_WAYS, CACHE_WAYS,
                READ + list_latency + later, line_latency + later, refresh, reads, early,
                cores.generator_latency, cores.generator_fifo, cores.one_token, cores.depth, cores.finished_after, cores.leaves_after,
                tables.by_tile(cores.served), tables.by_tile(cores.needed), tables.regions.records // RECORD_LINE, paced, gap,
                (held, latency(sizes.sorted_entries, **ways) + BEGIN + list_latency, sizes.list_chunks,
                 sizes.sorted_ahead + OUTPUTS, sizes.queued_records, sizes.pairs, config.sort_units), config.cores, missed,
            )
            others["lists"] = BEAT * int((tables.lines + tables.run_lines + tables.runs_read(batches)).sum())
            total = int(clock) + END + latency_cycles
            if dram:
                rate = EFFICIENCY * dram.bytes_per_second / CLOCK_HZ  # bytes in a cycle
                own = sum(others.values()) / (min(rate, config.port_bits / 8) * total)  # of the memory or its port, where the front end goes last
                now = np.minimum(own + np.array([0.0, BESIDE * beside / (rate * total)]), MOST_BUSY)
                if np.abs(now - busy).max() < SETTLED:
                    break
                busy = (busy + now) / 2
        return total, int(misses), batches, given

    beside_cycles = settle(beside)[0] if beside else 0
    total, misses, batches, given = settle(0)
    moved = {"lists": others["lists"], "pointers": others["pointers"], "records": RECORD_LINE * misses, "frame": others["frame"]}
    traffic: list[Stream] = []
    if dram:
        written = moved["frame"] + BEAT * int(tables.run_lines.sum())
        total = max(
            total, -(-sum(moved.values()) * CLOCK_HZ // dram.bytes_per_second),
            dram.port_cycles(sum(moved.values()) - written, written) if config.port_bits != LINE_BITS else 0,
        )
        traffic = tables.traffic(batches, missed[:misses], format_, stride)
    grid = np.zeros((2 * tables.rows, 2 * tables.cols), np.int64)
    for k in range(CORES):
        grid[2 * tables.y + k // 2, 2 * tables.x + k % 2] = given[:, k]
    return Rendering(total, moved, grid.ravel(), traffic, max(total, beside_cycles))
