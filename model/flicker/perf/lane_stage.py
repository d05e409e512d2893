"""Cycle model of a rendering stage of lanes: a proposal, no RTL exists.

A core's eight VRUs ("lanes") each hold eight pixels that are scattered over the whole sub-tile (`LANE`), have a FIFO of their own and never wait for
each other. Any splat that covers an area then spreads over all lanes evenly, wherever it lies, which mini-tiles shared by two VRUs
(`pixel_stage`) cannot: there a small splat keeps one channel busy and seven eighths of the core idle.

An element comes with a 64-bit pixel mask from a generator of `latency` stages, held as the CTU's pipeline is, that takes `width` elements a cycle. Each lane
with set pixels gets the record and its own eight mask bits, finished pixels taken out; an element waits until every lane it needs has room.
A lane visits one pixel per cycle. Of the `window` oldest entries it takes the first pixel that no older entry still wants and whose read-modify-write
loop (`loop` cycles) is over, oldest entry first, so each pixel sees its splats in order. Entries without pixels leave at the end of a cycle.
An end-of-sub-tile token moves the eight pixels to one of `buffers` output buffers; `ports` pixels leave a core per cycle.

Sub-tiles with an empty list are not streamed (the background is theirs). With `stop`, the input goes on to the token once all 64 pixels are
known to be finished. Finished pixels are known as late as in the RTL.
"""

from __future__ import annotations

import numba
import numpy as np

from ..methods.work import Work
from ..params import CHANNELS, CORES, COUNTERS_PER_CORE, MINITILE, SUBTILE, RenderConfig, vru_stages
from .pixel_stage import GENERATOR_LATENCY
from .render_stage import (
    BUSY, DELIVERED, DISCARDED, FINISHED, FULL, GAUSSIANS_IN, IDLE, N_CHANNEL, N_CORE, NEVER, REJECTED, SENT, STALLED, SUBTILES, TOKEN,
    VRU_BUSY, StageCycles,
)

LANES = 8  # VRUs of a core
LANE_PIXELS = SUBTILE * SUBTILE // LANES
LOOP = 2  # multiplication of the transmittance in two stages; colours in fixed-point accumulators, one


def lane_of_pixel() -> np.ndarray:
    """int64 (64,): lane of pixel 16 m + i (mini-tile m): (column + 3 row) modulo 8.

    All lanes are different in every row, every column and every 2x2 and 2x4 block; a 3x3 block has one lane twice.
    """
    lane = np.empty(CHANNELS * MINITILE * MINITILE, np.int64)
    for y in range(SUBTILE):
        for x in range(SUBTILE):
            m = y // MINITILE * 2 + x // MINITILE
            lane[16 * m + y % MINITILE * MINITILE + x % MINITILE] = (x + 3 * y) % LANES
    return lane


LANE = lane_of_pixel()
# Pixel 16 m + i as bit of its lane's mask, and back.
PLACE = np.array([int((LANE[:p] == LANE[p]).sum()) for p in range(64)])
PIXEL = np.array([[p for p in range(64) if LANE[p] == l] for l in range(LANES)])


@numba.njit(cache=True)
def _core(order, start, visit, pixel_finish, lane, place, pixel, latency, depth, blend, out_delay, loop, window, width, ports, buffers,
          store, stop, count, end):
    """One core; returns the cycle after its last pixel. `order` has no empty sub-tile."""
    n_sub = len(order)
    lanes, per_lane = pixel.shape
    ring = latency * width + width
    pipe = np.full(ring, -3, np.int64)  # position in the arrays, or TOKEN - sub-tile ordinal
    ready = np.zeros(ring, np.int64)
    p_read = 0
    p_used = 0
    at_out = 0  # ordinal of the sub-tile at the pipeline's end
    fifo = np.zeros((lanes, depth), np.int64)
    wants = np.zeros((lanes, depth), np.int64)
    slot = np.zeros((lanes, depth), np.int64)
    left = np.zeros(store, np.int64)  # lanes that still need a stored record
    s_read = 0
    s_used = 0
    read = np.zeros(lanes, np.int64)
    used = np.zeros(lanes, np.int64)
    sub = np.zeros(lanes, np.int64)
    known = np.full((lanes, per_lane), NEVER, np.int64)
    visited = np.full((lanes, per_lane), -NEVER, np.int64)
    bits = np.zeros(lanes, np.int64)
    finished = np.zeros(n_sub, np.int64)
    finished_at = np.zeros(n_sub, np.int64)
    b_sub = np.zeros((lanes, buffers), np.int64)
    b_left = np.zeros((lanes, buffers), np.int64)
    b_full = np.zeros((lanes, buffers), np.int64)
    b_read = np.zeros(lanes, np.int64)
    b_used = np.zeros(lanes, np.int64)
    first_out = 0
    arrived = np.zeros(n_sub, np.int64)
    total_out = 0
    sub_in = 0
    at = start[order[0]] if n_sub else np.int64(0)
    t = np.int64(0)
    while total_out < 64 * n_sub:
        # ---- output: one pixel from each of up to `ports` lanes
        sent = 0
        last_served = first_out
        for i in range(lanes):
            l = (first_out + i) % lanes
            r = b_read[l]
            if sent < ports and b_used[l] > 0 and b_full[l, r] <= t:
                sent += 1
                total_out += 1
                last_served = l
                k = b_sub[l, r]
                arrived[k] += 1
                if arrived[k] == 64:
                    end[order[k]] = t
                b_left[l, r] -= 1
                if b_left[l, r] == 0:
                    b_read[l] = (r + 1) % buffers
                    b_used[l] -= 1
        if sent > 0:
            first_out = (last_served + 1) % lanes
        # ---- lanes; what is written in this cycle is seen in the next
        for l in range(lanes):
            if used[l] == depth:
                count[N_CORE + (l // 2) * N_CHANNEL + FULL] += 1
        room = depth - used
        for l in range(lanes):
            base = N_CORE + (l // 2) * N_CHANNEL
            if used[l] == 0:
                continue
            issued = False
            older = np.int64(0)
            leave = 0
            for j in range(min(window, used[l])):
                e = (read[l] + j) % depth
                head = fifo[l, e]
                if head <= TOKEN:
                    if j == 0 and b_used[l] < buffers:
                        w = (b_read[l] + b_used[l]) % buffers
                        b_sub[l, w] = sub[l]
                        b_left[l, w] = per_lane
                        b_full[l, w] = t + out_delay
                        b_used[l] += 1
                        sub[l] += 1
                        for p in range(per_lane):
                            known[l, p] = NEVER
                            visited[l, p] = -NEVER
                        leave = 1
                    break
                todo = wants[l, e]
                for p in range(per_lane):
                    if not (todo >> p) & 1:
                        continue
                    if known[l, p] <= t:
                        todo &= ~(1 << p)
                        count[base + DISCARDED] += 1
                    elif not issued and not (older >> p) & 1 and visited[l, p] + loop <= t:
                        todo &= ~(1 << p)
                        issued = True
                        visited[l, p] = t
                        count[base + VRU_BUSY] += 1
                        s = order[sub[l]]
                        if head - start[s] == pixel_finish[s, pixel[l, p]]:
                            known[l, p] = t + blend + 1
                            finished[sub[l]] += 1
                            finished_at[sub[l]] = max(finished_at[sub[l]], known[l, p])
                wants[l, e] = todo
                older |= todo
                if todo == 0 and leave == j:
                    leave = j + 1
                    left[slot[l, e]] -= 1
            read[l] = (read[l] + leave) % depth
            used[l] -= leave
        while s_used > 0 and left[s_read] == 0:
            s_read = (s_read + 1) % store
            s_used -= 1
        # ---- dispatch: the oldest masks, if they are complete
        moved = 0
        while moved < width and p_used > 0 and ready[p_read] <= t:
            pos = pipe[p_read]
            token = pos <= TOKEN
            fits = True
            for l in range(lanes):
                bits[l] = 0
            if not token:
                for m in range(4):
                    mask = np.int64(visit[pos, m])
                    while mask:
                        i = 0
                        while not (mask >> i) & 1:
                            i += 1
                        mask &= mask - 1
                        p = 16 * m + i
                        l = lane[p]
                        if sub[l] != at_out or known[l, place[p]] > t:
                            bits[l] |= 1 << place[p]
            any_lane = False
            if not token and s_used == store:
                fits = False
            for l in range(lanes):
                if token or bits[l]:
                    any_lane = True
                    if room[l] == 0:
                        fits = False
            if not fits:
                break
            place_in = (s_read + s_used) % store
            for l in range(lanes):
                if token or bits[l]:
                    w = (read[l] + used[l]) % depth
                    slot[l, w] = place_in
                    fifo[l, w] = pos
                    wants[l, w] = bits[l]
                    used[l] += 1
                    room[l] -= 1
                    if not token:
                        left[place_in] += 1
                        count[DELIVERED] += 1
                        count[N_CORE + (l // 2) * N_CHANNEL + SENT] += 1
            if token:
                at_out += 1
            elif any_lane:
                s_used += 1
            else:
                count[REJECTED] += 1
            p_read = (p_read + 1) % ring
            p_used -= 1
            moved += 1
        # ---- generator: held while its oldest mask is
        if sub_in < n_sub:
            if (p_used > 0 and ready[p_read] <= t) or p_used + width > ring:
                count[STALLED] += 1
            else:
                count[BUSY] += 1
                for i in range(width):
                    if sub_in == n_sub:
                        break
                    s = order[sub_in]
                    if stop and finished[sub_in] == 64 and finished_at[sub_in] <= t:
                        at = start[s + 1]
                    w = (p_read + p_used) % ring
                    ready[w] = t + latency
                    p_used += 1
                    if at == start[s + 1]:
                        pipe[w] = TOKEN - sub_in
                        count[SUBTILES] += 1
                        sub_in += 1
                        if sub_in < n_sub:
                            at = start[order[sub_in]]
                    else:
                        pipe[w] = at
                        count[GAUSSIANS_IN] += 1
                        at += 1
        else:
            count[IDLE] += 1
        t += 1
    return t


@numba.njit(parallel=True, cache=True)
def _cores(order, core_start, start, visit, pixel_finish, lane, place, pixel, latency, depth, blend, out_delay, loop, window, width, ports,
           buffers, store, stop, counters, end, ends):
    for k in numba.prange(CORES):
        ends[k] = _core(
            order[core_start[k] : core_start[k + 1]], start, visit, pixel_finish, lane, place, pixel, latency, depth, blend, out_delay,
            loop, window, width, ports, buffers, store, stop, counters[k], end,
        )


def simulate_lanes(
    work: Work, config: RenderConfig, *, latency: int = GENERATOR_LATENCY, loop: int = LOOP, window: int = 1, width: int = 1,
    ports: int = 4, buffers: int = 2, store: int = 0, stop: bool = True, deal: bool = True,
) -> StageCycles:
    """Cycles of a frame on lanes; `config` gives form and FIFO depth. Channel counters are sums of two lanes; those without meaning here are 0."""
    counters = np.zeros((CORES, COUNTERS_PER_CORE), np.int64)
    end = np.zeros(work.subtiles, np.int64)
    ends = np.zeros(CORES, np.int64)
    blend, last = vru_stages(config.form)
    length = np.diff(work.start)
    if deal:
        tiles = np.arange(work.subtiles).reshape(work.rows, work.cols)
        r, c = np.indices(tiles.shape)
        key = ((r // 2) * ((work.cols + 1) // 2) + c // 2) * 4 + (r % 2) * 2 + c % 2
        order = tiles.ravel()[np.argsort(key.ravel(), kind="stable")]
        order = order[length[order] > 0]
        i = np.arange(len(order))
        orders = [order[(i + i // CORES) % CORES == k] for k in range(CORES)]
    else:
        orders = [work.order[a:b][length[work.order[a:b]] > 0] for a, b in zip(work.core_start, work.core_start[1:])]
    core_start = np.concatenate(([0], np.cumsum([len(o) for o in orders])))
    _cores(
        np.concatenate(orders), core_start, work.start, work.visit_masks(), work.pixel_finish, LANE, PLACE, PIXEL, latency,
        config.fifo_depth, blend, last + 1, loop, window, width, ports, buffers, store or 8 * config.fifo_depth, stop, counters, end, ends,
    )
    cycles = int(ends.max())
    counters[:, 0] = cycles
    counters[:, IDLE] += cycles - ends
    ended = (work.pixel_finish < length[:, None]).reshape(-1, 4, 16).sum(axis=2)
    for k in range(CORES):
        counters[k, N_CORE + FINISHED :: N_CHANNEL] = ended[orders[k]].sum(axis=0)
    return StageCycles(cycles, counters, end)
