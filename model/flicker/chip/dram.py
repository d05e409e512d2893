"""LPDDR4 at the level of commands: how long a sequence of bursts takes.

Rules and times of the DRAM are those of sim/dram.hpp (open page, queues of `window` reads and `write_places` writes a channel, row hits first, refresh),
compiled once, which also stand behind the AXI ports of simulations: docs/reference/memory_model.md. Numbers come from constants.py. Left out: the command
bus, latency of the controller, dependences between bursts (the streams of a phase touch different arrays).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..errors import FlickerError
from ..params import LINE_BITS, PORT_WIDTHS
from ..sim.memory import MASKED_WRITE, READ, WRITE, Behind, PortConfig, Timing, run_behind, run_bursts
from . import constants as c

__all__ = ["MASKED_WRITE", "READ", "WRITE", "DramConfig", "DramResult", "Refresh", "Stream", "interleave", "port_config", "simulate"]


class Refresh(StrEnum):
    """Whom a refresh command stops: nobody, as there is none; all banks of a channel for tRFCab every tREFI; one bank for tRFCpb every tREFI / banks."""

    NONE = "none"
    ALL_BANKS = "all-banks"
    PER_BANK = "per-bank"


@dataclass(frozen=True)
class DramConfig:
    """Organisation and timing; times in clocks of the command bus (rate / 2). Sources: constants.py. port_bits: of the port between chip and memory, which
    moves as many in a cycle of the chip, reads and writes each (`RenderConfig.port_bits`)."""

    channels: int = c.DRAM_CHANNELS
    width_bits: int = c.DRAM_WIDTH_BITS
    rate: int = c.DRAM_RATE
    burst_length: int = c.DRAM_BURST_LENGTH
    banks: int = c.DRAM_BANKS
    page_bytes: int = c.DRAM_PAGE_BYTES
    interleave_bytes: int = c.DRAM_INTERLEAVE_BYTES
    window: int = c.DRAM_WINDOW
    write_places: int = c.DRAM_WRITE_PLACES
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
    trfc_bank: int = c.DRAM_TRFC_BANK
    refresh: Refresh = Refresh.ALL_BANKS
    port_bits: int = LINE_BITS

    def __post_init__(self) -> None:
        for name in ("channels", "banks", "interleave_bytes", "page_bytes"):
            if (value := getattr(self, name)) < 1 or value & (value - 1):
                raise FlickerError(f"DRAM: {name} must be a power of two, not {value}")
        if self.port_bits not in PORT_WIDTHS:
            raise FlickerError(f"DRAM: port_bits must be {', '.join(map(str, PORT_WIDTHS[:-1]))} or {PORT_WIDTHS[-1]}, not {self.port_bits}")
        if self.interleave_bytes < self.burst_bytes or self.interleave_bytes > self.page_bytes:
            raise FlickerError(f"DRAM: interleave_bytes must be {self.burst_bytes} to {self.page_bytes}, not {self.interleave_bytes}")
        if self.window < 1:
            raise FlickerError(f"DRAM: window must be at least 1, not {self.window}")
        if self.write_places < 0:
            raise FlickerError(f"DRAM: write_places must be at least 0, not {self.write_places}")

    @property
    def burst_bytes(self) -> int:
        """Bytes of a burst."""
        return self.burst_length * self.width_bits // 8

    @property
    def burst_clocks(self) -> int:
        """Clocks of the command bus that a burst takes on the data bus."""
        return self.burst_length // 2

    @property
    def bytes_per_second(self) -> int:
        """Peak rate of all channels."""
        return self.channels * self.width_bits * self.rate // 8

    @property
    def narrow_port(self) -> bool:
        """Whether the port moves less in a cycle than the memory."""
        return self.port_bits * c.CLOCK_HZ < 8 * self.bytes_per_second

    def port_cycles(self, read_bytes: int, written_bytes: int) -> int:
        """Cycles of the chip that the port takes: reads and writes go side by side. While all banks are refreshed it stands still, and nothing catches up."""
        open_ = 1.0 - self.trfc / self.trefi if self.refresh == Refresh.ALL_BANKS else 1.0
        return math.ceil(8 * max(read_bytes, written_bytes) / (self.port_bits * open_))

    @property
    def timing(self) -> Timing:
        """What the engine (sim/dram.hpp) is told."""
        half = self.burst_clocks
        return Timing(
            channels=self.channels, banks=self.banks, interleave_bytes=self.interleave_bytes, page_bytes=self.page_bytes,
            burst_bytes=self.burst_bytes, window=self.window, writes=self.write_places,
            rcd=self.trcd, rp=self.trp, rp_all=self.trp_all, ras=self.tras, rrd=self.trrd, faw=self.tfaw, ccd=self.tccd,
            ccd_masked=self.tccd_masked, rtp=self.trtp,
            write_pre=self.wl + half + self.twr, write_read=self.wl + half + self.twtr + 1,
            read_write=self.rl + self.tdqsck + half + 1 - self.wl,
            refi=0 if self.refresh == Refresh.NONE else self.trefi, rfc=self.trfc, rfc_bank=self.trfc_bank if self.refresh == Refresh.PER_BANK else 0,
            rl=self.rl, wl=self.wl, half=half,
            clock_hz=self.rate // 2, chip_hz=c.CLOCK_HZ,
        )

    def idle_cycles(self, size: int = 64) -> int:
        """Cycles of the chip's clock from the request of `size` bytes of a page to the last of them, memory idle and row closed; rounded up."""
        bursts = -(-size // self.burst_bytes)
        return -(-(self.trcd + self.rl + self.burst_clocks + (bursts - 1) * self.tccd) * c.CLOCK_HZ // (self.rate // 2))


def port_config(config: DramConfig = DramConfig(), **options) -> PortConfig:
    """Options of an AXI port at which a lone read of a beat takes DRAM_LATENCY_CYCLES in all, or one more: `latency` is what the DRAM does not take of them.

    options: further fields of `PortConfig`.
    """
    width = options.get("data_bits", PortConfig.data_bits) // 8
    return PortConfig(**{"latency": c.DRAM_LATENCY_CYCLES - config.idle_cycles(width)} | options)


@dataclass(frozen=True)
class DramResult:
    """What a sequence of bursts cost. clocks: until the last data. row_hits: bursts that found their row open. efficiency: share of the peak rate."""

    bursts: int
    bytes: int
    clocks: int
    activates: int
    refreshes: int
    config: DramConfig

    @property
    def row_hits(self) -> int:
        """Bursts that found their row open."""
        return self.bursts - self.activates

    @property
    def seconds(self) -> float:
        """Time of all bursts."""
        return self.clocks / (self.config.rate / 2)

    @property
    def cycles(self) -> int:
        """Cycles of the chip's clock."""
        return int(np.ceil(self.seconds * c.CLOCK_HZ))

    @property
    def efficiency(self) -> float:
        """Share of the peak rate."""
        return self.bytes / (self.seconds * self.config.bytes_per_second) if self.clocks else 1.0


def simulate(burst: np.ndarray, kind: np.ndarray | int = READ, config: DramConfig = DramConfig()) -> DramResult:
    """Time of the bursts (int (B,), address / burst_bytes) in this order. kind: READ, WRITE or MASKED_WRITE, one for all or (B,)."""
    burst = np.ascontiguousarray(burst, np.int64)
    kind = np.ascontiguousarray(np.broadcast_to(np.asarray(kind, np.int8), burst.shape))
    if len(burst) and burst.min() < 0:
        raise FlickerError("DRAM: negative burst address")
    counts = run_bursts(config.timing, burst, kind)
    return DramResult(
        len(burst), len(burst) * config.burst_bytes, int(counts[:, 0].max()), int(counts[:, 1].sum()), int(counts[:, 2].sum()), config,
    )


def behind_port(stream: Stream, config: DramConfig, reads: int, ahead: int) -> int:
    """Cycles of the chip that one owner's bursts, in its order, take through the port. reads: lines under way at most; ahead: lines by which it asks before
    the oldest line that it has still to write."""
    each = LINE_BITS // 8 // config.burst_bytes
    return run_behind(config.timing, stream.burst, stream.kind, Behind(config.port_bits // 8, each * reads, each * ahead))


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
        """Bytes of the whole bursts."""
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
