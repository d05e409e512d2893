"""Cycle model of the rendering stage: cycles and every performance counter of the RTL, from the work of a frame.

Modelled, cycle by cycle: acceptance and stall of the mask generator (called CTU below), its pipeline (held, or with output FIFO), the wait of a
token for the one before it if the generator has that rule,
dispatch with filter of finished mini-tiles, feature FIFOs, issue to the VRUs, the delay after which a finished mini-tile is known, dropping, the
token's wait for the output buffers, both levels of pixel arbiters. Left out: numbers (masks and finished pixels are
recorded events, `flicker.perf.work.Work`), stalls from outside, i.e. input is always there and pixels are always taken.

Cores are independent; the frame ends with the last pixel of the last core.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..params import (
    CHANNEL_COUNTERS,
    CHANNELS,
    CORE_COUNTERS,
    CORES,
    COUNTERS_PER_CORE,
    RenderConfig,
    vru_stages,
)
from .work import Work

_CORE = {name: i for i, (name, _) in enumerate(CORE_COUNTERS)}
_CHANNEL = {name: i for i, (name, _) in enumerate(CHANNEL_COUNTERS)}
N_CORE, N_CHANNEL = len(CORE_COUNTERS), len(CHANNEL_COUNTERS)
SUBTILES, GAUSSIANS_IN, REJECTED = _CORE["subtiles"], _CORE["gaussians_in"], _CORE["gaussians_rejected"]
BUSY, STALLED, IDLE = _CORE["ctu_busy"], _CORE["ctu_stalled"], _CORE["ctu_idle"]
TESTED, DELIVERED, FILTERED = _CORE["minitiles_tested"], _CORE["minitiles_delivered"], _CORE["minitiles_filtered"]
FULL, VRU_BUSY, SENT = _CHANNEL["fifo_full"], _CHANNEL["vru_busy"], _CHANNEL["minitiles_sent"]
DISCARDED, FINISHED = _CHANNEL["minitiles_discarded"], _CHANNEL["pixels_finished"]

NEVER = np.int64(1) << 60
TOKEN = np.int64(-1)
MAX_DEPTH = 1024


@dataclass
class StageCycles:
    """Result of the model.

    cycles: of the frame. counters: int64 (CORES, COUNTERS_PER_CORE), as the RTL's counter vector at the frame's end.
    subtile_end: int64 (S,), cycle in which the last pixel of each sub-tile left.
    """

    cycles: int
    counters: np.ndarray
    subtile_end: np.ndarray

    def core(self, name: str) -> np.ndarray:
        """(CORES,) values of a core counter."""
        return self.counters[:, _CORE[name]]

    def channel(self, name: str) -> np.ndarray:
        """(CORES, CHANNELS) values of a channel counter."""
        first = N_CORE + _CHANNEL[name]
        return self.counters[:, first : first + CHANNELS * N_CHANNEL : N_CHANNEL]

    @property
    def utilisation(self) -> float:
        """Share of the cycles in which a channel issues pixels."""
        return float(self.channel("vru_busy").sum() / (self.cycles * CORES * CHANNELS))

    @property
    def stall_rate(self) -> float:
        """Share of the cycles in which a CTU has input but cannot take it."""
        return float(self.core("ctu_stalled").sum() / (self.cycles * CORES))


@numba.njit(cache=True)
def finish_events(pixel_finish, start, per_vru, last, op):
    """Per sub-tile and mini-tile: position of the element that finishes its last pixel (list length: none), and the operation of that
    element (pixel within its VRU) that does."""
    for s in range(len(last)):
        for m in range(4):
            at = -1
            for p in range(16):
                at = max(at, pixel_finish[s, m * 16 + p])
            k = 0
            for p in range(16):
                if pixel_finish[s, m * 16 + p] == at:
                    k = max(k, p % per_vru)
            last[s, m] = at
            op[s, m] = k


@numba.njit(forceinline=True)
def _ones(mask):
    """Set bits of a mini-tile mask."""
    return (mask & 1) + (mask >> 1 & 1) + (mask >> 2 & 1) + (mask >> 3 & 1)


@numba.njit(cache=True)
def _core(order, start, mask, test_cycles, finish, finish_op, ctu_latency, ctu_depth, one_token, depth, blend, out_delay, per_vru, vrus, count, end):
    """One core: fills its counters (all but `cycles`, idle cycles after its own end and `pixels_finished`) and the end of each
    sub-tile; returns the cycle after its last pixel.

    Values at the start of cycle t are those of the RTL's registers; what a cycle does is seen in the next. What a channel does with a splat is
    settled when it begins with it, so its state changes then and when the splat leaves the FIFO.
    """
    n_sub = len(order)
    # CTU: the pipeline holds element positions in ring slots; slot 0 is the one that entered last.
    pipe = np.full(ctu_latency, -3, np.int64)  # position, TOKEN, -2: first batch of a dense element, -3: bubble
    pipe_mask = np.zeros(ctu_latency, np.int64)
    head_slot = 0  # of the pipeline ring: the slot at the end of the pipeline
    in_flight = 0  # slots that are not bubbles
    batch = False
    eos_free = np.int64(0)  # cycle from which a token may be taken, with one_token
    sub_in = 0
    at = start[order[0]] if n_sub else np.int64(0)
    last_at = start[order[0] + 1] if n_sub else np.int64(0)
    # output FIFO of the CTU
    size = max(ctu_depth, 1)
    q_pos = np.zeros(size, np.int64)
    q_mask = np.zeros(size, np.int64)
    q_read = 0
    q_used = 0
    taken = 0
    # channels
    fifo = np.zeros((4, depth), np.int64)
    read = np.zeros(4, np.int64)
    used = np.zeros(4, np.int64)
    tokens = np.zeros(4, np.int64)  # in the FIFO
    token_gone = np.full(4, -NEVER, np.int64)  # cycle in which the last token was issued
    sub = np.zeros(4, np.int64)  # ordinal of the sub-tile at the pixels
    done_at = np.full(4, NEVER, np.int64)  # cycle from which all pixels are known to be finished
    leaves_at = np.full(4, NEVER, np.int64)  # cycle in which the splat that is worked on leaves the FIFO
    broken = np.zeros(4, np.bool_)  # it is broken off then
    full_since = np.zeros(4, np.int64)
    full_mask = 0  # channels whose FIFO is full
    # outputs: per channel and VRU
    left = np.zeros((4, vrus), np.int64)
    out_at = np.full(4, NEVER, np.int64)  # cycle from which a channel has pixels to give
    next_out = NEVER  # the first of them
    waiting = np.zeros(4, np.int64)  # pixels not yet out
    first = np.zeros(4, np.int64)
    core_first = 0
    sub_out = np.zeros(4, np.int64)
    arrived = np.zeros(n_sub, np.int64)
    subs_out = 0
    busy = stalled = delivered = filtered_out = tested = rejected = gaussians = 0
    t = np.int64(0)
    while subs_out < n_sub:
        # ---- dispatch and CTU, from the registers of this cycle
        out_pos = np.int64(-3)
        out_mask = np.int64(0)
        if ctu_depth == 0:
            out_pos = pipe[head_slot]
            out_mask = pipe_mask[head_slot]
            if out_pos < TOKEN or out_mask == 0:
                out_pos = np.int64(-3)
        elif q_used > 0:
            out_pos = q_pos[q_read]
            out_mask = q_mask[q_read]
        transfer = False
        target = np.int64(0)
        if out_pos != -3:
            filtered = np.int64(0)
            if out_pos != TOKEN:
                for c in range(4):
                    if done_at[c] <= t and tokens[c] == 0 and t > token_gone[c] + blend:
                        filtered |= 1 << c
                filtered &= out_mask
            target = out_mask & ~filtered
            if target & full_mask == 0:
                transfer = True
                if out_pos != TOKEN:
                    delivered += _ones(target)
                    filtered_out += _ones(filtered)
        advance = ctu_depth > 0 or out_pos == -3 or transfer
        stall = full_mask != 0
        # ---- channels: issue, drop, token
        changed = 0
        for c in range(4):
            if used[c] == 0 or (t < leaves_at[c] and leaves_at[c] != NEVER):
                continue
            pop = False
            if leaves_at[c] == t:
                pop = True
                leaves_at[c] = NEVER
                if broken[c]:
                    count[N_CORE + c * N_CHANNEL + DISCARDED] += 1
            else:
                head = fifo[c, read[c]]
                if head == TOKEN:
                    if waiting[c] == 0:
                        pop = True
                        tokens[c] -= 1
                        token_gone[c] = t
                        done_at[c] = NEVER
                        sub[c] += 1
                        for v in range(vrus):
                            left[c, v] = per_vru
                        out_at[c] = t + out_delay
                        next_out = min(next_out, out_at[c])
                        waiting[c] = 16
                elif done_at[c] <= t:
                    pop = True
                    count[N_CORE + c * N_CHANNEL + DISCARDED] += 1
                else:
                    s = order[sub[c]]
                    base = N_CORE + c * N_CHANNEL
                    if head <= finish[s, c]:
                        count[base + SENT] += 1
                    broken[c] = done_at[c] < t + per_vru
                    if broken[c]:
                        leaves_at[c] = done_at[c]
                        count[base + VRU_BUSY] += done_at[c] - t
                    else:
                        leaves_at[c] = t + per_vru - 1
                        count[base + VRU_BUSY] += per_vru
                    if head == finish[s, c]:
                        done_at[c] = t + finish_op[s, c] + blend + 1
            if pop:
                read[c] += 1
                if read[c] == depth:
                    read[c] = 0
                used[c] -= 1
                changed |= 1 << c
        # ---- pixels out: a round-robin choice of channel, then of VRU
        if next_out <= t:
            c = core_first
            while out_at[c] > t:
                c = (c + 1) & 3
            core_first = (c + 1) & 3
            v = first[c]
            while left[c, v] == 0:
                v += 1
                if v == vrus:
                    v = 0
            left[c, v] -= 1
            first[c] = v + 1 if v + 1 < vrus else 0
            waiting[c] -= 1
            if waiting[c] == 0:
                k = sub_out[c]
                sub_out[c] += 1
                arrived[k] += 1
                if arrived[k] == 4:
                    end[order[k]] = t
                    subs_out += 1
                out_at[c] = NEVER
                next_out = min(min(out_at[0], out_at[1]), min(out_at[2], out_at[3]))
        # ---- writes of this cycle
        if transfer:
            for c in range(4):
                if target >> c & 1:
                    w = read[c] + used[c]
                    if w >= depth:
                        w -= depth
                    fifo[c, w] = out_pos
                    used[c] += 1
                    if out_pos == TOKEN:
                        tokens[c] += 1
            changed |= target
            if ctu_depth > 0:
                q_read += 1
                if q_read == size:
                    q_read = 0
                q_used -= 1
                taken -= 1
        if changed:
            for c in range(4):
                if changed >> c & 1:
                    if used[c] == depth:
                        if not full_mask >> c & 1:
                            full_mask |= 1 << c
                            full_since[c] = t
                    elif full_mask >> c & 1:
                        full_mask &= ~(1 << c)
                        count[N_CORE + c * N_CHANNEL + FULL] += t - full_since[c]
        # ---- CTU: acceptance and results
        issued = False
        if sub_in < n_sub:
            space = ctu_depth == 0 or taken + (1 if transfer and ctu_depth > 0 else 0) < ctu_depth
            if space and advance and not stall and not (at == last_at and t < eos_free):
                issued = True
                busy += 1
            else:
                stalled += 1
        if advance and (issued or in_flight > 0):
            # the end of the pipeline leaves, its slot becomes the first
            gone = pipe[head_slot]
            gone_mask = pipe_mask[head_slot]
            if gone != -3:
                in_flight -= 1
            if gone >= TOKEN:
                if gone == TOKEN:
                    if one_token:
                        eos_free = t + 2
                else:
                    if gone_mask == 0:
                        rejected += 1
                        if ctu_depth > 0:
                            taken -= 1
                    tested += _ones(gone_mask)
                if ctu_depth > 0 and gone_mask != 0:
                    w = q_read + q_used
                    if w >= size:
                        w -= size
                    q_pos[w] = gone
                    q_mask[w] = gone_mask
                    q_used += 1
            entering = np.int64(-3)
            entering_mask = np.int64(0)
            if issued:
                in_flight += 1
                if at == last_at:
                    entering = TOKEN
                    entering_mask = np.int64(15)
                    if one_token:
                        eos_free = NEVER
                    sub_in += 1
                    if sub_in < n_sub:
                        at = start[order[sub_in]]
                        last_at = start[order[sub_in] + 1]
                    taken += 1
                elif test_cycles[at] == 2 and not batch:
                    entering = np.int64(-2)
                    batch = True
                else:
                    entering = at - start[order[sub_in]]
                    entering_mask = np.int64(mask[at])
                    batch = False
                    gaussians += 1
                    taken += 1
                    at += 1
            pipe[head_slot] = entering
            pipe_mask[head_slot] = entering_mask
            head_slot += 1
            if head_slot == ctu_latency:
                head_slot = 0
        t += 1
    count[SUBTILES] = n_sub
    count[GAUSSIANS_IN] = gaussians
    count[REJECTED] = rejected
    count[BUSY] = busy
    count[STALLED] = stalled
    count[IDLE] = t - busy - stalled
    count[TESTED] = tested
    count[DELIVERED] = delivered
    count[FILTERED] = filtered_out
    return t


@numba.njit(parallel=True, cache=True)
def _cores(order, core_start, start, mask, test_cycles, finish, finish_op, ctu_latency, ctu_depth, one_token, depth, blend, out_delay, per_vru, vrus,
           counters, end, ends):
    for k in numba.prange(CORES):
        ends[k] = _core(
            order[core_start[k] : core_start[k + 1]], start, mask, test_cycles, finish, finish_op, ctu_latency, ctu_depth, one_token, depth, blend,
            out_delay, per_vru, vrus, counters[k], end,
        )


def sum_up(
    work: Work, order: np.ndarray, core_start: np.ndarray, counters: np.ndarray, end: np.ndarray, ends: np.ndarray
) -> StageCycles:
    """Result of a frame that has run: adds to `counters` what is known at its end (cycles, idle time after a core's last one, pixels finished).

    order, core_start: sub-tiles as the cores took them, as in `Work`; end: of each sub-tile; ends: of each core.
    """
    cycles = int(ends.max())
    counters[:, _CORE["cycles"]] = cycles
    counters[:, IDLE] += cycles - ends
    ended = (work.pixel_finish < np.diff(work.start)[:, None]).reshape(-1, CHANNELS, 16).sum(axis=2)
    for k in range(CORES):
        counters[k, N_CORE + FINISHED :: N_CHANNEL] = ended[order[core_start[k] : core_start[k + 1]]].sum(axis=0)
    return StageCycles(cycles, counters, end)


def simulate(work: Work, config: RenderConfig) -> StageCycles:
    """Cycles and counters of a frame. work: of masks that send whole mini-tiles (`work.visit` None)."""
    if work.visit is not None:
        raise ValueError("the RTL's VRUs visit whole mini-tiles")
    per_vru = config.pixels_per_vru
    finish = np.empty((work.subtiles, 4), np.int64)
    finish_op = np.empty((work.subtiles, 4), np.int64)
    finish_events(work.pixel_finish, work.start, per_vru, finish, finish_op)
    counters = np.zeros((CORES, COUNTERS_PER_CORE), np.int64)
    end = np.zeros(work.subtiles, np.int64)
    ends = np.zeros(CORES, np.int64)
    blend, last = vru_stages(config.form)
    _cores(
        work.order, work.core_start, work.start, work.mask, work.test_cycles, finish, finish_op,
        config.generator.latency(config), config.ctu_fifo_depth, config.generator.one_token, config.fifo_depth, blend, last + 1, per_vru,
        config.vrus_per_channel, counters, end, ends,
    )
    return sum_up(work, work.order, work.core_start, counters, end, ends)
