"""Cycle model of the rendering stage: cycles and every performance counter of the RTL, from the work of a frame.

Modelled, cycle by cycle: acceptance and stall of the CTU, its pipeline (held, or with output FIFO), the wait of a token for the one before it,
dispatch with filter of finished mini-tiles, feature FIFOs, issue to the VRUs, the delay after which a finished mini-tile is known, dropping, the
token's wait for the output buffers, both levels of pixel arbiters. Left out: numbers (masks and finished pixels are
recorded events, `flicker.methods.work.Work`), stalls from outside, i.e. input is always there and pixels are always taken.

Cores are independent; the frame ends with the last pixel of the last core.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..methods.work import Work
from ..params import (
    CHANNEL_COUNTERS,
    CHANNELS,
    CORE_COUNTERS,
    CORES,
    COUNTERS_PER_CORE,
    PIXELS_PER_VRU,
    VRUS_PER_CHANNEL,
    RenderConfig,
    prtu_latency,
    vru_stages,
)

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
def _finish_events(pixel_finish, start, per_vru, last, op):
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


@numba.njit(cache=True)
def _core(order, start, mask, test_cycles, finish, finish_op, ctu_latency, ctu_depth, depth, blend, out_delay, per_vru, vrus, count, end):
    """One core: fills its counters (all but `cycles`, idle cycles after its own end and `pixels_finished`) and the end of each
    sub-tile; returns the cycle after its last pixel.

    Values at the start of cycle t are those of the RTL's registers; what a cycle does is seen in the next.
    """
    n_sub = len(order)
    # CTU: the pipeline holds element positions in ring slots; slot 0 is the one that entered last.
    pipe = np.full(ctu_latency, -3, np.int64)  # position, TOKEN, -2: first batch of a dense element, -3: bubble
    pipe_mask = np.zeros(ctu_latency, np.int64)
    head_slot = 0  # of the pipeline ring: the slot at the end of the pipeline
    in_flight = 0  # slots that are not bubbles
    batch = False
    eos_free = np.int64(0)  # cycle from which a token may be taken
    sub_in = 0
    at = start[order[0]] if n_sub else np.int64(0)
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
    pixel = np.zeros(4, np.int64)
    done_at = np.full(4, NEVER, np.int64)  # cycle from which all pixels are known to be finished
    # outputs: per channel and VRU
    full_at = np.full((4, vrus), NEVER, np.int64)
    left = np.zeros((4, vrus), np.int64)
    waiting = np.zeros(4, np.int64)  # pixels not yet out
    first = np.zeros(4, np.int64)
    core_first = 0
    sub_out = np.zeros(4, np.int64)
    open_pixels = np.zeros(4, np.int64)
    arrived = np.zeros(n_sub, np.int64)
    total_out = 0
    total_pixels = 64 * n_sub
    t = np.int64(0)
    full_mask = 0  # channels whose FIFO is full
    while total_out < total_pixels:
        # ---- dispatch and CTU, from the registers of this cycle
        stall = full_mask != 0
        if stall:
            for c in range(4):
                if full_mask >> c & 1:
                    count[N_CORE + c * N_CHANNEL + FULL] += 1
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
                    for c in range(4):
                        count[DELIVERED] += target >> c & 1
                        count[FILTERED] += filtered >> c & 1
        advance = ctu_depth > 0 or out_pos == -3 or transfer
        # ---- channels: issue, drop, token
        for c in range(4):
            if used[c] == 0:
                continue
            head = fifo[c, read[c]]
            pop = False
            if head == TOKEN:
                if waiting[c] == 0:
                    pop = True
                    tokens[c] -= 1
                    token_gone[c] = t
                    done_at[c] = NEVER
                    sub[c] += 1
                    for v in range(vrus):
                        left[c, v] = per_vru
                        full_at[c, v] = t + out_delay
                    waiting[c] = 16
                    open_pixels[c] = 16
            elif done_at[c] <= t:
                pop = True
                pixel[c] = 0
                count[N_CORE + c * N_CHANNEL + DISCARDED] += 1
            else:
                base = N_CORE + c * N_CHANNEL
                count[base + VRU_BUSY] += 1
                s = order[sub[c]]
                if pixel[c] == 0 and head <= finish[s, c]:
                    count[base + SENT] += 1
                if head == finish[s, c] and pixel[c] == finish_op[s, c]:
                    done_at[c] = t + blend + 1
                pixel[c] += 1
                if pixel[c] == per_vru:
                    pixel[c] = 0
                    pop = True
            if pop:
                read[c] += 1
                if read[c] == depth:
                    read[c] = 0
                used[c] -= 1
        # ---- pixels out: a round-robin choice of channel, then of VRU
        chosen = -1
        n_waiting = 0
        for i in range(4):
            c = (core_first + i) & 3
            if waiting[c] > 0:
                for v in range(vrus):
                    if left[c, v] > 0 and full_at[c, v] <= t:
                        n_waiting += 1
                        if chosen < 0:
                            chosen = c
                        break
        if n_waiting > 0:
            for c in range(4):
                if waiting[c] == 0:
                    continue
                pick = -1
                for i in range(vrus):
                    v = (first[c] + i) % vrus
                    if left[c, v] > 0 and full_at[c, v] <= t:
                        pick = v
                        break
                if pick < 0:
                    continue
                first[c] = pick
                if c == chosen:
                    left[c, pick] -= 1
                    waiting[c] -= 1
                    if left[c, pick] == 0:
                        full_at[c, pick] = NEVER
                    first[c] = (pick + 1) % vrus
                    total_out += 1
                    k = sub_out[c]
                    arrived[k] += 1
                    if arrived[k] == 64:
                        end[order[k]] = t
                    open_pixels[c] -= 1
                    if open_pixels[c] == 0:
                        sub_out[c] += 1
            core_first = (chosen + 1) & 3
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
            if ctu_depth > 0:
                q_read += 1
                if q_read == size:
                    q_read = 0
                q_used -= 1
                taken -= 1
        full_mask = 0
        for c in range(4):
            if used[c] == depth:
                full_mask |= 1 << c
        # ---- CTU: acceptance and results
        issued = False
        if sub_in < n_sub:
            s = order[sub_in]
            token = at == start[s + 1]
            space = ctu_depth == 0 or taken + (1 if transfer and ctu_depth > 0 else 0) < ctu_depth
            if space and advance and not stall and not (token and t < eos_free):
                issued = True
                count[BUSY] += 1
            else:
                count[STALLED] += 1
        else:
            count[IDLE] += 1
        if advance:
            # the end of the pipeline leaves, its slot becomes the first
            gone = pipe[head_slot]
            gone_mask = pipe_mask[head_slot]
            if gone != -3:
                in_flight -= 1
            if gone >= TOKEN:
                if gone == TOKEN:
                    eos_free = t + 2
                else:
                    if gone_mask == 0:
                        count[REJECTED] += 1
                        if ctu_depth > 0:
                            taken -= 1
                    for c in range(4):
                        count[TESTED] += gone_mask >> c & 1
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
                s = order[sub_in]
                if at == start[s + 1]:
                    entering = TOKEN
                    entering_mask = np.int64(15)
                    eos_free = NEVER
                    count[SUBTILES] += 1
                    sub_in += 1
                    if sub_in < n_sub:
                        at = start[order[sub_in]]
                    taken += 1
                elif test_cycles[at] == 2 and not batch:
                    entering = np.int64(-2)
                    batch = True
                else:
                    entering = at - start[s]
                    entering_mask = np.int64(mask[at])
                    batch = False
                    count[GAUSSIANS_IN] += 1
                    taken += 1
                    at += 1
            pipe[head_slot] = entering
            pipe_mask[head_slot] = entering_mask
            head_slot += 1
            if head_slot == ctu_latency:
                head_slot = 0
        t += 1
    return t


@numba.njit(parallel=True, cache=True)
def _cores(order, core_start, start, mask, test_cycles, finish, finish_op, ctu_latency, ctu_depth, depth, blend, out_delay, per_vru, vrus, counters, end, ends):
    for k in numba.prange(CORES):
        ends[k] = _core(
            order[core_start[k] : core_start[k + 1]], start, mask, test_cycles, finish, finish_op, ctu_latency, ctu_depth, depth, blend,
            out_delay, per_vru, vrus, counters[k], end,
        )


def simulate(work: Work, config: RenderConfig, vrus_per_channel: int = VRUS_PER_CHANNEL) -> StageCycles:
    """Cycles and counters of a frame.

    work: of a method that sends whole mini-tiles (`work.visit` None). vrus_per_channel: 1, 2 (the RTL) or 4; the pixels of a
    mini-tile are divided among them row by row.
    """
    if work.visit is not None:
        raise ValueError("the RTL's VRUs visit whole mini-tiles")
    if vrus_per_channel not in (1, 2, 4):
        raise ValueError("VRUs per channel: 1, 2 or 4")
    per_vru = PIXELS_PER_VRU * VRUS_PER_CHANNEL // vrus_per_channel
    finish = np.empty((work.subtiles, 4), np.int64)
    finish_op = np.empty((work.subtiles, 4), np.int64)
    _finish_events(work.pixel_finish, work.start, per_vru, finish, finish_op)
    counters = np.zeros((CORES, COUNTERS_PER_CORE), np.int64)
    end = np.zeros(work.subtiles, np.int64)
    ends = np.zeros(CORES, np.int64)
    blend, last = vru_stages(config.form)
    _cores(
        work.order, work.core_start, work.start, work.mask, work.test_cycles, finish, finish_op,
        prtu_latency(config.form, config.precision), config.ctu_fifo_depth, config.fifo_depth, blend, last + 1, per_vru,
        vrus_per_channel, counters, end, ends,
    )
    cycles = int(ends.max())
    counters[:, _CORE["cycles"]] = cycles
    counters[:, IDLE] += cycles - ends
    length = np.diff(work.start)
    ended = (work.pixel_finish < length[:, None]).reshape(-1, CHANNELS, 16).sum(axis=2)
    for k in range(CORES):
        mine = work.order[work.core_start[k] : work.core_start[k + 1]]
        counters[k, N_CORE + FINISHED :: N_CHANNEL] = ended[mine].sum(axis=0)
    return StageCycles(cycles, counters, end)
