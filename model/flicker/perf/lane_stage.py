"""Cycle model of a rendering stage of lanes: a proposal, no RTL exists.

A core's eight VRUs ("lanes") each hold eight pixels that are scattered over the whole sub-tile (`lane_of_pixel`), have a FIFO of their own and never wait for
each other. Any splat that covers an area then spreads over all lanes evenly, wherever it lies, which mini-tiles shared by two VRUs
(`pixel_stage`) cannot: there a small splat keeps one channel busy and the others idle.

An element comes with a 64-bit pixel mask from a generator of `latency` stages, held as the CTU's pipeline is, that takes `width` elements a cycle. Each lane
with set pixels gets the record and its own eight mask bits, finished pixels taken out; an element waits until every lane it needs has room.
A lane visits one pixel per cycle: of the `window` oldest entries the first pixel whose read-modify-write loop (`loop` cycles) is over, oldest entry
first, so each pixel sees its splats in order. Entries without pixels leave at the end of a cycle.
An end-of-sub-tile token moves the eight pixels to one of `buffers` output buffers; `ports` pixels leave a core per cycle.

Sub-tiles with an empty list are not streamed (the background is theirs). Once all 64 pixels are known to be finished, the input goes on to the
token. Finished pixels are known as late as in the RTL. A 2-cycle loop is the multiplication of the transmittance in two stages; colours are
then added in fixed-point accumulators in one (`flicker.golden.masked.accumulate`), for which the RTL's FP16 adders need three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..params import CHANNELS, CORES, COUNTERS_PER_CORE, MINITILE, SUBTILE, RenderConfig, vru_stages
from .pixel_stage import GENERATOR_LATENCY
from .render_stage import (
    BUSY,
    DELIVERED,
    DISCARDED,
    FULL,
    GAUSSIANS_IN,
    IDLE,
    N_CHANNEL,
    N_CORE,
    NEVER,
    REJECTED,
    SENT,
    STALLED,
    SUBTILES,
    TOKEN,
    VRU_BUSY,
    StageCycles,
    sum_up,
)
from .work import Work

LANES = 8  # VRUs of a core


def lane_of_pixel(lanes: int = LANES) -> np.ndarray:
    """int64 (64,): lane of pixel 16 m + i (mini-tile m).

    Eight lanes: (column + 3 row) modulo 8; all are different in every row, every column and every 2x3 and 3x2 block, a 3x3 block
    has one lane twice. Sixteen: column modulo 4 + 4 (row modulo 4).
    """
    if lanes not in (8, 16):
        raise ValueError(f"lanes: 8 or 16 a core, not {lanes}")
    lane = np.empty(CHANNELS * MINITILE * MINITILE, np.int64)
    for y in range(SUBTILE):
        for x in range(SUBTILE):
            pixel = 16 * (y // MINITILE * 2 + x // MINITILE) + y % MINITILE * MINITILE + x % MINITILE
            lane[pixel] = (x + 3 * y) % 8 if lanes == 8 else x % 4 + 4 * (y % 4)
    return lane


@numba.njit(cache=True)
def _core(order, start, visit, pixel_finish, lane, place, pixel, latency, depth, blend, out_delay, loop, window, width, ports, buffers,
          count, end):
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
                count[N_CORE + (l * 4 // lanes) * N_CHANNEL + FULL] += 1
        room = depth - used
        for l in range(lanes):
            base = N_CORE + (l * 4 // lanes) * N_CHANNEL
            if used[l] == 0:
                continue
            issued = False
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
                    elif not issued and visited[l, p] + loop <= t:
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
                if todo == 0 and leave == j:
                    leave = j + 1
            read[l] = (read[l] + leave) % depth
            used[l] -= leave
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
            for l in range(lanes):
                if token or bits[l]:
                    any_lane = True
                    if room[l] == 0:
                        fits = False
            if not fits:
                break
            for l in range(lanes):
                if token or bits[l]:
                    w = (read[l] + used[l]) % depth
                    fifo[l, w] = pos
                    wants[l, w] = bits[l]
                    used[l] += 1
                    room[l] -= 1
                    if not token:
                        count[DELIVERED] += 1
                        count[N_CORE + (l * 4 // lanes) * N_CHANNEL + SENT] += 1
            if token:
                at_out += 1
            elif not any_lane:
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
                for _ in range(width):
                    if sub_in == n_sub:
                        break
                    s = order[sub_in]
                    if finished[sub_in] == 64 and finished_at[sub_in] <= t:
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
           buffers, counters, end, ends):
    for k in numba.prange(CORES):
        ends[k] = _core(
            order[core_start[k] : core_start[k + 1]], start, visit, pixel_finish, lane, place, pixel, latency, depth, blend, out_delay,
            loop, window, width, ports, buffers, counters[k], end,
        )


@dataclass(frozen=True)
class LaneStage:
    """Options of the stage; the module's docstring says what they mean."""

    window: int = 1
    width: int = 1
    loop: int = 2
    ports: int = 4
    buffers: int = 1
    latency: int = GENERATOR_LATENCY


def deal(work: Work) -> list[np.ndarray]:
    """Sub-tiles that are not empty, dealt out to the cores tile by tile, every tile's first one to another core.

    The RTL's fixed places in the tile load its cores up to 3 % differently.
    """
    row, col = np.divmod(np.arange(work.subtiles), work.cols)
    tile = row // 2 * ((work.cols + 1) // 2) + col // 2
    order = np.lexsort((row % 2 * 2 + col % 2, tile))
    order = order[np.diff(work.start)[order] > 0]
    i = np.arange(len(order))
    return [order[(i + i // CORES) % CORES == k] for k in range(CORES)]


def simulate_lanes(work: Work, config: RenderConfig, stage: LaneStage = LaneStage(), lanes: int = LANES) -> StageCycles:
    """Cycles of a frame on `lanes` lanes a core; `config` gives form and FIFO depth.

    Channel counters are sums over a quarter of the lanes; those without meaning here are 0.
    """
    counters = np.zeros((CORES, COUNTERS_PER_CORE), np.int64)
    end = np.zeros(work.subtiles, np.int64)
    ends = np.zeros(CORES, np.int64)
    blend, last = vru_stages(config.form)
    lane = lane_of_pixel(lanes)
    pixel = np.array([np.flatnonzero(lane == i) for i in range(lanes)])  # of each bit of a lane's mask
    place = np.array([np.flatnonzero(pixel[lane[p]] == p)[0] for p in range(len(lane))])  # the bit of each pixel
    orders = deal(work)
    order = np.concatenate(orders)
    core_start = np.concatenate(([0], np.cumsum([len(o) for o in orders])))
    _cores(
        order, core_start, work.start, work.visit_masks(), work.pixel_finish, lane, place, pixel, stage.latency,
        config.fifo_depth, blend, last + 1, stage.loop, stage.window, stage.width, stage.ports, stage.buffers, counters, end, ends,
    )
    return sum_up(work, order, core_start, counters, end, ends)
