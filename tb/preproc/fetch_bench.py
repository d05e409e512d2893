"""Units that read memory, take a stream and give a stream, as functions: a frame's registers and items in, items out, with the memory behind AXI4."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from flicker_tb.runner import seed

from flicker.arithmetic.ff import ff_bits
from flicker.chip.dram import DramConfig, port_config
from flicker.sim.memory import FOLDER, HEADERS, PortConfig, Timing
from flicker.toolchain import verilate

HERE = Path(__file__).parent
BEAT = 64
PAUSES = {"never": (0, 1), "rare": (13, 1), "half": (128, 1), "bursts": (128, 20), "heavy": (230, 1)}  # 256ths of the cycles, mean length


class _Frame(ctypes.Structure):
    _fields_ = [(n, ctypes.c_int64) for n in ("items", "limit", "room")] + [
        (n, ctypes.c_int32) for n in ("idle", "idle_run", "stall", "stall_run", "reset_at")]


class _Result(ctypes.Structure):
    _fields_ = [(n, ctypes.c_int64) for n in ("cycles", "taken", "given")] + [("status", ctypes.c_uint32 * 6)]


@dataclass(frozen=True, eq=False)
class Outcome:
    """done: False if the frame was not over in time. bits: uint8 (items, bits), bit 0 first. when: cycle of each. status: words."""

    done: bool
    cycles: int
    bits: np.ndarray
    when: np.ndarray
    status: list[int]

    def field(self, low: int, width: int) -> np.ndarray:
        """int64 (items,)."""
        return self.bits[:, low : low + width].astype(np.int64) @ (1 << np.arange(width, dtype=np.int64))


@dataclass
class FetchBench:
    """top: module of a file beside this one. out_words: of 32 bits, of an item that comes out."""

    top: str
    out_words: int
    register_bits: int
    parameters: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        path = verilate(
            self.top, extra=[HERE / f"{self.top}.sv"], parameters=self.parameters, args=["--assert", "--x-assign", "unique", "--x-initial", "unique"],
            cpp=[HERE / "fetch_harness.cpp"], depends=HEADERS, cflags=f"-I{FOLDER} -DOUT_WORDS={self.out_words}", shared=True, kind="sim",
        )
        self.library = ctypes.CDLL(str(path))
        self.library.bench_open.argtypes = [ctypes.POINTER(Timing), ctypes.c_int, ctypes.c_void_p, ctypes.c_uint64]
        self.library.bench_store.argtypes = [ctypes.c_uint64, ctypes.c_uint64, ctypes.c_char_p]
        self.library.bench_fail.argtypes = [ctypes.c_uint64, ctypes.c_uint64]
        self.library.bench_error.restype = ctypes.c_char_p
        self.library.bench_beats.restype = self.library.bench_waits.restype = ctypes.c_uint64

    def open(self, contents: Mapping[int, bytes], perfect: bool = True, **options) -> None:
        """A memory with bytes at addresses, behind a port; the unit is reset. options: of the port, for LPDDR4 with its latency unless given."""
        options = {"seed": seed()} | options
        config = PortConfig(**options) if perfect else port_config(**options)
        self.library.bench_open(ctypes.byref(DramConfig().timing), perfect, ctypes.byref(config.structure()), seed())
        for base, data in contents.items():
            assert self.library.bench_store(base, len(data), data)

    def fail(self, base: int, size: int = BEAT) -> None:
        self.library.bench_fail(base, size)

    @property
    def waits(self) -> int:
        """Cycles in which a beat of the memory was not taken."""
        return self.library.bench_waits()

    def frame(
        self, registers: int, items: Sequence[int] = (), idle: str = "never", stall: str = "never", room: int = 1 << 16, limit: int = 500_000,
        reset_at: int = -1,
    ) -> Outcome:
        """A frame. AssertionError for whatever harness, memory or the design's assertions find."""
        frame = _Frame(len(items), limit, room, *PAUSES[idle], *PAUSES[stall], reset_at)
        fixed = np.frombuffer(registers.to_bytes(self.register_bits // 8, "little"), np.uint32)
        given = np.frombuffer(b"".join(item.to_bytes(12, "little") for item in items) or bytes(12), np.uint32)
        out, when, result = np.zeros((room, self.out_words), np.uint32), np.zeros(room, np.int64), _Result()
        p = lambda a: ctypes.c_void_p(a.ctypes.data)  # noqa: E731
        state = self.library.bench_frame(ctypes.byref(frame), p(fixed), p(given), p(out), p(when), ctypes.byref(result))
        assert state >= 0, f"{self.top}: {self.library.bench_error().decode()} (cycle {result.cycles})"
        n = result.given
        bits = np.unpackbits(out[:n].view(np.uint8), axis=1, bitorder="little")
        return Outcome(state == 1, result.cycles, bits, when[:n], list(result.status))


def packed_bits(*fields: tuple[int, int]) -> int:
    """(value, bits) of each field, the lowest first."""
    total, at = 0, 0
    for value, bits in fields:
        total |= (int(value) & (1 << bits) - 1) << at
        at += bits
    return total


def codes(values: np.ndarray, man_bits: int) -> list[tuple[int, int]]:
    """Fields of ff numbers."""
    return [(ff_bits(v, man_bits), 9 + man_bits) for v in np.asarray(values, np.float64).ravel().tolist()]


def codes_of(values: np.ndarray, man_bits: int) -> np.ndarray:
    """int64: codes of an array of ff numbers."""
    values = np.asarray(values, np.float64)
    return np.array([ff_bits(v, man_bits) for v in values.ravel().tolist()], np.int64).reshape(values.shape)
