"""Whole frames through the verilated rendering stage."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import layout, params
from ..errors import FlickerError
from ..front.records import SubtileLists
from ..golden.lanes.lists import RecordLists
from ..golden.lanes.streams import core_streams, whole_tiles
from ..golden.render import assemble
from ..params import CHANNELS, CORES, FP16_ONE_BITS, STAGES, SUBTILE_PIXELS, RenderConfig
from ..toolchain import sources_of, verilate
from . import generate

HERE = Path(__file__).parent
CHUNK_CYCLES = 5000  # cycles between two calls of the progress function


class _Frame(ctypes.Structure):
    _fields_ = [
        ("element", ctypes.c_void_p), ("which", ctypes.c_void_p), ("member", ctypes.c_void_p), ("start", ctypes.c_void_p), ("subtile", ctypes.c_void_p),
        ("order", ctypes.c_void_p), ("core_start", ctypes.c_void_p), ("cols", ctypes.c_int64), ("subtiles", ctypes.c_int64), ("pixels", ctypes.c_void_p),
        ("leave", ctypes.c_int64),
    ]


@dataclass
class RtlFrame:
    """Result of a simulated frame.

    pixels as in `golden.render.Frame`; counters: uint32 (cores, those that `names` names); seconds of simulation alone.
    """

    lists: SubtileLists | RecordLists
    pixels: np.ndarray
    counters: np.ndarray
    cycles: int
    seconds: float
    names: tuple[str, ...]

    def image(self, background=(0.0, 0.0, 0.0)) -> np.ndarray:
        """float32 (H, W, 3), unquantised."""
        return assemble(self.lists, self.pixels, background)

    def core_counter(self, name: str) -> np.ndarray:
        """int64 (cores,): a counter of each core."""
        return self.counters[:, self.names.index(name)].astype(np.int64)

    def channel_counter(self, name: str) -> np.ndarray:
        """int64 (4, 4): a counter of each core and channel."""
        first = len(params.CORE_COUNTERS) + [n for n, _ in params.CHANNEL_COUNTERS].index(name)
        step = len(params.CHANNEL_COUNTERS)
        return self.counters[:, first : first + CHANNELS * step : step].astype(np.int64)


def build(config: RenderConfig, *, checks: bool = False, replaced: Mapping[str, Path] | None = None) -> Path:
    """Shared library of the simulator for a configuration; cached by content.

    checks: with the design's assertions; without, it runs faster. replaced: files to take instead, by module.
    """
    stage = STAGES[config.stage]
    top, header = generate.write(config)
    sources = [(replaced or {}).get(path.stem, path) for path in sources_of(generate.TOP, [top])]
    return verilate(
        generate.TOP,
        sources,
        parameters=config.rtl_parameters(),
        # One piece of C++, with -O1: half the time to compile, for runs a twentieth longer than those of -O2.
        args=["--x-assign", "unique", "--x-initial", "unique", "-fno-dfg", "-fno-table", "--output-split", "0", "--assert" if checks else "--no-assert"],
        cpp=[HERE / "render_harness.cpp"],
        depends=[header],
        settings=[HERE / "render_stage.vlt", HERE / "lanes.vlt"],
        cflags=f"-DVL_USER_STOP -DVL_USER_FATAL -I{header.parent}",
        opt="-O1",
        shared=True,
        kind="sim",
        name=stage.module.removeprefix("flk_"),
    )


def _library(path: Path) -> ctypes.CDLL:
    lib = ctypes.CDLL(str(path))
    lib.flk_sim_new.restype = ctypes.c_void_p
    lib.flk_sim_new.argtypes = [ctypes.POINTER(_Frame), ctypes.c_int, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_uint32]
    lib.flk_sim_run.argtypes = [ctypes.c_void_p, ctypes.c_uint64]
    lib.flk_sim_abort.argtypes = [ctypes.c_void_p, ctypes.c_uint64, ctypes.c_int]
    lib.flk_sim_cycles.argtypes = lib.flk_sim_received.argtypes = [ctypes.c_void_p]
    lib.flk_sim_cycles.restype = lib.flk_sim_received.restype = ctypes.c_uint64
    lib.flk_sim_error.argtypes = [ctypes.c_void_p]
    lib.flk_sim_error.restype = ctypes.c_char_p
    lib.flk_sim_counters.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    lib.flk_sim_delete.argtypes = [ctypes.c_void_p]
    return lib


def elements(lists: SubtileLists | RecordLists, record: str) -> np.ndarray:
    """uint32 (E, words): the lists' elements as records of the layout, without the sub-tile."""
    if isinstance(lists, RecordLists):
        return _records(lists, record)
    gauss = lists.gauss[lists.entry]
    names = [path.rpartition(".")[2] for path in layout.leaves("feature")][::-1]  # least significant first, as in lists.gauss
    columns = {name: gauss[:, i] for i, name in enumerate(names)}
    columns |= {"mean_x": lists.mean[:, 0], "mean_y": lists.mean[:, 1], "spiky": (lists.spiky[lists.entry] != 0)}
    return layout.pack(record, columns)


def _records(lists: RecordLists, record: str) -> np.ndarray:
    at = layout.place(record, "record").at
    word, shift = divmod(at, 32)
    packed = np.zeros((len(lists.entry), layout.words(record)), np.uint32)
    bits = lists.records[lists.entry].view(np.uint32).astype(np.uint64) << np.uint64(shift)
    packed[:, word : word + 4] = bits.astype(np.uint32)
    packed[:, word + 1 : word + 5] |= (bits >> np.uint64(32)).astype(np.uint32)
    return packed


def render_rtl(
    lists: SubtileLists | RecordLists,
    config: RenderConfig,
    *,
    seed: int = 1,
    idle: float = 0.0,
    stall: float = 0.0,
    aborts: Sequence[tuple[int, int]] = (),
    leave: bool = False,
    empty: bool = True,
    checks: bool = False,
    library: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RtlFrame:
    """Simulate a frame.

    idle, stall: share of cycles in which an input stream offers nothing, an output stream is not ready (random, by `seed`).
    aborts: (cycles, length) each: before the frame that counts, begin it, clear it after so many cycles, for `length` cycles.
    leave: a sub-tile whose pixels are finished leaves its list (finished_o). empty: sub-tiles with an empty list are streamed, too; else they keep T = 1,
    black.
    checks: use the build with assertions. library: one that `build` made, instead. progress: called with (pixels received, pixels in all).
    Raises FlickerError when the RTL hangs, loses, repeats or misplaces a pixel, holds idle_o wrong, or, with checks, breaks an assertion.
    """
    if config.form != lists.form:
        raise ValueError(f"lists are in {lists.form.name} form, the configuration in {config.form.name}")
    lib = _library(library or build(config, checks=checks))
    streams = core_streams(lists, lists.entry, config.cores, empty)
    subtiles = streams.cols * streams.rows
    arrays = {
        "element": elements(lists, STAGES[config.stage].element),
        **{name: np.ascontiguousarray(getattr(streams, field), np.int64) for name, field in (
            ("which", "element"), ("member", "member"), ("start", "start"), ("subtile", "subtile"), ("order", "order"), ("core_start", "core_start"),
        )},
        "pixels": np.tile(np.array([FP16_ONE_BITS, 0, 0, 0], np.uint16), (subtiles, SUBTILE_PIXELS, 1)),
    }
    frame = _Frame(cols=streams.cols, subtiles=subtiles, leave=leave, **{k: a.ctypes.data for k, a in arrays.items()})
    sim = lib.flk_sim_new(ctypes.byref(frame), int(config.cat), seed, round(idle * 256), round(stall * 256))
    try:
        begin = time.perf_counter()
        state = 0
        for cycles, length in aborts:
            if not lib.flk_sim_abort(sim, cycles, length):
                raise FlickerError(f"RTL simulation: aborted after {cycles} cycles: {lib.flk_sim_error(sim).decode()}")
        while state == 0:
            state = lib.flk_sim_run(sim, CHUNK_CYCLES)
            if progress is not None:
                progress(lib.flk_sim_received(sim), streams.subtile[streams.order].size * SUBTILE_PIXELS)
        seconds = time.perf_counter() - begin
        cycles = lib.flk_sim_cycles(sim)
        if state < 0:
            raise FlickerError(f"RTL simulation: cycle {cycles}: {lib.flk_sim_error(sim).decode()}")
        counters = np.zeros((config.cores, len(STAGES[config.stage].counters)), np.uint32)
        lib.flk_sim_counters(sim, counters.ctypes.data)
    finally:
        lib.flk_sim_delete(sim)
    pixels = arrays["pixels"] if config.cores == CORES else arrays["pixels"][whole_tiles(lists.cols, lists.rows)[2]]
    return RtlFrame(lists, pixels, counters, int(cycles), seconds, STAGES[config.stage].counters)
