"""Cycle model of the lanes in the log domain, equal to the RTL in cycles and in every counter (rtl/flk_lane_stage.sv; docs/reference/lanes.md).

A core takes `in_width` elements a cycle through setup and masks, which move together. Dispatch gives one splat a cycle a slot of the store and each lane
with pixels in its mask an entry in its queue; what is empty or finished is dropped beside it. In a core that several sub-tiles share, two of those that are
left stand in a register slice before dispatch. Every lane visits a pixel a cycle, in the order of the list. A
token takes a slot and an entry in every queue, waits for the lane's bank, and lets the bank leave, a pixel a cycle from all lanes of a core.

The streams are offered as fast as they are taken, and pixels taken as they come. Numbers below are cycles after a visit (rtl/lanes/flk_lane.sv).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..golden.lanes.lists import RecordLists
from ..golden.lanes.render import finish_positions, lane_masks
from ..golden.lanes.streams import core_streams, whole_tiles
from ..params import (
    CORES,
    LANE_COUNTERS,
    LANE_ROW_MASK_STAGES,
    LANE_SETUP_STAGES,
    LANES_PER_CORE,
    MINITILE,
    SUBTILE,
    SUBTILE_PIXELS,
    RenderConfig,
)

# Cycles of a visit, one more each in a core that several sub-tiles share.
STATE = 5  # the pixel's S and its finished flag are written at the end
RELEASE = 6  # the slot is given back
COLOUR = 8  # the token is at the end of the pipeline: the bank leaves from the next cycle on
OUTPUT = 2  # registers behind the choice of a lane
TOKEN = -1  # positions below are tokens
NOTHING = -(1 << 62)

(
    CYCLES, SUBTILES, GAUSSIANS_IN, REJECTED, BUSY, STALLED, IDLE, DROPPED, DISPATCHED, NO_SLOT, NO_ROOM, ENTRIES, VISITS, SKIPPED, BLENDED, FINISHED,
    STARVED, BANK_WAITS,
) = range(len(LANE_COUNTERS))


@dataclass
class LaneWork:
    """What a frame makes the lanes do; nothing in it depends on timing or on the number of lanes.

    start: int64 (S + 1,), elements of sub-tile s, near to far. mask, passes: uint64 (E,), pixels (bit 16 m + i) of each element's mask, and those that pass the
    lane's own test; of those that are visited when they are finished it matters to one counter alone, `skipped`. finish: int64 (S, 64), position in the list of
    the element that finishes the pixel; the list's length when none does. contributing: pairs that are blended or finish a pixel. entry: int (E,), record of
    each element, which matters to cores that several sub-tiles share; None: each element is of a record of its own.
    """

    cols: int
    rows: int
    start: np.ndarray
    mask: np.ndarray
    passes: np.ndarray
    finish: np.ndarray
    contributing: int
    entry: np.ndarray | None = None


@dataclass
class LaneCycles:
    """Result: cycles of the frame; counters: int64 (cores, len(LANE_COUNTERS)); lanes: of all cores; subtile_end: int64 (S,), cycle in which the last pixel
    of each sub-tile left, 0 where it was not streamed."""

    cycles: int
    counters: np.ndarray
    lanes: int
    subtile_end: np.ndarray

    def total(self, name: str) -> int:
        """Sum of a counter over the cores."""
        return int(self.counters[:, [n for n, _ in LANE_COUNTERS].index(name)].sum())

    @property
    def utilisation(self) -> float:
        """Share of the lanes' cycles in which a pair is blended or finishes a pixel."""
        return (self.total("blended") + self.total("pixels_finished")) / (self.cycles * self.lanes)

    @property
    def stall_rate(self) -> float:
        """Share of the cycles in which a core has input but cannot take it."""
        return self.total("stalled") / (self.cycles * len(self.counters))


def pixels_of_lanes(lanes: int) -> np.ndarray:
    """int64 (lanes, 64 / lanes): number 16 m + i of each pixel of each lane of a core in a sub-tile (flk_lane_pkg, lane_row and lane_column)."""
    if lanes not in LANES_PER_CORE:
        raise ValueError(f"lanes of a core: 4, 8, 16 or 32, not {lanes}")
    lane, p = np.arange(lanes)[:, None], np.arange(SUBTILE_PIXELS // lanes)[None, :]
    if lanes == 4:
        row, column = p // 2 + 0 * lane, (lane + 4 * (p % 2) + 5 * (p // 2)) % SUBTILE
    elif lanes == 8:
        row, column = p + 0 * lane, (lane + 5 * p) % SUBTILE
    elif lanes == 16:
        row, column = lane // 4 + 4 * (p // 2), lane % 4 + 4 * (p % 2)
    else:
        row, column = lane // 8 + 4 * p, lane % 8 + 0 * p
    minitile = row // MINITILE * (SUBTILE // MINITILE) + column // MINITILE
    return minitile * MINITILE * MINITILE + row % MINITILE * MINITILE + column % MINITILE


@numba.njit(cache=True)
def _bits_of(element, live, pixel, bits):
    """Sets the pixels of each lane in a splat's live mask; none of a token."""
    for l in range(len(pixel)):
        bits[l] = 0
        if element > TOKEN:
            for p in range(pixel.shape[1]):
                bits[l] |= np.int64((live >> np.uint64(pixel[l, p])) & np.uint64(1)) << p


@numba.njit(cache=True)
def _give(slot, element, bits, q_read, q_used, q_slot, q_bits, pending, tokens):
    """A splat, or a token, into the queues of the lanes that need it. Returns the entries, of a splat."""
    entries = 0
    for l in range(len(q_read)):
        if element <= TOKEN or bits[l]:
            r = (q_read[l] + q_used[l]) % q_slot.shape[1]
            q_slot[l, r] = slot
            q_bits[l, r] = bits[l]
            q_used[l] += 1
            pending[slot] += 1
            if element <= TOKEN:
                tokens[l] += 1
            else:
                entries += 1
    return entries


@numba.njit(cache=True)
def _core(
    order, start, element, member, subtile, position, mask, passes, finish, pixel, latency, width, slots, depth, leave, dispatch, count, subtile_end,
):
    """One core: fills its counters and the end of each sub-tile; returns the cycles it was followed for, and that after its last pixel. start, element,
    member, subtile: of `CoreStreams`; position: of each element in its sub-tile's list."""
    lanes, per_lane = pixel.shape
    share = subtile.shape[1]
    state, released, colour = STATE + (share > 1), RELEASE + (share > 1), COLOUR + (share > 1)
    n_sub = len(order)  # lists
    # Setup and masks: ring of groups, the youngest at `young`; the group at dispatch is `latency` moves old.
    pipe = np.full((latency, width), NOTHING, np.int64)
    pipe_tokens = 0
    young = 0
    sent = np.zeros(width, np.bool_)
    live = np.zeros(width, np.uint64)
    wanted = np.zeros(width, np.bool_)
    n_given = 0  # of a core that is shared: what stands in the slice, and its pixels by lane
    given = np.full(2, NOTHING, np.int64)
    given_bits = np.zeros((2, lanes), np.int64)
    going = np.full(width, -1, np.int64)  # slot of those that dispatch gives to the lanes in this cycle
    # Store
    pending = np.zeros(slots, np.int64)  # lanes that have not released
    release = np.zeros((released + 1, slots), np.int64)
    slot_at = np.zeros(slots, np.int64)
    # Queues
    q_slot = np.zeros((lanes, depth), np.int64)
    q_bits = np.zeros((lanes, depth), np.int64)
    q_read = np.zeros(lanes, np.int64)
    q_used = np.zeros(lanes, np.int64)
    done = np.zeros(lanes, np.int64)
    tokens = np.zeros(lanes, np.int64)
    # Lanes
    token_at = np.full(lanes, NOTHING, np.int64)  # of the last token
    sub = np.zeros(lanes, np.int64)  # ordinal of the list that is visited
    flags = np.zeros((lanes, share), np.int64)  # finished pixels, as the register has them
    ending = np.zeros((state + 1, lanes, share), np.int64)  # flags that are set state cycles after a visit
    bank = np.zeros(lanes, np.bool_)
    full_at = np.full(lanes, -NOTHING, np.int64)
    bank_left = np.zeros(lanes, np.int64)
    first = 0
    bits = np.zeros((width, lanes), np.int64)
    coming = np.zeros(lanes, np.int64)  # entries of this cycle
    # Input
    sub_in, began = 0, False
    at = start[order[0]] if n_sub else np.int64(0)
    held = np.full(width, NOTHING, np.int64)
    n_held = 0
    sub_finished = np.zeros(share, np.bool_)  # the register finished_o
    pixels_left = SUBTILE_PIXELS * share * n_sub
    arrived = np.zeros((n_sub, share), np.int64)  # pixels of each sub-tile that have left
    last_pixel = np.int64(0)
    t = np.int64(0)
    while pixels_left > 0:  # the last ones are on their way through the output's registers afterwards
        # ---- what this cycle sees
        for l in range(lanes):
            if token_at[l] + state + 1 == t:  # the token has passed
                flags[l, :] = 0
                tokens[l] -= 1
            flags[l] |= ending[t % (state + 1), l]
            ending[t % (state + 1), l, :] = 0
        if n_held == 0 and sub_in < n_sub:
            leaves = sub_in if leave and began else -1
            while n_held < width and sub_in < n_sub:
                while sub_in == leaves and at < start[order[sub_in] + 1] and sub_finished[member[at]]:
                    at += 1
                if at == start[order[sub_in] + 1]:
                    held[n_held] = TOKEN - sub_in
                    sub_in += 1
                    began = False
                    if sub_in < n_sub:
                        at = start[order[sub_in]]
                else:
                    held[n_held] = at
                    at += 1
                    began = True
                n_held += 1
        # ---- dispatch: of the group at the pipeline's end
        old = (young + 1) % latency
        after_token = False
        for k in range(n_given):
            after_token = after_token or given[k] <= TOKEN
        for w in range(width):
            e = pipe[old, w]
            wanted[w] = False
            live[w] = np.uint64(0)
            if e == NOTHING or sent[w]:
                continue
            if e <= TOKEN:
                wanted[w] = True
                after_token = True
            else:
                m, own = mask[element[e]], member[e]
                if not after_token:
                    for l in range(lanes):
                        if tokens[l] == 0 and flags[l, own]:
                            for p in range(per_lane):
                                if (flags[l, own] >> p) & 1:
                                    m &= ~(np.uint64(1) << np.uint64(pixel[l, p]))
                live[w] = m
                wanted[w] = m != np.uint64(0)
        move = True
        slot, left = -1, dispatch
        coming[:] = 0
        chosen, head = -1, -1  # the one that goes into the slice; the slot of the one that leaves it
        if share > 1:
            if n_given > 0:
                head = 0
                while head < slots and pending[head] != 0:
                    head += 1
                room = True
                for l in range(lanes):
                    if (given[0] <= TOKEN or given_bits[0, l]) and q_used[l] == depth:
                        room = False
                if head == slots:
                    count[NO_SLOT] += 1
                    head = -1
                elif not room:
                    count[NO_ROOM] += 1
                    head = -1
                else:
                    count[DISPATCHED] += 1
            left = 0
            for w in range(width):
                if wanted[w]:
                    left += 1
                    if chosen < 0 and n_given < 2:
                        chosen = w
            move = n_given < 2 if width == 1 else left == (chosen >= 0)
        for w in range(width):
            going[w] = -1
            if share > 1 or not wanted[w]:
                continue
            if left == 0 or not move:  # in order
                move = False
                continue
            slot += 1
            while slot < slots and pending[slot] != 0:
                slot += 1
            token = pipe[old, w] <= TOKEN
            room = True
            _bits_of(pipe[old, w], live[w], pixel, bits[w])
            for l in range(lanes):
                if (token or bits[w, l]) and q_used[l] + coming[l] == depth:
                    room = False
            if slot == slots:
                count[NO_SLOT] += 1
                move = False
            elif not room:
                count[NO_ROOM] += 1
                move = False
            else:
                count[DISPATCHED] += 1
                going[w] = slot
                left -= 1
                for l in range(lanes):
                    if token or bits[w, l]:
                        coming[l] += 1
        # ---- pixels leave: the registers behind take one in every cycle
        served = -1
        for i in range(lanes):
            l = (first + i) % lanes
            if full_at[l] <= t:
                served = l
                break
        if served >= 0:
            first = (served + 1) % lanes
            pixels_left -= 1
            last_pixel = t
            k = sub[served] - 1  # the bank holds the list before the one that is visited
            own = share - 1 - (bank_left[served] - 1) // per_lane
            arrived[k, own] += 1
            if arrived[k, own] == SUBTILE_PIXELS:
                subtile_end[subtile[order[k], own]] = t
        # ---- lanes
        for l in range(lanes):
            taken = bank[l]
            if served == l:
                bank_left[l] -= 1
                if bank_left[l] == 0:
                    bank[l] = False
                    full_at[l] = -NOTHING
            if q_used[l] == 0:
                count[STARVED] += 1
                continue
            r = q_read[l]
            todo = q_bits[l, r]
            pop = False
            if todo == 0:
                if taken:
                    count[BANK_WAITS] += 1
                else:
                    pop = True
                    bank[l] = True
                    bank_left[l] = per_lane * share
                    full_at[l] = t + colour + 1
                    token_at[l] = t
                    sub[l] += 1
            else:
                todo &= ~done[l]
                own = member[slot_at[q_slot[l, r]]]
                if t - token_at[l] > state:
                    todo &= ~flags[l, own]
                if todo:
                    p = 0
                    while not (todo >> p) & 1:
                        p += 1
                    e = element[slot_at[q_slot[l, r]]]
                    s = subtile[order[sub[l]], own]
                    k = position[e]
                    end = finish[s, pixel[l, p]]
                    passed = (passes[e] >> np.uint64(pixel[l, p])) & np.uint64(1)
                    count[VISITS] += 1
                    if not passed:
                        count[SKIPPED] += 1
                    elif k < end:
                        count[BLENDED] += 1
                    elif k == end:
                        count[FINISHED] += 1
                        ending[(t + state + 1) % (state + 1), l, own] |= 1 << p
                    todo &= todo - 1
                    done[l] |= 1 << p
                pop = todo == 0
            if pop:
                release[(t + released) % (released + 1), q_slot[l, r]] += 1
                q_read[l] = (r + 1) % depth
                q_used[l] -= 1
                done[l] = 0
        # ---- the end of the cycle
        for s in range(slots):
            pending[s] -= release[t % (released + 1), s]
            release[t % (released + 1), s] = 0
        ahead = 0
        for k in range(n_given):
            ahead += given[k] <= TOKEN
        for own in range(share):
            all_finished = pipe_tokens == 0 and ahead == 0
            for l in range(lanes):
                if tokens[l] > 0 or flags[l, own] != (1 << per_lane) - 1:
                    all_finished = False
            sub_finished[own] = all_finished
        if head >= 0:
            count[ENTRIES] += _give(head, given[0], given_bits[0], q_read, q_used, q_slot, q_bits, pending, tokens)
            slot_at[head] = given[0]
            n_given -= 1
            given[0] = given[1]
            given_bits[0] = given_bits[1]
        if chosen >= 0:
            given[n_given] = pipe[old, chosen]
            _bits_of(pipe[old, chosen], live[chosen], pixel, given_bits[n_given])
            n_given += 1
        for w in range(width):
            slot = going[w]
            if slot >= 0:
                count[ENTRIES] += _give(slot, pipe[old, w], bits[w], q_read, q_used, q_slot, q_bits, pending, tokens)
                slot_at[slot] = pipe[old, w]
            elif w != chosen:
                continue
            sent[w] = True
            for u in range(w):  # what was passed over is dropped, whatever its lanes say later
                if not sent[u]:
                    sent[u] = True
                    count[REJECTED if mask[element[pipe[old, u]]] == np.uint64(0) else DROPPED] += 1
        if n_held == 0:
            count[IDLE] += 1
        elif not move:
            count[STALLED] += 1
        else:
            count[BUSY] += 1
        if move:
            for w in range(width):
                e = pipe[old, w]
                if e == NOTHING:
                    continue
                if e <= TOKEN:
                    pipe_tokens -= 1
                elif not sent[w]:
                    if mask[element[e]] == np.uint64(0):
                        count[REJECTED] += 1
                    else:
                        count[DROPPED] += 1
            young = old
            for w in range(width):
                sent[w] = False
                pipe[young, w] = held[w] if w < n_held else NOTHING
                if w < n_held:
                    if held[w] <= TOKEN:
                        count[SUBTILES] += 1
                        pipe_tokens += 1
                        sub_finished[:] = False
                    else:
                        count[GAUSSIANS_IN] += 1
            n_held = 0
        t += 1
    return t, last_pixel + 1


@numba.njit(parallel=True, cache=True)
def _cores(
    order, core_start, start, element, member, subtile, position, mask, passes, finish, pixel, latency, width, slots, depth, leave, dispatch, counters, end,
    ends,
):
    for k in numba.prange(len(counters)):
        own = order[core_start[k] : core_start[k + 1]]
        ends[k, 0], ends[k, 1] = _core(
            own, start, element, member, subtile, position, mask, passes, finish, pixel, latency, width, slots, depth, leave, dispatch, counters[k], end,
        )


def lane_work(lists: RecordLists) -> LaneWork:
    """What a frame makes the lanes do."""
    mask, passes = lane_masks(lists)
    finish, contributing = finish_positions(lists, mask, passes)
    total = int(np.bitwise_count(contributing).sum(dtype=np.int64))
    return LaneWork(lists.cols, lists.rows, np.asarray(lists.start, np.int64), mask, passes, finish, total, lists.entry)


def simulate_lanes(
    work: LaneWork, config: RenderConfig, *, leave: bool = False, empty: bool = True, in_width: int | None = None, dispatch: int = 1,
) -> LaneCycles:
    """Cycles of a frame. leave: a finished sub-tile leaves its list. empty: sub-tiles with an empty list are streamed, too.

    in_width, dispatch: elements that a core takes in a cycle (None: config's) and splats of these that get a slot and entries in queues. The RTL has 1 or 2,
    and 1; anything else is a core that was not built.
    """
    lanes = config.lanes // config.cores
    streams = core_streams(work, np.arange(len(work.mask)) if work.entry is None else work.entry, config.cores, empty)
    counters, ends = np.zeros((config.cores, len(LANE_COUNTERS)), np.int64), np.zeros((config.cores, 2), np.int64)
    # A core that is shared has whole tiles.
    number = np.arange(work.cols * work.rows) if config.cores == CORES else whole_tiles(work.cols, work.rows)[2]
    finish, end = np.zeros((streams.cols * streams.rows, SUBTILE_PIXELS), np.int64), np.zeros(streams.cols * streams.rows, np.int64)
    finish[number] = work.finish
    position = np.arange(len(work.mask)) - np.repeat(work.start[:-1], np.diff(work.start))
    _cores(
        streams.order, streams.core_start, streams.start, streams.element, streams.member, streams.subtile, position, work.mask, work.passes, finish,
        pixels_of_lanes(lanes), LANE_SETUP_STAGES + LANE_ROW_MASK_STAGES, in_width or config.in_width, config.slots, config.fifo_depth, leave, dispatch,
        counters, end, ends,
    )
    output = OUTPUT + (config.cores < CORES)
    ends[:, 1] += output
    end[end > 0] += output
    cycles = int(ends[:, 1].max())
    # A core that has ended goes on counting: no input, no entry in any queue.
    counters[:, CYCLES] = cycles
    counters[:, IDLE] += cycles - ends[:, 0]
    counters[:, STARVED] += (cycles - ends[:, 0]) * lanes
    return LaneCycles(cycles, counters, config.lanes, end[number])
