"""One half of the chip or all of it, verilated, with a memory behind its AXI ports (frame_harness.cpp): what their simulations share."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Self

import numpy as np

from ..chip_counters import Counter
from ..errors import FlickerError
from ..toolchain import verilate
from .memory import HEADERS, Counts, PortConfig, PurposeCounts, Timing, _Config

HERE = Path(__file__).parent
BEAT = 64
PAGE = 4096  # regions begin at a multiple of it

Fields = Sequence[tuple[int, int]]  # value and width, the highest first


@dataclass(frozen=True)
class MemoryOptions:
    """timing: of the DRAM; None: a perfect memory. ports: options of a port by name. fail: (first byte, bytes) that answer with an error; fail_reads: reads
    alone; mended: no longer in the last frame."""

    timing: Timing | None = None
    ports: Mapping[str, PortConfig] = field(default_factory=dict)
    fail: Sequence[tuple[int, int]] = ()
    fail_reads: Sequence[tuple[int, int]] = ()
    mended: bool = False


def build(top: str, parameters: Mapping[str, int], settings: Sequence[Path], args: Sequence[str] = (), define: str = "") -> Path:
    """Shared library of a half's simulator, with the design's assertions; cached by content. define: for the harness, which ports there are."""
    return verilate(
        top,
        parameters=parameters,
        args=["--x-assign", "unique", "--x-initial", "unique", "-fno-dfg", "-fno-table", *args, "--assert"],
        cpp=[HERE / "frame_harness.cpp"],
        depends=HEADERS,
        settings=settings,
        cflags=f"-DVL_USER_STOP -DVL_USER_FATAL {define} -I{HERE}",
        opt="-O1",
        shared=True,
        kind="sim",
        name=top.removeprefix("flk_"),
    )


@cache
def _library(path: Path) -> ctypes.CDLL:
    lib = ctypes.CDLL(str(path))
    u64, pointer = ctypes.c_uint64, ctypes.c_void_p
    for name, result, *arguments in (
        ("failure", ctypes.c_char_p),
        ("new", pointer, pointer, ctypes.c_int, pointer, u64),
        ("delete", None, pointer),
        ("load", ctypes.c_int, pointer, u64, u64, pointer, u64, ctypes.c_uint32),
        ("read", ctypes.c_int, pointer, u64, u64, pointer),
        ("fail", None, pointer, u64, u64, ctypes.c_int),
        ("mend", None, pointer),
        ("given", ctypes.c_int, pointer, ctypes.c_int, pointer, ctypes.c_int),
        ("efficiency", ctypes.c_double, pointer),
        ("dram", None, pointer, pointer),
        ("counts", None, pointer, ctypes.c_uint32, pointer),
    ):
        function = getattr(lib, f"flk_half_{name}")
        function.restype = result
        function.argtypes = arguments
    if hasattr(lib, "flk_half_frame"):  # the chip has none
        lib.flk_half_waits.restype, lib.flk_half_waits.argtypes = ctypes.c_int, [pointer, pointer]
        lib.flk_half_frame.restype = ctypes.c_int
        lib.flk_half_frame.argtypes = [pointer, pointer, ctypes.c_int, u64, pointer, ctypes.c_int, pointer]
    return lib


class Half:
    """A simulator and its memory. Use as a context. ports: by name, in the harness's order.

    Every method raises FlickerError that begins with `name`.
    """

    def __init__(self, name: str, library: Path, ports: Mapping[str, PortConfig], memory: MemoryOptions, seed: int) -> None:
        self.name, self.memory, self.seed = name, memory, seed
        self._lib = _library(library)
        configs = (_Config * len(ports))()
        for k, (port, default) in enumerate(ports.items()):
            configs[k] = memory.ports.get(port, default).structure()  # type: ignore[call-overload]
        timing = memory.timing or Timing(*[1] * len(Timing._fields_))
        self._sim = self._lib.flk_half_new(ctypes.byref(timing), memory.timing is None, configs, seed)
        if not self._sim:
            raise self._failure()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_) -> None:
        self._lib.flk_half_delete(self._sim)

    def _failure(self, text: str = "") -> FlickerError:
        return FlickerError(f"{self.name}: {text or self._lib.flk_half_failure().decode()} (seed {self.seed})")

    def load(self, base: int, allocated: int, data: bytes, purpose: int) -> None:
        """Allocate a range, filled with noise, with data at its beginning."""
        if not self._lib.flk_half_load(self._sim, base, allocated, data, len(data), purpose):
            raise self._failure(f"{allocated} bytes at {base:#x} overlap others")

    def read(self, base: int, size: int) -> np.ndarray:
        """uint8 (size,)."""
        out = np.zeros(size, np.uint8)
        if size and not self._lib.flk_half_read(self._sim, base, size, out.ctypes.data):
            raise self._failure(f"{size} bytes at {base:#x} are not there")
        return out

    def mend(self) -> None:
        """No range fails any more, and channels that had stopped go on."""
        self.memory = replace(self.memory, fail=[], fail_reads=[])
        self._lib.flk_half_mend(self._sim)

    def run(
        self, registers: Fields, counters: Sequence[Counter], frames: int, limit: int,
    ) -> tuple[dict[str, int | np.ndarray], list[int]]:
        """Frames one after the other: counters of the last by name, int or int64 (n,), and error_o of each.

        counters: of the design's structure, the first in the highest bits. Raises FlickerError where a frame does not end within `limit` cycles, an assertion
        fails or a rule of AXI is broken.
        """
        for ranges, writes in ((self.memory.fail, True), (self.memory.fail_reads, False)):
            for base, size in ranges:
                self._lib.flk_half_fail(self._sim, base, size, writes)
        word = 0
        for value, width in registers:
            assert 0 <= value < 1 << width
            word = word << width | value
        count = -(-sum(width for _, width in registers) // 32)
        given = np.frombuffer(word.to_bytes(4 * count, "little"), np.uint32).copy()
        out = np.zeros(-(-sum(c.bits * c.words for c in counters) // 32), np.uint32)
        error = ctypes.c_uint32()
        errors = []
        for frame in range(frames):
            if self.memory.mended and frame == frames - 1:
                self.mend()
            done = self._lib.flk_half_frame(self._sim, given.ctypes.data, count, limit, out.ctypes.data, len(out), ctypes.byref(error))
            if done < 0:
                raise self._failure()
            if not done:
                raise self._failure(f"no end within {limit} cycles")
            errors.append(error.value)
        return _counters(out, counters), errors

    def traffic(self, purposes: Sequence[str], first: int = 0) -> dict[str, PurposeCounts]:
        """By the purposes that `load` numbered, from `first` on, of all frames."""
        out = {}
        for number, name in enumerate(purposes, first):
            counts = PurposeCounts()
            self._lib.flk_half_counts(self._sim, number, ctypes.byref(counts))
            out[name] = counts
        return out

    def given(self, subtile: int, lists: int) -> np.ndarray:
        """int64 (lists,): records that delivery gave for one of the four sub-tiles of each tile in the last frame. Only flk_rendering has it."""
        out = np.zeros(lists, np.uint32)
        if self._lib.flk_half_given(self._sim, subtile, out.ctypes.data, lists) != lists:
            raise self._failure(f"sub-tile {subtile} did not get {lists} lists")
        return out.astype(np.int64)

    def waits(self, counters: Sequence[Counter]) -> dict[str, int]:
        """Those of `counters` that count a stall, of the last frame as the harness counts them, as far as it can; not of the chip."""
        names = [counter.name for counter in counters if counter.stall]
        out = np.zeros(len(names), np.int64)
        if self._lib.flk_half_waits(self._sim, out.ctypes.data) != len(names):
            raise self._failure(f"not {len(names)} counters of waits")
        return {name: int(value) for name, value in zip(names, out) if value >= 0}

    def dram_counts(self) -> Counts:
        """Of the DRAM, all frames until now."""
        counts = Counts()
        self._lib.flk_half_dram(self._sim, ctypes.byref(counts))
        return counts

    @property
    def efficiency(self) -> float:
        """Share of the memory's peak rate."""
        return self._lib.flk_half_efficiency(self._sim)


def _counters(words: np.ndarray, counters: Sequence[Counter]) -> dict[str, int | np.ndarray]:
    word = int.from_bytes(words.tobytes(), "little")
    out: dict[str, int | np.ndarray] = {}
    for counter in reversed(counters):
        values = []
        for _ in range(counter.words):
            values.append(word & (1 << counter.bits) - 1)
            word >>= counter.bits
        out[counter.name] = values[0] if counter.words == 1 else np.array(values, np.int64)
    return out
