"""Cycle model of a rendering stage whose VRUs visit single pixels: a proposal, no RTL exists.

As `render_stage`, but a splat comes with a 16-bit pixel mask per mini-tile, and each of a channel's VRUs visits the set pixels among its own, one
per cycle; the channel's VRUs take the next splat together. A mask that is empty after the finished pixels have been taken out is not
written. Masks come from a generator that takes one element per `rate` cycles and core and has `latency` stages, held as the CTU's pipeline is.
A VRU's read-modify-write loops take `loop` cycles: the same pixel is not visited again before that. Pixels are visited in ascending order.
Finished pixels are known as late as in the RTL.
"""

from __future__ import annotations

import numba
import numpy as np

from ..params import CORES, COUNTERS_PER_CORE, RenderConfig, vru_stages
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
from .work import SPLITS, Work

GENERATOR_LATENCY = 16
LOOP = 4  # rtl/render/flk_vru.sv


@numba.njit(cache=True)
def _core(order, start, visit, rate, pixel_finish, split, latency, depth, blend, out_delay, loop, ports, buffers, halt, count, end):
    """One core; returns the cycle after its last pixel. Values as in `render_stage._core`."""
    n_sub = len(order)
    ring = 256
    pipe = np.full(ring, -3, np.int64)  # position in the arrays, TOKEN - sub-tile ordinal (all <= TOKEN), -3 never used
    ready = np.zeros(ring, np.int64)
    p_read = 0
    p_used = 0
    fifo = np.zeros((4, depth), np.int64)
    read = np.zeros(4, np.int64)
    used = np.zeros(4, np.int64)
    tokens = np.zeros(4, np.int64)
    token_gone = np.full(4, -NEVER, np.int64)
    sub = np.zeros(4, np.int64)
    busy_until = np.zeros(4, np.int64)
    known = np.full((4, 16), NEVER, np.int64)  # cycle from which a pixel is known to be finished
    visited = np.full((4, 16), -NEVER, np.int64)  # cycle of the last visit
    # output buffers, a ring per channel: sub-tile, pixels left, cycle from which it is full
    b_sub = np.zeros((4, buffers), np.int64)
    b_left = np.zeros((4, buffers), np.int64)
    b_full = np.zeros((4, buffers), np.int64)
    b_read = np.zeros(4, np.int64)
    b_used = np.zeros(4, np.int64)
    core_first = 0
    last_served = 0
    arrived = np.zeros(n_sub, np.int64)
    total_out = 0
    sub_in = 0
    at = start[order[0]] if n_sub else np.int64(0)
    next_in = np.int64(0)
    t = np.int64(0)
    while total_out < 64 * n_sub:
        stall = False
        for c in range(4):
            if used[c] == depth:
                stall = True
                count[N_CORE + c * N_CHANNEL + FULL] += 1
        # ---- dispatch: the oldest mask, if it is complete
        moved = False
        pos = np.int64(0)
        write = 0
        token = False
        if p_used > 0 and ready[p_read] <= t:
            pos = pipe[p_read]
            token = pos <= TOKEN
            moved = True
            for c in range(4):
                if token:
                    write |= 1 << c
                else:
                    bits = np.int64(visit[pos, c])
                    if bits != 0 and tokens[c] == 0 and t > token_gone[c] + blend:
                        for p in range(16):
                            if known[c, p] <= t:
                                bits &= ~(1 << p)
                    if bits != 0:
                        write |= 1 << c
                if write >> c & 1 and used[c] == depth:
                    moved = False
        # ---- channels
        for c in range(4):
            if used[c] == 0 or busy_until[c] > t:
                if busy_until[c] > t:
                    count[N_CORE + c * N_CHANNEL + VRU_BUSY] += 1
                continue
            head = fifo[c, read[c]]
            if head <= TOKEN:
                if b_used[c] == buffers:
                    continue
                tokens[c] -= 1
                token_gone[c] = t
                w = (b_read[c] + b_used[c]) % buffers
                b_sub[c, w] = sub[c]
                b_left[c, w] = 16
                b_full[c, w] = t + out_delay
                b_used[c] += 1
                sub[c] += 1
                for p in range(16):
                    known[c, p] = NEVER
                    visited[c, p] = -NEVER
            else:
                s = order[sub[c]]
                n = head - start[s]
                bits = np.int64(visit[head, c])
                last = t
                for v in range(2):
                    at_v = t
                    for p in range(16):
                        if not (bits >> p) & 1 or ((split >> p) & 1) == v or known[c, p] <= t:
                            continue
                        at_v = max(at_v, visited[c, p] + loop)
                        visited[c, p] = at_v
                        if n == pixel_finish[s, c * 16 + p]:
                            known[c, p] = at_v + blend + 1
                        at_v += 1
                    last = max(last, at_v)
                base = N_CORE + c * N_CHANNEL
                if last == t:
                    count[base + DISCARDED] += 1
                    last = t + 1
                else:
                    count[base + VRU_BUSY] += 1
                    count[base + SENT] += 1
                busy_until[c] = last
            read[c] += 1
            if read[c] == depth:
                read[c] = 0
            used[c] -= 1
        # ---- pixels out
        sent = 0
        for i in range(4):
            c = (core_first + i) & 3
            r = b_read[c]
            if sent < ports and b_used[c] > 0 and b_full[c, r] <= t:
                sent += 1
                b_left[c, r] -= 1
                total_out += 1
                k = b_sub[c, r]
                arrived[k] += 1
                if arrived[k] == 64:
                    end[order[k]] = t
                if b_left[c, r] == 0:
                    b_read[c] = (r + 1) % buffers
                    b_used[c] -= 1
                last_served = c
        if sent > 0:
            core_first = (last_served + 1) & 3
        if moved:
            for c in range(4):
                if write >> c & 1:
                    w = read[c] + used[c]
                    if w >= depth:
                        w -= depth
                    fifo[c, w] = pos
                    used[c] += 1
                    if token:
                        tokens[c] += 1
                    else:
                        count[DELIVERED] += 1
            if not token and write == 0:
                count[REJECTED] += 1
            p_read = (p_read + 1) % ring
            p_used -= 1
        # ---- generator
        if sub_in < n_sub:
            blocked = p_used > 0 and ready[p_read] <= t and not moved
            if (stall and halt) or blocked or t < next_in or p_used >= latency:
                count[STALLED] += 1
            else:
                w = (p_read + p_used) % ring
                s = order[sub_in]
                count[BUSY] += 1
                if at == start[s + 1]:
                    pipe[w] = TOKEN - sub_in
                    count[SUBTILES] += 1
                    next_in = t + 1
                    sub_in += 1
                    if sub_in < n_sub:
                        at = start[order[sub_in]]
                else:
                    pipe[w] = at
                    count[GAUSSIANS_IN] += 1
                    next_in = t + max(1, rate[at])
                    at += 1
                ready[w] = t + latency
                p_used += 1
        else:
            count[IDLE] += 1
        t += 1
    return t


@numba.njit(parallel=True, cache=True)
def _cores(order, core_start, start, visit, rate, pixel_finish, split, latency, depth, blend, out_delay, loop, ports, buffers, halt, counters, end, ends):
    for k in numba.prange(CORES):
        ends[k] = _core(
            order[core_start[k] : core_start[k + 1]], start, visit, rate, pixel_finish, split, latency, depth, blend, out_delay, loop,
            ports, buffers, halt, counters[k], end,
        )


def simulate_pixels(
    work: Work, config: RenderConfig, *, split: str = "checkerboard", latency: int = GENERATOR_LATENCY, loop: int = LOOP,
    ports: int = 1, buffers: int = 1, halt: bool = True,
) -> StageCycles:
    """Cycles of a frame with pixel masks; `config` gives form and FIFO depth. Counters that have no meaning here are 0."""
    if config.vrus_per_channel != 2:
        raise ValueError("single pixels are modelled for two VRUs per channel")
    counters = np.zeros((CORES, COUNTERS_PER_CORE), np.int64)
    end = np.zeros(work.subtiles, np.int64)
    ends = np.zeros(CORES, np.int64)
    blend, last = vru_stages(config.form)
    _cores(
        work.order, work.core_start, work.start, work.visit_masks(), work.test_cycles, work.pixel_finish, SPLITS[split], latency,
        config.fifo_depth, blend, last + 1, loop, ports, buffers, halt, counters, end, ends,
    )
    return sum_up(work, work.order, work.core_start, counters, end, ends)
