"""LPDDR4 at the level of commands: how long a sequence of bursts takes.

Open-page policy, one queue of `window` bursts a channel. Of those waiting the one whose data can move first is
served, the oldest among equals, so that row hits go first, activates overlap with the data of other banks and the bus
turns as rarely as the window allows; a burst is passed over at most 4 x window times. All-bank refresh every tREFI.
Consecutive addresses go to the channels in turn, `interleave_bytes` each; within a channel page by page to the banks
in turn, the bank number exclusive-or'ed with the row. Left out: the command bus, latency of the controller,
dependences between bursts (the streams of a phase touch different arrays), per-bank refresh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from ..errors import FlickerError
from . import constants as c

READ, WRITE, MASKED_WRITE = 0, 1, 2


@dataclass(frozen=True)
class DramConfig:
    """Organisation and timing; times in clocks of the command bus (rate / 2). Sources: constants.py."""

    channels: int = c.DRAM_CHANNELS
    width_bits: int = c.DRAM_WIDTH_BITS
    rate: int = c.DRAM_RATE
    burst_length: int = c.DRAM_BURST_LENGTH
    banks: int = c.DRAM_BANKS
    page_bytes: int = c.DRAM_PAGE_BYTES
    interleave_bytes: int = c.DRAM_INTERLEAVE_BYTES
    window: int = c.DRAM_WINDOW
    trcd: int = c.DRAM_TRCD
    trp: int = c.DRAM_TRP
    trp_all: int = c.DRAM_TRP_ALL
    tras: int = c.DRAM_TRAS
    trrd: int = c.DRAM_TRRD
    tfaw: int = c.DRAM_TFAW
    tccd: int = c.DRAM_TCCD
    tccd_masked: int = c.DRAM_TCCD_MASKED
    trtp: int = c.DRAM_TRTP
    twr: int = c.DRAM_TWR
    twtr: int = c.DRAM_TWTR
    rl: int = c.DRAM_RL
    wl: int = c.DRAM_WL
    tdqsck: int = c.DRAM_TDQSCK
    trefi: int = c.DRAM_TREFI
    trfc: int = c.DRAM_TRFC
    refresh: bool = True

    def __post_init__(self) -> None:
        for name in ("channels", "banks", "interleave_bytes", "page_bytes"):
            if (value := getattr(self, name)) < 1 or value & (value - 1):
                raise FlickerError(f"DRAM: {name} must be a power of two, not {value}")
        if self.interleave_bytes < self.burst_bytes or self.interleave_bytes > self.page_bytes:
            raise FlickerError(f"DRAM: interleave_bytes must be {self.burst_bytes} to {self.page_bytes}, not {self.interleave_bytes}")
        if self.window < 1:
            raise FlickerError(f"DRAM: window must be at least 1, not {self.window}")

    @property
    def burst_bytes(self) -> int:
        return self.burst_length * self.width_bits // 8

    @property
    def burst_clocks(self) -> int:
        return self.burst_length // 2

    @property
    def bytes_per_second(self) -> int:
        return self.channels * self.width_bits * self.rate // 8

    @property
    def _timing(self) -> np.ndarray:
        half = self.burst_clocks
        return np.array([
            self.trcd, self.trp, self.trp_all, self.tras, self.trrd, self.tfaw, self.tccd, self.tccd_masked, self.trtp,
            self.wl + half + self.twr,  # write to precharge
            self.wl + half + self.twtr + 1,  # write to read
            self.rl + self.tdqsck + half + 1 - self.wl,  # read to write
            self.trefi if self.refresh else 0, self.trfc, self.rl, self.wl, half,
        ], np.int64)


@dataclass(frozen=True)
class DramResult:
    """What a sequence of bursts cost. clocks: until the last data. efficiency: share of the peak rate."""

    bursts: int
    bytes: int
    clocks: int
    activates: int
    refreshes: int
    config: DramConfig

    @property
    def seconds(self) -> float:
        return self.clocks / (self.config.rate / 2)

    @property
    def cycles(self) -> int:
        """Cycles of the chip's clock."""
        return int(np.ceil(self.seconds * c.CLOCK_HZ))

    @property
    def efficiency(self) -> float:
        return self.bytes / (self.seconds * self.config.bytes_per_second) if self.clocks else 1.0


@numba.njit(cache=True)
def _channel(bank_of, row_of, kind, banks, window, t):
    """One channel: (clocks, activates, refreshes). bank_of, row_of, kind: its bursts in order."""
    (rcd, rp, rp_all, ras, rrd, faw, ccd, ccd_masked, rtp, write_pre, write_read, read_write, refi, rfc, rl, wl, half) = t
    far = np.int64(-1) << 40
    open_row = np.full(banks, -1, np.int64)
    act_ok = np.zeros(banks, np.int64)  # earliest activate of a closed bank
    pre_ok = np.zeros(banks, np.int64)
    col_ok = np.zeros(banks, np.int64)
    wrote = np.full(banks, far, np.int64)
    acts = np.full(4, far, np.int64)
    queue = np.empty(window, np.int64)
    arrived = np.zeros(window, np.int64)
    waiting = 0
    taken = 0
    passed_over = 0
    last_col = far
    last_kind = 0
    next_ref = refi
    activates = 0
    refreshes = 0
    end = np.int64(0)
    for _ in range(len(bank_of)):
        while waiting < window and taken < len(bank_of):
            queue[waiting] = taken
            arrived[waiting] = max(last_col, 0)
            waiting += 1
            taken += 1
        while refi > 0 and last_col + ccd >= next_ref:
            start = next_ref
            for k in range(banks):
                if open_row[k] >= 0:
                    start = max(start, pre_ok[k])
            for k in range(banks):
                open_row[k] = -1
                act_ok[k] = start + rp_all + rfc
            next_ref += refi
            refreshes += 1
        best = 0
        best_col = np.int64(1) << 60
        best_act = np.int64(0)
        for w in range(waiting):
            i = queue[w]
            b = bank_of[i]
            act = np.int64(-1)
            col = col_ok[b]
            if open_row[b] != row_of[i]:
                act = max(arrived[w], act_ok[b])
                if open_row[b] >= 0:
                    act = max(act, max(arrived[w], pre_ok[b]) + rp)
                act = max(act, acts[3] + rrd, acts[0] + faw)
                col = act + rcd
            k = kind[i]
            gap = ccd
            if k == 0 and last_kind != 0:
                gap = write_read
            elif k != 0 and last_kind == 0:
                gap = read_write
            col = max(col, arrived[w], last_col + gap)
            if k == 2:
                col = max(col, wrote[b] + ccd_masked)
            if col < best_col:
                best = w
                best_col = col
                best_act = act
                if col == last_col + ccd:
                    break  # nothing can be earlier
            if passed_over >= 4 * window:
                break  # the oldest has waited long enough
        passed_over = passed_over + 1 if best > 0 else 0
        i = queue[best]
        b = bank_of[i]
        if best_act >= 0:
            acts[0] = acts[1]
            acts[1] = acts[2]
            acts[2] = acts[3]
            acts[3] = best_act
            activates += 1
            open_row[b] = row_of[i]
            col_ok[b] = best_act + rcd
            pre_ok[b] = best_act + ras
        if kind[i] == 0:
            pre_ok[b] = max(pre_ok[b], best_col + rtp)
            end = max(end, best_col + rl + half)
        else:
            pre_ok[b] = max(pre_ok[b], best_col + write_pre)
            wrote[b] = best_col
            end = max(end, best_col + wl + half)
        last_col = best_col
        last_kind = kind[i]
        waiting -= 1
        for w in range(best, waiting):
            queue[w] = queue[w + 1]
            arrived[w] = arrived[w + 1]
    return end, activates, refreshes


@numba.njit(parallel=True, cache=True)
def _run(burst, kind, channels, granule, banks, columns, window, t):
    """Clocks, activates and refreshes of every channel, int64 (channels, 3)."""
    count = np.zeros(channels + 1, np.int64)
    for i in range(len(burst)):
        count[(burst[i] // granule) % channels + 1] += 1
    start = np.cumsum(count)
    fill = start[:-1].copy()
    bank_of = np.empty(len(burst), np.int64)
    row_of = np.empty(len(burst), np.int64)
    kind_of = np.empty(len(burst), np.int8)
    for i in range(len(burst)):
        b = burst[i]
        ch = (b // granule) % channels
        page = ((b // granule // channels) * granule + b % granule) // columns
        k = fill[ch]
        fill[ch] += 1
        row_of[k] = page // banks
        bank_of[k] = (page % banks) ^ (row_of[k] % banks)
        kind_of[k] = kind[i]
    out = np.zeros((channels, 3), np.int64)
    for ch in numba.prange(channels):
        part = slice(start[ch], start[ch + 1])
        out[ch] = _channel(bank_of[part], row_of[part], kind_of[part], banks, window, t)
    return out


def simulate(burst: np.ndarray, kind: np.ndarray | int = READ, config: DramConfig = DramConfig()) -> DramResult:
    """Time of the bursts (int (B,), address / burst_bytes) in this order. kind: READ, WRITE or MASKED_WRITE, one for all or (B,)."""
    burst = np.ascontiguousarray(burst, np.int64)
    kind = np.ascontiguousarray(np.broadcast_to(np.asarray(kind, np.int8), burst.shape))
    if len(burst) and burst.min() < 0:
        raise FlickerError("DRAM: negative burst address")
    counts = _run(
        burst, kind, config.channels, config.interleave_bytes // config.burst_bytes, config.banks,
        config.page_bytes // config.burst_bytes, config.window, tuple(int(x) for x in config._timing),
    )
    return DramResult(
        len(burst), len(burst) * config.burst_bytes, int(counts[:, 0].max()), int(counts[:, 1].sum()), int(counts[:, 2].sum()), config,
    )


@dataclass
class Stream:
    """Bursts that one purpose moves, in order.

    burst: int64 (B,). kind: int8 (B,). used_bytes: bytes that the purpose needs; the rest of the bursts is padding and neighbours.
    """

    name: str
    burst: np.ndarray
    kind: np.ndarray
    used_bytes: int

    @property
    def moved_bytes(self) -> int:
        return len(self.burst) * c.LINE_BYTES

    @staticmethod
    def span(name: str, base: int, size: int, kind: int) -> Stream:
        """`size` consecutive bytes from byte `base` (a multiple of the burst)."""
        burst = base // c.LINE_BYTES + np.arange(-(-size // c.LINE_BYTES), dtype=np.int64)
        return Stream(name, burst, np.full(len(burst), kind, np.int8), size)

    @staticmethod
    def items(name: str, base: int, size: int, index: np.ndarray, kind: int) -> Stream:
        """Items `index` of an array of `size` bytes each; a burst shared by consecutive accesses is moved once."""
        index = np.asarray(index, np.int64)
        first = base + index * size
        return Stream.ranges(name, first, np.full(len(first), size, np.int64), kind)

    @staticmethod
    def ranges(name: str, first: np.ndarray, size: np.ndarray, kind: int) -> Stream:
        """Byte ranges in order; a burst shared by consecutive accesses is moved once."""
        low = first // c.LINE_BYTES
        count = np.where(size > 0, (first + size - 1) // c.LINE_BYTES - low + 1, 0)
        offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        burst = np.repeat(low, count) + offset
        if len(burst):
            burst = burst[np.concatenate([[True], burst[1:] != burst[:-1]])]
        return Stream(name, burst, np.full(len(burst), kind, np.int8), int(size.sum()))


def interleave(streams: Sequence[Stream], batch: int = c.DRAM_BATCH_BURSTS) -> tuple[np.ndarray, np.ndarray]:
    """Bursts and kinds of streams that run side by side: batches of each, at rates that let all end together."""
    streams = [s for s in streams if len(s.burst)]
    if not streams:
        return np.zeros(0, np.int64), np.zeros(0, np.int8)
    when, order = [], []
    for k, s in enumerate(streams):
        number = np.arange(len(s.burst)) // batch
        when.append((number + 0.5) * batch / len(s.burst))
        order.append(np.full(len(s.burst), k))
    place = np.lexsort([np.concatenate(order), np.concatenate(when)])
    return np.concatenate([s.burst for s in streams])[place], np.concatenate([s.kind for s in streams])[place]
