"""Memory for simulations: LPDDR4 timing, contents and AXI4 ports of `dram.hpp` and `memory.hpp` (docs/reference/memory_model.md).

Harnesses in C++ use the headers; here they are for Python: the chip model counts its DRAM cycles with `run_bursts`, tests drive
ports cycle by cycle. Times of the DRAM are clocks of its command bus, times of ports cycles of the chip's clock.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Mapping
from ctypes import POINTER, c_char_p, c_double, c_int, c_int64, c_uint8, c_uint32, c_uint64, c_void_p
from dataclasses import dataclass, field, fields
from enum import IntEnum
from pathlib import Path

import numpy as np

from ..errors import FlickerError
from ..toolchain import compile_library

FOLDER = Path(__file__).parent
HEADERS = (FOLDER / "dram.hpp", FOLDER / "memory.hpp")
READ, WRITE, MASKED_WRITE = 0, 1, 2
MAX_WORDS = 16


class Timing(ctypes.Structure):
    """Organisation and timing of the DRAM: bytes, clocks of the command bus, hertz. `flicker.chip.dram.DramConfig.timing` makes one."""

    _fields_ = [(name, c_int64) for name in (
        "channels", "banks", "interleave_bytes", "page_bytes", "burst_bytes", "window", "writes",
        "rcd", "rp", "rp_all", "ras", "rrd", "faw", "ccd", "ccd_masked", "rtp", "write_pre", "write_read", "read_write",
        "refi", "rfc", "rfc_bank", "rl", "wl", "half", "clock_hz", "chip_hz",
    )]


class Counts(ctypes.Structure):
    """Of the DRAM. clocks: until the last data. row_hits: bursts that found their row open. data to rows: clocks of all channels up to their last column
    commands, by what they went to: data, nothing that waits, turns between reads and writes, refreshes of all banks, the rest (rows)."""

    _fields_ = [(name, c_int64) for name in ("clocks", "activates", "refreshes", "bursts", "data", "idle", "turning", "refreshing", "rows")]

    @property
    def row_hits(self) -> int:
        """Bursts that found their row open."""
        return self.bursts - self.activates

    @property
    def spent(self) -> dict[str, int]:
        """Clocks of all channels by what they went to."""
        return {name: getattr(self, name) for name in ("data", "idle", "turning", "refreshing", "rows")}


class _Address(ctypes.Structure):
    _fields_ = [("addr", c_uint64), ("id", c_uint32), ("valid", c_uint8), ("len", c_uint8), ("size", c_uint8), ("burst", c_uint8), ("qos", c_uint8)]


class Request(ctypes.Structure):
    """What a design drives in a cycle; data in 32-bit words, lowest first."""

    _fields_ = [
        ("aw", _Address), ("ar", _Address), ("w_data", c_uint32 * MAX_WORDS), ("w_strb", c_uint64),
        ("w_valid", c_uint8), ("w_last", c_uint8), ("b_ready", c_uint8), ("r_ready", c_uint8),
    ]


class Reply(ctypes.Structure):
    """What a port drives in a cycle."""

    _fields_ = [
        ("r_data", c_uint32 * MAX_WORDS), ("b_id", c_uint32), ("r_id", c_uint32),
        ("aw_ready", c_uint8), ("w_ready", c_uint8), ("ar_ready", c_uint8), ("b_valid", c_uint8), ("b_resp", c_uint8),
        ("r_valid", c_uint8), ("r_resp", c_uint8), ("r_last", c_uint8),
    ]


class Resp(IntEnum):
    """AXI's responses, by their code."""

    OKAY, EXOKAY, SLVERR, DECERR = range(4)


class Order(IntEnum):
    """Order of responses.

    IN_ORDER: that of all addresses. BY_ID: in order within an id, any across ids. INTERLEAVED: as BY_ID, reads of several ids also beat by beat in turn. WHOLE:
    as BY_ID, and a read begins once all of its beats are there, so that none waits for the DRAM in the middle of another's burst.
    """

    IN_ORDER, BY_ID, INTERLEAVED, WHOLE = range(4)


class WriteOrder(IntEnum):
    """ANY: data before (up to 16 beats), with or behind addresses. ADDRESS_FIRST: ready for data only behind addresses. DATA_FIRST: the reverse."""

    ANY, ADDRESS_FIRST, DATA_FIRST = range(3)


CHANNELS = ("AW", "W", "B", "AR", "R")
_LISTS = ("stall", "run", "stop_after")  # options by channel


@dataclass(frozen=True)
class PortConfig:
    """Options of a port.

    latency: cycles that are added to the DRAM's, or, in a perfect memory, all there are. max_reads, max_writes: transactions that may be under way.
    max_beats: longest burst that is legal.

    order, write_order: see there.

    urgent: transactions of at least that AXI quality of service (`ar_qos`, `aw_qos`) enter a DRAM channel's queue first and have their
    responses first, except IN_ORDER; 16: none does. Nothing bounds how long the others wait: for managers whose own work ends.

    hazards: a transaction that overlaps one under way, one of them a write, is an error (writes of one id excepted, which follow each other).

    stall: channel to share of the cycles without ready (AW, W, AR) or valid (B, R). run: channel to mean length of such a pause in cycles, default 1.
    stop_after: channel to transfers after which it is never ready or valid again. Random choices follow `seed`; what is offered stays.
    """

    data_bits: int = 512
    id_bits: int = 4
    latency: int = 1
    max_reads: int = 32
    max_writes: int = 32
    max_beats: int = 256
    order: Order = Order.BY_ID
    write_order: WriteOrder = WriteOrder.ANY
    hazards: bool = True
    urgent: int = 16
    seed: int = 1
    stall: Mapping[str, float] = field(default_factory=dict)
    run: Mapping[str, int] = field(default_factory=dict)
    stop_after: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in _LISTS:
            if unknown := getattr(self, name).keys() - set(CHANNELS):
                raise FlickerError(f"AXI port: {name}: no channel {min(unknown)}, they are {', '.join(CHANNELS)}")

    def structure(self) -> ctypes.Structure:
        """The same as `AxiConfig` of memory.hpp."""
        values = {name: int(getattr(self, name)) for name in _NUMBERS}
        lists = {
            "stall": [round(256 * self.stall.get(k, 0)) for k in CHANNELS],
            "run": [self.run.get(k, 1) for k in CHANNELS],
            "stop_after": [self.stop_after.get(k, -1) for k in CHANNELS],
        }
        return _Config(**values, **{name: (c_int64 * len(CHANNELS))(*x) for name, x in lists.items()})


_NUMBERS = [f.name for f in fields(PortConfig) if f.name not in _LISTS]


class _Config(ctypes.Structure):
    _fields_ = [(name, c_int64) for name in _NUMBERS] + [(name, c_int64 * len(CHANNELS)) for name in _LISTS]


class PurposeCounts(ctypes.Structure):
    """Traffic of one purpose. write_bytes: those with a strobe; dram_*: whole bursts, masked ones among the written; errors: bursts answered with one;
    rows_opened: for its bursts of the DRAM, row_clocks: of a channel, that went to that (`Counts.rows`)."""

    _fields_ = [(name, c_uint64) for name in (
        "read_bursts", "read_beats", "read_bytes", "write_bursts", "write_beats", "write_bytes",
        "dram_read_bytes", "dram_write_bytes", "dram_masked_bytes", "errors", "rows_opened", "row_clocks",
    )]


class Behind(ctypes.Structure):
    """A port between an owner of bursts and the channels. bytes: that it moves in a cycle of the chip, of reads and of writes each; reads: bursts under way at
    most; ahead: places in the list by which a read may be asked for before the oldest write that has not left."""

    _fields_ = [(name, c_int64) for name in ("bytes", "reads", "ahead")]


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled memory; built once, cached by content below build/."""
    lib = ctypes.CDLL(str(compile_library("flk_memory", [FOLDER / "memory.cpp"], depends=HEADERS)))
    for name, result, *arguments in (
        ("dram_run", None, POINTER(Timing), c_int64, c_void_p, c_void_p, c_void_p),
        ("dram_run_behind", c_int64, POINTER(Timing), c_int64, c_void_p, c_void_p, POINTER(Behind)),
        ("dram_new", c_void_p, POINTER(Timing)),
        ("dram_delete", None, c_void_p),
        ("dram_push", c_int64, c_void_p, c_int64, c_uint64, c_int),
        ("dram_advance", None, c_void_p, c_int64),
        ("dram_done", c_int64, c_void_p, c_int64),
        ("dram_counts", None, c_void_p, POINTER(Counts)),
        ("memory_new", c_void_p, POINTER(Timing), c_int),
        ("memory_delete", None, c_void_p),
        ("memory_tick", None, c_void_p),
        ("memory_allocate", c_int, c_void_p, c_uint64, c_uint64, c_uint64),
        ("memory_read", c_int, c_void_p, c_uint64, c_uint64, c_void_p),
        ("memory_write", c_int, c_void_p, c_uint64, c_uint64, c_void_p),
        ("memory_counts", None, c_void_p, POINTER(Counts)),
        ("memory_efficiency", c_double, c_void_p),
        ("axi_new", c_void_p, c_void_p, POINTER(_Config)),
        ("axi_problem", c_char_p),
        ("axi_purpose", None, c_void_p, c_uint64, c_uint64, c_uint32),
        ("axi_fail_range", None, c_void_p, c_uint64, c_uint64, c_int, c_int, c_int),
        ("axi_fail_read", None, c_void_p, c_uint64, c_int),
        ("axi_fail_write", None, c_void_p, c_uint64, c_int),
        ("axi_reply", POINTER(Reply), c_void_p),
        ("axi_cycle", None, c_void_p, POINTER(Request)),
        ("axi_reset", None, c_void_p, POINTER(Request)),
        ("axi_idle", c_int, c_void_p),
        ("axi_errors", c_int64, c_void_p),
        ("axi_error", c_char_p, c_void_p, c_int64),
        ("axi_channels", None, c_void_p, c_void_p, c_void_p),
        ("axi_counts", c_int, c_void_p, c_uint32, POINTER(PurposeCounts)),
    ):
        function = getattr(lib, f"flk_{name}")
        function.restype = result
        function.argtypes = arguments
    return lib


def _same_length(burst: np.ndarray, kind: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both as the library takes them. Raises ValueError if one has more bursts."""
    burst, kind = np.ascontiguousarray(burst, np.int64), np.ascontiguousarray(kind, np.int8)
    if burst.shape != kind.shape:
        raise ValueError("burst and kind differ in shape")
    return burst, kind


def run_bursts(timing: Timing, burst: np.ndarray, kind: np.ndarray) -> np.ndarray:
    """`Counts` of every channel, int64 (channels, fields).

    burst: int64 (B,), address / burst_bytes, not negative; kind: int8 (B,), READ, WRITE or MASKED_WRITE. All wait from clock 0 on, in this order.
    """
    burst, kind = _same_length(burst, kind)
    counts = np.zeros((timing.channels, len(Counts._fields_)), np.int64)
    library().flk_dram_run(ctypes.byref(timing), burst.size, burst.ctypes.data, kind.ctypes.data, counts.ctypes.data)
    return counts


def run_behind(timing: Timing, burst: np.ndarray, kind: np.ndarray, port: Behind) -> int:
    """Cycles of the chip until bursts, as of `run_bursts`, have moved through a port that is narrower than the memory."""
    burst, kind = _same_length(burst, kind)
    if min(port.bytes, port.reads, port.ahead) < 1:
        raise ValueError("bytes, reads and ahead must be at least 1")
    return library().flk_dram_run_behind(ctypes.byref(timing), burst.size, burst.ctypes.data, kind.ctypes.data, ctypes.byref(port))


class Dram:
    """The channels, fed while time goes on."""

    def __init__(self, timing: Timing) -> None:
        self._lib = library()
        self._at = self._lib.flk_dram_new(ctypes.byref(timing))
        self._now = 0

    def __del__(self) -> None:
        if hasattr(self, "_at"):
            self._lib.flk_dram_delete(self._at)

    def push(self, clock: int, address: int, kind: int) -> int:
        """Add the burst at a byte address; clock: not before the last push or `advance`. Returns its number."""
        if clock < self._now:
            raise ValueError(f"burst at clock {clock}, time is {self._now} already")
        self._now = clock
        return self._lib.flk_dram_push(self._at, clock, address, kind)

    def advance(self, clock: int) -> None:
        """Issue all column commands before a clock."""
        self._now = max(self._now, clock)
        self._lib.flk_dram_advance(self._at, clock)

    def done(self, number: int) -> int | None:
        """Clock of the end of a burst's data; None: its command has not been issued."""
        clock = self._lib.flk_dram_done(self._at, number)
        return None if clock < 0 else clock

    def counts(self) -> Counts:
        """What the channels have done until now."""
        out = Counts()
        self._lib.flk_dram_counts(self._at, ctypes.byref(out))
        return out


class Memory:
    """Contents and time behind the ports. perfect: no DRAM, every beat after its port's latency."""

    def __init__(self, timing: Timing, perfect: bool = False) -> None:
        self._lib = library()
        self._at = self._lib.flk_memory_new(ctypes.byref(timing), perfect)
        self.cycle = 0

    def __del__(self) -> None:
        if hasattr(self, "_at"):
            self._lib.flk_memory_delete(self._at)

    def tick(self) -> None:
        """Begin a cycle: once, before the ports' `step`."""
        self.cycle += 1
        self._lib.flk_memory_tick(self._at)

    def allocate(self, base: int, size: int, noise: int = 0) -> None:
        """A range of bytes: zeros, or random ones by the seed `noise`. Raises FlickerError if it overlaps another."""
        if not self._lib.flk_memory_allocate(self._at, base, size, noise):
            raise FlickerError(f"memory: {size} bytes at {base:#x} are none, wrap around or overlap others")

    def read(self, base: int, size: int) -> bytes:
        """Bytes of an allocated range."""
        out = ctypes.create_string_buffer(size)
        if not self._lib.flk_memory_read(self._at, base, size, out):
            raise FlickerError(f"memory: {size} bytes at {base:#x} are not allocated")
        return out.raw

    def write(self, base: int, data: bytes) -> None:
        """Put bytes into an allocated range."""
        if not self._lib.flk_memory_write(self._at, base, len(data), ctypes.create_string_buffer(data, len(data))):
            raise FlickerError(f"memory: {len(data)} bytes at {base:#x} are not allocated")

    @property
    def efficiency(self) -> float:
        """Share of the DRAM's peak rate that was moved, from cycle 0 until now."""
        return self._lib.flk_memory_efficiency(self._at)

    def counts(self) -> Counts:
        """Of the DRAM."""
        out = Counts()
        self._lib.flk_memory_counts(self._at, ctypes.byref(out))
        return out


class Port:
    """An AXI4 port of a memory. Fill `request`, call `step` once a cycle, read `reply` for the next one.

    ```python
    memory = Memory(DramConfig().timing)                       # flicker.chip.dram
    memory.allocate(0x1000, 4096)
    port = Port(memory, port_config(seed=3, stall={"R": 0.2}))  # flicker.chip.dram
    port.request.ar.valid, port.request.ar.addr, port.request.ar.size, port.request.ar.burst = 1, 0x1000, 6, 1
    port.request.r_ready = 1
    while not port.reply.r_valid:
        taken = port.reply.ar_ready
        memory.tick()
        port.step()
        if taken:
            port.request.ar.valid = 0
    ```
    """

    def __init__(self, memory: Memory, config: PortConfig = PortConfig()) -> None:
        self._lib = memory._lib
        self.memory = memory  # owns what is behind this port
        self.config = config
        self._at = self._lib.flk_axi_new(memory._at, ctypes.byref(config.structure()))
        if not self._at:
            raise FlickerError(f"AXI port: {self._lib.flk_axi_problem().decode()}")
        self.request = Request()
        self.reply: Reply = self._lib.flk_axi_reply(self._at).contents  # follows the port

    def step(self) -> None:
        """The edge that ends a cycle: transfers by `request` and `reply`, then `reply` is that of the next cycle."""
        self._lib.flk_axi_cycle(self._at, ctypes.byref(self.request))

    def reset(self) -> None:
        """A cycle in reset."""
        self._lib.flk_axi_reset(self._at, ctypes.byref(self.request))

    def purpose(self, base: int, size: int, number: int) -> None:
        """Count transactions that begin in a range under `number`; all others under their id."""
        self._lib.flk_axi_purpose(self._at, base, size, number)

    def fail_range(self, base: int, size: int, *, reads: bool = True, writes: bool = True, resp: Resp = Resp.SLVERR) -> None:
        """Answer bursts that touch a range with an error; a write that fails changes nothing."""
        self._lib.flk_axi_fail_range(self._at, base, size, reads, writes, resp)

    def fail_read(self, nth: int, resp: Resp = Resp.SLVERR) -> None:
        """Answer the nth read burst (from 0) with an error."""
        self._lib.flk_axi_fail_read(self._at, nth, resp)

    def fail_write(self, nth: int, resp: Resp = Resp.SLVERR) -> None:
        """Answer the nth write burst (from 0) with an error."""
        self._lib.flk_axi_fail_write(self._at, nth, resp)

    @property
    def idle(self) -> bool:
        """Nothing is under way, and no data without an address are left."""
        return bool(self._lib.flk_axi_idle(self._at))

    @property
    def errors(self) -> list[str]:
        """Rules of AXI that the design has broken, each with its cycle; at most 100."""
        return [self._lib.flk_axi_error(self._at, i).decode() for i in range(self._lib.flk_axi_errors(self._at))]

    def counts(self, purpose: int) -> PurposeCounts:
        """Traffic of the port by purpose, and cycles by channel."""
        out = PurposeCounts()
        self._lib.flk_axi_counts(self._at, purpose, ctypes.byref(out))
        return out

    def channels(self) -> dict[str, tuple[int, int]]:
        """Transfers, and cycles of valid without ready, by channel."""
        out = np.zeros((2, len(CHANNELS)), np.uint64)
        self._lib.flk_axi_channels(self._at, out[0].ctypes.data, out[1].ctypes.data)
        return {name: (int(a), int(b)) for name, a, b in zip(CHANNELS, *out)}
